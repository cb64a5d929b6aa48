//! Sampled units that are more than a linear cell: clusters that share their change of volume, quadratic cells. They are
//! a body of their own ([`WeightedSubset`]), whose kernels are those of every body; here is what lies between its nodes and the modes.
//!
//! With the modes `E` on its nodes, a row for each degree of freedom, force and tangent of `W(u_0 + E q)` are `E^T f` and
//! `E^T K E`. The modes are held in single precision, as they are for [linear cells](super::panels).

use super::reduced_energy::{Reduced, Wanted};
use crate::body::{Body, Curvature, SymmetricBlocks, UPRIGHT, WeightedSubset, Workspace};
use crate::linear::Precision;
use crate::simd::{WideKernel, dispatch_wide};
use crate::threads::for_parts;
use crate::unroll::each;
use std::sync::Arc;

/// Numbers of a row come in runs of so many, with zeros after the last mode.
const RUN: usize = 16;
/// Rows that are processed together: those of a node.
const ABREAST: usize = 3;
/// Modes whose products with all others a thread finds at once.
const MODES: usize = 8;
/// Rows that are gone through together, which stay in the cache.
const CACHED: usize = 384;

/// Sampling units and the modes on their nodes.
#[derive(Clone)]
pub(super) struct SamplingUnits {
    subset: Arc<WeightedSubset>,
    modes: Arc<Rows>,
    /// `q` with zeros after the last mode, `u_0 + E q`, and the force there.
    q: Vec<f64>,
    u: Vec<f64>,
    f: Vec<f64>,
    tangent: SymmetricBlocks,
    /// Row and column node of each of its blocks.
    pairs: Arc<Vec<(u32, u32)>>,
    /// `E^T f`; `K E`, and `E^T K E` up to its diagonal.
    sums: Vec<f64>,
    stresses: Vec<f32>,
    products: Vec<f32>,
    workspace: Workspace,
}

impl SamplingUnits {
    /// The displacement in the origin and the `modes` are runs of all degrees of freedom of the whole body.
    pub fn new(subset: WeightedSubset, displacement: &[f64], modes: &[Vec<f64>]) -> Self {
        let (n, tangent) = (subset.body.n_dofs(), subset.body.zero_tangent());
        let modes = Rows::new(&subset.nodes, displacement, modes);
        SamplingUnits {
            q: vec![0.0; modes.stride],
            u: vec![0.0; n],
            f: vec![0.0; n],
            pairs: Arc::new(tangent.pattern().pairs().collect()),
            tangent,
            sums: vec![0.0; modes.stride],
            stresses: Vec::new(),
            products: Vec::new(),
            workspace: Workspace::default(),
            modes: Arc::new(modes),
            subset: Arc::new(subset),
        }
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.subset.body.cells().len()
    }

    /// Evaluations stay on the thread that asks; from the second tangent on they allocate nothing.
    pub fn stay_on_one_thread(&mut self, is_alone: bool) {
        self.workspace.stay_on_one_thread(is_alone);
    }

    /// Energy and force at `q`, and the tangent where asked for.
    pub fn evaluate(&mut self, q: &[f64], wanted: Wanted, reduced: &mut Reduced) {
        reduced.energy = self.find_force(q);
        let SamplingUnits { subset, modes, u, f, sums, .. } = self;
        reduced.jacobian = smallest_jacobian(&subset.body, u);
        modes.project(f, sums);
        reduced.force.copy_from_slice(&sums[..modes.r]);
        if wanted != Wanted::Force {
            self.curve(wanted, reduced);
        }
    }

    /// Displacement and force at `q`; returns the energy.
    fn find_force(&mut self, q: &[f64]) -> f64 {
        let SamplingUnits { subset, modes, q: padded, u, f, workspace, .. } = self;
        padded[..q.len()].copy_from_slice(q);
        modes.combine(padded, u);
        subset.body.internal_force_in(workspace, (u, UPRIGHT), f)
    }

    /// `E^T K E` at `u`.
    fn curve(&mut self, wanted: Wanted, reduced: &mut Reduced) {
        let SamplingUnits { subset, modes, u, f, tangent, pairs, stresses, products, .. } = self;
        subset.body.linearize_in(&mut self.workspace, (u, Curvature::Exact), f, tangent);
        stresses.clear();
        stresses.resize(modes.values.len(), 0.0);
        dispatch_wide(Stress { tangent, pairs, modes, out: stresses });
        let r = modes.r;
        products.resize(r * r, 0.0);
        let of_modes = |part: usize, out: &mut [f32]| {
            dispatch_wide(Products { modes, stresses, first: part * MODES, out });
        };
        if wanted == Wanted::SharedTangent {
            for_parts(products, MODES * r, of_modes);
        } else {
            let parts = products.chunks_mut(MODES * r).enumerate();
            parts.for_each(|(part, out)| of_modes(part, out));
        }
        reduced.tangent.iter_mut().zip(&*products).for_each(|(k, &x)| *k = f64::from(x));
        reduced.mirror();
    }

    /// The force of each unit along each mode at `q`, of units that have no node in common.
    pub fn forces(&mut self, q: &[f64]) -> Vec<f64> {
        self.find_force(q);
        let SamplingUnits { subset, modes, f, .. } = self;
        let (r, count) = (modes.r, subset.body.n_sampling_units());
        let mut forces = vec![0.0; count * r];
        for (dof, &f) in f.iter().enumerate() {
            let unit = subset.units[dof / 3] as usize;
            let (out, row) = (&mut forces[unit * r..(unit + 1) * r], modes.row(dof));
            out.iter_mut().zip(row).for_each(|(out, &x)| *out += f * f64::from(x));
        }
        forces
    }
}

/// Minus infinity where a displacement is not a number.
fn smallest_jacobian(body: &Body, u: &[f64]) -> f64 {
    let is_known = u.iter().all(|u| u.is_finite());
    if is_known { body.smallest_jacobian(u).0 } else { f64::NEG_INFINITY }
}

/// `E`, row by row.
struct Rows {
    r: usize,
    /// Numbers from one row to the next.
    stride: usize,
    values: Vec<f32>,
    /// `u_0`.
    start: Vec<f64>,
}

impl Rows {
    /// The rows of the degrees of freedom of these nodes.
    fn new(nodes: &[u32], displacement: &[f64], modes: &[Vec<f64>]) -> Self {
        let r = modes.len();
        let stride = r.next_multiple_of(RUN);
        let mut values = vec![0.0; 3 * nodes.len() * stride];
        let dof = |row: usize| 3 * nodes[row / 3] as usize + row % 3;
        for (row, out) in values.chunks_exact_mut(stride).enumerate() {
            let dof = dof(row);
            out.iter_mut().zip(modes).for_each(|(out, mode)| *out = mode[dof] as f32);
        }
        let start = (0..3 * nodes.len()).map(|row| displacement[dof(row)]).collect();
        Rows { r, stride, values, start }
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.stride..row * self.stride + self.r]
    }

    /// `u_0 + E q`, with zeros after the last coordinate.
    fn combine(&self, q: &[f64], out: &mut [f64]) {
        dispatch_wide(Combine { rows: self, q, out });
    }

    /// `E^T f`, with zeros after the last coordinate.
    fn project(&self, f: &[f64], sums: &mut [f64]) {
        sums.fill(0.0);
        dispatch_wide(Project { rows: self, f, sums });
    }
}

struct Combine<'a> {
    rows: &'a Rows,
    q: &'a [f64],
    out: &'a mut [f64],
}

impl WideKernel for Combine<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Combine { rows: Rows { stride, values, start, .. }, q, out } = self;
        out.copy_from_slice(start);
        let nodes = values.chunks_exact(ABREAST * stride);
        for (rows, out) in nodes.zip(out.as_chunks_mut::<ABREAST>().0) {
            let mut sums = [[0.0; RUN]; ABREAST];
            for run in (0..*stride).step_by(RUN) {
                let q = &q[run..run + RUN];
                for (row, sums) in sums.iter_mut().enumerate() {
                    let e = &rows[row * stride + run..row * stride + run + RUN];
                    for k in 0..RUN {
                        sums[k] = q[k].times_plus::<BITS>(f64::from(e[k]), sums[k]);
                    }
                }
            }
            out.iter_mut().zip(sums).for_each(|(out, sums)| *out += sums.iter().sum::<f64>());
        }
    }
}

struct Project<'a> {
    rows: &'a Rows,
    f: &'a [f64],
    sums: &'a mut [f64],
}

impl WideKernel for Project<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Project { rows: Rows { stride, values, .. }, f, sums } = self;
        for (rows, f) in values.chunks_exact(ABREAST * stride).zip(f.as_chunks::<ABREAST>().0) {
            for (run, sums) in sums.as_chunks_mut::<RUN>().0.iter_mut().enumerate() {
                for (row, f) in f.iter().enumerate() {
                    let e = &rows[row * stride + run * RUN..row * stride + (run + 1) * RUN];
                    for k in 0..RUN {
                        sums[k] = f.times_plus::<BITS>(f64::from(e[k]), sums[k]);
                    }
                }
            }
        }
    }
}

/// `K E`, added to what is there: a run of modes after the other, so that what a node needs stays in registers.
struct Stress<'a> {
    tangent: &'a SymmetricBlocks,
    /// Row and column of each block.
    pairs: &'a [(u32, u32)],
    modes: &'a Rows,
    out: &'a mut [f32],
}

/// Three rows of a node, along a run of modes.
type Node = [[f32; RUN]; ABREAST];

impl WideKernel for Stress<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Stress { tangent, pairs, modes: Rows { stride, values, .. }, out } = self;
        let blocks = tangent.values().as_chunks::<9>().0;
        for run in (0..*stride).step_by(RUN) {
            let place = |node: u32, row: usize| (ABREAST * node as usize + row) * stride + run;
            // Of the column, from the blocks above its diagonal, which comes last.
            let mut below: Node = [[0.0; RUN]; ABREAST];
            for (&(row, column), block) in pairs.iter().zip(blocks) {
                let block = block.map(|x| x as f32);
                let mut sum = load(out, |k| place(row, k));
                add_product::<BITS>(&block, &load(values, |k| place(column, k)), &mut sum);
                if row == column {
                    add(&below, &mut sum);
                    below = [[0.0; RUN]; ABREAST];
                } else {
                    let [a, b, c, d, e, f, g, h, i] = block;
                    let transposed = [a, d, g, b, e, h, c, f, i];
                    add_product::<BITS>(&transposed, &load(values, |k| place(row, k)), &mut below);
                }
                for (k, sum) in sum.iter().enumerate() {
                    out[place(row, k)..place(row, k) + RUN].copy_from_slice(sum);
                }
            }
        }
    }
}

#[inline(always)]
fn load(values: &[f32], place: impl Fn(usize) -> usize) -> Node {
    let mut node = [[0.0; RUN]; ABREAST];
    for (k, row) in node.iter_mut().enumerate() {
        row.copy_from_slice(&values[place(k)..place(k) + RUN]);
    }
    node
}

#[inline(always)]
fn add(node: &Node, sum: &mut Node) {
    for (sum, row) in sum.iter_mut().zip(node) {
        for k in 0..RUN {
            sum[k] += row[k];
        }
    }
}

/// Adds a block times the rows of a node.
#[inline(always)]
fn add_product<const BITS: usize>(block: &[f32; 9], e: &Node, sum: &mut Node) {
    for (i, sum) in sum.iter_mut().enumerate() {
        for (j, e) in e.iter().enumerate() {
            for k in 0..RUN {
                sum[k] = block[3 * i + j].times_plus::<BITS>(e[k], sum[k]);
            }
        }
    }
}

/// `out[k r + l] = sum_i E_ik (K E)_il` for [`MODES`] modes `k` from `first` on and the `l` up to them; what is beyond
/// the diagonal has no meaning. A general kernel would take memory in every tick.
struct Products<'a> {
    modes: &'a Rows,
    stresses: &'a [f32],
    first: usize,
    out: &'a mut [f32],
}

impl WideKernel for Products<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Products { modes: Rows { r, stride, values, .. }, stresses, first, out } = self;
        out.fill(0.0);
        let (last, chunk) = (first + out.len() / r, CACHED * stride);
        for (values, stresses) in values.chunks(chunk).zip(stresses.chunks(chunk)) {
            for k in (first..last).step_by(PAIRED) {
                for l in (0..last.min(k + PAIRED)).step_by(RUN) {
                    let sums = products::<BITS>(values, stresses, *stride, [k, l]);
                    for (k, sums) in (k - first..last - first).zip(sums) {
                        let out = &mut out[k * r + l..(k * r + l + RUN).min((k + 1) * r)];
                        out.iter_mut().zip(sums).for_each(|(out, sum)| *out += sum);
                    }
                }
            }
        }
    }
}

/// Modes whose products with a run of others stay in registers.
const PAIRED: usize = 4;

/// The products of modes from `k` on with those from `l` on, over some rows.
#[inline(always)]
fn products<const BITS: usize>(
    values: &[f32],
    stresses: &[f32],
    stride: usize,
    [k, l]: [usize; 2],
) -> [[f32; RUN]; PAIRED] {
    let mut sums = [[0.0; RUN]; PAIRED];
    for (e, s) in values.chunks_exact(stride).zip(stresses.chunks_exact(stride)) {
        let (e, s) = (&e[k..k + PAIRED], &s[l..l + RUN]);
        each!(PAIRED, |i| {
            for j in 0..RUN {
                sums[i][j] = e[i].times_plus::<BITS>(s[j], sums[i][j]);
            }
        });
    }
    sums
}
