//! Starts of a search that does not continue from the last one: the superposed series, or a known equilibrium.

use super::factor::ReducedFactor;
use super::forces::State;
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
}

impl Starts {
    /// From `known` equilibria of orthonormal modes with these means.
    pub fn new(known: &[State], constraints: &[Vec<f64>], r: usize) -> Self {
        let known = known.iter().map(|State { q, .. }| {
            let d = constraints.iter().map(|row| dot(row, q)).collect();
            Known { q: q.clone(), d }
        });
        Starts { known: known.collect(), in_origin: ReducedFactor::in_origin(constraints, r) }
    }

    /// The `guess` and the known equilibria nearest to `d`, moved by the tangent in the origin to where the means are `d`.
    pub fn at(&self, d: &[f64], guess: Vec<f64>, constraints: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let gap = |known: &Known| known.d.iter().zip(d).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let mut nearest: Vec<(f64, &Known)> = self.known.iter().map(|k| (gap(k), k)).collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
        let known = nearest.into_iter().take(NEAREST).map(|(_, known)| known.q.clone());
        std::iter::once(guess).chain(known).map(|q| self.moved(q, d, constraints)).collect()
    }

    fn moved(&self, mut q: Vec<f64>, d: &[f64], constraints: &[Vec<f64>]) -> Vec<f64> {
        let constraint_residual: Vec<f64> =
            d.iter().zip(constraints).map(|(d, row)| d - dot(row, &q)).collect();
        let (mut step, mut forces) = (vec![0.0; q.len()], vec![0.0; d.len()]);
        self.in_origin.step(
            &vec![0.0; q.len()],
            &constraint_residual,
            constraints,
            &mut step,
            &mut forces,
        );
        q.iter_mut().zip(step).for_each(|(q, s)| *q += s);
        q
    }
}
