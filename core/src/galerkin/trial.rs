//! Trials: displacements of a grasp that are solved when it takes hold, and what the whole body says of the answers.
//!
//! With the full internal force `f(u)` of an answer and its contact forces `A^T F`, the step
//!   z = -K^-1 (f(u) - A^T F),     moved so that the means of the patches stay,
//! K the tangent at rest, is nearly what is missing: `|z| / |u|` is the error that is told.

use super::grasp::Grasp;
use super::nnls::norm;
use super::solver::{Search, Status};
use super::training::spread;
use crate::equilibrium::patch_mean;

/// Trials at each depth.
const TRIALS: usize = 4;
/// Where the sequence of their directions starts: those before are for training.
const FIRST: usize = 1000;

/// Worst errors of the field, relative to its norm, at most 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// All contacts displaced by half the depth of training.
    pub half_depth: f64,
    /// By the whole.
    pub depth: f64,
}

impl Errors {
    /// Before anything is measured.
    pub(super) const NONE: Errors = Errors { half_depth: 1.0, depth: 1.0 };

    /// Measures those of a grasp.
    pub(super) fn measure(grasp: &mut Grasp) -> Self {
        let depth = grasp.galerkin().sampling.depth;
        let mut worst = |depth: f64| {
            let of_trial = |trial| {
                let d = displacements(grasp.contacts().len(), trial, depth);
                error(grasp, &d)
            };
            (0..TRIALS).map(of_trial).fold(0.0, f64::max)
        };
        Errors { half_depth: worst(0.5 * depth), depth: worst(depth) }
    }

    /// Error expected where the largest displacement is a share of the depth; none at rest.
    pub(super) fn at(&self, share: f64) -> f64 {
        let slope = 2.0 * (self.depth - self.half_depth);
        let expected = (self.half_depth + slope * (share - 0.5).max(0.0)).clamp(0.0, 1.0);
        if share > 0.0 { expected } else { 0.0 }
    }
}

fn displacements(contacts: usize, trial: usize, depth: f64) -> Vec<f64> {
    let of_contact = |contact: usize| {
        let d = spread(FIRST + contacts * trial + contact);
        d.map(|x| depth * x / norm(&d))
    };
    (0..contacts).flat_map(of_contact).collect()
}

fn error(grasp: &mut Grasp, d: &[f64]) -> f64 {
    let mut search = Search::default();
    if grasp.find(d, &mut search) != Status::Converged {
        return 1.0;
    }
    let u = grasp.displacement(grasp.coordinates());
    match missing(grasp, &u, &grasp.solver().forces) {
        Some(z) => (norm(&z) / norm(&u)).min(1.0),
        None => 1.0,
    }
}

/// The step `z`; none where it is not finite.
fn missing(grasp: &Grasp, u: &[f64], forces: &[f64]) -> Option<Vec<f64>> {
    let rest = &grasp.galerkin().rest;
    let mut residual = vec![0.0; u.len()];
    rest.body.internal_force(u, &mut residual);
    let patches = grasp.patches();
    for (patch, force) in patches.iter().zip(forces.chunks_exact(3)) {
        for (&node, w) in patch.nodes.iter().zip(&patch.weights) {
            (0..3).for_each(|i| residual[3 * node as usize + i] -= w * force[i]);
        }
    }
    let free = rest.system.free();
    let mut step: Vec<f64> = free.iter().map(|&dof| -residual[dof as usize]).collect();
    rest.system.solve_free(&mut step, 1).ok()?;
    let mut z = vec![0.0; u.len()];
    free.iter().zip(step).for_each(|(&dof, x)| z[dof as usize] = x);
    let moved: Vec<f64> = patches.iter().flat_map(|patch| patch_mean(patch, &z)).collect();
    let back = grasp.subspace().first_order(&moved);
    z.iter_mut().zip(grasp.displacement(&back)).for_each(|(z, x)| *z -= x);
    Some(z)
}
