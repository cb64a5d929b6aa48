//! One load step: Newton's method from an equilibrium to the one at a higher load, or to an earlier one if the
//! prediction is valid only up to there.

use super::Newton;
use super::run::Run;
use crate::body::Curvature;
use crate::clock::Instant;
use crate::equilibrium::ending::{Cut, Fall, still_falls};
use crate::equilibrium::iteration::{Iteration, Limits, Stop, iterate};
use crate::number::norm;

/// Residual next to an equilibrium, where a load step began with a linear step: a tangent that is indefinite there is
/// that of an unstable one, which the path passes and Newton's method may leave downhill. Farther off it is common and
/// says nothing; if a slender body was bent by the series of its path, until the residual is next to nothing.
const NEAR: f64 = 0.02;
const AT: f64 = 1e-6;

/// Way from there to the equilibrium found, relative to the displacement, up to which that is the one it was next to: what
/// is out of balance may turn the tangent of a body that next to nothing holds indefinite beside a stable equilibrium.
const SAME: f64 = 0.1;

/// Load steps above this part of the load are cut where something rubs that was out of reach at their start.
const FINE: f64 = 1.0 / 64.0;

/// Smallest part of the motion of prescribed displacements that a step takes, as far as contact lets it: another one follows.
/// Friction, which depends on the path, takes none but the whole; the load step is cut in place of that.
const SHORTEST: f64 = 0.1;

/// Last increment, relative to the displacement, up to which the tangent before it speaks for the equilibrium after it.
const NEXT_TO: f64 = 0.02;

/// Part of the residual expected after a step that its linear system may leave, and the bounds of what it may leave. In contact
/// it always leaves the same: what a step leaves there depends on what it comes to touch, and the last step does not tell.
const FORCED: f64 = 0.3;
const TIGHTEST: f64 = 2e-5;
const LOOSEST: f64 = 1e-3;
const IN_CONTACT: f64 = 1e-3;

/// How often an equilibrium on the pieces of contact pairs is followed by newer ones: where they change in number, it may go
/// on for ever.
const MOST_PIECES: usize = 60;

/// A load step in progress.
struct LoadStep<'r, 'a> {
    run: &'r mut Run<'a>,
    load: f64,
    u: Vec<f64>,
    multipliers: Vec<f64>,
    /// Internal force, what is out of balance with it, and the relative size of that.
    force: Vec<f64>,
    residual: Vec<f64>,
    norm: f64,
    /// The relative residuals so far, and the same as the iteration takes them.
    history: Vec<[f64; 2]>,
    steps: usize,
    /// Norm of the last increment, over that of the displacement after it.
    moved: f64,
    /// Degree of freedom of a pivot that was not positive in the last tangent.
    unstable: Option<usize>,
    /// The same in the first one next to an equilibrium, and the displacement there.
    passed: Option<(usize, Vec<f64>)>,
    /// It began with a linear step, not with a series.
    is_linear: bool,
    /// Whether prescribed displacements are still to be moved to their values, regardless of the energy.
    is_led: bool,
}

impl<'a> Run<'a> {
    /// The load, at most `target`, that tools reach in one step.
    pub(super) fn reaches(&self, target: f64) -> f64 {
        self.contact.reaches(self.body(), &self.u, self.load, target)
    }

    /// Newton iterations to the equilibrium at `load`, or before it where a prediction does not hold so far; on success it
    /// becomes the state.
    pub(super) fn advance(&mut self, load: f64) -> Result<usize, Cut> {
        self.tried = load - self.load;
        self.contact.advance(load);
        self.contact.begin(&self.u);
        (self.spent, self.fall, self.unfinished) = (0, None, 0);
        let mut step = LoadStep::new(self, load);
        step.converge()?;
        if step.run.contact.was_out_of_reach() && step.run.tried > FINE {
            return Err(Cut::OutOfReach);
        }
        let unstable = step.verdict()?.or(step.instability_passed());
        let LoadStep { load, u, multipliers, history, steps, .. } = step;
        if let Some(row) = unstable {
            self.unstable = Some((load, row));
        }
        let body = self.body();
        if let Some(entry) = self.contact.find_entry(body, &u) {
            return Err(Cut::Entered(entry));
        }
        self.contact.end(&u);
        (self.u, self.multipliers, self.load, self.met) =
            (u, multipliers, load, self.contact.met());
        self.residuals.push(history.iter().map(|&[told, _]| told).collect());
        Ok(steps)
    }
}

impl<'r, 'a> LoadStep<'r, 'a> {
    fn new(run: &'r mut Run<'a>, load: f64) -> Self {
        LoadStep {
            load,
            u: run.u.clone(),
            multipliers: run.multipliers.clone(),
            force: vec![0.0; run.u.len()],
            residual: Vec::new(),
            norm: f64::INFINITY,
            history: Vec::new(),
            steps: 0,
            moved: f64::INFINITY,
            unstable: None,
            passed: None,
            is_linear: true,
            is_led: run.contact.is_empty() || run.is_led(),
            run,
        }
    }

    /// Iterates until the residual is small enough. If surfaces have moved since the pieces of contact pairs were found on
    /// which it is small, finds these anew and goes on: a fixed-point iteration.
    fn converge(&mut self) -> Result<(), Cut> {
        let Newton { tolerance, max_iterations, .. } = self.run.settings;
        let limits = Limits { tolerance, steps: max_iterations, waits: true };
        for _ in 0..MOST_PIECES {
            if iterate(self, limits)? != Stop::Converged {
                return Err(self.too_many_iterations());
            }
            if !self.run.contact.renew_pieces() {
                return Ok(());
            }
        }
        // What the last new pieces began with.
        self.residual()?;
        Err(Cut::Pieces { residual: self.norm })
    }

    /// Why the iterations were too many: next to equilibrium, because a tool has gone in where no sample meets it.
    fn too_many_iterations(&mut self) -> Cut {
        let LoadStep { run, u, norm, history, .. } = self;
        let entry = run.contact.find_entry(run.problem.body, u);
        if let (Some(entry), true) = (entry, *norm <= NEAR) {
            return Cut::Entered(entry);
        }
        let Newton { tolerance, max_iterations, .. } = run.settings;
        let residuals: Vec<f64> = history.iter().map(|&[_, norm]| norm).collect();
        let falls = still_falls(&residuals);
        Cut::Iterations { residual: *norm, tolerance, most: max_iterations, falls }
    }

    /// Relative residual to which conjugate gradients that were chosen automatically solve a linear system: part of what
    /// Newton's step is expected to leave, by the last step, or of what the solution may leave in the end (Eisenstat and
    /// Walker, SIAM J. Sci. Comput. 17 (1996) 16, choice 2).
    fn forcing(&self) -> f64 {
        if self.run.contact.touches() {
            return IN_CONTACT;
        }
        if !self.norm.is_finite() || self.steps == 1 {
            return LOOSEST;
        }
        let before = self.history.iter().rev().nth(1).map_or(1.0, |&[_, norm]| norm);
        let left = FORCED * (self.norm / before).powi(2);
        let enough = FORCED * self.run.settings.tolerance / self.norm;
        left.max(enough).clamp(TIGHTEST, LOOSEST)
    }

    /// The first step, which moves prescribed displacements or a part of them. If it would stretch the body out of
    /// proportion, the series of the path replaces it; returns whether it did.
    fn lead(&mut self, step: &[f64], part: f64) -> Result<bool, Cut> {
        let LoadStep { run, u, load, force, .. } = self;
        let mut along = vec![0.0; u.len()];
        run.tangent.multiply(step, &mut along);
        run.note_slope(step, &along, *load);
        if part < 1.0 || self.unstable.is_some() {
            return Ok(false);
        }
        let is_sound = !run.follows_series && run.is_in_proportion(u, step, force, &along);
        if is_sound || !run.has_series() {
            return Ok(false);
        }
        if run.defers_to_factor() {
            // A body that bends so far needs many solves that are exact.
            return Err(Cut::Doubtful);
        }
        (self.load, self.u, self.multipliers) = run.predict(u, step, *load)?;
        (run.tried, self.is_linear) = (self.load - run.load, false);
        Ok(true)
    }

    /// Notes a tangent that is not positive definite next to an equilibrium.
    fn note_instability(&mut self) {
        let LoadStep { passed, unstable, u, .. } = self;
        if let (None, Some(row)) = (&passed, *unstable) {
            *passed = Some((row, u.clone()));
        }
    }

    /// Degree of freedom in which an equilibrium was not stable that Newton's method came by and left.
    fn instability_passed(&self) -> Option<usize> {
        let (row, passed) = self.passed.as_ref()?;
        let way: Vec<f64> = self.u.iter().zip(passed).map(|(u, p)| u - p).collect();
        (norm(&way) > SAME * norm(&self.u)).then_some(*row)
    }

    /// Degree of freedom in which the equilibrium found is not stable. The last tangent says that it is stable, unless the last
    /// increment led far from it: then the one at the equilibrium does, which nothing else has needed.
    fn verdict(&mut self) -> Result<Option<usize>, Cut> {
        if self.run.is_linear() {
            return Ok(self.unstable);
        }
        let is_near = self.moved <= NEXT_TO;
        if self.run.budget.is_some() {
            return self.probe(is_near);
        }
        if is_near && self.unstable.is_none() && !self.run.has_overlooked()? {
            return Ok(None);
        }
        self.run.find_instability()
    }

    /// The same where conjugate gradients were chosen automatically: what they may have overlooked is for a factor.
    fn probe(&mut self, is_known: bool) -> Result<Option<usize>, Cut> {
        if !is_known {
            self.run.is_near = true;
            self.run.factorize()?;
        }
        if self.run.is_probed_stable()? { Ok(None) } else { Err(Cut::Doubtful) }
    }
}

impl Iteration for LoadStep<'_, '_> {
    type Failure = Cut;

    fn residual(&mut self) -> Result<f64, Cut> {
        let LoadStep { run, u, load, force, .. } = self;
        let clock = Instant::now();
        run.contact.linearize(u);
        run.widen(u)?;
        run.tangent.leave_to_device(run.solver.forms_tangents());
        let body = run.widened.as_deref().unwrap_or(run.problem.body);
        run.tangent.linearize(body, u, Curvature::Exact, force);
        let external = run.external_force(*load, u);
        run.add_stiffness_of_loads(u, *load);
        run.seconds.assembly += clock.elapsed().as_secs_f64();
        let told;
        (self.residual, told, self.norm) = run.residual(u, force, &external, &self.multipliers);
        if self.steps == 0 || self.is_led {
            return Ok(f64::INFINITY); // an equilibrium, but of another load
        }
        self.history.push([told, self.norm]);
        Ok(self.norm)
    }

    fn step(&mut self) -> Result<(), Cut> {
        self.run.go_on()?;
        let (is_first, is_leading) = (self.steps == 0, self.is_led);
        self.steps += 1;
        self.run.iterations += 1;
        self.run.is_near = !is_first && self.norm <= NEAR;
        self.run.solver.move_to(self.run.problem.body, &self.u);
        let last_shift = self.run.shift;
        let mut unstable = self.run.factorize()?;
        self.run.go_on()?;
        if self.run.budget.is_some() {
            self.run.solver.set_tolerance(self.forcing());
        }
        let clock = Instant::now();
        let mut solved = self.run.newton_step(&self.u, &self.residual, self.load, is_leading);
        while let Err(Cut::Doubtful) = solved
            && !self.run.is_doubtful()
        {
            self.run.lift(last_shift)?;
            solved = self.run.newton_step(&self.u, &self.residual, self.load, is_leading);
        }
        if let Err(Cut::Spent) = solved {
            self.run.hand_over().map_err(Cut::Factor)?;
            unstable = self.run.factorize()?;
            solved = self.run.newton_step(&self.u, &self.residual, self.load, is_leading);
        }
        let (step, change, indefinite) = solved?;
        let is_fall = self.run.contact.is_fall(&step);
        if is_fall {
            let is_stopped = self.run.contact.longest(&self.u, &step) < 1.0;
            self.run.fall = Some(if is_stopped { Fall::Onto } else { Fall::Away });
        }
        self.unstable = unstable.or(indefinite);
        if !is_first && self.norm <= if self.is_linear { NEAR } else { AT } {
            self.note_instability();
        }
        self.run.seconds.solve += clock.elapsed().as_secs_f64();
        let length = if is_leading {
            let part = self.run.contact.longest(&self.u, &step);
            let least = if self.run.contact.has_friction() { 1.0 } else { SHORTEST };
            if part < least {
                return Err(Cut::NoDescent { residual: self.norm });
            }
            self.is_led = part < 1.0;
            if is_first && self.lead(&step, part)? {
                return Ok(());
            }
            self.run.check_energy(&self.u, &step, part)?;
            part
        } else {
            self.run.line_search(&self.u, &step, self.load, &self.residual, self.norm, is_fall)?
        };
        self.u.iter_mut().zip(&step).for_each(|(u, s)| *u += length * s);
        self.moved = length * norm(&step) / norm(&self.u);
        self.multipliers.iter_mut().zip(&change).for_each(|(m, c)| *m += length * c);
        Ok(())
    }
}
