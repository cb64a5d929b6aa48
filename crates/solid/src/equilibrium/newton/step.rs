//! One step of Newton's method: factor of the tangent, step, line search.

use super::listener::while_wanted;
use super::run::Run;
use crate::clock::Instant;
use crate::equilibrium::domain::NoEnergy;
use crate::equilibrium::ending::Cut;
use crate::equilibrium::iteration::backtrack;
use crate::equilibrium::problem::patch_mean;
use crate::equilibrium::skew;
use crate::equilibrium::system::Until;
use crate::linear::{FactorError, next_shift};

/// Ratio of the energy of a linear step to that predicted by its tangent, above which the step is not used.
const STRETCHED: f64 = 10.0;

/// First shift of a tangent that is not positive definite, over its mean diagonal, if the last tangent needed none.
const FIRST_SHIFT: f64 = 1e-6;

/// The same where conjugate gradients have met negative curvature, so that each further shift costs them a solve.
const FIRST_LIFT: f64 = 1e-2;

/// Further halvings of a step of a body that falls: anywhere on its way it comes down on what stops it, and it is to go no
/// deeper there than a millionth of its size.
const LANDING: usize = 24;

/// Part of the descent that the slope promises which a step must keep (Armijo).
const ARMIJO: f64 = 1e-4;

impl Run<'_> {
    /// Factorises the tangent, shifted where it is not positive definite under what tools hold; returns the degree of
    /// freedom of the first pivot that was not.
    pub(super) fn factorize(&mut self) -> Result<Option<usize>, Cut> {
        let clock = Instant::now();
        let first = (0.1 * self.shift).max(FIRST_SHIFT);
        let (mut shift, mut unstable) = (0.0, None);
        loop {
            self.factorizations += 1;
            let Err(error) = self.solver.prepare(&self.tangent, shift) else { break };
            let (FactorError::NotPositiveDefinite { row } | FactorError::Singular { row }) = error
            else {
                return Err(Cut::Factor(error));
            };
            if self.is_doubtful() {
                return Err(Cut::Doubtful);
            }
            unstable = unstable.or(Some(row));
            shift = next_shift(shift, first).ok_or(Cut::Factor(error))?;
        }
        self.shift = shift;
        self.seconds.factorization += clock.elapsed().as_secs_f64();
        Ok(unstable)
    }

    /// Degree of freedom in which the last tangent is not positive definite under what tools hold.
    pub(super) fn find_instability(&mut self) -> Result<Option<usize>, Cut> {
        let clock = Instant::now();
        self.factorizations += 1;
        let Run { progress, load, solver, tangent, .. } = self;
        let find = |until: Until<'_>| solver.find_instability(tangent, until);
        let found = while_wanted(&mut **progress, *load, find);
        self.seconds.factorization += clock.elapsed().as_secs_f64();
        found?.map_err(Cut::Factor)
    }

    /// Shifts the tangent further, after conjugate gradients met a direction of negative curvature; `last` is the shift of
    /// the tangent before.
    pub(super) fn lift(&mut self, last: f64) -> Result<(), Cut> {
        let clock = Instant::now();
        let first = (0.1 * last).max(FIRST_LIFT);
        loop {
            self.shift = next_shift(self.shift, first).ok_or(Cut::Doubtful)?;
            self.factorizations += 1;
            match self.solver.prepare(&self.tangent, self.shift) {
                Ok(()) => break,
                Err(FactorError::NotPositiveDefinite { .. }) => {}
                Err(_) => return Err(Cut::Doubtful),
            }
        }
        self.seconds.factorization += clock.elapsed().as_secs_f64();
        Ok(())
    }

    /// The full-length step, which in the first iteration of a load step also moves what is prescribed; the change of
    /// the patch forces; a degree of freedom of a direction of negative curvature, where one was met.
    #[allow(clippy::type_complexity)]
    pub(super) fn newton_step(
        &mut self,
        u: &[f64],
        residual: &[f64],
        load: f64,
        moving: bool,
    ) -> Result<(Vec<f64>, Vec<f64>, Option<usize>), Cut> {
        let mut step = vec![0.0; u.len()];
        let mut rhs: Vec<f64> = residual.iter().map(|r| -r).collect();
        if moving {
            for &(dof, value) in &self.problem.prescribed {
                let dof = dof as usize;
                step[dof] = self.start[dof] + load * (value - self.start[dof]) - u[dof];
            }
            let mut force = vec![0.0; u.len()];
            self.tangent.multiply(&step, &mut force);
            rhs.iter_mut().zip(&force).for_each(|(b, f)| *b -= f);
        }
        let constraint_residual: Vec<f64> = self
            .problem
            .patches
            .iter()
            .zip(&self.start_means)
            .flat_map(|(patch, start)| {
                let now = patch_mean(&patch.patch, u);
                let held = patch_mean(&patch.patch, &step);
                std::array::from_fn::<f64, 3, _>(|i| {
                    start[i] + load * (patch.displacement[i] - start[i]) - now[i] - held[i]
                })
            })
            .collect();
        let (mut free, mut change) = (vec![0.0; u.len()], Vec::new());
        let (problem, solver) = (self.problem, &mut self.solver);
        let find = |until: Until<'_>| {
            if problem.pressure.is_empty() {
                let (b, c) = (&mut rhs, &constraint_residual);
                return solver.solve_until(b, c, &mut free, &mut change, until);
            }
            let skew = |x: &[f64]| {
                let mut force = vec![0.0; u.len()];
                problem.pressure.add_skew(problem.body, u, load, x, &mut force);
                force
            };
            // What is prescribed pulls through the skew part too.
            rhs.iter_mut().zip(skew(&step)).for_each(|(b, s)| *b -= s);
            skew::solve(solver, skew, &mut rhs, &constraint_residual, &mut free, &mut change, until)
        };
        let solved = while_wanted(&mut *self.progress, self.load, find)?.map_err(Cut::Factor)?;
        self.linear_iterations += solved.iterations;
        self.spent += solved.iterations;
        self.unfinished += usize::from(!solved.is_complete && solved.indefinite.is_none());
        if let Some(budget) = self.budget {
            if solved.indefinite.is_some() && !self.follows_negative_curvature() {
                return Err(Cut::Doubtful);
            }
            if !solved.is_complete && solved.indefinite.is_none() || self.spent > budget {
                return Err(Cut::Spent);
            }
        }
        step.iter_mut().zip(&free).for_each(|(s, f)| *s += f);
        Ok((step, change, solved.indefinite))
    }

    /// Whether the energy of a linear step is about that predicted by its tangent, and no cell is inverted; `product` is the
    /// tangent times the step.
    pub(super) fn is_in_proportion(
        &self,
        u: &[f64],
        step: &[f64],
        force: &[f64],
        product: &[f64],
    ) -> bool {
        let trial: Vec<f64> = u.iter().zip(step).map(|(u, s)| u + s).collect();
        let dot = |a: &[f64]| a.iter().zip(step).map(|(a, s)| a * s).sum::<f64>();
        let taken = self.body().energy(&trial) - self.body().energy(u) - dot(force);
        let bound = STRETCHED * 0.5 * dot(product).abs();
        self.rounding.is_no_higher(taken, bound, 0.0)
    }

    /// Refuses a part of a step at whose end the body has no energy.
    pub(super) fn check_energy(&self, u: &[f64], step: &[f64], part: f64) -> Result<(), Cut> {
        let trial: Vec<f64> = u.iter().zip(step).map(|(u, s)| u + part * s).collect();
        if self.body().energy(&trial).is_finite() {
            return Ok(());
        }
        Err(Cut::NoEnergy(NoEnergy::of(self.body(), &trial)))
    }

    /// Backtracks until the total potential falls (Armijo); it is infinite where a cell inverts, and no number where the law
    /// of one has no energy.
    pub(super) fn line_search(
        &self,
        u: &[f64],
        step: &[f64],
        load: f64,
        residual: &[f64],
        norm: f64,
        is_fall: bool,
    ) -> Result<f64, Cut> {
        let (left, pressure) = (1.0 - load, &self.problem.pressure);
        let potential = |length: f64| {
            let trial: Vec<f64> = u.iter().zip(step).map(|(u, s)| u + length * s).collect();
            let dead = self.problem.force.iter().zip(&self.imbalance).map(|(f, r)| f + left * r);
            let dead: f64 = trial.iter().zip(dead).map(|(u, f)| u * f).sum();
            let work = dead + load * pressure.work(self.body(), u, step, length);
            let energy = self.body().energy(&trial) + self.contact.energy(&trial);
            (energy - work, energy.abs() + work.abs())
        };
        let (start, magnitude) = potential(0.0);
        let slope: f64 = residual.iter().zip(step).map(|(r, s)| r * s).sum();
        let descends = |length: f64| {
            let (value, _) = potential(length);
            let bound = start + ARMIJO * length * slope;
            self.rounding.is_no_higher(value, bound, magnitude).then_some(())
        };
        let longest = self.contact.longest(u, step);
        let further = if is_fall { LANDING } else { 0 };
        backtrack(longest, self.settings.max_backtracks + further, descends)
            .map(|(length, ())| length)
            .ok_or(Cut::NoDescent { residual: norm })
    }
}
