//! Right-hand sides of the asymptotic numerical method: the highest-degree coefficients of the
//! internal force along a series of displacements (paper A; docs/architecture.md).

use super::cells::{CellBatches, Slot};
use super::clusters::Clusters;
use crate::element::{Geometry, Shape};
use crate::law::{Kept, LawKernels, Material, SeriesKernels};
use crate::number::{Monomials, Real};
use crate::simd::{Kernel, dispatch_solver};

/// The part of an element's integrals that is about series, of coefficients `T`.
pub trait SeriesIntegrals<T> {
    /// Adds the degree-p coefficients of the internal force.
    fn add_force_series(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        force: &mut [T],
    );
}

/// A series of displacements.
pub struct Along<'a, T> {
    pub table: &'static Monomials,
    pub displacement: &'a [T],
    pub stride: usize,
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
        for (i, row) in out.chunks_exact_mut(3 * n).enumerate() {
            let u = nodes
                .map(|node| &self.displacement[(3 * node as usize + i) * self.stride..][..known]);
            // Coefficient by coefficient: each is loaded once, and the sums stay in registers.
            for c in 0..known {
                let mut sums = [T::default(); 3];
                for (u, g) in u.iter().zip(gradients) {
                    for (sum, &g) in sums.iter_mut().zip(g) {
                        *sum = *sum + u[c] * g;
                    }
                }
                for (j, sum) in sums.into_iter().enumerate() {
                    row[j * n + c] = sum;
                }
            }
            row.chunks_exact_mut(n).for_each(|run| run[known..].fill(T::default()));
            row[i * n] = row[i * n] + 1.0;
        }
    }
}

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// Adds the degree-p forces; `pressure` holds the series of an extra pressure in each cell, or nothing.
    pub fn force_series<T: Real>(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        pressure: &[T],
        force: &mut [T],
    ) where
        dyn LawKernels: SeriesKernels<T>,
    {
        dispatch_solver(Forces { cells: self, material, geometry, along, pressure, force });
    }

    /// Series of the volume ratio of each cell.
    pub fn volume_series<T: Real>(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
    ) -> Vec<T>
    where
        dyn LawKernels: SeriesKernels<T>,
    {
        let mut out = vec![T::default(); self.nodes.len() * along.table.len()];
        let volumes = &mut out;
        dispatch_solver(Volumes { cells: self, material, geometry, along, volumes });
        out
    }
}

/// Gradients of the shape functions of a cell.
#[inline(always)]
fn gradients<const N: usize>(slopes: &[[f64; 3]; N], geometry: &Geometry) -> [[f64; 3]; N] {
    let g = &geometry.gradients;
    slopes.map(|s| std::array::from_fn(|j| s[0] * g[0][j] + s[1] * g[1][j] + s[2] * g[2][j]))
}

struct Forces<'a, T, E, const N: usize> {
    cells: &'a CellBatches<E, N>,
    material: &'a Material,
    geometry: &'a [Geometry],
    along: Along<'a, T>,
    pressure: &'a [T],
    force: &'a mut [T],
}

impl<T: Real, E: Shape<N>, const N: usize> Kernel for Forces<'_, T, E, N>
where
    dyn LawKernels: SeriesKernels<T>,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Forces { cells, material, geometry, along, pressure, force } = self;
        let (table, law) = (along.table, material.law());
        let (n, top) = (table.len(), table.of_degree(table.order()).len());
        let mut deformation = vec![T::default(); 9 * n];
        let mut stress = vec![T::default(); 9 * top];
        let mut kept = Kept::default();
        for (cell, (nodes, geometry)) in cells.nodes.iter().zip(geometry).enumerate() {
            let row = material.row(cell);
            kept.turn_to(row);
            let pressure = pressure.get(cell * n..(cell + 1) * n).unwrap_or_default();
            for point in 0..E::POINTS {
                let gradients = gradients(E::slopes(point), geometry);
                along.deformation(nodes, &gradients, &mut deformation);
                stress.fill(T::default());
                law.stress_series(row, &mut kept, table, &deformation, pressure, &mut stress);
                let weight = geometry.volume / E::POINTS as f64;
                for (a, &node) in nodes.iter().enumerate() {
                    for i in 0..3 {
                        let dof = 3 * node as usize + i;
                        let out = &mut force[dof * top..(dof + 1) * top];
                        let (p, others) = stress[3 * i * top..3 * (i + 1) * top].split_at(top);
                        let (q, r) = others.split_at(top);
                        let [x, y, z] = gradients[a].map(|slope| slope * weight);
                        for (((out, &p), &q), &r) in out.iter_mut().zip(p).zip(q).zip(r) {
                            *out = *out + p * x + q * y + r * z;
                        }
                    }
                }
            }
        }
    }
}

struct Volumes<'a, T, E, const N: usize> {
    cells: &'a CellBatches<E, N>,
    material: &'a Material,
    geometry: &'a [Geometry],
    along: Along<'a, T>,
    volumes: &'a mut [T],
}

impl<T: Real, E: Shape<N>, const N: usize> Kernel for Volumes<'_, T, E, N>
where
    dyn LawKernels: SeriesKernels<T>,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Volumes { cells, material, geometry, along, volumes } = self;
        let (n, law) = (along.table.len(), material.law());
        let mut deformation = vec![T::default(); 9 * n];
        let cells = cells.nodes.iter().zip(geometry).zip(volumes.chunks_exact_mut(n));
        for (cell, ((nodes, geometry), out)) in cells.enumerate() {
            along.deformation(nodes, &gradients(E::slopes(0), geometry), &mut deformation);
            law.volume_series(material.row(cell), along.table, &deformation, out);
        }
    }
}

impl Clusters {
    /// From the series of each cell's volume ratio to those of the pressure its cluster adds, in place.
    pub fn pressure_series<T: Real>(
        &self,
        material: &Material,
        slots: &[Slot],
        table: &'static Monomials,
        series: &mut [T],
    ) where
        dyn LawKernels: SeriesKernels<T>,
    {
        let (n, count, law) = (table.len(), self.members.len(), material.law());
        let mut ratios = vec![T::default(); count * n];
        for (cluster, ratio) in ratios.chunks_exact_mut(n).enumerate() {
            for m in self.members.of(cluster) {
                add_scaled(ratio, m.part, &series[m.cell as usize * n..][..n]);
            }
        }
        let (mut kept, mut pressure) = (Kept::default(), vec![T::default(); n]);
        let mut pressure_at = |row: &[f64], ratio: &[T], factor: f64, sum: &mut [T]| {
            pressure.fill(T::default());
            kept.turn_to(row);
            law.pressure_series(row, &mut kept, table, ratio, &mut pressure);
            add_scaled(sum, factor, &pressure);
        };
        let mut means = vec![T::default(); count * n];
        for batch in &self.batches {
            for (lane, cluster) in batch.cluster.into_iter().enumerate() {
                let (cluster, weight) = (cluster as usize, batch.weight[lane]);
                if weight > 0.0 {
                    let (ratio, factor) =
                        (&ratios[cluster * n..][..n], weight / self.volume[cluster]);
                    let mean = &mut means[cluster * n..][..n];
                    pressure_at(&batch.parameters, ratio, factor, mean);
                }
            }
        }
        for (cell, (slot, q)) in slots.iter().zip(series.chunks_exact_mut(n)).enumerate() {
            let (batch, lane) = (slot.batch as usize, slot.lane as usize);
            let cluster = self.of[batch][lane] as usize;
            let mut answer = means[cluster * n..][..n].to_vec();
            pressure_at(material.row(cell), q, -self.share[batch], &mut answer);
            q.copy_from_slice(&answer);
        }
    }
}

/// `sum += factor series`.
#[inline(always)]
fn add_scaled<T: Real>(sum: &mut [T], factor: f64, series: &[T]) {
    sum.iter_mut().zip(series).for_each(|(sum, &value)| *sum = *sum + value * factor);
}
