//! Newton's method, written once for statics, frames, snapshots, the reduced energy and path correction. Each defines
//! its own step and how it makes its tangent definite ([`Iteration`]). When to stop ([`iterate`]), how much of a step
//! to take ([`backtrack`]) and what counts as rounding ([`Rounding`]) is common to all. The shifts of a tangent follow
//! one sequence, [`next_shift`](crate::linear::next_shift).

use crate::body::Body;

/// A residual below this part of the previous one is about to vanish, so the iteration is not stopped yet.
const SETTLES: f64 = 0.3;

/// A problem that Newton's method solves: its residual and its step.
pub trait Iteration {
    /// Why the iteration cannot continue.
    type Failure;

    /// The relative residual, or step, at the present iterate. Infinite while it is not known.
    ///
    /// # Errors
    /// What prevents its evaluation.
    fn residual(&mut self) -> Result<f64, Self::Failure>;

    /// Finds a step and takes it, or an acceptable part of it.
    ///
    /// # Errors
    /// No step can be found, or no part of it is acceptable.
    fn step(&mut self) -> Result<(), Self::Failure>;

    /// Whether one more step would end after its deadline.
    fn is_late(&self) -> bool {
        false
    }
}

/// When to stop iterating.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Residual at which the iteration has converged.
    pub tolerance: f64,
    /// Largest number of steps.
    pub steps: usize,
    /// Whether to continue beyond `steps` while the residual is about to vanish.
    pub waits: bool,
}

/// Why an iteration stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The residual is small enough.
    Converged,
    /// The largest number of steps was not enough.
    TooManySteps,
    /// The time was over.
    OutOfTime,
}

/// Iterates until the residual is small enough, or a limit is reached. The first step is taken regardless of the time.
///
/// # Errors
/// Those of the residuals and the steps.
pub fn iterate<I: Iteration>(iteration: &mut I, limits: Limits) -> Result<Stop, I::Failure> {
    let (mut steps, mut last) = (0, f64::INFINITY);
    loop {
        if steps > 0 && iteration.is_late() {
            return Ok(Stop::OutOfTime);
        }
        let residual = iteration.residual()?;
        if residual <= limits.tolerance {
            return Ok(Stop::Converged);
        }
        let vanishes = limits.waits && last.is_finite() && residual < SETTLES * last;
        if steps >= limits.steps && !vanishes {
            return Ok(Stop::TooManySteps);
        }
        iteration.step()?;
        (steps, last) = (steps + 1, residual);
    }
}

/// The first of the lengths `whole`, `whole / 2`, `whole / 4` ... for which `accept` returns something, with that
/// result; none if it is none for all of them.
pub fn backtrack<T>(
    whole: f64,
    halvings: usize,
    mut accept: impl FnMut(f64) -> Option<T>,
) -> Option<(f64, T)> {
    let mut length = whole;
    for _ in 0..=halvings {
        if let Some(accepted) = accept(length) {
            return Some((length, accepted));
        }
        length *= 0.5;
    }
    None
}

/// Largest error of force and energy of a body by rounding, for any strain: both cancel terms of the size of its
/// moduli.
#[derive(Clone, Copy, Debug)]
pub struct Rounding {
    /// Of the norm of nodal forces [N].
    force: f64,
    /// Of the strain energy [J].
    pub energy: f64,
}

impl Rounding {
    /// Relative error of an energy by rounding.
    const OF_ENERGY: f64 = 1e-13;

    /// That of a body.
    pub fn of(body: &Body) -> Self {
        let force = 8.0 * f64::EPSILON * body.force_scale();
        Rounding { force, energy: Self::OF_ENERGY * body.energy_scale() }
    }

    /// That of a region which has this part of the body's forces and energy.
    pub fn part(&self, part: f64) -> Self {
        Rounding { force: part * self.force, energy: part * self.energy }
    }

    /// Whether loads of this norm are rounding: those of a body that nothing loads.
    pub fn is_all_of(&self, loads: f64) -> bool {
        loads <= self.force
    }

    /// A residual relative to the norm of the loads; it is within `tolerance` if it is rounding.
    pub fn relative(&self, residual: f64, loads: f64, tolerance: f64) -> f64 {
        let scale = loads.max(self.force / tolerance);
        if scale > 0.0 { residual / scale } else { 0.0 }
    }

    /// Whether an energy is no higher than a bound, as far as terms of the size `magnitude` let the two be compared.
    pub fn is_no_higher(&self, energy: f64, bound: f64, magnitude: f64) -> bool {
        energy <= bound + Self::OF_ENERGY * magnitude + self.energy
    }
}
