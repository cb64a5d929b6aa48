//! When conjugate gradients on the device stop, and how they ended.

use crate::Error;
use bytemuck::{Pod, Zeroable};
use viscera_clock::Instant;

/// When conjugate gradients stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Residual to reach, relative to the right-hand side.
    pub tolerance: f64,
    /// Largest number of iterations; the solution so far is returned.
    pub max_iterations: usize,
    /// Fewest iterations between two checks whether the device has finished.
    pub check_every: usize,
    /// Time at which to stop and return the solution so far.
    pub deadline: Option<Instant>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { tolerance: 1e-4, max_iterations: 2000, check_every: 16, deadline: None }
    }
}

/// How conjugate gradients ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The tolerance is reached.
    Solved,
    /// The budget of iterations or time is spent.
    Spent,
    /// A direction of negative curvature was found, or rounding that cannot be told from one.
    Indefinite,
    /// A number is not finite.
    NotFinite,
}

/// The result of conjugate gradients.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The solution so far; zero at held degrees of freedom.
    pub x: Vec<f64>,
    /// Iterations.
    pub iterations: usize,
    /// `|r| / |b|` with the residual `r` of the recurrence, and `b` where degrees of freedom are free.
    pub residual: f64,
    /// `| |A| |start + x| |`.
    pub magnitude: f64,
    /// How they ended.
    pub ending: Ending,
}

/// The scalars of the recurrence on the device.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Recurrence {
    pub gamma: f32,
    pub alpha: f32,
    pub ended: u32,
    pub iterations: u32,
    pub now: f32,
    pub goal: f32,
    pub most: u32,
    pub unused: u32,
}

impl Recurrence {
    pub fn ending(&self) -> Ending {
        match self.ended {
            1 => Ending::Solved,
            2 => Ending::Indefinite,
            3 => Ending::NotFinite,
            _ => Ending::Spent,
        }
    }
}

impl Settings {
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !(self.tolerance > 0.0 && self.tolerance < 1.0)
            || self.max_iterations == 0
            || self.check_every == 0
        {
            return Err(Error::Input(format!(
                "conjugate gradients: tolerance {}, {} iterations, a check every {}; give a tolerance between 0 and 1, \
                 and at least one of the others",
                self.tolerance, self.max_iterations, self.check_every
            )));
        }
        Ok(())
    }
}
