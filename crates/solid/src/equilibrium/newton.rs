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

mod load_step;
mod step;
#[cfg(test)]
mod tests;

use super::ending::{Cut, Ending, Slopes};
use super::iteration::Rounding;
use super::outcome::{Equilibrium, Seconds};
use super::predictor::Predictor;
use super::problem::{Problem, patch_mean};
use super::system::{Choice, ConstrainedSystem, Method, waves};
use super::tangent::Tangent;
use crate::body::{Body, Curvature};
use crate::clock::Instant;
use crate::contact::Contact;
use crate::error::Error;
use crate::linear::FactorError;
use crate::settings::{self, Setting, Values};
use std::sync::Arc;

/// Ratio of the energy of a linear step to that predicted by its tangent, above which the step is not used.
const STRETCHED: f64 = 10.0;

/// Residual next to an equilibrium, where a load step began with a linear step: a tangent that is indefinite there is
/// that of an unstable one, which the path passes and Newton's method may leave downhill. Farther off it is common and
/// says nothing; if a slender body was bent by the series of its path, until the residual is next to nothing.
const NEAR: f64 = 0.02;
const AT: f64 = 1e-6;

/// Residual at which conjugate gradients have met whatever negative curvature there is. A force that holds something of all
/// motions cannot be balanced so far without them.
const PROBED: f64 = 1e-4;

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

    /// Solves a load case; in every iteration and at the end of a load step `progress` receives the load fraction
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
        self.solve_by(Choice::of(self.method, problem.body), problem, contact, progress)
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
            match run.advance(target) {
                Ok(iterations) => {
                    if iterations <= 6 {
                        step = (2.0 * step).min(1.0 / self.steps.max(1) as f64);
                    }
                    run.go_on().map_err(|_| Error::Cancelled)?;
                }
                Err(Cut::Cancelled) => return Err(Error::Cancelled),
                Err(Cut::Solver(error)) => return Err(error),
                Err(_) if run.budget.is_some() => run.hand_over().map_err(Error::Factor)?,
                Err(cut) => {
                    step = 0.5 * step.min(run.tried);
                    run.follows_series = true;
                    last_cut = Some(cut);
                    if step < self.smallest_step {
                        break;
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

/// The state of a solution in progress; `u`, `multipliers` and `load` always hold an equilibrium.
struct Run<'a> {
    settings: Newton,
    problem: &'a Problem<'a>,
    contact: &'a mut Contact,
    /// The body with the pattern of the tangent, where that has become wider.
    widened: Option<Arc<Body>>,
    progress: &'a mut dyn FnMut(f64) -> bool,
    solver: ConstrainedSystem,
    tangent: Tangent,
    u: Vec<f64>,
    multipliers: Vec<f64>,
    load: f64,
    start: Vec<f64>,
    start_means: Vec<[f64; 3]>,
    /// Out-of-balance force of the start state on the free degrees of freedom.
    imbalance: Vec<f64>,
    rounding: Rounding,
    iterations: usize,
    residuals: Vec<Vec<f64>>,
    unstable: Option<(f64, usize)>,
    slopes: Slopes,
    /// Shift of the last tangent; the next one is usually similar.
    shift: f64,
    /// Whether a load step has failed, so that the next ones follow the series of the path.
    follows_series: bool,
    /// Part of the load that the load step in progress is to add.
    tried: f64,
    factorizations: usize,
    linear_iterations: usize,
    /// Iterations of conjugate gradients that a load step may take, where they were chosen automatically.
    budget: Option<usize>,
    /// Those that this one has taken.
    spent: usize,
    /// They may shift a tangent that is not positive definite far from equilibrium.
    shifts: bool,
    /// Whether the iterate is close to an equilibrium, whose stability counts.
    is_near: bool,
    solvers: Vec<&'static str>,
    seconds: Seconds,
}

impl<'a> Run<'a> {
    fn new(
        settings: Newton,
        choice: Choice,
        problem: &'a Problem<'a>,
        contact: &'a mut Contact,
        progress: &'a mut dyn FnMut(f64) -> bool,
    ) -> Result<Self, Error> {
        let body = problem.body;
        let settings = Newton { method: choice.method, ..settings };
        let tangent = settings.method.tangent(body);
        let prescribed = problem.prescribed.iter().map(|&(dof, _)| dof);
        let patches = problem.patches.iter().map(|load| load.patch.clone()).collect();
        let solver = ConstrainedSystem::new(settings.method, body, prescribed, patches)?;
        let start = problem.start.clone().unwrap_or_else(|| vec![0.0; body.n_dofs()]);
        if !body.energy(&start).is_finite() {
            let (jacobian, cell) = body.smallest_jacobian(&start);
            return Err(Error::input(format!(
                "the start displacement turns cell {cell} inside out (J = {jacobian:.3}); start from rest"
            )));
        }
        let mut imbalance = vec![0.0; body.n_dofs()];
        body.internal_force(&start, &mut imbalance);
        let mut applied = problem.force.clone();
        contact.advance(0.0);
        contact.begin(&start);
        contact.linearize(&start);
        contact.add_force(&mut applied);
        imbalance.iter_mut().zip(&applied).for_each(|(r, f)| *r -= f);
        let start_means =
            problem.patches.iter().map(|load| patch_mean(&load.patch, &start)).collect();
        Ok(Run {
            settings,
            problem,
            contact,
            widened: None,
            progress,
            u: start.clone(),
            multipliers: vec![0.0; 3 * problem.patches.len()],
            load: 0.0,
            start,
            start_means,
            imbalance,
            rounding: Rounding::of(body),
            solver,
            tangent,
            iterations: 0,
            residuals: Vec::new(),
            unstable: None,
            slopes: Slopes::new(),
            shift: 0.0,
            follows_series: false,
            tried: 0.0,
            factorizations: 0,
            linear_iterations: 0,
            budget: choice.budget,
            spent: 0,
            shifts: choice.shifts,
            is_near: false,
            solvers: vec![settings.method.name()],
            seconds: Seconds::default(),
        })
    }

    fn body(&self) -> &'a Body {
        self.problem.body
    }

    /// Takes a wider pattern for the tangent where surfaces have come to touch that it does not couple. Without it, the
    /// stiffness between them would be missing, and with it the verdict of stability.
    fn widen(&mut self, u: &[f64]) -> Result<(), Cut> {
        let body = self.widened.as_deref().unwrap_or(self.problem.body);
        if !self.contact.is_beyond(body.pattern(), u) {
            return Ok(());
        }
        let wider = self.body().widened(u);
        self.solver = self.system(&wider).map_err(Cut::Solver)?;
        self.tangent = self.settings.method.tangent(&wider);
        self.widened = Some(Arc::new(wider));
        Ok(())
    }

    /// The linear system of a body with these supports and tools.
    fn system(&self, body: &Body) -> Result<ConstrainedSystem, Error> {
        let prescribed = self.problem.prescribed.iter().map(|&(dof, _)| dof);
        let patches = self.problem.patches.iter().map(|load| load.patch.clone()).collect();
        ConstrainedSystem::new(self.settings.method, body, prescribed, patches)
    }

    /// Lets a factor do what conjugate gradients, which were chosen automatically, do not do well.
    fn hand_over(&mut self) -> Result<(), FactorError> {
        (self.settings.method, self.budget) = (Method::Cholesky, None);
        self.solvers.push(self.settings.method.name());
        let clock = Instant::now();
        let body = self.widened.as_deref().unwrap_or(self.problem.body);
        self.solver = self.system(body).map_err(|error| match error {
            Error::Factor(error) => error,
            _ => FactorError::NotFactorized,
        })?;
        self.seconds.analysis += clock.elapsed().as_secs_f64();
        Ok(())
    }

    /// Whether a tangent that is not positive definite is a matter for a factor.
    fn doubts(&self) -> bool {
        self.budget.is_some() && (self.is_near || !self.shifts)
    }

    /// Whether the last tangent is positive definite, as far as conjugate gradients can tell that were chosen
    /// automatically. A factor has told already.
    fn is_probed_stable(&mut self) -> bool {
        let clock = Instant::now();
        let is_stable = self.budget.is_none()
            || self.shift == 0.0
                && self.solver.is_definite_along(&waves(self.body().points()), PROBED)
                    == Some(true);
        self.seconds.solve += clock.elapsed().as_secs_f64();
        is_stable
    }

    /// Tells the load reached, unless the caller wants no more. A large factor takes most of a second, so it is asked
    /// on either side of it.
    fn go_on(&mut self) -> Result<(), Cut> {
        if (self.progress)(self.load) { Ok(()) } else { Err(Cut::Cancelled) }
    }

    /// External force at a load: the dead target plus what is left of the start's imbalance, pressure, and the tools'
    /// where they were found last.
    fn external_force(&self, load: f64, u: &[f64]) -> Vec<f64> {
        let left = 1.0 - load;
        let dead = self.problem.force.iter().zip(&self.imbalance);
        let mut force = dead.map(|(f, r)| f + left * r).collect::<Vec<_>>();
        self.problem.pressure.add_force(self.body(), u, load, &mut force);
        self.contact.add_force(&mut force);
        force
    }

    fn add_stiffness_of_loads(&mut self, u: &[f64], load: f64) {
        let Problem { body, pressure, .. } = self.problem;
        if !pressure.is_empty() {
            pressure.add_stiffness(body, u, load, self.tangent.blocks_mut());
        }
        if !self.contact.is_empty() {
            self.contact.add_stiffness(Curvature::Exact, self.tangent.blocks_mut());
        }
    }

    /// Whether the tangent is the same everywhere.
    fn is_linear(&self) -> bool {
        let Problem { body, pressure, .. } = self.problem;
        let is_law = body.material().name() == "linear";
        is_law && pressure.is_empty() && self.contact.is_empty() && !body.has_links()
    }

    /// Whether a load step moves prescribed displacements; its first iteration then moves them there.
    fn is_led(&self) -> bool {
        let Problem { prescribed, patches, .. } = self.problem;
        !patches.is_empty() || prescribed.iter().any(|&(dof, v)| v != self.start[dof as usize])
    }

    /// `f_int - f_ext - W^T F`, zero where a displacement is prescribed, and its norm relative to
    /// that of all nodal forces.
    fn residual(&self, force: &[f64], external: &[f64], multipliers: &[f64]) -> (Vec<f64>, f64) {
        let mut out: Vec<f64> = force.iter().zip(external).map(|(i, e)| i - e).collect();
        for (load, m) in self.problem.patches.iter().zip(multipliers.chunks_exact(3)) {
            for (&node, &w) in load.patch.nodes.iter().zip(&load.patch.weights) {
                for i in 0..3 {
                    out[3 * node as usize + i] -= w * m[i];
                }
            }
        }
        self.problem.prescribed.iter().for_each(|&(dof, _)| out[dof as usize] = 0.0);
        let square = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
        let loads = square(force).max(square(external)).sqrt();
        let norm = self.rounding.relative(square(&out).sqrt(), loads, self.settings.tolerance);
        (out, norm)
    }

    /// Where the series of the path leads from the equilibrium `u`: load, displacement and patch forces.
    fn predict(
        &mut self,
        u: &[f64],
        first: &[f64],
        load: f64,
    ) -> Result<(f64, Vec<f64>, Vec<f64>), Cut> {
        let (clock, increment) = (Instant::now(), load - self.load);
        let predictor =
            Predictor::new(self.problem, &mut self.solver, u, first, [self.load, increment])
                .map_err(Cut::Factor)?;
        let mut part = predictor.range.max(self.settings.smallest_step / increment).min(1.0);
        let (mut force, still) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        let predicted = loop {
            let reached = if part == 1.0 { load } else { self.load + part * increment };
            let mut ahead = predictor.at(part);
            // Exactly where what is prescribed should be.
            let (closing, ..) = self.newton_step(&ahead, &still, reached, true)?;
            ahead.iter_mut().zip(&closing).for_each(|(u, s)| *u += s);
            if self.body().internal_force(&ahead, &mut force).is_finite() {
                let external = self.external_force(reached, &ahead);
                let residual: Vec<f64> = force.iter().zip(&external).map(|(i, e)| i - e).collect();
                let carried = self.solver.patch_forces(&residual);
                break (reached, ahead, carried.iter().map(|f| -f).collect());
            }
            if part * increment < self.settings.smallest_step {
                let (jacobian, cell) = self.body().smallest_jacobian(&ahead);
                return Err(Cut::Inverted { cell, jacobian });
            }
            part *= 0.5;
        };
        self.seconds.solve += clock.elapsed().as_secs_f64();
        Ok(predicted)
    }

    /// The first step of a load step is the tangent of the path.
    fn note_slope(&mut self, step: &[f64], load: f64) {
        let free = step.iter().enumerate().filter(|&(dof, _)| !self.solver.is_held(dof));
        let square: f64 = free.map(|(_, s)| s.powi(2)).sum();
        self.slopes.note(self.load, square.sqrt() / (load - self.load));
    }

    fn finish(mut self, cut: Option<Cut>, step: f64) -> Equilibrium {
        let body = self.body();
        let mut internal_force = vec![0.0; body.n_dofs()];
        body.internal_force(&self.u, &mut internal_force);
        let mut external_force = self.problem.force.clone();
        self.problem.pressure.add_force(body, &self.u, 1.0, &mut external_force);
        self.contact.advance(self.load);
        self.contact.linearize(&self.u);
        self.contact.add_force(&mut external_force);
        let ending = Ending {
            load: self.load,
            iterations: self.iterations,
            cut,
            // The smallest step that failed is twice the one that was not tried any more.
            turn: self.slopes.limit_point(self.load, 4.0 * step),
            unstable: self.unstable,
        };
        Equilibrium {
            energy: body.energy(&self.u),
            displacement: std::mem::take(&mut self.u),
            internal_force,
            external_force,
            patch_forces: self.multipliers.chunks_exact(3).map(|m| [m[0], m[1], m[2]]).collect(),
            status: ending.status(),
            message: ending.message(self.problem),
            device_fault: self.solver.device_fault().map(str::to_string),
            origin: self.solver.origin(),
            load: self.load,
            iterations: self.iterations,
            factorizations: self.factorizations,
            linear_iterations: self.linear_iterations,
            solvers: self.solvers,
            residuals: self.residuals,
            seconds: self.seconds,
        }
    }
}
