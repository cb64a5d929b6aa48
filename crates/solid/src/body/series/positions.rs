//! Series of load positions side by side, cell after cell, neighbours near each other: the coefficients at a node take
//! kilobytes, and stay in the cache while its cells are gone through.

use super::{Along, AroundSeries, CellSeries, ClusterSeries};
use crate::body::batch::Slot;
use crate::body::cells::CellBatches;
use crate::body::clusters::Clusters;
use crate::element::{Geometry, Shape};
use crate::law::{Material, SharedSeries, TaylorCache};
use crate::number::{Monomials, Wide};
use crate::simd::{Kernel, dispatch_solver};

impl Along<'_, Wide> {
    /// Series of `F = I + sum_a u_a (x) grad N_a`, those of degree p without `u_p`.
    #[inline(always)]
    fn deformation<const N: usize>(
        &self,
        nodes: &[u32; N],
        gradients: &[[f64; 3]; N],
        out: &mut [Wide],
    ) {
        let n = self.table.len();
        let known = self.known();
        for (i, row) in out.chunks_exact_mut(3 * n).enumerate() {
            let u = nodes
                .map(|node| &self.displacement[(3 * node as usize + i) * self.stride..][..known]);
            // Coefficient by coefficient: each is loaded once, and the sums stay in registers.
            for c in 0..known {
                let mut sums = [Wide::default(); 3];
                for (u, g) in u.iter().zip(gradients) {
                    for (sum, &g) in sums.iter_mut().zip(g) {
                        *sum = *sum + u[c] * g;
                    }
                }
                for (j, sum) in sums.into_iter().enumerate() {
                    row[j * n + c] = sum;
                }
            }
            row.chunks_exact_mut(n).for_each(|run| run[known..].fill(Wide::default()));
            row[i * n] = row[i * n] + 1.0;
        }
    }
}

impl<'a> AroundSeries<'a, Wide> {
    /// Around a cell, of series with `n` coefficients.
    fn of(&self, slot: Slot, n: usize) -> SharedSeries<'a, Wide> {
        let of_cluster = |(clusters, pressures): (&Clusters, &'a [Wide])| SharedSeries {
            part: clusters.share[slot.batch as usize],
            pressure: &pressures[clusters.at(slot) * n..][..n],
        };
        self.0.map(of_cluster).unwrap_or_default()
    }
}

impl<E: Shape<N>, const N: usize> CellSeries<Wide> for CellBatches<E, N> {
    fn force_series(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<Wide>,
        around: AroundSeries<Wide>,
        force: &mut [Wide],
    ) {
        dispatch_solver(Forces { cells: self, material, geometry, along, around, force });
    }

    fn add_volume_series(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<Wide>,
        clusters: &Clusters,
        ratios: &mut [Wide],
    ) {
        dispatch_solver(Volumes { cells: self, material, geometry, along, clusters, ratios });
    }
}

/// Gradients of the shape functions of a cell.
#[inline(always)]
fn gradients<const N: usize>(slopes: &[[f64; 3]; N], geometry: &Geometry) -> [[f64; 3]; N] {
    let g = &geometry.gradients;
    slopes.map(|s| std::array::from_fn(|j| s[0] * g[0][j] + s[1] * g[1][j] + s[2] * g[2][j]))
}

struct Forces<'a, E, const N: usize> {
    cells: &'a CellBatches<E, N>,
    material: &'a Material,
    geometry: &'a [Geometry],
    along: Along<'a, Wide>,
    around: AroundSeries<'a, Wide>,
    force: &'a mut [Wide],
}

impl<E: Shape<N>, const N: usize> Kernel for Forces<'_, E, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Forces { cells, material, geometry, along, around, force } = self;
        let (table, law) = (along.table, material.law());
        let (n, top) = (table.len(), table.of_degree(table.order()).len());
        let mut deformation = vec![Wide::default(); 9 * n];
        let mut stress = vec![Wide::default(); 9 * top];
        let mut cache = TaylorCache::default();
        for cell in cells.order.iter().map(|&cell| cell as usize) {
            let (nodes, geometry) = (&cells.nodes[cell], &geometry[cell]);
            let (row, shared) = (material.row(cell), around.of(cells.slots[cell], n));
            cache.turn_to(row, shared.part);
            for point in 0..E::POINTS {
                let gradients = gradients(E::slopes(point), geometry);
                along.deformation(nodes, &gradients, &mut deformation);
                stress.fill(Wide::default());
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

struct Volumes<'a, E, const N: usize> {
    cells: &'a CellBatches<E, N>,
    material: &'a Material,
    geometry: &'a [Geometry],
    along: Along<'a, Wide>,
    clusters: &'a Clusters,
    ratios: &'a mut [Wide],
}

impl<E: Shape<N>, const N: usize> Kernel for Volumes<'_, E, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Volumes { cells, material, geometry, along, clusters, ratios } = self;
        let (n, law) = (along.table.len(), material.law());
        let mut deformation = vec![Wide::default(); 9 * n];
        let mut ratio = vec![Wide::default(); n];
        for cell in cells.order.iter().map(|&cell| cell as usize) {
            let (nodes, geometry) = (&cells.nodes[cell], &geometry[cell]);
            along.deformation(nodes, &gradients(E::slopes(0), geometry), &mut deformation);
            ratio.fill(Wide::default());
            law.volume_series(material.row(cell), along.table, &deformation, &mut ratio);
            let cluster = clusters.at(cells.slots[cell]);
            let part = geometry.volume / clusters.volume[cluster];
            add_scaled(&mut ratios[cluster * n..(cluster + 1) * n], part, &ratio);
        }
    }
}

impl ClusterSeries<Wide> for Clusters {
    fn pressure_series(&self, material: &Material, table: &'static Monomials, series: &mut [Wide]) {
        let (n, law) = (table.len(), material.law());
        let (mut cache, mut own) = (TaylorCache::default(), vec![Wide::default(); n]);
        let mut pressures = vec![Wide::default(); series.len()];
        for batch in &self.batches {
            cache.turn_to(&batch.parameters, 0.0);
            for (lane, cluster) in batch.cluster.into_iter().enumerate() {
                let (cluster, weight) = (cluster as usize, batch.weight[lane]);
                if weight > 0.0 {
                    let run = cluster * n..(cluster + 1) * n;
                    own.fill(Wide::default());
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
fn add_scaled(sum: &mut [Wide], factor: f64, series: &[Wide]) {
    sum.iter_mut().zip(series).for_each(|(sum, &value)| *sum = *sum + value * factor);
}
