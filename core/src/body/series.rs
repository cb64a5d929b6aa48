//! Right-hand sides of the asymptotic numerical method: the highest-degree coefficients of the
//! internal force along a series of displacements (paper A; docs/architecture.md).

use super::cells::{Cells, Slot};
use super::clusters::Clusters;
use super::{Assembly, Body};
use crate::element::{Geometry, Shape};
use crate::law::{Law, LawVisitor, Material};
use crate::number::{Jet, Monomials, Real};
use crate::simd::{Kernel, dispatch_here};

dispatch_here!();

impl Body {
    /// Degree-p coefficients of the internal force, p being the order of `table`.
    ///
    /// `displacement` holds `stride >= table.len()` coefficients for each degree of freedom (the
    /// displacement of the base state first); only those of degree below p are read, so that the
    /// result is the nonlinear right-hand side with `u_p = 0`. `force` receives
    /// `table.of_degree(p).len()` coefficients for each degree of freedom.
    pub fn force_series<T: Real>(
        &self,
        table: &'static Monomials,
        displacement: &[T],
        stride: usize,
        force: &mut [T],
    ) {
        force.fill(T::default());
        let along = Along { table, displacement, stride };
        let Body { material, geometry, .. } = self;
        match &*self.assembly {
            Assembly::P1(cells) => cells.force_series(material, geometry, along, &[], force),
            Assembly::P1MeanVolume(cells, clusters) => {
                let mut volumes = cells.volume_series(material, geometry, along);
                clusters.pressure_series(material, &cells.slots, table, &mut volumes);
                cells.force_series(material, geometry, along, &volumes, force);
            }
            Assembly::P2(cells) => cells.force_series(material, geometry, along, &[], force),
        }
    }
}

/// A series of displacements.
pub(super) struct Along<'a, T> {
    table: &'static Monomials,
    displacement: &'a [T],
    stride: usize,
}

impl<T> Clone for Along<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Along<'_, T> {}

impl<T: Real> Along<'_, T> {
    /// Series of `F = I + sum_a u_a (x) grad N_a`, those of degree p without `u_p`.
    #[inline(always)]
    fn deformation<const N: usize>(
        &self,
        nodes: &[u32; N],
        gradients: &[[f64; 3]; N],
        out: &mut [T],
    ) {
        let n = self.table.len();
        let known = n - self.table.of_degree(self.table.order()).len();
        out.fill(T::default());
        for (a, &node) in nodes.iter().enumerate() {
            for i in 0..3 {
                let dof = 3 * node as usize + i;
                let u = &self.displacement[dof * self.stride..dof * self.stride + known];
                for j in 0..3 {
                    let run = &mut out[(3 * i + j) * n..(3 * i + j) * n + known];
                    for (f, &u) in run.iter_mut().zip(u) {
                        *f = *f + u * gradients[a][j];
                    }
                }
            }
        }
        for i in 0..3 {
            out[4 * i * n] = out[4 * i * n] + 1.0;
        }
    }
}

impl<E: Shape<N>, const N: usize> Cells<E, N> {
    /// Adds the degree-p forces; `pressure` holds the series of an extra pressure in each cell, or nothing.
    fn force_series<T: Real>(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        pressure: &[T],
        force: &mut [T],
    ) {
        let table = along.table;
        let task = &mut |stress_of: &StressOf<'_, T>| {
            let force = &mut *force;
            dispatch(Forces { cells: self, material, geometry, along, pressure, stress_of, force });
        };
        material.visit(Stresses { table, task });
    }

    /// Series of the volume ratio of each cell.
    fn volume_series<T: Real>(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
    ) -> Vec<T> {
        let mut out = vec![T::default(); self.nodes.len() * along.table.len()];
        let volumes = &mut out;
        material.visit(Volumes { cells: self, material, geometry, along, volumes });
        out
    }
}

/// Gradients of the shape functions of a cell.
#[inline(always)]
fn gradients<const N: usize>(slopes: &[[f64; 3]; N], geometry: &Geometry) -> [[f64; 3]; N] {
    let g = &geometry.gradients;
    slopes.map(|s| std::array::from_fn(|j| s[0] * g[0][j] + s[1] * g[1][j] + s[2] * g[2][j]))
}

/// Stress series of a law: parameters, series of deformation gradient and extra pressure, and where it goes.
type StressOf<'a, T> = dyn Fn(&[f64], (&[T], &[T]), &mut [T]) + 'a;

/// Calls back with the stress series of the law: nothing but that is compiled for every law.
struct Stresses<'a, T> {
    table: &'static Monomials,
    task: &'a mut dyn FnMut(&StressOf<'_, T>),
}

impl<T: Real> LawVisitor for Stresses<'_, T> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        let Stresses { table, task } = self;
        task(&|parameters, series, out| {
            let law = make(parameters);
            dispatch(StressKernel { law, table, series, out });
        });
    }
}

/// [`Law::stress_series`].
struct StressKernel<'a, T, L> {
    law: L,
    table: &'static Monomials,
    series: (&'a [T], &'a [T]),
    out: &'a mut [T],
}

impl<T: Real, L: Law> Kernel for StressKernel<'_, T, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.law.stress_series(self.table, self.series.0, self.series.1, self.out);
    }
}

struct Forces<'a, T, E, const N: usize> {
    cells: &'a Cells<E, N>,
    material: &'a Material,
    geometry: &'a [Geometry],
    along: Along<'a, T>,
    pressure: &'a [T],
    stress_of: &'a StressOf<'a, T>,
    force: &'a mut [T],
}

impl<T: Real, E: Shape<N>, const N: usize> Kernel for Forces<'_, T, E, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Forces { cells, material, geometry, along, pressure, stress_of, force } = self;
        let table = along.table;
        let (n, top) = (table.len(), table.of_degree(table.order()).len());
        let mut deformation = vec![T::default(); 9 * n];
        let mut stress = vec![T::default(); 9 * top];
        for (cell, (nodes, geometry)) in cells.nodes.iter().zip(geometry).enumerate() {
            let pressure = pressure.get(cell * n..(cell + 1) * n).unwrap_or_default();
            for point in 0..E::POINTS {
                let gradients = gradients(E::slopes(point), geometry);
                along.deformation(nodes, &gradients, &mut deformation);
                stress.fill(T::default());
                stress_of(material.of_cell(cell), (&deformation, pressure), &mut stress);
                let weight = geometry.volume / E::POINTS as f64;
                for (a, &node) in nodes.iter().enumerate() {
                    for i in 0..3 {
                        let dof = 3 * node as usize + i;
                        let out = &mut force[dof * top..(dof + 1) * top];
                        for j in 0..3 {
                            let weight = gradients[a][j] * weight;
                            let p = &stress[(3 * i + j) * top..(3 * i + j + 1) * top];
                            for (out, &p) in out.iter_mut().zip(p) {
                                *out = *out + p * weight;
                            }
                        }
                    }
                }
            }
        }
    }
}

struct Volumes<'a, T, E, const N: usize> {
    cells: &'a Cells<E, N>,
    material: &'a Material,
    geometry: &'a [Geometry],
    along: Along<'a, T>,
    volumes: &'a mut [T],
}

impl<T: Real, E: Shape<N>, const N: usize> LawVisitor for Volumes<'_, T, E, N> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        dispatch(VolumeKernel { volumes: self, make });
    }
}

struct VolumeKernel<'a, T, E, L, const N: usize> {
    volumes: Volumes<'a, T, E, N>,
    make: fn(&[f64]) -> L,
}

impl<T: Real, E: Shape<N>, L: Law, const N: usize> Kernel for VolumeKernel<'_, T, E, L, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Volumes { cells, material, geometry, along, volumes } = self.volumes;
        let n = along.table.len();
        let mut deformation = vec![T::default(); 9 * n];
        let cells = cells.nodes.iter().zip(geometry).zip(volumes.chunks_exact_mut(n));
        for (cell, ((nodes, geometry), out)) in cells.enumerate() {
            along.deformation(nodes, &gradients(E::slopes(0), geometry), &mut deformation);
            let law = (self.make)(material.of_cell(cell));
            law.volume_series(along.table, &deformation, out);
        }
    }
}

impl Clusters {
    /// From the series of each cell's volume ratio to those of the pressure its cluster adds, in place.
    fn pressure_series<T: Real>(
        &self,
        material: &Material,
        slots: &[Slot],
        table: &'static Monomials,
        series: &mut [T],
    ) {
        material.visit(Pressures { clusters: self, material, slots, table, series });
    }
}

struct Pressures<'a, T> {
    clusters: &'a Clusters,
    material: &'a Material,
    slots: &'a [Slot],
    table: &'static Monomials,
    series: &'a mut [T],
}

impl<T: Real> LawVisitor for Pressures<'_, T> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        dispatch(PressureKernel { pressures: self, make });
    }
}

struct PressureKernel<'a, T, L> {
    pressures: Pressures<'a, T>,
    make: fn(&[f64]) -> L,
}

impl<T: Real, L: Law> Kernel for PressureKernel<'_, T, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Pressures { clusters, material, slots, table, series } = self.pressures;
        let (n, count) = (table.len(), clusters.members.len());
        let mut ratios = vec![T::default(); count * n];
        for (cluster, ratio) in ratios.chunks_exact_mut(n).enumerate() {
            for m in clusters.members.of(cluster) {
                add_scaled(ratio, m.part, &series[m.cell as usize * n..][..n]);
            }
        }
        let pressure = |parameters: &[f64], ratio: &[T]| {
            (self.make)(parameters).pressure(&Jet::new(table, ratio.to_vec()))
        };
        let mut means = vec![T::default(); count * n];
        for response in &clusters.responses {
            for (lane, cluster) in response.cluster.into_iter().enumerate() {
                let (cluster, weight) = (cluster as usize, response.weight[lane]);
                if weight > 0.0 {
                    let p = pressure(&response.parameters, &ratios[cluster * n..][..n]);
                    let mean = &mut means[cluster * n..][..n];
                    add_scaled(mean, weight / clusters.volume[cluster], p.coefficients());
                }
            }
        }
        for (cell, (slot, q)) in slots.iter().zip(series.chunks_exact_mut(n)).enumerate() {
            let own = pressure(material.of_cell(cell), q);
            let (batch, lane) = (slot.batch as usize, slot.lane as usize);
            let cluster = clusters.of[batch][lane] as usize;
            q.copy_from_slice(&means[cluster * n..][..n]);
            add_scaled(q, -clusters.share[batch], own.coefficients());
        }
    }
}

/// `sum += factor series`.
#[inline(always)]
fn add_scaled<T: Real>(sum: &mut [T], factor: f64, series: &[T]) {
    sum.iter_mut().zip(series).for_each(|(sum, &value)| *sum = *sum + value * factor);
}
