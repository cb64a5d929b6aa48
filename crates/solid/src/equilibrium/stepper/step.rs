//! The Newton steps of a frame and their safeguards: a tangent that is not definite is made convex cell by cell, a step
//! that would crush or tear a cell is cut back, and the hands then wait for the body. Cells that come close to a bound
//! all the same are held by a barrier, see [`VolumeBarrier`](super::barrier::VolumeBarrier).

use super::contact::{LEAST_PART, MAX_RETURNS, OVERSHOT};
use super::pressed::Linearization;
use super::{Input, Stepper, StepperSettings};
use crate::body::{Body, Curvature};
use crate::clock::Instant;
use crate::equilibrium::iteration::{Iteration, Limits, Stop, backtrack, iterate};
use crate::equilibrium::problem::patch_mean;
use crate::equilibrium::system::Solved;
use crate::error::Error;
use crate::linear::{FactorError, next_shift};
use crate::number::dot;

/// Halvings of a step before a frame stands still.
const MAX_CUTS: usize = 14;

/// Strain energy that a step may end with, over the modulus of the body times its volume, for laws that stiffen
/// exponentially: they reach any number at a stretch of two or three, where a tangent drowns all others in rounding.
pub(super) const MOST_ENERGY: f64 = 10.0;

/// Part of a body's length by which hands that have arrived may miss where they are to be: means of patches are rounded.
const ARRIVED: f64 = 1e-12;

/// Smallest part of their motion that hands make in an iteration, however often it is cut.
const SMALLEST_FRACTION: f64 = 1e-3;

/// First shift of a tangent that is not definite though it is convex, over its mean diagonal.
const FIRST_SHIFT: f64 = 1e-3;

/// Whether a convex or a shifted tangent has a factor where this one has none.
fn is_mendable(error: &FactorError) -> bool {
    use FactorError::{NotFinite, NotPositiveDefinite, Singular};
    matches!(error, NotPositiveDefinite { .. } | Singular { .. } | NotFinite { .. })
}

/// The result of the Newton iterations of a frame.
pub(super) struct Progress {
    pub taken: f64,
    /// The last step was cut back. A cut that later steps have made up for leaves nothing out of balance.
    pub is_cut: bool,
    /// The same of a body with inertia: it has lost momentum, and its residual holds no forces of inertia.
    pub is_braked: bool,
    pub is_unstable: bool,
    /// Newton iterations.
    pub steps: usize,
    /// Relative residual.
    pub residual: f64,
    /// The hands are where they are to be.
    pub has_arrived: bool,
    /// Iterations of the linear solver.
    pub iterations: usize,
    pub is_solved: bool,
    /// What single precision alone would leave of the linear systems.
    pub floor: f64,
    /// When the last linear system was solved.
    pub solved_at: Instant,
    pub energy: f64,
}

/// What was taken of a step.
struct Taken {
    /// The part of it.
    length: f64,
    /// Strain energy at its end [J].
    energy: f64,
    /// It is all that motion and contact allow, and no cell has cut it.
    is_allowed: bool,
}

impl Progress {
    fn new() -> Self {
        Progress {
            taken: 1.0,
            is_cut: false,
            is_braked: false,
            is_unstable: false,
            steps: 0,
            residual: f64::INFINITY,
            has_arrived: false,
            iterations: 0,
            is_solved: true,
            floor: 0.0,
            solved_at: Instant::now(),
            energy: 0.0,
        }
    }

    /// Whether hands and body have gone all the way.
    pub fn is_whole(&self) -> bool {
        self.has_arrived && self.taken == 1.0
    }

    /// The relative residual, infinite as long as hands or inertia lead on.
    fn left(&self) -> f64 {
        if self.has_arrived && !self.is_braked { self.residual } else { f64::INFINITY }
    }

    /// Whether what is left is no more than this, with the hands where they are to be and all of the motion made.
    pub fn is_settled(&self, residual: f64) -> bool {
        self.left() <= residual
    }
}

/// The Newton iterations of a frame, in progress.
struct FrameIteration<'a> {
    stepper: &'a mut Stepper,
    body: &'a Body,
    input: &'a Input<'a>,
    deadline: Option<Instant>,
    is_wanted: &'a dyn Fn() -> bool,
    /// When the last step began.
    began: Instant,
    progress: Progress,
}

impl Iteration for FrameIteration<'_> {
    type Failure = Error;

    fn residual(&mut self) -> Result<f64, Error> {
        Ok(self.progress.left())
    }

    fn step(&mut self) -> Result<(), Error> {
        if self.progress.steps > 0 && !(self.is_wanted)() {
            return Err(Error::Cancelled);
        }
        self.began = Instant::now();
        let FrameIteration { stepper, body, input, deadline, progress, .. } = self;
        let (number, before) = (progress.steps, progress.residual);
        let (is_unstable, solved) = stepper.find_step(body, input, number, *deadline)?;
        // Tangents on the way say nothing of where the frame ends.
        progress.is_unstable = is_unstable;
        progress.iterations += solved.iterations;
        progress.is_solved &= solved.is_complete;
        progress.floor = progress.floor.max(solved.floor);
        progress.solved_at = Instant::now();
        let Taken { length: taken, energy, is_allowed } = stepper.take(body);
        let moved = if stepper.hands_move { stepper.motion_fraction * taken } else { taken };
        (progress.taken, progress.energy) = (progress.taken.min(moved), energy);
        progress.is_cut = taken < 1.0;
        progress.is_braked = progress.is_cut && stepper.motion.is_some();
        progress.has_arrived = !stepper.hands_move || moved == 1.0;
        progress.steps += 1;
        stepper.adapt(taken, is_unstable, solved.indefinite.is_some());
        progress.residual = stepper.measure(body, progress.is_cut);
        stepper.keep_residual(number, progress.residual);
        stepper.follows_friction &= progress.residual < before;
        if !stepper.contact.is_empty() && !stepper.hands_move {
            // A step that contact cut has still led into the layer; one that cells cut has not met its end.
            stepper.contact.keep_pieces(true);
            let went_back = is_allowed && stepper.go_back(body, taken, progress);
            let has_pairs = stepper.contact.keep_pieces(false);
            if has_pairs && went_back {
                progress.residual = stepper.measure(body, progress.is_cut);
            }
        }
        Ok(())
    }

    /// The next step will take as long as the last.
    fn is_late(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() + self.began.elapsed() >= deadline)
    }
}

impl Stepper {
    /// The Newton iterations of a frame.
    pub(super) fn advance(
        &mut self,
        body: &Body,
        input: &Input<'_>,
        deadline: Option<Instant>,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Progress, Error> {
        let StepperSettings { settled, iterations, .. } = self.settings;
        let mut limits = Limits { tolerance: settled, steps: iterations, waits: false };
        let (began, progress) = (Instant::now(), Progress::new());
        let mut frame =
            FrameIteration { stepper: self, body, input, deadline, is_wanted, began, progress };
        // A frame is settled only if it is on the pieces of contact pairs where it has ended.
        while iterate(&mut frame, limits)? == Stop::Converged
            && frame.stepper.contact.renew_pieces()
        {
            frame.progress.residual = frame.stepper.measure(body, frame.progress.is_cut);
            limits.steps = iterations - frame.progress.steps;
            if frame.is_late() {
                break;
            }
        }
        Ok(frame.progress)
    }

    /// What a step that was cut, or not, or left to what descent there was, means for the next.
    fn adapt(&mut self, taken: f64, is_unstable: bool, is_makeshift: bool) {
        let is_cut = taken < 1.0;
        self.projects_next = is_makeshift || is_cut && is_unstable;
        self.motion_fraction = if is_cut {
            (self.motion_fraction * taken).max(SMALLEST_FRACTION)
        } else {
            (4.0 * self.motion_fraction).min(1.0)
        };
        let larger = next_shift(self.shift, FIRST_SHIFT).unwrap_or(self.shift);
        self.shift = if taken == 0.0 { larger } else { 0.0 };
    }

    /// Forces where the body is, and the tangent of all but its loads.
    fn linearize(
        &mut self,
        body: &Body,
        curvature: Curvature,
        is_first: bool,
    ) -> Result<(), Error> {
        let clock = Instant::now();
        self.widen(body)?;
        let widened = self.widened.clone();
        let body = widened.as_deref().unwrap_or(body);
        self.tangent.leave_to_device(self.solver.forms_tangents());
        self.tangent.linearize(body, &self.displacement, curvature, &mut self.internal);
        if let Some(relaxation) = &self.relaxation {
            relaxation.apply(body, &self.displacement, &mut self.internal);
            relaxation.soften(body, (&self.displacement, curvature), &mut self.tangent);
        }
        if !self.barrier.is_idle() {
            self.barrier.add_force(body, &mut self.internal);
            self.barrier.add_stiffness(body, self.tangent.blocks_mut());
        }
        let linearization = match is_first {
            true if self.ahead > 0.0 => Linearization::Ahead(self.ahead),
            true if self.was_settled => Linearization::Led,
            _ => Linearization::Here,
        };
        self.press(body, linearization);
        if curvature == Curvature::Projected {
            self.convex = clock.elapsed();
        }
        Ok(())
    }

    /// The Newton step of hands and body, and whether the tangent was not positive definite. Such a tangent is made
    /// convex cell by cell; if that is not enough (pressure, nothing that holds the body) it is shifted. Where the budget
    /// leaves no time for that, the descent that the solver has made is the step.
    fn find_step(
        &mut self,
        body: &Body,
        input: &Input<'_>,
        number: usize,
        deadline: Option<Instant>,
    ) -> Result<(bool, Solved), Error> {
        let is_first = number == 0;
        let projects_next = self.projects_next && self.has_time_for_convex(deadline);
        let mut curvature = if projects_next { Curvature::Projected } else { Curvature::Exact };
        self.linearize(body, curvature, is_first)?;
        if is_first {
            self.begin_frame();
        }
        self.move_hands(input);
        self.balance(body, curvature);
        let residual = self.constraint_residual(input);
        let near = ARRIVED * self.length;
        self.hands_move = residual.iter().chain(&self.step).any(|&by| by.abs() > near);
        if self.tangent.product_part().is_some() {
            self.extrapolation.balance(&self.residual);
        }
        let (mut shift, mut iterations) = (self.shift, 0);
        let solved = loop {
            let unbalanced = (!self.contact.is_empty()).then(|| self.residual.clone());
            let (b, free, forces) = (&mut self.residual, &mut self.increment, &mut self.forces);
            let outcome = match self.solver.prepare(&self.tangent, shift) {
                Ok(()) => self.solver.solve(b, &residual, free, forces, deadline),
                Err(error) => Err(error),
            };
            self.descent = unbalanced.map_or(0.0, |b| dot(&b, &self.increment));
            let larger = next_shift(shift, FIRST_SHIFT);
            let is_last = larger.is_none() || !self.has_time_for_convex(deadline);
            match outcome {
                // Where it is the last, the descent made before a direction of negative curvature, or at least one of
                // descent.
                Ok(solved) if solved.indefinite.is_none() || is_last => break solved,
                Ok(solved) => iterations += solved.iterations,
                Err(error) if larger.is_none() || !is_mendable(&error) => return Err(error.into()),
                Err(_) => {}
            }
            if curvature == Curvature::Projected {
                shift = larger.unwrap_or(shift);
            } else {
                curvature = Curvature::Projected;
                self.linearize(body, curvature, is_first)?;
                self.move_hands(input);
                self.balance(body, curvature);
            }
        };
        self.step.iter_mut().zip(&self.increment).for_each(|(s, f)| *s += f);
        let is_unstable = curvature == Curvature::Projected || solved.indefinite.is_some();
        if solved.indefinite.is_none() {
            iterations += self.follow_friction(number, deadline)?;
        }
        Ok((is_unstable, Solved { iterations: iterations + solved.iterations, ..solved }))
    }

    fn has_time_for_convex(&self, deadline: Option<Instant>) -> bool {
        deadline.is_none_or(|end| Instant::now() + self.convex < end)
    }

    /// The constraint residual: how far the means of the patches and their turns have to go, at the hands' fraction,
    /// beside the motion of what is grasped.
    fn constraint_residual(&self, input: &Input<'_>) -> Vec<f64> {
        let mut residual = Vec::with_capacity(3 * (self.patches.len() + self.turning.len()));
        for (patch, mean) in self.patches.iter().zip(input.means) {
            let now = patch_mean(patch, &self.displacement);
            let held = patch_mean(patch, &self.step);
            residual.extend((0..3).map(|i| self.motion_fraction * (mean[i] - now[i]) - held[i]));
        }
        for turning in &self.turning {
            let now = turning.value(&self.displacement);
            let held = turning.change(&self.step);
            residual.extend((0..3).map(|i| -self.motion_fraction * now[i] - held[i]));
        }
        residual
    }

    /// Takes as much of the step as leaves all cells sound, and takes no free node farther than the body is long
    /// at once, nor a surface through another or a tool. The internal force is that of the state reached.
    fn take(&mut self, body: &Body) -> Taken {
        let (u, step) = (&self.displacement, &self.step);
        // While hands move, no step is taken back to where it balances.
        let allowed = match self.hands_move {
            true => self.contact.longest_in_layer(u, step),
            false => self.contact.longest(u, step),
        };
        let whole = self.within_length().min(allowed);
        let taken = backtrack(whole, MAX_CUTS, |length| {
            self.try_at(length);
            let energy = self.force_within_bounds(body);
            energy.is_finite().then_some(energy)
        });
        if let Some((length, energy)) = taken {
            std::mem::swap(&mut self.displacement, &mut self.trial);
            self.complete(body);
            return Taken { length, energy, is_allowed: length == whole };
        }
        let energy = body.internal_force(&self.displacement, &mut self.internal);
        self.complete(body);
        Taken { length: 0.0, energy, is_allowed: false }
    }

    /// The part of the step whose increment takes no free node farther than the body is long; 1 mostly.
    fn within_length(&self) -> f64 {
        let squares = self.increment.chunks_exact(3).map(|w| dot(w, w));
        let longest = squares.fold(0.0, f64::max).sqrt();
        if longest > self.length { self.length / longest } else { 1.0 }
    }

    /// Goes back from where a step led among tools, if it led beyond the place on its way where what is out of balance has
    /// no power any more: what touches there, or does not, is not what the tangent knew. The next step would set out
    /// without the tool, or deep in it. That place is looked for by false position. Whether it went back.
    fn go_back(&mut self, body: &Body, taken: f64, progress: &mut Progress) -> bool {
        let most = OVERSHOT * self.descent;
        let (mut length, mut near, mut far) = (taken, [0.0, self.descent], None);
        for _ in 0..MAX_RETURNS {
            let power = dot(&self.residual, &self.step);
            let here = [length, power];
            let beyond = match far {
                _ if power < -most => here,
                Some(beyond) if power > most => {
                    near = here;
                    beyond
                }
                _ => break,
            };
            far = Some(beyond);
            let part = (near[1] / (near[1] - beyond[1])).max(LEAST_PART);
            let shorter = near[0] + part * (beyond[0] - near[0]);
            self.try_at(shorter - length);
            let energy = self.force_within_bounds(body);
            if !energy.is_finite() {
                body.internal_force(&self.displacement, &mut self.internal);
                self.complete(body);
                break;
            }
            std::mem::swap(&mut self.displacement, &mut self.trial);
            self.complete(body);
            (length, progress.energy) = (shorter, energy);
            progress.residual = self.measure(body, progress.is_cut);
        }
        length < taken
    }

    /// Evaluates the displacement after a part of the step.
    pub(super) fn try_at(&mut self, length: f64) {
        let places = self.displacement.iter().zip(&self.step);
        self.trial.iter_mut().zip(places).for_each(|(trial, (u, s))| *trial = u + length * s);
    }

    /// Strain energy and internal force on trial, infinite where a cell is out of bounds or too close to one, or where the
    /// energy is out of its own.
    fn force_within_bounds(&mut self, body: &Body) -> f64 {
        let (u, force) = (&self.trial, &mut self.internal);
        let energy = body.internal_force_within(u, self.barrier.inner(), force);
        if energy.is_finite() {
            if !self.is_within_energies(body, energy) {
                return f64::INFINITY;
            }
            self.barrier.forget();
            return energy;
        }
        let energy = body.internal_force_within(u, self.barrier.range(), force);
        let is_sound = self.is_within_energies(body, energy);
        if is_sound && self.barrier.follow(body, &self.trial) { energy } else { f64::INFINITY }
    }

    /// Whether there is a strain energy on trial, and frames go to it: it is not too high, or below that of the present.
    pub(super) fn is_within_energies(&self, body: &Body, energy: f64) -> bool {
        let is_too_high = energy > self.most_energy && energy >= body.energy(&self.displacement);
        energy.is_finite() && !is_too_high
    }

    /// From the law's internal force to that of tissue that remembers, and of cells next to a bound.
    fn complete(&mut self, body: &Body) {
        if let Some(relaxation) = &self.relaxation {
            relaxation.apply(body, &self.displacement, &mut self.internal);
        }
        self.barrier.add_force(body, &mut self.internal);
    }
}
