//! Newton's method with an energy line search and adaptive load steps.
//!
//! A load step leads from an equilibrium to the target along a straight homotopy: the out-of-
//! balance force of the start fades as `1 - load`, pressure and prescribed values grow linearly. Where the
//! linear step that begins it would stretch the body out of proportion, the series of the path takes its place and
//! says how far the load step goes. A step that fails is halved from the last equilibrium. A tangent that is
//! indefinite, also under what tools hold, is shifted until it yields a descent direction, and said so.
//!
//! Where the linear solver is chosen automatically, conjugate gradients only do what they do well. They have a budget, the
//! stability that they find is probed, and whatever fails with them is done again by a factor.

mod listener;
mod load_step;
mod run;
mod step;
#[cfg(test)]
mod tests;

use super::ending::Cut;
use super::outcome::Equilibrium;
use super::problem::Problem;
use super::system::{Choice, Method};
use crate::clock::Instant;
use crate::contact::Contact;
use crate::error::Error;
use crate::settings::{self, Setting, Values};
use run::Run;

/// Settings.
#[derive(Clone, Copy, Debug)]
pub struct Newton {
    /// Residual on the free degrees of freedom, relative to the norm of all nodal forces.
    pub tolerance: f64,
    /// Iterations in one load step before it is cut, unless its residual is about to vanish.
    pub max_iterations: usize,
    /// Halvings of a Newton step in the line search.
    pub max_backtracks: usize,
    /// Initial number of load steps.
    pub steps: usize,
    /// Smallest load step before the solver gives up.
    pub smallest_step: f64,
    /// How the linear systems are solved.
    pub method: Method,
}

impl Default for Newton {
    fn default() -> Self {
        Newton {
            tolerance: 1e-9,
            max_iterations: 30,
            max_backtracks: 12,
            steps: 1,
            smallest_step: 1.0 / 1024.0,
            method: Method::default(),
        }
    }
}

impl Newton {
    /// The settings that users may choose.
    pub const SETTINGS: [Setting<Self>; 4] = [
        Setting {
            name: "tolerance",
            means: "residual, relative to the norm of all nodal forces",
            values: Values::Fraction,
            get: |newton| newton.tolerance,
            set: |newton, value| newton.tolerance = value,
        },
        Setting {
            name: "max_iterations",
            means: "iterations in one load step before it is halved",
            values: Values::Whole(1, 10_000),
            get: |newton| newton.max_iterations as f64,
            set: |newton, value| newton.max_iterations = value as usize,
        },
        Setting {
            name: "max_backtracks",
            means: "halvings of a step in the line search",
            values: Values::Whole(0, 1_000),
            get: |newton| newton.max_backtracks as f64,
            set: |newton, value| newton.max_backtracks = value as usize,
        },
        Setting {
            name: "smallest_step",
            means: "smallest fraction of the load before the solver gives up",
            values: Values::Part,
            get: |newton| newton.smallest_step,
            set: |newton, value| newton.smallest_step = value,
        },
    ];

    /// Solves a load case; in every iteration, while a device iterates and at the end of a load step `progress` receives the load fraction
    /// reached, and may return false to stop.
    ///
    /// # Errors
    /// Bad input ([`Problem::check`]), bad settings, no solver for surfaces that come to touch, or a stop on request.
    /// Failure to converge is a status, not an error.
    pub fn solve(
        &self,
        problem: &Problem,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Equilibrium, Error> {
        self.solve_in_contact(problem, &mut Contact::new(problem.body), progress)
    }

    /// As [`solve`](Self::solve) with rigid tools, which move in proportion to the load; their final state is in
    /// `contact`.
    ///
    /// # Errors
    /// Those of [`solve`](Self::solve).
    pub fn solve_in_contact(
        &self,
        problem: &Problem,
        contact: &mut Contact,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Equilibrium, Error> {
        self.check()?;
        problem.check()?;
        let choice = Choice::of(self.method, problem.body, !contact.is_empty());
        self.solve_by(choice, problem, contact, progress)
    }

    fn solve_by(
        &self,
        choice: Choice,
        problem: &Problem,
        contact: &mut Contact,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Equilibrium, Error> {
        let clock = Instant::now();
        let mut run = Run::new(*self, choice, problem, contact, progress)?;
        run.seconds.analysis = clock.elapsed().as_secs_f64();
        let (mut step, mut last_cut) = (1.0 / self.steps.max(1) as f64, None);
        while run.load < 1.0 {
            let target = if run.load + 1.001 * step >= 1.0 { 1.0 } else { run.load + step };
            match run.advance(run.reaches(target)) {
                Ok(iterations) => {
                    if iterations <= 6 {
                        step = (2.0 * step).min(1.0 / self.steps.max(1) as f64);
                    }
                    run.go_on().map_err(|_| Error::Cancelled)?;
                }
                Err(Cut::Cancelled) => return Err(Error::Cancelled),
                Err(Cut::Solver(error)) => return Err(error),
                Err(cut) if run.suspects_device(&cut) => run.leave_device(&cut)?,
                Err(cut) if run.needs_factor(&cut) => run.hand_over().map_err(Error::Factor)?,
                Err(cut) => {
                    step = 0.5 * step.min(run.tried);
                    run.follows_series = true;
                    last_cut = Some(cut);
                    if step < self.smallest_step {
                        if run.budget.is_none() {
                            break;
                        }
                        run.hand_over().map_err(Error::Factor)?;
                        step = 1.0 / self.steps.max(1) as f64;
                    }
                }
            }
        }
        run.seconds.total = clock.elapsed().as_secs_f64();
        Ok(run.finish(last_cut, step))
    }

    fn check(&self) -> Result<(), Error> {
        settings::check(&Self::SETTINGS, self, "Newton's method")?;
        self.method.check()
    }
}
