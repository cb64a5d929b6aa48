//! A solution in progress: where it stands, and what its steps have in common.

use super::Newton;
use super::listener::while_wanted;
use crate::body::{Body, Curvature};
use crate::clock::Instant;
use crate::contact::{Contact, Met};
use crate::equilibrium::analytic::require_series_about_rest;
use crate::equilibrium::domain::{NoEnergy, check_start};
use crate::equilibrium::ending::{Cut, Ending, Fall, Slope, Slopes, unsound_cell};
use crate::equilibrium::iteration::Rounding;
use crate::equilibrium::outcome::{Equilibrium, Seconds};
use crate::equilibrium::predictor::Predictor;
use crate::equilibrium::problem::{Problem, patch_mean};
use crate::equilibrium::system::{
    Choice, ConjugateGradients, ConstrainedSystem, Method, NegativeCurvature, Until, waves,
};
use crate::equilibrium::tangent::Tangent;
use crate::error::Error;
use crate::law::LINEAR;
use crate::linear::FactorError;
use crate::number::dot;
use std::sync::Arc;

/// Residual at which conjugate gradients have met whatever negative curvature there is. A force that holds something of all
/// motions cannot be balanced so far without them.
const PROBED: f64 = 1e-4;

/// The state of a solution in progress; `u`, `multipliers` and `load` always hold an equilibrium.
pub(super) struct Run<'a> {
    pub(super) settings: Newton,
    pub(super) problem: &'a Problem<'a>,
    pub(super) contact: &'a mut Contact,
    /// The body with the pattern of the tangent, where that has become wider.
    pub(super) widened: Option<Arc<Body>>,
    pub(super) progress: &'a mut dyn FnMut(f64) -> bool,
    pub(super) solver: ConstrainedSystem,
    pub(super) tangent: Tangent,
    pub(super) u: Vec<f64>,
    pub(super) multipliers: Vec<f64>,
    pub(super) load: f64,
    /// What contact pairs meet there.
    pub(super) met: Vec<Met>,
    pub(super) start: Vec<f64>,
    pub(super) start_means: Vec<[f64; 3]>,
    /// Out-of-balance force of the start state on the free degrees of freedom.
    pub(super) imbalance: Vec<f64>,
    pub(super) rounding: Rounding,
    pub(super) iterations: usize,
    pub(super) residuals: Vec<Vec<f64>>,
    pub(super) unstable: Option<(f64, usize)>,
    pub(super) slopes: Slopes,
    /// Shift of the last tangent; the next one is usually similar.
    pub(super) shift: f64,
    /// Whether the body has fallen in this load step.
    pub(super) fall: Option<Fall>,
    /// Linear systems of this load step that conjugate gradients left unfinished.
    pub(super) unfinished: usize,
    /// Whether a load step has failed, so that the next ones follow the series of the path.
    pub(super) follows_series: bool,
    /// Whether there is such a series, once that has been asked.
    pub(super) is_analytic: Option<bool>,
    /// Part of the load that the load step in progress is to add.
    pub(super) tried: f64,
    pub(super) factorizations: usize,
    pub(super) linear_iterations: usize,
    /// Iterations of conjugate gradients that a load step may take, where they were chosen automatically.
    pub(super) budget: Option<usize>,
    /// Those that this one has taken.
    pub(super) spent: usize,
    /// What they do where a tangent far from equilibrium is not positive definite.
    pub(super) negative_curvature: NegativeCurvature,
    /// Whether the iterate is close to an equilibrium, whose stability counts.
    pub(super) is_near: bool,
    pub(super) solvers: Vec<&'static str>,
    /// Why a device that works was left.
    pub(super) left_device: Option<String>,
    pub(super) seconds: Seconds,
}

impl<'a> Run<'a> {
    pub(super) fn new(
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
        check_start(body, &start)?;
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
            met: contact.met(),
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
            fall: None,
            unfinished: 0,
            follows_series: false,
            is_analytic: None,
            tried: 0.0,
            factorizations: 0,
            linear_iterations: 0,
            budget: choice.budget,
            spent: 0,
            negative_curvature: choice.negative_curvature,
            is_near: false,
            solvers: vec![settings.method.name()],
            left_device: None,
            seconds: Seconds::default(),
        })
    }

    pub(super) fn body(&self) -> &'a Body {
        self.problem.body
    }

    /// Takes a wider pattern for the tangent where surfaces have come to touch that it does not couple. Without it, the
    /// stiffness between them would be missing, and with it the verdict of stability.
    pub(super) fn widen(&mut self, u: &[f64]) -> Result<(), Cut> {
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
    pub(super) fn system(&self, body: &Body) -> Result<ConstrainedSystem, Error> {
        let prescribed = self.problem.prescribed.iter().map(|&(dof, _)| dof);
        let patches = self.problem.patches.iter().map(|load| load.patch.clone()).collect();
        ConstrainedSystem::new(self.settings.method, body, prescribed, patches)
    }

    /// Lets a factor do what conjugate gradients, which were chosen automatically, do not do well.
    pub(super) fn hand_over(&mut self) -> Result<(), FactorError> {
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

    /// Whether a load step may have failed because the steps of a device are in single precision. In contact one fails as
    /// often with other solvers.
    pub(super) fn suspects_device(&self, cut: &Cut) -> bool {
        let is_of_steps = matches!(cut, Cut::Iterations { .. } | Cut::NoDescent { .. });
        is_of_steps && self.solver.origin().is_some() && self.contact.is_empty()
    }

    /// Lets the processor go on in double precision, by the same method.
    pub(super) fn leave_device(&mut self, cut: &Cut) -> Result<(), Error> {
        let Method::ConjugateGradients(settings) = self.settings.method else { return Ok(()) };
        self.settings.method =
            Method::ConjugateGradients(ConjugateGradients { device: None, ..settings });
        let body = self.widened.as_deref().unwrap_or(self.problem.body);
        self.solver = self.system(body)?;
        self.tangent = self.settings.method.tangent(body);
        self.left_device = Some(format!(
            "steps in the single precision of the graphics processor do not lead from load {:.4} to equilibrium, as where \
             one part is many times as stiff as another: {}",
            self.load,
            cut.sentence()
        ));
        Ok(())
    }

    /// Whether conjugate gradients that were chosen automatically leave a difficult load step to a factor. In contact they do
    /// not: tangents that need a shift and load steps that are cut are as common there with a factor.
    pub(super) fn defers_to_factor(&self) -> bool {
        self.budget.is_some() && self.contact.is_empty()
    }

    /// Whether a factor goes on after a cut: after any one outside contact, in contact where conjugate gradients cannot tell
    /// whether an equilibrium is stable.
    pub(super) fn needs_factor(&self, cut: &Cut) -> bool {
        self.defers_to_factor() || self.budget.is_some() && matches!(cut, Cut::Doubtful)
    }

    /// Whether a tangent that is not positive definite is a matter for a factor.
    pub(super) fn is_doubtful(&self) -> bool {
        self.defers_to_factor()
            && (self.is_near || self.negative_curvature == NegativeCurvature::Refused)
    }

    /// Whether the line search follows a direction of negative curvature.
    pub(super) fn follows_negative_curvature(&self) -> bool {
        self.defers_to_factor()
            && !self.is_near
            && self.negative_curvature == NegativeCurvature::Followed
    }

    /// Whether the last tangent is positive definite, as far as conjugate gradients can tell that were chosen
    /// automatically. A factor has told already.
    pub(super) fn is_probed_stable(&mut self) -> Result<bool, Cut> {
        Ok(self.budget.is_none()
            || self.shift == 0.0 && self.is_definite_along_waves()? == Some(true))
    }

    /// Whether the last tangent is not positive definite, though the solution did not excite that motion and conjugate
    /// gradients did not meet it: a straight column, pressed straight.
    pub(super) fn has_overlooked(&mut self) -> Result<bool, Cut> {
        Ok(self.is_definite_along_waves()? == Some(false))
    }

    fn is_definite_along_waves(&mut self) -> Result<Option<bool>, Cut> {
        let (clock, waves) = (Instant::now(), waves(self.body().points()));
        let Run { progress, load, solver, .. } = self;
        let find = |until: Until<'_>| solver.is_definite_along(&waves, PROBED, until);
        let found = while_wanted(&mut **progress, *load, find);
        self.seconds.solve += clock.elapsed().as_secs_f64();
        found
    }

    /// Tells the load reached, unless the caller wants no more. A large factor takes most of a second, so it is asked
    /// on either side of it.
    pub(super) fn go_on(&mut self) -> Result<(), Cut> {
        if (self.progress)(self.load) { Ok(()) } else { Err(Cut::Cancelled) }
    }

    /// External force at a load: the dead target plus what is left of the start's imbalance, pressure, and the tools'
    /// where they were found last.
    pub(super) fn external_force(&self, load: f64, u: &[f64]) -> Vec<f64> {
        let left = 1.0 - load;
        let dead = self.problem.force.iter().zip(&self.imbalance);
        let mut force = dead.map(|(f, r)| f + left * r).collect::<Vec<_>>();
        self.problem.pressure.add_force(self.body(), u, load, &mut force);
        self.contact.add_force(&mut force);
        force
    }

    pub(super) fn add_stiffness_of_loads(&mut self, u: &[f64], load: f64) {
        let Problem { body, pressure, .. } = self.problem;
        if !pressure.is_empty() {
            pressure.add_stiffness(body, u, load, self.tangent.blocks_mut());
        }
        if !self.contact.is_empty() {
            self.contact.add_stiffness(Curvature::Exact, self.tangent.blocks_mut());
        }
    }

    /// Whether the tangent is the same everywhere.
    pub(super) fn is_linear(&self) -> bool {
        let Problem { body, pressure, .. } = self.problem;
        let is_law = body.material().name() == LINEAR;
        is_law && pressure.is_empty() && self.contact.is_empty() && !body.has_links()
    }

    /// Whether a load step moves prescribed displacements; its first iteration then moves them there.
    pub(super) fn is_led(&self) -> bool {
        let Problem { prescribed, patches, .. } = self.problem;
        !patches.is_empty() || prescribed.iter().any(|&(dof, v)| v != self.start[dof as usize])
    }

    /// `f_int - f_ext - W^T F` at `u`, zero where a displacement is prescribed; its norm relative to that of all nodal forces;
    /// the same for the iteration, within its tolerance if the residual is rounding. Those of supports and springs count by
    /// themselves: what they balance is in `f_int`, too.
    pub(super) fn residual(
        &self,
        u: &[f64],
        force: &[f64],
        external: &[f64],
        multipliers: &[f64],
    ) -> (Vec<f64>, f64, f64) {
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
        let tied = self.body().ties().map_or(0.0, |ties| {
            let mut tied = vec![0.0; u.len()];
            ties.add_internal_force(u, &mut tied);
            square(&tied)
        });
        let loads = square(force).max(square(external)).max(tied).sqrt();
        let size = square(&out).sqrt();
        let norm = self.rounding.relative(size, loads, self.settings.tolerance);
        let told = if self.rounding.is_all_of(loads) { norm } else { size / loads };
        (out, told, norm)
    }

    /// Whether the path is a power series as far as the law goes, and nothing but it resists.
    pub(super) fn has_series(&mut self) -> bool {
        let body = self.body();
        let is_analytic = || require_series_about_rest(body).is_ok();
        self.contact.is_empty()
            && !body.has_links()
            && *self.is_analytic.get_or_insert_with(is_analytic)
    }

    /// Where the series of the path leads from the equilibrium `u`: load, displacement and patch forces.
    pub(super) fn predict(
        &mut self,
        u: &[f64],
        first: &[f64],
        load: f64,
    ) -> Result<(f64, Vec<f64>, Vec<f64>), Cut> {
        let (clock, increment) = (Instant::now(), load - self.load);
        let Run { problem, progress, solver, .. } = self;
        let loads = [self.load, increment];
        let find = |until: Until<'_>| Predictor::new(problem, solver, u, first, loads, until);
        let predictor = while_wanted(&mut **progress, self.load, find)?.map_err(Cut::Factor)?;
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
                return Err(Cut::NoEnergy(NoEnergy::of(self.body(), &ahead)));
            }
            part *= 0.5;
        };
        self.seconds.solve += clock.elapsed().as_secs_f64();
        Ok(predicted)
    }

    /// The first step of a load step is the tangent of the path; `forces` is the tangent times it.
    pub(super) fn note_slope(&mut self, step: &[f64], forces: &[f64], load: f64) {
        let free = step.iter().enumerate().filter(|&(dof, _)| !self.solver.is_held(dof));
        let square: f64 = free.map(|(_, s)| s.powi(2)).sum();
        let (length, stiffness) = (square.sqrt() / (load - self.load), dot(step, forces) / square);
        self.slopes.note(Slope { load: self.load, length, stiffness });
    }

    pub(super) fn finish(mut self, cut: Option<Cut>, step: f64) -> Equilibrium {
        let body = self.body();
        let mut internal_force = vec![0.0; body.n_dofs()];
        body.internal_force(&self.u, &mut internal_force);
        let mut external_force: Vec<f64> =
            self.problem.force.iter().map(|force| self.load * force).collect();
        self.problem.pressure.add_force(body, &self.u, self.load, &mut external_force);
        self.contact.advance(self.load);
        self.contact.go_back(std::mem::take(&mut self.met));
        self.contact.linearize(&self.u);
        self.contact.add_force(&mut external_force);
        let ending = Ending {
            load: self.load,
            iterations: self.iterations,
            cut,
            // The smallest step that failed is twice the one that was not tried any more.
            singular: self.slopes.singular_point(self.load, 4.0 * step),
            unstable: self.unstable,
            in_contact: !self.contact.is_empty(),
            fall: self.fall,
            unfinished: self.unfinished,
            residual: self.residuals.last().and_then(|step| step.last()).copied().unwrap_or(0.0),
            tolerance: self.settings.tolerance,
            unsound: unsound_cell(body, &self.u),
        };
        Equilibrium {
            energy: body.energy(&self.u),
            displacement: std::mem::take(&mut self.u),
            internal_force,
            external_force,
            patch_forces: self.multipliers.chunks_exact(3).map(|m| [m[0], m[1], m[2]]).collect(),
            status: ending.status(),
            message: ending.message(self.problem),
            device_fault: self.solver.device_fault().map(str::to_string).or(self.left_device),
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
