//! Series along one path, cells of one tissue side by side.

use super::{Along, AroundSeries, CellSeries, ClusterSeries};
use crate::body::batch::Batch;
use crate::body::cells::CellBatches;
use crate::body::clusters::{ClusterBatch, Clusters};
use crate::element::{Geometry, Shape};
use crate::law::{Material, SharedSeries, TaylorCache};
use crate::number::{LANES, Lane, Lanes, Monomials, WIDTH, Wide};
use crate::simd::{Kernel, dispatch_solver};
use crate::tensor::Vec3;
use std::array::from_fn;

/// Batches that fill the lanes of a series.
const BATCHES: usize = WIDTH / LANES;

impl<E: Shape<N>, const N: usize> CellSeries<f64> for CellBatches<E, N> {
    fn force_series(
        &self,
        material: &Material,
        _: &[Geometry],
        along: Along<f64>,
        around: AroundSeries<f64>,
        force: &mut [f64],
    ) {
        dispatch_solver(Forces { cells: self, material, along, around, force });
    }

    fn add_volume_series(
        &self,
        material: &Material,
        _: &[Geometry],
        along: Along<f64>,
        clusters: &Clusters,
        ratios: &mut [f64],
    ) {
        dispatch_solver(Volumes { cells: self, material, along, clusters, ratios });
    }
}

/// Batches of one tissue that share a series kernel's lanes, and the number of the first.
struct Group<'a, const N: usize> {
    first: usize,
    batches: &'a [Batch<N>],
}

/// All batches in groups.
#[inline(always)]
fn groups<const N: usize>(batches: &[Batch<N>]) -> impl Iterator<Item = Group<'_, N>> {
    let tissues = batches.chunk_by(|a, b| a.tissue == b.tissue);
    tissues.flat_map(|of_tissue| of_tissue.chunks(BATCHES)).scan(0, |next, batches| {
        let first = *next;
        *next += batches.len();
        Some(Group { first, batches })
    })
}

impl<const N: usize> Group<'_, N> {
    /// The batch and the lane in it of a lane of the series; where there is none, those of another cell.
    #[inline(always)]
    fn place(&self, lane: usize) -> (usize, usize) {
        ((lane / LANES).min(self.batches.len() - 1), lane % LANES)
    }

    /// Lanes that are cells of their own.
    #[inline(always)]
    fn lanes(&self) -> impl Iterator<Item = usize> {
        let is_own = |lane: &usize| {
            let batch = self.batches.get(lane / LANES);
            batch.is_some_and(|batch| lane % LANES < batch.n_cells as usize)
        };
        (0..WIDTH).filter(is_own)
    }

    /// One number of each cell.
    #[inline(always)]
    fn wide(&self, of: impl Fn(&Batch<N>) -> Lane) -> Wide {
        Lanes(from_fn(|lane| {
            let (batch, lane) = self.place(lane);
            of(&self.batches[batch])[lane]
        }))
    }

    /// The nodes of each cell.
    #[inline(always)]
    fn nodes(&self) -> [[u32; N]; WIDTH] {
        from_fn(|lane| {
            let (batch, lane) = self.place(lane);
            self.batches[batch].nodes[lane]
        })
    }

    /// Gradients of the shape functions where they have these slopes.
    #[inline(always)]
    fn gradients(&self, slopes: &[[f64; 3]; N]) -> [Vec3<Wide>; N] {
        let own: [Vec3<Wide>; 3] = from_fn(|k| from_fn(|j| self.wide(|b| b.gradients[k][j])));
        slopes.map(|s| from_fn(|j| own[0][j] * s[0] + own[1][j] * s[1] + own[2][j] * s[2]))
    }
}

impl Along<'_, f64> {
    /// Series of `F = I + sum_a u_a (x) grad N_a`, those of degree p without `u_p`.
    #[inline(always)]
    fn deformation<const N: usize>(
        &self,
        nodes: &[[u32; N]; WIDTH],
        gradients: &[Vec3<Wide>; N],
        out: &mut [Wide],
    ) {
        let (n, known) = (self.table.len(), self.known());
        for (i, row) in out.chunks_exact_mut(3 * n).enumerate() {
            row.fill(Wide::default());
            for (a, gradient) in gradients.iter().enumerate() {
                let u: [&[f64]; WIDTH] = from_fn(|lane| {
                    &self.displacement[(3 * nodes[lane][a] as usize + i) * self.stride..][..known]
                });
                for c in 0..known {
                    let u = Lanes(from_fn(|lane| u[lane][c]));
                    for (j, &slope) in gradient.iter().enumerate() {
                        row[j * n + c] = row[j * n + c] + u * slope;
                    }
                }
            }
            row[i * n] = row[i * n] + 1.0;
        }
    }
}

impl<'a> AroundSeries<'a, f64> {
    /// Around the cells of a group, of series with `n` coefficients; `pressure` is room for them.
    #[inline(always)]
    fn of<'b, const N: usize>(
        &self,
        group: &Group<N>,
        n: usize,
        pressure: &'b mut Vec<Wide>,
    ) -> SharedSeries<'b, Wide> {
        let Some((clusters, pressures)) = self.0 else { return SharedSeries::default() };
        let of = of_clusters(clusters, group);
        pressure.clear();
        pressure.extend((0..n).map(|c| Lanes(of.map(|cluster| pressures[cluster * n + c]))));
        SharedSeries { part: clusters.share[group.first], pressure }
    }
}

/// The cluster of each lane.
#[inline(always)]
fn of_clusters<const N: usize>(clusters: &Clusters, group: &Group<N>) -> [usize; WIDTH] {
    from_fn(|lane| {
        let (batch, lane) = group.place(lane);
        clusters.of[group.first + batch][lane] as usize
    })
}

struct Forces<'a, E, const N: usize> {
    cells: &'a CellBatches<E, N>,
    material: &'a Material,
    along: Along<'a, f64>,
    around: AroundSeries<'a, f64>,
    force: &'a mut [f64],
}

impl<E: Shape<N>, const N: usize> Kernel for Forces<'_, E, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Forces { cells, material, along, around, force } = self;
        let (table, law) = (along.table, material.law());
        let (n, top) = (table.len(), table.of_degree(table.order()).len());
        let mut deformation = vec![Wide::default(); 9 * n];
        let mut stress = vec![Wide::default(); 9 * top];
        let (mut cache, mut pressure) = (TaylorCache::default(), Vec::new());
        for group in groups(&cells.batches) {
            let row = &cells.tissues[group.batches[0].tissue as usize];
            let shared = around.of(&group, n, &mut pressure);
            cache.turn_to(row, shared.part);
            let (nodes, volume) = (group.nodes(), group.wide(|batch| batch.volume));
            for point in 0..E::POINTS {
                let gradients = group.gradients(E::slopes(point));
                along.deformation(&nodes, &gradients, &mut deformation);
                stress.fill(Wide::default());
                law.stress_series(row, &mut cache, table, &deformation, shared, &mut stress);
                let weight = volume * (1.0 / E::POINTS as f64);
                for (a, gradient) in gradients.iter().enumerate() {
                    let [x, y, z] = gradient.map(|slope| slope * weight);
                    for (i, c) in (0..3 * top).map(|k| (k / top, k % top)) {
                        let [p, q, r]: [Wide; 3] = from_fn(|j| stress[(3 * i + j) * top + c]);
                        let share = p * x + q * y + r * z;
                        for lane in group.lanes() {
                            let dof = 3 * nodes[lane][a] as usize + i;
                            force[dof * top + c] += share[lane];
                        }
                    }
                }
            }
        }
    }
}

struct Volumes<'a, E, const N: usize> {
    cells: &'a CellBatches<E, N>,
    material: &'a Material,
    along: Along<'a, f64>,
    clusters: &'a Clusters,
    ratios: &'a mut [f64],
}

impl<E: Shape<N>, const N: usize> Kernel for Volumes<'_, E, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Volumes { cells, material, along, clusters, ratios } = self;
        let (n, law) = (along.table.len(), material.law());
        let mut deformation = vec![Wide::default(); 9 * n];
        let mut ratio = vec![Wide::default(); n];
        for group in groups(&cells.batches) {
            let row = &cells.tissues[group.batches[0].tissue as usize];
            let (nodes, volume) = (group.nodes(), group.wide(|batch| batch.volume));
            along.deformation(&nodes, &group.gradients(E::slopes(0)), &mut deformation);
            ratio.fill(Wide::default());
            law.volume_series(row, along.table, &deformation, &mut ratio);
            let of = of_clusters(clusters, &group);
            for lane in group.lanes() {
                let part = volume[lane] / clusters.volume[of[lane]];
                let sum = &mut ratios[of[lane] * n..][..n];
                sum.iter_mut().zip(&ratio).for_each(|(sum, ratio)| *sum += part * ratio[lane]);
            }
        }
    }
}

impl ClusterSeries<f64> for Clusters {
    fn pressure_series(&self, material: &Material, table: &'static Monomials, series: &mut [f64]) {
        let (n, law) = (table.len(), material.law());
        let (mut cache, mut own) = (TaylorCache::default(), vec![Wide::default(); n]);
        let mut pressures = vec![0.0; series.len()];
        let mut ratio = vec![Wide::default(); n];
        let of_tissues = self.batches.chunk_by(|a, b| a.parameters == b.parameters);
        for batches in of_tissues.flat_map(|of_tissue| of_tissue.chunks(BATCHES)) {
            let parameters = &batches[0].parameters;
            cache.turn_to(parameters, 0.0);
            let of = |lane: usize| {
                let ClusterBatch { cluster, weight, .. } =
                    &batches[(lane / LANES).min(batches.len() - 1)];
                (cluster[lane % LANES] as usize, weight[lane % LANES])
            };
            for (c, ratio) in ratio.iter_mut().enumerate() {
                *ratio = Lanes(from_fn(|lane| series[of(lane).0 * n + c]));
            }
            own.fill(Wide::default());
            law.pressure_series(parameters, &mut cache, table, &ratio, &mut own);
            for lane in 0..LANES * batches.len() {
                let (cluster, weight) = of(lane);
                if weight > 0.0 {
                    let factor = weight / self.volume[cluster];
                    let sum = &mut pressures[cluster * n..][..n];
                    sum.iter_mut().zip(&own).for_each(|(sum, own)| *sum += factor * own[lane]);
                }
            }
        }
        series.copy_from_slice(&pressures);
    }
}
