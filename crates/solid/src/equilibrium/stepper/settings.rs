//! Settings of a stepper: solver, time, inertia, relaxation, budget.

use super::relaxation::Prony;
use crate::equilibrium::Method;
use crate::error::Error;

/// Settings of a stepper; the default is quasi-static with a direct solver.
#[derive(Clone, Debug, PartialEq)]
pub struct StepperSettings {
    /// How the linear systems are solved.
    pub method: Method,
    /// Largest number of Newton iterations in a frame; 1 in
    /// *Implementation and Evaluation of Hyperelastic Model for Surgical Simulator and Navigation*.
    pub iterations: usize,
    /// Residual at which a frame counts as settled, and needs no further iteration.
    pub settled: f64,
    /// Whether a frame sets out from where the motion of the last one leads, as far as hands and tools repeat theirs; with
    /// inertia it always sets out from the last state.
    pub extrapolates: bool,
    /// Wall time [s] after which a frame stops iterating.
    pub budget: Option<f64>,
    /// Time between frames [s], for inertia and relaxation.
    pub time_step: Option<f64>,
    /// Density, one or one per cell, for gravity and inertia [kg/m^3]; none if empty.
    pub density: Vec<f64>,
    /// Inertia and damping; quasi-static without.
    pub dynamics: Option<Dynamics>,
    /// Viscoelasticity.
    pub relaxation: Option<Prony>,
}

impl Default for StepperSettings {
    fn default() -> Self {
        StepperSettings {
            method: Method::default(),
            iterations: 1,
            settled: 1e-3,
            extrapolates: true,
            budget: None,
            time_step: None,
            density: Vec::new(),
            dynamics: None,
            relaxation: None,
        }
    }
}

/// Settings of inertia: `M a + C v + f_int(u) = f_ext`, `C = alpha M + beta K` with the tangent `K` of the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics {
    /// The rule in time.
    pub integration: Integration,
    /// The mass matrix.
    pub mass: Mass,
    /// Rayleigh's `alpha` [1/s] and `beta` [s].
    pub damping: [f64; 2],
}

/// Rules in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Integration {
    /// First order; damps motions that are fast compared with the time step.
    BackwardEuler,
    /// Newmark (1959). With beta = 1/4 and gamma = 1/2 of second order, without dissipation.
    Newmark {
        /// Weight of the new acceleration in the displacement.
        beta: f64,
        /// Weight of the new acceleration in the velocity.
        gamma: f64,
    },
}

/// Mass matrices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mass {
    /// A quarter of each cell's mass at each of its nodes.
    Lumped,
    /// The integral of density times products of shape functions.
    Consistent,
}

impl StepperSettings {
    /// # Errors
    /// A value out of range, or a missing value that another one needs.
    pub fn check(&self) -> Result<(), Error> {
        self.method.check()?;
        let positive = |name: &str, value: Option<f64>| match value {
            Some(value) if !(value > 0.0 && value.is_finite()) => {
                Err(Error::input(format!("{name} is {value} s; it must be positive")))
            }
            _ => Ok(()),
        };
        positive("time_step", self.time_step)?;
        positive("budget", self.budget)?;
        if self.iterations == 0 {
            return Err(Error::input("a frame needs at least one Newton iteration, got 0"));
        }
        if !(self.settled > 0.0 && self.settled < 1.0) {
            return Err(Error::input(format!(
                "settled is {}; give a relative residual between 0 and 1, 1e-3 for instance",
                self.settled
            )));
        }
        if let Some(relaxation) = &self.relaxation {
            relaxation.check()?;
        }
        let needs_time = self.dynamics.is_some() || self.relaxation.is_some();
        if needs_time && self.time_step.is_none() {
            return Err(Error::input("dynamics and relaxation need a time_step [s]"));
        }
        match &self.dynamics {
            Some(dynamics) => dynamics.check(&self.density),
            None => Ok(()),
        }
    }
}

impl Dynamics {
    fn check(&self, density: &[f64]) -> Result<(), Error> {
        if density.is_empty() {
            return Err(Error::input("dynamics needs a density [kg/m^3]"));
        }
        if self.damping.iter().any(|d| !(*d >= 0.0 && d.is_finite())) {
            return Err(Error::input(format!(
                "Rayleigh damping is {:?}; both factors must be finite and not negative",
                self.damping
            )));
        }
        if let Integration::Newmark { beta, gamma } = self.integration {
            // Unconditionally stable for 2 beta >= gamma >= 1/2.
            if !(gamma >= 0.5 && 2.0 * beta >= gamma && beta.is_finite()) {
                return Err(Error::input(format!(
                    "Newmark with beta = {beta} and gamma = {gamma} is not stable for every time step; \
                     choose 2 beta >= gamma >= 1/2"
                )));
            }
        }
        Ok(())
    }
}
