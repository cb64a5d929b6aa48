//! Starts of a search that does not continue from the last one: the superposed series, or a known equilibrium.

use super::factor::ReducedFactor;
use super::forces::TrainingState;
use crate::number::dot;

/// Number of nearest known equilibria that a search may start from.
const NEAREST: usize = 3;

/// An equilibrium of the whole body in the span.
#[derive(Clone)]
struct Known {
    q: Vec<f64>,
    /// `A q`.
    d: Vec<f64>,
}

/// Known equilibria, and the factor that moves them to other patch means.
#[derive(Clone)]
pub(super) struct Starts {
    known: Vec<Known>,
    /// The tangent in the origin, in which the modes are orthonormal.
    in_origin: ReducedFactor,
    /// Squared distance and place of each, nearest first.
    order: Vec<(f64, usize)>,
    /// What is missing of the means, a step, no force, and the forces of the contacts.
    missing: Vec<f64>,
    step: Vec<f64>,
    rest: Vec<f64>,
    forces: Vec<f64>,
}

impl Starts {
    /// From `known` equilibria of orthonormal modes with these means.
    pub fn new(known: &[TrainingState], constraints: &[Vec<f64>], r: usize) -> Self {
        let known = known.iter().map(|TrainingState { q, .. }| {
            let d = constraints.iter().map(|row| dot(row, q)).collect();
            Known { q: q.clone(), d }
        });
        let (known, n): (Vec<Known>, usize) = (known.collect(), constraints.len());
        Starts {
            order: vec![(0.0, 0); known.len()],
            known,
            in_origin: ReducedFactor::in_origin(constraints, r),
            missing: vec![0.0; n],
            step: vec![0.0; r],
            rest: vec![0.0; r],
            forces: vec![0.0; n],
        }
    }

    /// Finds the known equilibria nearest to `d`; returns how many.
    pub fn find(&mut self, d: &[f64]) -> usize {
        for ((place, known), found) in self.known.iter().enumerate().zip(&mut self.order) {
            *found = (known.d.iter().zip(d).map(|(a, b)| (a - b).powi(2)).sum(), place);
        }
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.order.len().min(NEAREST)
    }

    /// Copies one of the equilibria that were found.
    pub fn put(&self, found: usize, q: &mut [f64]) {
        q.copy_from_slice(&self.known[self.order[found].1].q);
    }

    /// Moves coordinates by the tangent in the origin to where the means are `d`.
    pub fn shift(&mut self, d: &[f64], constraints: &[Vec<f64>], q: &mut [f64]) {
        let Starts { in_origin, missing, step, rest, forces, .. } = self;
        for ((missing, d), row) in missing.iter_mut().zip(d).zip(constraints) {
            *missing = d - dot(row, q);
        }
        in_origin.step(rest, missing, constraints, step, forces);
        q.iter_mut().zip(&*step).for_each(|(q, s)| *q += s);
    }
}
