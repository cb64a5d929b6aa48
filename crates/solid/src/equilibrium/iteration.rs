//! Newton's method, once: statics under a load, a frame, a snapshot, a reduced energy, a corrector. What each of them
//! takes for a step, and how it makes its tangent definite, is its own ([`Iteration`]); when to stop ([`iterate`]), how
//! far to go along a step ([`backtrack`]) and what is rounding ([`Rounding`]) is the same for all. The shifts of a tangent
//! are those of one ladder, [`next_shift`](crate::linear::next_shift).

use crate::body::Body;

/// A residual that falls below this part of the one before is about to vanish: no iteration is the last one then.
const SETTLES: f64 = 0.3;

/// Where a Newton iteration is, and how it goes on.
pub trait Iteration {
    /// Why it cannot go on.
    type Failure;

    /// What is left where it is, relative: a residual, or a step. Infinite while it is not known.
    ///
    /// # Errors
    /// What keeps it from being told.
    fn residual(&mut self) -> Result<f64, Self::Failure>;

    /// Finds a step and takes it, or as much of it as is good.
    ///
    /// # Errors
    /// There is none, or none of it is good.
    fn step(&mut self) -> Result<(), Self::Failure>;

    /// Whether one more step would end after its deadline.
    fn is_late(&self) -> bool {
        false
    }
}

/// How far to iterate.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Residual that is small enough.
    pub tolerance: f64,
    /// Steps at most.
    pub steps: usize,
    /// Whether a residual that is about to vanish is waited for.
    pub waits: bool,
}

/// Why an iteration stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The residual is small enough.
    Converged,
    /// The steps did not suffice; with the residual that they left.
    TooManySteps,
    /// Its time was over.
    OutOfTime,
}

/// Iterates until the residual is small enough, or a limit is reached; the first step is always taken in time.
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

/// The first of the lengths `whole`, `whole / 2`, `whole / 4` ... that `accept` has something for, and what it has; none
/// where that many halvings lead nowhere.
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

/// By how much rounding may have the force and the energy of a body wrong, however small its strain: both cancel terms of
/// the size of its moduli.
#[derive(Clone, Copy, Debug)]
pub struct Rounding {
    /// Of the norm of nodal forces [N].
    force: f64,
    /// Of the strain energy [J].
    pub energy: f64,
}

impl Rounding {
    /// Part of an energy that rounding may have wrong.
    const OF_ENERGY: f64 = 1e-13;

    /// That of a body.
    pub fn of(body: &Body) -> Self {
        let force = 8.0 * f64::EPSILON * body.force_scale();
        Rounding { force, energy: Self::OF_ENERGY * body.energy_scale() }
    }

    /// A residual relative to the norm of the loads, within `tolerance` where it is rounding.
    pub fn relative(&self, residual: f64, loads: f64, tolerance: f64) -> f64 {
        let scale = loads.max(self.force / tolerance);
        if scale > 0.0 { residual / scale } else { 0.0 }
    }

    /// Whether an energy is no higher than a bound, as far as terms of the size `magnitude` let the two be compared.
    pub fn is_no_higher(&self, energy: f64, bound: f64, magnitude: f64) -> bool {
        energy <= bound + Self::OF_ENERGY * magnitude + self.energy
    }
}
