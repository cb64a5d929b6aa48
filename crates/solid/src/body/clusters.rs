//! Clusters of cells that share one volume ratio: a linear tetrahedron that does not lock.
//!
//! With `U(J)` the law's energy of a pure dilatation, and `J_c = sum V_e J_e / sum V_e` over the cells of cluster c,
//!   W = sum_e V_e [psi(F_e) - s U(J_e)] + sum_c s V_c U(J_c),
//!   P_e = dpsi/dF + (s U'(J_c) - s U'(J_e)) dJ/dF,
//!   K = K_cells + sum_c s V_c U''(J_c) j_c (x) j_c,   j_c = dJ_c/du.
//! The mean dilatation of Nagtegaal, Parks and Rice (1974) on patches of tetrahedra, as in de Souza Neto, Pires and
//! Owen, IJNME 62 (2005) 353, with an energy, for any law. The part `1 - s` keeps the bulk modulus of
//! Poisson's ratio 0, `2 mu / 3`, in the cell: enough to hold its shape, too little to lock.

use super::batch::Slot;
use super::blocks::{BlockPattern, Grouped};
use super::cells::{CellBatches, tissues};
use super::curvature::Curvature;
use super::partition::Partition;
use super::programmed::ClusterNodes;
use super::tasks::RUN;
use crate::element::{Geometry, Shape, Tet4};
use crate::law::{LawKernels, Material, Shared};
use crate::number::{LANES, Lane, Lanes};
use crate::simd::{Kernel, dispatch_solver};
use crate::tensor::{Mat3, Vec3, mul_vector};
use crate::unroll::array;
use rayon::prelude::*;
use std::ops::Range;

/// Batches of a task.
const BATCHES: usize = CellBatches::<Tet4, 4>::TASK;

/// The clusters over which volume ratios are averaged, with their nodes and blocks.
pub(super) struct Clusters {
    /// By batch: the cluster of each cell.
    pub(super) of: Vec<[u32; LANES]>,
    /// By batch: the averaged part `s`.
    pub(super) share: Vec<f64>,
    /// By cluster: `V_c`.
    pub(super) volume: Vec<f64>,
    /// By cluster: its cells.
    pub(super) members: Grouped<Member>,
    /// By cluster: the nodes of its cells, ascending.
    nodes: Grouped<u32>,
    /// The clusters in batches of one tissue.
    pub(super) batches: Vec<ClusterBatch>,
    /// By block: the places of `j_c` whose products add up to it.
    products: Grouped<[u32; 2]>,
}

/// A cell of a cluster: its part of the volume, and where its corners are among the cluster's nodes.
#[derive(Clone, Copy)]
pub(super) struct Member {
    pub cell: u32,
    pub part: f64,
    slot: Slot,
    places: [u16; 4],
}

/// `s V_c` of some clusters in one tissue.
pub(super) struct ClusterBatch {
    pub cluster: [u32; LANES],
    pub weight: Lane,
    pub parameters: Vec<f64>,
}

/// Volume ratios at a displacement.
#[derive(Clone, Default)]
pub(super) struct Volumes {
    /// `J_e` of each batch.
    cells: Vec<Lane>,
    /// `dJ_e/dF g_k` of each batch.
    slopes: Vec<[Vec3<Lane>; 3]>,
    /// `J_c`.
    pub(super) clusters: Vec<f64>,
}

/// Contribution of the clusters to the tangent at a displacement.
#[derive(Clone, Default)]
pub struct SharedTangent {
    /// `s U'(J_c)`.
    pub pressures: Vec<f64>,
    /// `j_c` over the nodes of the clusters.
    pub slopes: Vec<[f64; 3]>,
    /// The same times `s V_c U''(J_c)`.
    pub weighted: Vec<[f64; 3]>,
}

/// Memory for the evaluation of the clusters of a body.
#[derive(Clone, Default)]
pub(super) struct ClusterWorkspace {
    pub volumes: Volumes,
    pub shared: SharedTangent,
    /// `s V_c U''(J_c)`.
    moduli: Vec<f64>,
}

impl Clusters {
    /// Lays a partition out for the batches of `slots`; `pattern` must hold its pairs of nodes.
    pub fn new(
        partition: &Partition,
        cells: &[[u32; 4]],
        slots: &[Slot],
        geometry: &[Geometry],
        material: &Material,
        pattern: &BlockPattern,
    ) -> Self {
        let n_batches = slots.iter().map(|slot| slot.batch as usize + 1).max().unwrap_or(0);
        let mut of = vec![[0; LANES]; n_batches];
        let mut share = vec![0.0; n_batches];
        for (cell, slot) in slots.iter().enumerate() {
            of[slot.batch as usize][slot.lane as usize] = partition.of[cell];
            share[slot.batch as usize] = averaged_part(material, cell);
        }
        let mut volume = vec![0.0; partition.cells.len()];
        partition.of.iter().zip(geometry).for_each(|(&c, g)| volume[c as usize] += g.volume);
        let member = |(cell, nodes): (usize, &[u32; 4])| {
            let cluster = partition.of[cell];
            let all = partition.nodes.of(cluster as usize);
            let places = nodes.map(|node| all.partition_point(|&n| n < node) as u16);
            let part = geometry[cell].volume / volume[cluster as usize];
            (cluster, Member { cell: cell as u32, part, slot: slots[cell], places })
        };
        let members: Vec<(u32, Member)> = cells.iter().enumerate().map(member).collect();
        Clusters {
            of,
            share,
            members: Grouped::new(volume.len(), &members),
            batches: batches(partition, geometry, material),
            products: products(partition, pattern),
            nodes: partition.nodes.clone(),
            volume,
        }
    }

    /// The cluster of a cell.
    pub fn at(&self, slot: Slot) -> usize {
        self.of[slot.batch as usize][slot.lane as usize] as usize
    }

    /// Which cells and nodes they have.
    pub fn nodes(&self) -> ClusterNodes {
        let members = (0..self.members.len()).map(|cluster| self.members.of(cluster));
        let mut of = vec![0; members.clone().map(<[Member]>::len).sum()];
        for (cluster, members) in (0u32..).zip(members) {
            members.iter().for_each(|member| of[member.cell as usize] = cluster);
        }
        let ranges = (0..self.nodes.len()).map(|cluster| self.nodes.range(cluster));
        let starts = std::iter::once(0).chain(ranges.map(|range| range.end as u32)).collect();
        let nodes =
            (0..self.nodes.len()).flat_map(|cluster| self.nodes.of(cluster).iter().copied());
        ClusterNodes { of, starts, nodes: nodes.collect() }
    }

    /// Volume ratios of cells and clusters; by all threads if `is_shared`.
    pub fn volumes(
        &self,
        (law, of): (&dyn LawKernels, &CellBatches<Tet4, 4>),
        u: &[f64],
        is_shared: bool,
        Volumes { cells, slopes, clusters }: &mut Volumes,
    ) {
        let n = of.batches.len();
        cells.resize(n, Lane::default());
        slopes.resize(n, [[Lane::default(); 3]; 3]);
        clusters.resize(self.members.len(), 0.0);
        let of_task = |(task, (ratios, slopes)): (usize, (&mut [Lane], &mut [_]))| {
            dispatch_solver(VolumeKernel {
                cells: of,
                first: task * BATCHES,
                law,
                u,
                ratios,
                slopes,
            });
        };
        if is_shared {
            let results = cells.par_chunks_mut(BATCHES).zip(slopes.par_chunks_mut(BATCHES));
            results.enumerate().for_each(of_task);
        } else {
            cells.chunks_mut(BATCHES).zip(slopes.chunks_mut(BATCHES)).enumerate().for_each(of_task);
        }
        let mean = |(cluster, mean): (usize, &mut f64)| {
            let ratio = |m: &Member| cells[m.slot.batch as usize][m.slot.lane as usize];
            *mean = self.members.of(cluster).iter().map(|m| m.part * ratio(m)).sum();
        };
        if is_shared {
            clusters.par_iter_mut().enumerate().with_min_len(1024).for_each(mean);
        } else {
            clusters.iter_mut().enumerate().for_each(mean);
        }
    }

    /// `sum_c s V_c U(J_c)`.
    pub fn energy(&self, law: &dyn LawKernels, volumes: &Volumes) -> f64 {
        let batch = |r: &ClusterBatch| {
            let ratio = Lanes(r.cluster.map(|c| volumes.clusters[c as usize]));
            let mut energy = [Lane::default()];
            law.dilatation(&r.parameters, &[ratio], &mut energy);
            (energy[0] * r.weight).0.iter().sum::<f64>()
        };
        self.batches.iter().map(batch).sum()
    }

    /// `s U'(J_c)` and `s V_c U''(J_c)` at the volume ratios.
    pub fn pressures(&self, law: &dyn LawKernels, workspace: &mut ClusterWorkspace) {
        let ClusterWorkspace { volumes, shared: SharedTangent { pressures, .. }, moduli } =
            workspace;
        for sums in [&mut *pressures, &mut *moduli] {
            sums.clear();
            sums.resize(self.members.len(), 0.0);
        }
        for batch in &self.batches {
            let ratio = Lanes(batch.cluster.map(|c| volumes.clusters[c as usize]));
            let mut answer = [[Lane::default(); 2]];
            law.pressure(&batch.parameters, &[ratio], &mut answer);
            let [pressure, modulus] = answer[0];
            for (lane, cluster) in batch.cluster.into_iter().enumerate() {
                let (cluster, weight) = (cluster as usize, batch.weight[lane]);
                pressures[cluster] += weight / self.volume[cluster] * pressure[lane];
                moduli[cluster] += weight * modulus[lane];
            }
        }
    }

    /// The pressures of the clusters on their cells.
    pub fn around<'a>(&'a self, pressure: &'a [f64]) -> Around<'a> {
        Around { clusters: Some((self, pressure)) }
    }

    /// Contribution of the clusters to the tangent, at the volume ratios.
    pub fn tangent(
        &self,
        law: &dyn LawKernels,
        curvature: Curvature,
        workspace: &mut ClusterWorkspace,
    ) {
        self.pressures(law, workspace);
        let ClusterWorkspace { volumes, shared: SharedTangent { slopes, weighted, .. }, moduli } =
            workspace;
        if curvature == Curvature::Projected {
            moduli.iter_mut().for_each(|modulus| *modulus = modulus.abs());
        }
        self.slopes(volumes, slopes);
        weighted.clone_from(slopes);
        for (cluster, modulus) in moduli.iter().enumerate() {
            for slope in &mut weighted[self.nodes.range(cluster)] {
                *slope = slope.map(|s| modulus * s);
            }
        }
    }

    /// `j_c` over the nodes of the clusters.
    fn slopes(&self, volumes: &Volumes, slopes: &mut Vec<[f64; 3]>) {
        slopes.clear();
        slopes.resize(self.nodes.total(), [0.0; 3]);
        for cluster in 0..self.members.len() {
            let out = &mut slopes[self.nodes.range(cluster)];
            for m in self.members.of(cluster) {
                let z = &volumes.slopes[m.slot.batch as usize];
                for k in 0..3 {
                    for i in 0..3 {
                        let slope = m.part * z[k][i][m.slot.lane as usize];
                        out[m.places[k + 1] as usize][i] += slope;
                        out[m.places[0] as usize][i] -= slope;
                    }
                }
            }
        }
    }

    /// Adds `sum_c s V_c U'' j_c (j_c . x)` to `y`.
    pub fn add_products_times(&self, shared: &SharedTangent, x: &[f64], y: &mut [f64]) {
        let SharedTangent { slopes, weighted, .. } = shared;
        for cluster in 0..self.nodes.len() {
            let (nodes, places) = (self.nodes.of(cluster), self.nodes.range(cluster));
            let along = |(&node, slope): (&u32, &[f64; 3])| -> f64 {
                (0..3).map(|i| slope[i] * x[3 * node as usize + i]).sum()
            };
            let change: f64 = nodes.iter().zip(&slopes[places.clone()]).map(along).sum();
            for (&node, weighted) in nodes.iter().zip(&weighted[places]) {
                (0..3).for_each(|i| y[3 * node as usize + i] += change * weighted[i]);
            }
        }
    }

    /// Adds the same products to the blocks of nodes with themselves.
    pub fn add_diagonal(&self, shared: &SharedTangent, blocks: &mut [[f64; 9]]) {
        let SharedTangent { slopes, weighted, .. } = shared;
        for cluster in 0..self.nodes.len() {
            for (place, &node) in self.nodes.range(cluster).zip(self.nodes.of(cluster)) {
                let block = &mut blocks[node as usize];
                let (a, b) = (&weighted[place], &slopes[place]);
                (0..9).for_each(|entry| block[entry] += a[entry / 3] * b[entry % 3]);
            }
        }
    }

    /// Adds `sum_c s V_c U'' j_c (x) j_c` to a block.
    #[inline(always)]
    pub fn add_products(&self, shared: &SharedTangent, block: usize, out: &mut [f64; 9]) {
        let SharedTangent { slopes, weighted, .. } = shared;
        for &[row, column] in self.products.of(block) {
            let (a, b) = (&weighted[row as usize], &slopes[column as usize]);
            for i in 0..3 {
                for k in 0..3 {
                    out[3 * i + k] += a[i] * b[k];
                }
            }
        }
    }
}

/// `s = 1 - (2 mu / 3) / K`, none for materials that expand sideways when pulled.
pub(super) fn averaged_part(material: &Material, cell: usize) -> f64 {
    let [shear, bulk] = material.moduli_of_cell(cell);
    (1.0 - 2.0 / 3.0 * shear / bulk).max(0.0)
}

fn batches(partition: &Partition, geometry: &[Geometry], material: &Material) -> Vec<ClusterBatch> {
    let mut batches = Vec::new();
    for tissue in tissues(partition.of.len(), material) {
        let share = averaged_part(material, tissue[0]);
        let mut weights: Vec<(u32, f64)> =
            tissue.iter().map(|&c| (partition.of[c], share * geometry[c].volume)).collect();
        weights.sort_by_key(|&(cluster, _)| cluster);
        let sums: Vec<(u32, f64)> = (weights.chunk_by(|a, b| a.0 == b.0))
            .map(|same| (same[0].0, same.iter().map(|w| w.1).sum()))
            .collect();
        batches.extend(sums.chunks(LANES).map(|some| ClusterBatch {
            cluster: std::array::from_fn(|l| some[l.min(some.len() - 1)].0),
            weight: Lanes(std::array::from_fn(|l| some.get(l).map_or(0.0, |w| w.1))),
            parameters: material.row(tissue[0]).to_vec(),
        }));
    }
    batches
}

fn products(partition: &Partition, pattern: &BlockPattern) -> Grouped<[u32; 2]> {
    let mut products = Vec::new();
    for cluster in 0..partition.nodes.len() {
        let nodes = partition.nodes.of(cluster);
        let first = partition.nodes.range(cluster).start as u32;
        for (k, &column) in (0u32..).zip(nodes) {
            for (l, &row) in (0u32..=k).zip(nodes) {
                products.push((pattern.block(row, column), [first + l, first + k]));
            }
        }
    }
    Grouped::new(pattern.len(), &products)
}

/// The effect of clusters on their cells: nothing by default, or the pressures `s U'(J_c)`.
#[derive(Clone, Copy, Default)]
pub(super) struct Around<'a> {
    clusters: Option<(&'a Clusters, &'a [f64])>,
}

impl Around<'_> {
    /// The part of the cells' own response to dilatation that a cluster replaces, by batch.
    #[inline(always)]
    pub fn part(&self, batch: usize) -> f64 {
        self.clusters.map_or(0.0, |(clusters, _)| clusters.share[batch])
    }

    /// What takes its place in some batches of one tissue; `pressures` is where that is put.
    #[inline(always)]
    pub fn of<'p>(&self, batches: Range<usize>, pressures: &'p mut [Lane]) -> Shared<'p> {
        let Some((clusters, pressure)) = self.clusters else {
            return Shared::default();
        };
        let pressures = &mut pressures[..batches.len()];
        for (p, of) in pressures.iter_mut().zip(&clusters.of[batches.clone()]) {
            *p = Lanes(of.map(|cluster| pressure[cluster as usize]));
        }
        Shared { part: clusters.share[batches.start], pressure: pressures }
    }
}

/// Volume ratios of the batches from `first` on, and their slopes along the gradients.
struct VolumeKernel<'a> {
    cells: &'a CellBatches<Tet4, 4>,
    first: usize,
    law: &'a dyn LawKernels,
    u: &'a [f64],
    ratios: &'a mut [Lane],
    slopes: &'a mut [[Vec3<Lane>; 3]],
}

impl Kernel for VolumeKernel<'_> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let VolumeKernel { cells, first: begin, law, u, ratios, slopes } = self;
        let (mut f, mut z) = ([Mat3::<Lane>::default(); RUN], [Mat3::<Lane>::default(); RUN]);
        let (mut first, last) = (begin, begin + ratios.len());
        while first < last {
            let run = cells.run(first, last);
            let (n, row) = (run.len(), &cells.tissues[cells.batches[first].tissue as usize]);
            let (batches, here) = (&cells.batches[run.clone()], first - begin..run.end - begin);
            for (f, batch) in f.iter_mut().zip(batches) {
                *f = batch.deformation(Tet4::slopes(0), u);
            }
            law.volume_ratio(row, &f[..n], &mut ratios[here.clone()], &mut z[..n]);
            for ((slopes, z), batch) in slopes[here].iter_mut().zip(&z).zip(batches) {
                *slopes = array!(3, |k| mul_vector(z, &batch.gradients[k]));
            }
            first = run.end;
        }
    }
}
