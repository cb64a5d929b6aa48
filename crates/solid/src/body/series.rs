//! Right-hand sides of the asymptotic numerical method: the highest-degree coefficients of the
//! internal force along a series of displacements (paper A; docs/architecture.md).

use super::batch::Slot;
use super::cells::CellBatches;
use super::clusters::Clusters;
use crate::element::{Geometry, Shape};
use crate::law::{LawKernels, Material, SeriesKernels, SharedSeries, TaylorCache};
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

/// The pressures of clusters as series, or nothing where every cell is on its own.
pub struct AroundSeries<'a, T>(pub Option<(&'a Clusters, &'a [T])>);

impl<'a, T> AroundSeries<'a, T> {
    /// Around a cell, of series with `n` coefficients.
    fn of(&self, slot: Slot, n: usize) -> SharedSeries<'a, T> {
        let of_cluster = |(clusters, pressures): (&Clusters, &'a [T])| SharedSeries {
            part: clusters.share[slot.batch as usize],
            pressure: &pressures[clusters.at(slot) * n..][..n],
        };
        self.0.map(of_cluster).unwrap_or_default()
    }
}

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// Adds the degree-p forces.
    pub fn force_series<T: Real>(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        around: AroundSeries<T>,
        force: &mut [T],
    ) where
        dyn LawKernels: SeriesKernels<T>,
    {
        dispatch_solver(Forces { cells: self, material, geometry, along, around, force });
    }

    /// Adds the series of each cell's volume ratio, times its part of the volume, to that of its cluster.
    pub fn add_volume_series<T: Real>(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        clusters: &Clusters,
        ratios: &mut [T],
    ) where
        dyn LawKernels: SeriesKernels<T>,
    {
        dispatch_solver(Volumes { cells: self, material, geometry, along, clusters, ratios });
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
    around: AroundSeries<'a, T>,
    force: &'a mut [T],
}

impl<T: Real, E: Shape<N>, const N: usize> Kernel for Forces<'_, T, E, N>
where
    dyn LawKernels: SeriesKernels<T>,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Forces { cells, material, geometry, along, around, force } = self;
        let (table, law) = (along.table, material.law());
        let (n, top) = (table.len(), table.of_degree(table.order()).len());
        let mut deformation = vec![T::default(); 9 * n];
        let mut stress = vec![T::default(); 9 * top];
        let mut cache = TaylorCache::default();
        for (cell, (nodes, geometry)) in cells.nodes.iter().zip(geometry).enumerate() {
            let (row, shared) = (material.row(cell), around.of(cells.slots[cell], n));
            cache.turn_to(row, shared.part);
            for point in 0..E::POINTS {
                let gradients = gradients(E::slopes(point), geometry);
                along.deformation(nodes, &gradients, &mut deformation);
                stress.fill(T::default());
                law.stress_series(row, &mut cache, table, &deformation, shared, &mut stress);
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
    clusters: &'a Clusters,
    ratios: &'a mut [T],
}

impl<T: Real, E: Shape<N>, const N: usize> Kernel for Volumes<'_, T, E, N>
where
    dyn LawKernels: SeriesKernels<T>,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Volumes { cells, material, geometry, along, clusters, ratios } = self;
        let (n, law) = (along.table.len(), material.law());
        let mut deformation = vec![T::default(); 9 * n];
        let mut ratio = vec![T::default(); n];
        for (cell, (nodes, geometry)) in cells.nodes.iter().zip(geometry).enumerate() {
            along.deformation(nodes, &gradients(E::slopes(0), geometry), &mut deformation);
            ratio.fill(T::default());
            law.volume_series(material.row(cell), along.table, &deformation, &mut ratio);
            let cluster = clusters.at(cells.slots[cell]);
            let part = geometry.volume / clusters.volume[cluster];
            add_scaled(&mut ratios[cluster * n..(cluster + 1) * n], part, &ratio);
        }
    }
}

impl Clusters {
    /// From the series of the volume ratio of each cluster to those of its pressure, `sum_t s V_t U_t'(J_c) / V_c` over
    /// its tissues t, in place.
    pub fn pressure_series<T: Real>(
        &self,
        material: &Material,
        table: &'static Monomials,
        series: &mut [T],
    ) where
        dyn LawKernels: SeriesKernels<T>,
    {
        let (n, law) = (table.len(), material.law());
        let (mut cache, mut own) = (TaylorCache::default(), vec![T::default(); n]);
        let mut pressures = vec![T::default(); series.len()];
        for batch in &self.batches {
            cache.turn_to(&batch.parameters, 0.0);
            for (lane, cluster) in batch.cluster.into_iter().enumerate() {
                let (cluster, weight) = (cluster as usize, batch.weight[lane]);
                if weight > 0.0 {
                    let run = cluster * n..(cluster + 1) * n;
                    own.fill(T::default());
                    law.pressure_series(
                        &batch.parameters,
                        &mut cache,
                        table,
                        &series[run.clone()],
                        &mut own,
                    );
                    add_scaled(&mut pressures[run], weight / self.volume[cluster], &own);
                }
            }
        }
        series.copy_from_slice(&pressures);
    }
}

/// `sum += factor series`.
#[inline(always)]
fn add_scaled<T: Real>(sum: &mut [T], factor: f64, series: &[T]) {
    sum.iter_mut().zip(series).for_each(|(sum, &value)| *sum = *sum + value * factor);
}
