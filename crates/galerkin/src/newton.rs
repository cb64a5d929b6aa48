//! The reduced equilibrium: minimise W(q) under A q = d.
//!
//! With the tangent K at an earlier iterate and f = dW/dq, a step is
//!   [K -A^T; A 0] [dq; F] = [-f; d - A q],
//! with the contact forces F. The tangent is renewed when steps shrink too slowly. Until then Broyden's update improves
//! it, so most iterations cost only a force.

use super::broyden::BroydenUpdates;
use super::factor::ReducedFactor;
use super::forces::TrainingState;
use super::reduced_energy::Reduced;
use super::sampled::Sampled;
use super::starts::Starts;
use crate::clock::Instant;
use crate::equilibrium::{Iteration, Limits, Stop, backtrack, iterate};
use crate::number::{dot, norm};
use std::time::Duration;

/// The search ends when a step is below this part of the coordinates, a hundredth of the error by modes and cells.
const TOLERANCE: f64 = 1e-4;
/// Coordinates with a norm below this part of the typical one count as if they had it.
const SMALLEST: f64 = 1e-6;
/// Steps that shrink by less than this ask for a new tangent.
const SLOW: f64 = 0.5;
const MAX_STEPS: usize = 41;
/// Halvings of a step, and of the share of a guess.
const HALVINGS: usize = 10;
/// Constraint residual, relative to what is prescribed, of a step that starts on the constraint.
const FEASIBLE: f64 = 1e-9;

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReducedStatus {
    /// At an equilibrium of the reduced energy.
    Converged,
    /// Every step, however short, inverts a sampled cell or raises the energy.
    StepTooSmall,
    /// The iterations did not suffice.
    TooManyIterations,
    /// The time was over; the next search from the last solution continues.
    OutOfTime,
}

/// How a search for equilibrium went.
#[derive(Default)]
pub(super) struct Search {
    /// Start of the search and its time limit; one step is always taken.
    pub limit: Option<(Instant, Duration)>,
    pub iterations: usize,
    pub tangents: usize,
    /// Last step, relative to the coordinates.
    pub residual: f64,
}

/// Modes on sampled cells, and constraints, with the last iterate.
#[derive(Clone)]
pub(super) struct ReducedNewton {
    pub reduced: Reduced,
    pub q: Vec<f64>,
    sampled: Sampled,
    /// `A`: three rows for each contact.
    constraints: Vec<Vec<f64>>,
    factor: ReducedFactor,
    updates: BroydenUpdates,
    starts: Starts,
    /// Of a load step: its means, and the coordinates of the last that was reached.
    pub step_means: Vec<f64>,
    pub reached: Vec<f64>,
    /// Typical norm of the coordinates.
    unit: f64,
    /// Size of a step, relative to the coordinates, at which the search ends.
    pub tolerance: f64,
    /// How long the last new tangent took.
    renewal: Duration,
    /// Contact forces of the last step, three for each.
    pub forces: Vec<f64>,
    /// The step, the last before it, where it started, and the constraint residual there.
    step: Vec<f64>,
    last: Vec<f64>,
    origin: Vec<f64>,
    constraint_residual: Vec<f64>,
}

impl ReducedNewton {
    /// At rest; `r` modes with these `means`, `known` coordinates of equilibria to start from.
    pub fn new(
        sampled: Sampled,
        r: usize,
        constraints: Vec<Vec<f64>>,
        unit: f64,
        known: &[TrainingState],
    ) -> Self {
        let n = constraints.len();
        let mut solver = ReducedNewton {
            reduced: Reduced::new(r),
            q: vec![0.0; r],
            factor: ReducedFactor::new(r, n),
            updates: BroydenUpdates::new(r),
            starts: Starts::new(known, &constraints, r),
            step_means: vec![0.0; n],
            reached: vec![0.0; r],
            sampled,
            constraints,
            unit,
            tolerance: TOLERANCE,
            renewal: Duration::ZERO,
            forces: vec![0.0; n],
            step: vec![0.0; r],
            last: vec![0.0; r],
            origin: vec![0.0; r],
            constraint_residual: vec![0.0; n],
        };
        solver.evaluate(false);
        solver
    }

    /// Number of sampled cells.
    pub fn n_cells(&self) -> usize {
        self.sampled.n_cells()
    }

    /// Starts from the largest of the tried shares of what `guess` puts, in which no sampled cell is inverted.
    pub fn start(&mut self, mut guess: impl FnMut(f64, &mut [f64])) {
        backtrack(1.0, HALVINGS + 1, |share| {
            guess(share, &mut self.q);
            self.evaluate(false);
            (self.reduced.jacobian > 0.0).then_some(())
        });
        self.factor.forget();
    }

    /// Starts from rest or one of the [`Starts`] for `d`, whichever has the lowest energy without inverted cells; if all
    /// have such cells, from a share of the guess. To displace contacts near each other differently, the superposed series
    /// displaces each by a multiple of that, maybe farther than it converges.
    pub fn start_at(&mut self, d: &[f64], mut guess: impl FnMut(f64, &mut [f64])) {
        let (found, mut lowest) = (self.starts.find(d), f64::INFINITY);
        let mut best = std::mem::take(&mut self.origin);
        for candidate in 0..found + 2 {
            match candidate {
                0 => guess(1.0, &mut self.q),
                1 => self.q.fill(0.0),
                _ => self.starts.put(candidate - 2, &mut self.q),
            }
            self.starts.shift(d, &self.constraints, &mut self.q);
            self.evaluate(false);
            if self.reduced.jacobian > 0.0 && self.reduced.energy < lowest {
                lowest = self.reduced.energy;
                best.copy_from_slice(&self.q);
            }
        }
        if lowest < f64::INFINITY {
            self.start(|_, q| q.copy_from_slice(&best));
        } else {
            self.start(guess);
        }
        self.origin = best;
    }

    /// Energy and force at `q`, and the tangent where asked for.
    pub fn evaluate(&mut self, with_tangent: bool) {
        self.sampled.evaluate(&self.q, with_tangent, &mut self.reduced);
    }

    /// Derivative of the contact forces with respect to `d`, row by row, with a new tangent at `q`.
    pub fn stiffness(&mut self, search: &mut Search, out: &mut Vec<f64>) {
        self.renew(search);
        self.factor.stiffness(out);
    }

    /// Whether threads share the work.
    pub fn share(&mut self, is_shared: bool) {
        self.sampled.share(is_shared);
    }

    /// Iterates from `q`, where the energy was evaluated last, to the equilibrium under `A q = d`, or as far as
    /// possible.
    pub fn solve(&mut self, d: &[f64], search: &mut Search) -> ReducedStatus {
        let limits = Limits { tolerance: self.tolerance, steps: MAX_STEPS, waits: false };
        let size = d.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let (last, is_fresh, step_norm, is_feasible) = (f64::INFINITY, false, 0.0, false);
        let mut run =
            ReducedRun { newton: self, d, size, search, last, is_fresh, step_norm, is_feasible };
        match iterate(&mut run, limits) {
            Ok(Stop::Converged) => ReducedStatus::Converged,
            Ok(Stop::TooManySteps) => ReducedStatus::TooManyIterations,
            Ok(Stop::OutOfTime) => ReducedStatus::OutOfTime,
            Err(status) => status,
        }
    }

    /// The next step, updated by the last one if that was taken whole, and the norm of the constraint residual.
    fn find_step(&mut self, d: &[f64], with_update: bool) -> f64 {
        let ReducedNewton {
            reduced,
            constraint_residual,
            constraints,
            step,
            forces,
            factor,
            updates,
            last,
            q,
            ..
        } = self;
        for ((lacks, row), d) in constraint_residual.iter_mut().zip(constraints.iter()).zip(d) {
            *lacks = d - dot(row, q);
        }
        std::mem::swap(step, last);
        factor.step(&reduced.force, constraint_residual, constraints, step, forces);
        updates.correct(step);
        if with_update {
            updates.update(last, step);
        }
        norm(constraint_residual)
    }

    /// Whether the time is over, or would be with the tangent that is asked for next.
    fn would_be_late(&self, search: &Search) -> bool {
        let ahead = if self.factor.is_ready() { Duration::ZERO } else { self.renewal };
        search.limit.is_some_and(|(since, budget)| since.elapsed() + ahead >= budget)
    }

    fn renew(&mut self, search: &mut Search) {
        let clock = Instant::now();
        self.evaluate(true);
        self.factor.factorize(&self.reduced.tangent, &self.constraints);
        self.updates.forget();
        search.tangents += 1;
        self.renewal = clock.elapsed();
    }

    /// Takes the step, halved until no sampled cell is inverted and, on the constraint, the energy does not rise; none
    /// if that fails.
    fn advance(&mut self, is_feasible: bool) -> Option<f64> {
        let energy = self.reduced.energy;
        // What the constraint residual may still cost.
        let bound = energy + FEASIBLE * energy.abs();
        self.origin.copy_from_slice(&self.q);
        let taken = backtrack(1.0, HALVINGS, |length| {
            for ((q, &from), &along) in self.q.iter_mut().zip(&self.origin).zip(&self.step) {
                *q = from + length * along;
            }
            self.evaluate(false);
            let is_lower = !is_feasible || self.sampled.is_no_higher(self.reduced.energy, bound);
            (self.reduced.jacobian > 0.0 && is_lower).then_some(())
        });
        if taken.is_none() {
            self.q.copy_from_slice(&self.origin);
            self.evaluate(false);
        }
        taken.map(|(length, ())| length)
    }
}

/// A solve in progress: towards `A q = d`, the largest entry of `d` being `size`.
struct ReducedRun<'a> {
    newton: &'a mut ReducedNewton,
    d: &'a [f64],
    size: f64,
    search: &'a mut Search,
    /// Norm of the last step taken with the present tangent, and whether there was none.
    last: f64,
    is_fresh: bool,
    /// Norm of the step that was found, and whether it starts on the constraint.
    step_norm: f64,
    is_feasible: bool,
}

impl Iteration for ReducedRun<'_> {
    type Failure = ReducedStatus;

    /// The next step relative to the coordinates, with a new tangent if steps shrink too slowly.
    fn residual(&mut self) -> Result<f64, ReducedStatus> {
        let ReducedRun { newton, search, .. } = self;
        loop {
            if !newton.factor.is_ready() {
                newton.renew(search);
                (self.last, self.is_fresh) = (f64::INFINITY, true);
            }
            let lacks = newton.find_step(self.d, self.last < f64::INFINITY);
            (self.step_norm, self.is_feasible) =
                (norm(&newton.step), lacks <= FEASIBLE * self.size);
            search.residual = self.step_norm / norm(&newton.q).max(SMALLEST * newton.unit);
            if search.residual <= newton.tolerance || !(self.step_norm > SLOW * self.last) {
                return Ok(search.residual);
            }
            newton.factor.forget();
            if newton.would_be_late(search) {
                return Err(ReducedStatus::OutOfTime);
            }
        }
    }

    fn step(&mut self) -> Result<(), ReducedStatus> {
        let ReducedRun { newton, search, .. } = self;
        search.iterations += 1;
        let Some(length) = newton.advance(self.is_feasible) else {
            newton.factor.forget();
            return if self.is_fresh { Err(ReducedStatus::StepTooSmall) } else { Ok(()) };
        };
        (self.last, self.is_fresh) = (self.step_norm, false);
        if length < 1.0 || newton.factor.is_shifted() {
            newton.factor.forget();
        }
        Ok(())
    }

    fn is_late(&self) -> bool {
        self.newton.would_be_late(self.search)
    }
}
