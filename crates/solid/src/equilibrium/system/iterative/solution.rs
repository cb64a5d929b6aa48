//! One solution by conjugate gradients: where it sets out from, its iterations, and what their end means.

use super::{Border, Inverse, Iterative, Operand, Remote, Solved, Until};
use crate::clock::Instant;
use crate::linear::FactorError;
use crate::linear::conjugate_gradients::{self as cg, Error, Operator, Settings, Solve};
use crate::number::norm;
use crate::threads::among_threads;
use std::time::Duration;

/// Part of a further force that the answer may leave. With a lagged factor that mostly takes one iteration.
const UNANSWERED: f64 = 0.4;

/// Time after which iterations pause, so that who wants the solution is asked.
const UNASKED: Duration = Duration::from_millis(100);

impl Iterative {
    /// The correction that balances the residual without moving the patches.
    pub(super) fn iterate(
        &mut self,
        border: &Border,
        until: Until<'_>,
    ) -> Result<Solved, FactorError> {
        let whole = norm(&self.residual);
        let tolerance = self.settings.tolerance;
        let of_frame = self.forcing.as_mut().map(|forcing| forcing.tolerance(tolerance, whole));
        let tolerance = of_frame.unwrap_or(tolerance);
        // A device sets out by itself, unless means are held.
        let is_remote = matches!(self.remote, Remote::Working(_)) && border.is_empty();
        if is_remote {
            self.correction.fill(0.0);
            self.left.copy_from_slice(&self.residual);
        } else {
            self.set_out(border, tolerance);
        }
        if let Some(solved) = self.iterate_on_device(border, tolerance, until) {
            return Ok(solved);
        }
        if is_remote && self.correction.iter().all(|&x| x == 0.0) {
            self.set_out(border, tolerance);
        }
        self.conjugate(border, tolerance, until)
    }

    /// The step that a further force asks for, from zero; what is kept of the last steps stays as it is. None on a device
    /// that has the matrix to itself. Returns the iterations.
    pub fn respond(
        &mut self,
        border: &Border,
        b: &[f64],
        step: &mut [f64],
        deadline: Option<Instant>,
    ) -> Result<usize, FactorError> {
        step.fill(0.0);
        if self.is_formed() {
            return Ok(0);
        }
        self.residual.copy_from_slice(b);
        border.project(&mut self.residual);
        self.correction.fill(0.0);
        let solved = self.conjugate(border, UNANSWERED, Until::time(deadline))?;
        if solved.indefinite.is_none() {
            step.copy_from_slice(&self.correction);
        }
        Ok(solved.iterations)
    }

    /// Conjugate gradients from the correction that there is.
    fn conjugate(
        &mut self,
        border: &Border,
        tolerance: f64,
        until: Until<'_>,
    ) -> Result<Solved, FactorError> {
        let settings = Settings {
            relative_tolerance: tolerance,
            max_iterations: self.settings.max_iterations,
            least_iterations: self.least_iterations(),
            deadline: until.deadline,
        };
        let n = self.residual.len();
        let Iterative { operand, inverse, correction, residual, workspace, .. } = self;
        let (n_shared, operator) = (operand.n_shared(), Projected { operand, border });
        let mut inverse = Closed { inverse, n, border, forces: Vec::new() };
        let begun = Solve::begin(correction, &operator, &inverse, residual, &settings, workspace);
        let outcome = begun.and_then(|mut solve| {
            loop {
                let pause = Some(Instant::now() + UNASKED);
                let mut go_on = || {
                    solve.iterate(correction, &operator, &mut inverse, residual, workspace, pause)
                };
                // A frame stays on its own thread: one of those that share loops might meanwhile take up all of another
                // solution.
                let has_ended = match self.forcing {
                    Some(_) => go_on()?,
                    None => among_threads(n_shared, go_on)?,
                };
                if has_ended {
                    return Ok(solve.info());
                }
                if !(until.is_wanted)() {
                    return Err(Error::BudgetSpent(solve.info()));
                }
            }
        });
        let solved = self.judge(outcome);
        if solved.is_ok() && self.correction.iter().all(|x| x.is_finite()) {
            return solved;
        }
        self.guess.forget();
        self.is_stale = true;
        Err(FactorError::NotFinite { position: 0 })
    }

    /// Sets the correction to the guess.
    fn set_out(&mut self, border: &Border, tolerance: f64) {
        let is_formed = self.is_formed();
        let Iterative { operand, residual, correction, left, guess, remote, .. } = self;
        left.copy_from_slice(residual);
        guess.start(correction, left, tolerance, |step, product| {
            let remotely = || remote.multiply(border, operand.given(), step);
            let is_finite = |product: &Vec<f64>| product.iter().all(|k| k.is_finite());
            match is_formed.then(remotely).flatten().filter(is_finite) {
                Some(found) => {
                    product.copy_from_slice(&found);
                    border.project(product);
                }
                None => Projected { operand, border }.apply(step, product),
            }
        });
    }

    /// The result of conjugate gradients as a step: after a spent budget or a direction of negative curvature there is
    /// still a descent direction.
    fn judge(&mut self, outcome: Result<cg::Info, Error>) -> Result<Solved, FactorError> {
        let solved = |info: cg::Info, is_complete| Solved {
            iterations: info.iterations,
            residual: info.relative_residual,
            is_complete,
            ..Solved::default()
        };
        match outcome {
            Ok(info) => Ok(solved(info, true)),
            Err(Error::BudgetSpent(info)) => Ok(solved(info, false)),
            // What is left is rounding.
            Err(Error::IndefinitePreconditioner { iterations }) => {
                self.is_stale = true;
                let info = cg::Info { iterations, relative_residual: self.settings.tolerance };
                Ok(solved(info, false))
            }
            Err(Error::IndefiniteOperator { iterations, .. }) => {
                let direction = self.workspace.direction();
                if iterations == 0 {
                    self.correction.copy_from_slice(direction);
                }
                let indefinite = largest(direction);
                Ok(Solved { iterations, residual: 1.0, indefinite, ..Solved::default() })
            }
            Err(_) => Err(FactorError::NotFinite { position: 0 }),
        }
    }
}

/// `P K` with the projector `P` of the patches.
pub(super) struct Projected<'a> {
    pub operand: &'a Operand,
    pub border: &'a Border,
}

impl Operator for Projected<'_> {
    fn n(&self) -> usize {
        self.operand.n()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        self.operand.apply(x, y);
        self.border.project(y);
    }
}

/// A preconditioner whose answers leave the means of the patches alone.
struct Closed<'a> {
    inverse: &'a mut Inverse,
    n: usize,
    border: &'a Border,
    forces: Vec<f64>,
}

impl cg::Preconditioner for Closed<'_> {
    fn n(&self) -> usize {
        self.n
    }

    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        self.inverse.apply(r, z);
        self.border.close(z, &self.border.zeros(), &mut self.forces);
    }
}

/// The degree of freedom that moves most.
pub(super) fn largest(direction: &[f64]) -> Option<usize> {
    (0..direction.len()).max_by(|&a, &b| direction[a].abs().total_cmp(&direction[b].abs()))
}
