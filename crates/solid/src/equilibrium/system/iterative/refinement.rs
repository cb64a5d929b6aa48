//! Conjugate gradients on a device, in single precision, and their refinement in double (Higham 2002, section 12).

use super::solution::{Projected, largest};
use super::{Border, Iterative, Remote, Solved, Until};
use crate::equilibrium::system::device::DeviceEnd;
use crate::linear::conjugate_gradients::Operator;
use crate::number::{dot, norm};

/// Tolerance of one solution in single precision, relative to its right-hand side.
const SINGLE: f64 = 1e-5;

/// Factor by which a residual may exceed the tolerance if it had reached it in single precision.
const SLACK: f64 = 1.02;

/// Largest relative error of a number in single precision.
const UNIT: f64 = 0.5 * f32::EPSILON as f64;

/// Part of the tolerance that rounding to single precision may leave where a residual in single precision is believed.
const TRUSTED: f64 = 0.1;

/// Refinement continues only if a solution in single precision reduces the residual at least by this factor.
const PROGRESS: f64 = 0.5;

/// Whether a step leads anywhere.
fn is_any(step: &&[f64]) -> bool {
    step.iter().any(|&x| x != 0.0)
}

impl Iterative {
    /// The correction that balances the residual, from the guess. What is left is formed in double precision, and solved
    /// for again until it is small enough. Where the device forms the tangent, its own residual is believed unless
    /// rounding comes near the tolerance: the residual of Newton's method is in double precision anyway. None if there is
    /// no device, or where it failed on the way: the processor goes on from what there is.
    pub(super) fn iterate_on_device(
        &mut self,
        border: &Border,
        tolerance: f64,
        until: Until<'_>,
    ) -> Option<Solved> {
        if !matches!(self.remote, Remote::Working(_)) {
            return None;
        }
        let mut left = std::mem::take(&mut self.left);
        let solved = self.refine(border, tolerance, until, &mut left);
        self.left = left;
        solved
    }

    fn refine(
        &mut self,
        border: &Border,
        tolerance: f64,
        until: Until<'_>,
        left: &mut [f64],
    ) -> Option<Solved> {
        let (whole, mut before) = (norm(&self.residual), f64::INFINITY);
        let mut solved = Solved { residual: norm(left) / whole, ..Solved::default() };
        let mut is_first = true;
        loop {
            solved.is_complete = solved.residual <= SLACK * tolerance;
            let has_stalled = !is_first && !(solved.residual < PROGRESS * before);
            // Even where time is up, a device makes a few iterations: from a guess alone no frame would come to its end.
            let is_late = !is_first && until.is_over();
            let budget = self.settings.max_iterations - solved.iterations;
            if solved.is_complete || has_stalled || is_late || budget == 0 {
                return Some(solved);
            }
            let wanted = tolerance / solved.residual;
            let end = DeviceEnd { tolerance: wanted.max(SINGLE), max_iterations: budget, until };
            let steps: Vec<&[f64]> = match is_first && border.is_empty() {
                true => self.guess.candidates().into_iter().flatten().filter(is_any).collect(),
                false => Vec::new(),
            };
            let vectors = (&*left, &steps[..], self.correction.as_slice());
            let found = self.remote.solve(border, self.operand.given(), vectors, &end)?;
            if !found.x.iter().all(|x| x.is_finite()) {
                return None;
            }
            solved.iterations += found.iterations;
            if found.is_indefinite {
                let direction = self.remote.direction(border, self.operand.given())?;
                if self.has_negative_curvature(border, &direction) {
                    solved.indefinite = largest(&direction);
                    solved.residual = 1.0;
                    if solved.iterations == 0 {
                        self.correction.copy_from_slice(&direction);
                    } else {
                        self.correction.iter_mut().zip(&found.x).for_each(|(c, x)| *c += x);
                    }
                    return Some(solved);
                }
            }
            is_first = false;
            self.correction.iter_mut().zip(&found.x).for_each(|(c, x)| *c += x);
            solved.floor = UNIT * found.magnitude / whole;
            before = solved.residual;
            let expected = before * found.residual;
            let is_believed = self.is_formed()
                && solved.floor <= TRUSTED * tolerance
                && expected <= SLACK * tolerance;
            solved.residual = if is_believed { expected } else { self.remainder(border, left) };
        }
    }

    /// The residual after the correction, and its size relative to the one before.
    fn remainder(&self, border: &Border, left: &mut [f64]) -> f64 {
        Projected { operand: &self.operand, border }.apply(&self.correction, left);
        left.iter_mut().zip(&self.residual).for_each(|(k, r)| *k = r - *k);
        norm(left) / norm(&self.residual)
    }

    /// Whether curvature is negative in double precision, too.
    fn has_negative_curvature(&self, border: &Border, direction: &[f64]) -> bool {
        let mut product = vec![0.0; direction.len()];
        Projected { operand: &self.operand, border }.apply(direction, &mut product);
        dot(direction, &product) <= 0.0
    }
}
