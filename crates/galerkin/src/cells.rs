//! Sampled linear cells: energy, force and tangent in the coordinates of the modes, the loops of the on-line solver.

use super::origin::Origin;
use super::panels::{BATCHES, Panel, Work, curvature_place, place};
use super::reduced_energy::{Reduced, Wanted};
use super::weighted_cells::{Batch, EDGES, WeightedCells};
use crate::law::{LawKernels, Shared, TangentBlocks};
use crate::number::{LANES, Lane};
use crate::simd::{Kernel, dispatch_solver};
use crate::tensor::{Mat3, cofactor, determinant, mul_vector};
use crate::unroll::tabulate;
use rayon::prelude::*;
use std::slice::{from_mut, from_ref};

/// Linear cells with weights, and the modes on them, in panels.
#[derive(Clone)]
pub(super) struct SampledCells {
    sample: WeightedCells,
    panels: Vec<Panel>,
    works: Vec<Work>,
}

impl SampledCells {
    /// Some cells of a body with their weights; each of the `modes` holds all degrees of freedom.
    pub fn new(origin: &Origin, cells: &[usize], weights: &[f64], modes: &[Vec<f64>]) -> Self {
        let body = &origin.body;
        let mut sample = WeightedCells::new(body.points(), body.cells(), body.material(), cells);
        sample.set_weights(weights);
        let panels = Panel::all(&sample, &origin.displacement, modes);
        SampledCells { sample, works: panels.iter().map(Panel::work).collect(), panels }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.sample.len()
    }

    /// Energy and force at `q`, and the tangent where asked for.
    pub fn evaluate(&mut self, q: &[f64], wanted: Wanted, reduced: &mut Reduced) {
        let SampledCells { sample, panels, works } = self;
        let with_tangent = wanted != Wanted::Force;
        let evaluate = |((panel, batches), work): ((&Panel, &[Batch]), &mut Work)| {
            panel.combine(q, work);
            let (energy, jacobian) = dispatch_solver(PanelEvaluation {
                law: sample.material.law(),
                batches,
                work,
                with_tangent,
            });
            (work.energy, work.jacobian) = (energy, jacobian);
            panel.project(work);
            if with_tangent {
                panel.curve(work);
            }
        };
        let is_shared = wanted == Wanted::SharedTangent && panels.len() > 1;
        if is_shared && rayon::current_num_threads() > 1 {
            let panels = panels.par_iter().zip(sample.batches.par_chunks(BATCHES));
            panels.zip(works).for_each(evaluate);
        } else {
            let panels = panels.iter().zip(sample.batches.chunks(BATCHES));
            panels.zip(works).for_each(evaluate);
        }
        self.add(with_tangent, reduced);
    }

    /// The sum over all panels, always in the same order.
    fn add(&self, with_tangent: bool, reduced: &mut Reduced) {
        let Reduced { force, tangent, .. } = reduced;
        force.fill(0.0);
        for work in &self.works {
            force.iter_mut().zip(&work.force).for_each(|(f, part)| *f += part);
        }
        if with_tangent {
            tangent.fill(0.0);
            for work in &self.works {
                tangent.iter_mut().zip(&work.tangent).for_each(|(k, &part)| *k += f64::from(part));
            }
            reduced.mirror();
        }
        let works = self.works.iter();
        reduced.jacobian =
            works.clone().fold(f64::INFINITY, |least, work| least.min(work.jacobian));
        reduced.energy = works.map(|work| work.energy).sum();
    }

    /// The force of each cell along each mode at `q`: runs of all modes, cell by cell.
    pub fn forces(&mut self, q: &[f64]) -> Vec<f64> {
        let (r, SampledCells { sample, panels, works }) = (q.len(), self);
        let mut forces = vec![0.0; sample.batches.len() * LANES * r];
        let panels = panels.iter().zip(sample.batches.chunks(BATCHES)).zip(works);
        for (((panel, batches), work), out) in panels.zip(forces.chunks_mut(BATCHES * LANES * r)) {
            panel.combine(q, work);
            let law = sample.material.law();
            dispatch_solver(PanelEvaluation { law, batches, work, with_tangent: false });
            panel.each(work, batches.len(), |cell, mode, force| out[cell * r + mode] = force);
        }
        sample.by_cell(&forces, r)
    }
}

/// Evaluates the law of the cells of a panel: from edge displacements to forces on the edges and their derivative. The
/// result is the energy of these cells, infinite if one is outside the domain of its law, and the smallest volume ratio
/// of one with a weight, minus infinity if one is not a number.
struct PanelEvaluation<'a> {
    law: &'a dyn LawKernels,
    batches: &'a [Batch],
    work: &'a mut Work,
    with_tangent: bool,
}

impl Kernel for PanelEvaluation<'_> {
    type Output = (f64, f64);
    #[inline(always)]
    fn run(self) -> (f64, f64) {
        let PanelEvaluation { law, batches, work, with_tangent } = self;
        let (mut f, mut stresses) =
            ([Mat3::<Lane>::default(); BATCHES], [Mat3::<Lane>::default(); BATCHES]);
        let mut psi = [Lane::default(); BATCHES];
        let mut jacobian = f64::INFINITY;
        for (place, (batch, f)) in batches.iter().zip(&mut f).enumerate() {
            *f = deformation(&edges(work, place), &batch.gradients);
            let ratio = determinant(f, &cofactor(f));
            for (&j, &w) in ratio.0.iter().zip(&batch.weight.0) {
                let j = if j.is_nan() { f64::NEG_INFINITY } else { j };
                jacobian = if w > 0.0 { jacobian.min(j) } else { jacobian };
            }
        }
        let mut first = 0;
        for tissue in batches.chunk_by(|a, b| a.parameters == b.parameters) {
            let (row, run) = (&tissue[0].parameters, first..first + tissue.len());
            let (f, stresses) = (&f[run.clone()], &mut stresses[run.clone()]);
            law.stress(row, f, Shared::default(), &mut psi[run.clone()], stresses);
            first = run.end;
        }
        let mut energy = 0.0;
        for (place, batch) in batches.iter().enumerate() {
            energy += (psi[place] * batch.weight).0.iter().sum::<f64>();
            put_flux(work, place, &stresses[place], batch);
            if with_tangent {
                let (g, mut blocks) = (&batch.gradients, [TangentBlocks::<Lane>::default()]);
                let (f, stress) = (from_ref(&f[place]), from_mut(&mut stresses[place]));
                let row = &batch.parameters;
                law.tangent(row, f, from_ref(g), Shared::default(), stress, &mut blocks);
                put_curvature(work, place, &blocks[0], batch.weight);
            }
        }
        let is_outside = law.forbids_inversion() && !(jacobian > 0.0);
        (if is_outside { f64::INFINITY } else { energy }, jacobian)
    }
}

/// `y` of a batch.
#[inline(always)]
fn edges(work: &Work, batch: usize) -> [Lane; EDGES] {
    let mut y = [Lane::default(); EDGES];
    for (edge, y) in y.iter_mut().enumerate() {
        let at = place(batch, edge);
        y.0.copy_from_slice(&work.edges[at..at + LANES]);
    }
    y
}

/// `F = I + sum_a y_a (x) g_a`.
#[inline(always)]
fn deformation(y: &[Lane; EDGES], g: &[[Lane; 3]; 3]) -> Mat3<Lane> {
    tabulate!(|i, j| {
        let sum = y[i] * g[0][j] + y[3 + i] * g[1][j] + y[6 + i] * g[2][j];
        if i == j { sum + 1.0 } else { sum }
    })
}

/// `w V P g_a`, the force on the edges.
#[inline(always)]
fn put_flux(
    work: &mut Work,
    batch: usize,
    stress: &Mat3<Lane>,
    Batch { gradients, weight, .. }: &Batch,
) {
    for a in 0..3 {
        let force = mul_vector(stress, &gradients[a]);
        for i in 0..3 {
            let at = place(batch, 3 * a + i);
            work.flux[at..at + LANES].copy_from_slice(&(force[i] * *weight).0);
        }
    }
}

/// The weighted blocks of the law, all edges against all.
#[inline(always)]
fn put_curvature(work: &mut Work, batch: usize, blocks: &TangentBlocks<Lane>, weight: Lane) {
    for c in 0..EDGES {
        for d in 0..EDGES {
            let ((a, i), (b, j)) = ((c / 3, c % 3), (d / 3, d % 3));
            let entry = (if a <= b { blocks[a][b][i][j] } else { blocks[b][a][j][i] }) * weight;
            let at = curvature_place(batch, c, d);
            for (out, x) in work.curvature[at..at + LANES].iter_mut().zip(entry.0) {
                *out = x as f32;
            }
        }
    }
}
