//! Volume ratios averaged around nodes: a linear tetrahedron that does not lock (Bonet and Burton, Comm. Num.
//! Meth. Eng. 14 (1998) 437, here for any law).
//!
//! With `U(J)` the law's answer to a pure dilatation, and `J_a = sum V_e J_e / sum V_e` over the cells at node `a`,
//!   W = sum_e V_e [psi(F_e) - s U(J_e)] + sum_a s V_a U(J_a),   V_a = sum V_e / 4,
//!   P_e = dpsi/dF + (mean of s U'(J_a) over the nodes - s U'(J_e)) dJ/dF,
//!   K = K_cells + sum_a s V_a U''(J_a) j_a (x) j_a,   j_a = dJ_a/du.
//! A node where different tissues meet has one average for each. The part `1 - s` that stays in the cell keeps
//! pressures from oscillating; it has the bulk modulus [`KEPT`] mu, so that it does not lock either.

use super::blocks::{BlockPattern, Grouped};
use super::cells::{Batch, Slot, tissues};
use super::kernels::{Surroundings, TASK};
use super::{LANES, Lane};
use crate::element::{Geometry, Shape, Tet4};
use crate::law::{Law, LawVisitor, Material, TangentBlocks};
use crate::number::{Jet, Lanes, Monomials, Real};
use crate::simd::{Kernel, dispatch};
use crate::tensor::{Mat3, Vec3, mul_vector, tabulate};
use rayon::prelude::*;

/// Bulk modulus that stays in each cell, in units of its shear modulus.
pub(super) const KEPT: f64 = 2.0;

/// Where the averages are taken, and what they touch.
pub(super) struct Averages {
    /// By batch: the average of each corner of each cell.
    corners: Vec<[[u32; 4]; LANES]>,
    /// By batch: the averaged part `s`.
    share: Vec<f64>,
    /// By average: `V_a`.
    volume: Vec<f64>,
    /// By average: its cells, with their part of the volume and the places of their corners in the ring.
    members: Grouped<Member>,
    /// By average: the nodes of its cells, ascending.
    ring: Grouped<u32>,
    /// The averages in batches of one tissue.
    responses: Vec<Response>,
    /// By block: the entries of rings whose products add up to it.
    products: Grouped<[u32; 2]>,
}

#[derive(Clone, Copy)]
struct Member {
    cell: u32,
    slot: Slot,
    part: f64,
    places: [u16; 4],
}

/// `s V_a` of some averages in one tissue.
struct Response {
    average: [u32; LANES],
    weight: Lane,
    parameters: Vec<f64>,
}

/// Averages at a displacement.
pub(super) struct Volumes {
    /// `J_e` of each batch.
    cells: Vec<Lane>,
    /// `dJ_e/dF g_k` of each batch.
    slopes: Vec<[Vec3<Lane>; 3]>,
    /// `J_a`.
    averages: Vec<f64>,
}

/// What the averages do to a cell.
#[derive(Clone, Copy)]
pub(super) struct Averaged<'a> {
    averages: &'a Averages,
    /// `dW/dJ_a / V_a`, and a zero for corners without average.
    pressure: &'a [f64],
}

/// Pairs of nodes that share a block because some cell of each is at one node.
pub(super) fn pairs(rings: &Rings) -> impl Iterator<Item = [u32; 2]> + '_ {
    (0..rings.nodes.len()).flat_map(|average| {
        let ring = rings.nodes.of(average);
        ring.iter().enumerate().flat_map(|(k, &m)| ring[..=k].iter().map(move |&n| [n, m]))
    })
}

/// The averages of a mesh before anything is batched.
pub(super) struct Rings {
    /// By average: the cells at it.
    cells: Grouped<u32>,
    /// By average: the nodes of its cells, ascending.
    nodes: Grouped<u32>,
    /// The average of each corner of each cell.
    corners: Vec<[u32; 4]>,
    /// The averaged part of each cell.
    share: Vec<f64>,
}

impl Rings {
    /// One average for each kind of tissue at a node: of moduli in the same octaves.
    pub fn new(cells: &[[u32; 4]], material: &Material) -> Self {
        let mut share = vec![0.0; cells.len()];
        let mut kind = vec![[0; 2]; cells.len()];
        for group in tissues(cells.len(), material) {
            let [shear, bulk] = material.moduli(material.of_cell(group[0]));
            for cell in group {
                let kept =
                    std::env::var("VISCERA_KEPT").ok().and_then(|k| k.parse().ok()).unwrap_or(KEPT);
                share[cell] = (1.0 - kept * shear / bulk).max(0.0);
                kind[cell] = [shear, bulk].map(|modulus| modulus.log2().round() as i32);
            }
        }
        let mut corners: Vec<(u32, [i32; 2], u32, u8)> = Vec::new();
        for (cell, nodes) in (0u32..).zip(cells).filter(|&(cell, _)| share[cell as usize] > 0.0) {
            corners.extend((0u8..).zip(nodes).map(|(a, &n)| (n, kind[cell as usize], cell, a)));
        }
        corners.sort_unstable();
        let (mut at_cells, mut members, mut ring) = (Vec::new(), Vec::new(), Vec::new());
        let mut count = 0;
        for group in corners.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            at_cells.extend(group.iter().map(|&(_, _, cell, a)| (cell, a, count)));
            members.extend(group.iter().map(|&(_, _, cell, _)| (count, cell)));
            let mut nodes: Vec<u32> =
                group.iter().flat_map(|&(_, _, cell, _)| cells[cell as usize]).collect();
            nodes.sort_unstable();
            nodes.dedup();
            ring.extend(nodes.into_iter().map(|node| (count, node)));
            count += 1;
        }
        let mut corners = vec![[count; 4]; cells.len()];
        at_cells.iter().for_each(|&(cell, a, k)| corners[cell as usize][a as usize] = k);
        Rings {
            cells: Grouped::new(count as usize, &members),
            nodes: Grouped::new(count as usize, &ring),
            corners,
            share,
        }
    }
}

impl Averages {
    /// Lays the rings out for the batches of `slots`; `pattern` must hold their [`pairs`].
    pub fn new(
        rings: Rings,
        cells: &[[u32; 4]],
        slots: &[Slot],
        geometry: &[Geometry],
        material: &Material,
        pattern: &BlockPattern,
    ) -> Self {
        let n_batches = slots.iter().map(|slot| slot.batch as usize + 1).max().unwrap_or(0);
        let count = rings.cells.len();
        let mut corners = vec![[[count as u32; 4]; LANES]; n_batches];
        let mut share = vec![0.0; n_batches];
        for (cell, slot) in slots.iter().enumerate() {
            corners[slot.batch as usize][slot.lane as usize] = rings.corners[cell];
            share[slot.batch as usize] = rings.share[cell];
        }
        let (mut members, mut volumes) = (Vec::new(), Vec::with_capacity(count));
        for average in 0..count {
            let (mine, ring) = (rings.cells.of(average), rings.nodes.of(average));
            let volume: f64 = mine.iter().map(|&cell| geometry[cell as usize].volume).sum();
            volumes.push(0.25 * volume);
            members.extend(mine.iter().map(|&cell| {
                let place = |node| ring.partition_point(|&n| n < node) as u16;
                let (cell, part) = (cell as usize, geometry[cell as usize].volume / volume);
                let member = Member {
                    cell: cell as u32,
                    slot: slots[cell],
                    part,
                    places: cells[cell].map(place),
                };
                (average as u32, member)
            }));
        }
        Averages {
            corners,
            share,
            volume: volumes,
            members: Grouped::new(count, &members),
            responses: responses(&rings, geometry, material),
            products: products(&rings, pattern),
            ring: rings.nodes,
        }
    }

    /// Volume ratios of cells and averages.
    pub fn volumes(&self, material: &Material, batches: &[Batch<4>], u: &[f64]) -> Volumes {
        let mut volumes = Volumes {
            cells: vec![Lane::default(); batches.len()],
            slopes: vec![[[Lane::default(); 3]; 3]; batches.len()],
            averages: Vec::new(),
        };
        material.visit(CellVolumes { batches, u, volumes: &mut volumes });
        let average = |k: usize| -> f64 {
            let ratio = |m: &Member| volumes.cells[m.slot.batch as usize][m.slot.lane as usize];
            self.members.of(k).iter().map(|m| m.part * ratio(m)).sum()
        };
        volumes.averages =
            (0..self.members.len()).into_par_iter().with_min_len(1024).map(average).collect();
        volumes
    }

    /// `sum_a s V_a U(J_a)`.
    pub fn energy(&self, material: &Material, volumes: &Volumes) -> f64 {
        material.visit(AverageEnergy { averages: self, volumes })
    }

    /// `dW/dJ_a / V_a` with a zero behind the last, and `d2W/dJ_a^2`.
    pub fn pressures(&self, material: &Material, volumes: &Volumes) -> (Vec<f64>, Vec<f64>) {
        material.visit(Pressures { averages: self, volumes })
    }

    /// What a cell feels of the averages.
    pub fn around<'a>(&'a self, pressure: &'a [f64]) -> Averaged<'a> {
        Averaged { averages: self, pressure }
    }

    /// `j_a` over the rings, and the same times `d2W/dJ_a^2`.
    pub fn ring_slopes(&self, volumes: &Volumes, modulus: &[f64]) -> [Vec<[f64; 3]>; 2] {
        const CHUNK: usize = 256;
        let mut slopes = vec![[0.0; 3]; self.ring.total()];
        let mut chunks = Vec::new();
        let mut left = &mut slopes[..];
        for first in (0..self.members.len()).step_by(CHUNK) {
            let last = (first + CHUNK).min(self.members.len());
            let size = self.ring.range(last - 1).end - self.ring.range(first).start;
            let (mine, rest) = left.split_at_mut(size);
            chunks.push((first..last, mine));
            left = rest;
        }
        chunks.into_par_iter().for_each(|(averages, out)| {
            let start = self.ring.range(averages.start).start;
            for average in averages {
                let out = &mut out[self.ring.range(average).start - start..];
                for m in self.members.of(average) {
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
        });
        let mut weighted = slopes.clone();
        for (average, modulus) in modulus.iter().enumerate() {
            for slope in &mut weighted[self.ring.range(average)] {
                *slope = slope.map(|s| modulus * s);
            }
        }
        [slopes, weighted]
    }

    /// Adds `sum_a d2W/dJ_a^2 j_a (x) j_a` to a block.
    #[inline(always)]
    pub fn add_products(
        &self,
        [slopes, weighted]: &[Vec<[f64; 3]>; 2],
        block: usize,
        out: &mut [f64; 9],
    ) {
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

fn responses(rings: &Rings, geometry: &[Geometry], material: &Material) -> Vec<Response> {
    let mut responses = Vec::new();
    for group in tissues(rings.share.len(), material) {
        let mut weights: Vec<(u32, f64)> = Vec::new();
        for &cell in group.iter().filter(|&&cell| rings.share[cell] > 0.0) {
            let weight = 0.25 * rings.share[cell] * geometry[cell].volume;
            weights.extend(rings.corners[cell].map(|average| (average, weight)));
        }
        weights.sort_by_key(|&(average, _)| average);
        let sums: Vec<(u32, f64)> = (weights.chunk_by(|a, b| a.0 == b.0))
            .map(|same| (same[0].0, same.iter().map(|w| w.1).sum()))
            .collect();
        responses.extend(sums.chunks(LANES).map(|some| Response {
            average: std::array::from_fn(|l| some[l.min(some.len() - 1)].0),
            weight: Lanes(std::array::from_fn(|l| some.get(l).map_or(0.0, |w| w.1))),
            parameters: material.of_cell(group[0]).to_vec(),
        }));
    }
    responses
}

fn products(rings: &Rings, pattern: &BlockPattern) -> Grouped<[u32; 2]> {
    let mut products = Vec::new();
    for average in 0..rings.nodes.len() {
        let (ring, first) = (rings.nodes.of(average), rings.nodes.range(average).start as u32);
        for (k, &column) in (0u32..).zip(ring) {
            for (l, &row) in (0u32..=k).zip(ring) {
                products.push((pattern.block(row, column), [first + l, first + k]));
            }
        }
    }
    Grouped::new(pattern.len(), &products)
}

impl Averaged<'_> {
    /// Mean over the corners of the pressures of the averages.
    #[inline(always)]
    fn mean_pressure(&self, batch: usize) -> Lane {
        let at = |corner: u32| self.pressure[corner as usize];
        Lanes(
            self.averages.corners[batch].map(|[a, b, c, d]| 0.25 * (at(a) + at(b) + at(c) + at(d))),
        )
    }
}

impl Surroundings for Averaged<'_> {
    #[inline(always)]
    fn energy<L: Law>(&self, law: &L, batch: usize, f: &Mat3<Lane>, energy: &mut Lane) {
        let (ratio, _) = law.volume_ratio(f);
        *energy = *energy - law.dilatation(&ratio) * self.averages.share[batch];
    }

    #[inline(always)]
    fn stress<L: Law>(&self, law: &L, batch: usize, f: &Mat3<Lane>, stress: &mut Mat3<Lane>) {
        let (ratio, slope) = law.volume_ratio(f);
        let q = self.mean_pressure(batch) - law.pressure(&ratio) * self.averages.share[batch];
        *stress = tabulate(|i, j| stress[i][j] + q * slope[i][j]);
    }

    #[inline(always)]
    fn tangent<L: Law>(
        &self,
        law: &L,
        batch: usize,
        (f, g): (&Mat3<Lane>, &[Vec3<Lane>; 3]),
        stress: &mut Mat3<Lane>,
        blocks: &mut TangentBlocks<Lane>,
    ) {
        let share = self.averages.share[batch];
        let (ratio, slope) = law.volume_ratio(f);
        let [pressure, modulus] = law.pressure_and_modulus(&ratio);
        let q = self.mean_pressure(batch) - pressure * share;
        let curvature = law.volume_curvature(f, g);
        *stress = tabulate(|i, j| stress[i][j] + q * slope[i][j]);
        let z: [Vec3<Lane>; 3] = std::array::from_fn(|k| mul_vector(&slope, &g[k]));
        let mz = z.map(|z| z.map(|z| z * modulus * share));
        for a in 0..3 {
            for b in a..3 {
                let (block, curvature) = (&mut blocks[a][b], &curvature[a][b]);
                *block = tabulate(|i, k| block[i][k] + q * curvature[i][k] - mz[a][i] * z[b][k]);
            }
        }
    }
}

struct CellVolumes<'a> {
    batches: &'a [Batch<4>],
    u: &'a [f64],
    volumes: &'a mut Volumes,
}

impl LawVisitor for CellVolumes<'_> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        let (u, Volumes { cells, slopes, .. }) = (self.u, self.volumes);
        let tasks = self.batches.par_chunks(TASK);
        let results = cells.par_chunks_mut(TASK).zip(slopes.par_chunks_mut(TASK));
        tasks.zip(results).for_each(|(batches, (cells, slopes))| {
            dispatch(VolumeKernel { batches, u, make, cells, slopes });
        });
    }
}

struct VolumeKernel<'a, L> {
    batches: &'a [Batch<4>],
    u: &'a [f64],
    make: fn(&[f64]) -> L,
    cells: &'a mut [Lane],
    slopes: &'a mut [[Vec3<Lane>; 3]],
}

impl<L: Law> Kernel for VolumeKernel<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let results = self.cells.iter_mut().zip(self.slopes);
        for (batch, (ratio, slopes)) in self.batches.iter().zip(results) {
            let f = batch.deformation(Tet4::slopes(0), self.u);
            let (volume_ratio, slope) = (self.make)(&batch.parameters).volume_ratio(&f);
            *ratio = volume_ratio;
            *slopes = std::array::from_fn(|k| mul_vector(&slope, &batch.gradients[k]));
        }
    }
}

struct AverageEnergy<'a> {
    averages: &'a Averages,
    volumes: &'a Volumes,
}

impl LawVisitor for AverageEnergy<'_> {
    type Output = f64;
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) -> f64 {
        let response = |r: &Response| {
            let ratio = Lanes(r.average.map(|k| self.volumes.averages[k as usize]));
            (make(&r.parameters).dilatation(&ratio) * r.weight).0.iter().sum::<f64>()
        };
        self.averages.responses.iter().map(response).sum()
    }
}

struct Pressures<'a> {
    averages: &'a Averages,
    volumes: &'a Volumes,
}

impl LawVisitor for Pressures<'_> {
    type Output = (Vec<f64>, Vec<f64>);
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) -> (Vec<f64>, Vec<f64>) {
        dispatch(PressureKernel { averages: self.averages, volumes: self.volumes, make })
    }
}

struct PressureKernel<'a, L> {
    averages: &'a Averages,
    volumes: &'a Volumes,
    make: fn(&[f64]) -> L,
}

impl<L: Law> Kernel for PressureKernel<'_, L> {
    type Output = (Vec<f64>, Vec<f64>);
    #[inline(always)]
    fn run(self) -> Self::Output {
        let PressureKernel { averages, volumes, make } = self;
        let count = averages.members.len();
        let (mut pressures, mut moduli) = (vec![0.0; count + 1], vec![0.0; count]);
        for response in &averages.responses {
            let ratio = Lanes(response.average.map(|k| volumes.averages[k as usize]));
            let [pressure, modulus] = make(&response.parameters).pressure_and_modulus(&ratio);
            for (lane, average) in response.average.into_iter().enumerate() {
                let (average, weight) = (average as usize, response.weight[lane]);
                pressures[average] += weight / averages.volume[average] * pressure[lane];
                moduli[average] += weight * modulus[lane];
            }
        }
        (pressures, moduli)
    }
}

impl Averages {
    /// From the series of each cell's volume ratio to those of the pressure its neighbours add, in place.
    pub fn pressure_series<T: Real>(
        &self,
        material: &Material,
        slots: &[Slot],
        table: &'static Monomials,
        series: &mut [T],
    ) {
        material.visit(PressureSeries { averages: self, material, slots, table, series });
    }
}

struct PressureSeries<'a, T> {
    averages: &'a Averages,
    material: &'a Material,
    slots: &'a [Slot],
    table: &'static Monomials,
    series: &'a mut [T],
}

impl<T: Real> LawVisitor for PressureSeries<'_, T> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        dispatch(SeriesKernel { series: self, make });
    }
}

struct SeriesKernel<'a, T, L> {
    series: PressureSeries<'a, T>,
    make: fn(&[f64]) -> L,
}

impl<T: Real, L: Law> Kernel for SeriesKernel<'_, T, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let PressureSeries { averages, material, slots, table, series } = self.series;
        let n = table.len();
        let count = averages.members.len();
        let mut ratios = vec![T::default(); count * n];
        for (average, ratio) in ratios.chunks_exact_mut(n).enumerate() {
            for m in averages.members.of(average) {
                add_scaled(ratio, m.part, &series[m.cell as usize * n..][..n]);
            }
        }
        let pressure = |parameters: &[f64], ratio: &[T]| {
            (self.make)(parameters).pressure(&Jet::new(table, ratio.to_vec()))
        };
        let mut pressures = vec![T::default(); (count + 1) * n];
        for response in &averages.responses {
            for (lane, average) in response.average.into_iter().enumerate() {
                let average = average as usize;
                let weight = response.weight[lane] / averages.volume[average];
                if weight != 0.0 {
                    let p = pressure(&response.parameters, &ratios[average * n..][..n]);
                    add_scaled(&mut pressures[average * n..][..n], weight, p.coefficients());
                }
            }
        }
        for (cell, (slot, q)) in slots.iter().zip(series.chunks_exact_mut(n)).enumerate() {
            let own = pressure(material.of_cell(cell), q);
            q.fill(T::default());
            add_scaled(q, -averages.share[slot.batch as usize], own.coefficients());
            for average in averages.corners[slot.batch as usize][slot.lane as usize] {
                add_scaled(q, 0.25, &pressures[average as usize * n..][..n]);
            }
        }
    }
}

/// `sum += factor series`.
#[inline(always)]
fn add_scaled<T: Real>(sum: &mut [T], factor: f64, series: &[T]) {
    sum.iter_mut().zip(series).for_each(|(sum, &value)| *sum = *sum + value * factor);
}
