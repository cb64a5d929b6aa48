//! Time: displacement, velocity and acceleration from frame to frame.
//!
//! With `D` the increment of a frame of length `h`, both rules read `a = c_a D - a*`, `v = c_v D - v*`:
//!   backward Euler:  c_a = 1/h^2,        c_v = 1/h,            a* = v/h,                         v* = 0;
//!   Newmark:         c_a = 1/(beta h^2), c_v = gamma/(beta h), a* = v/(beta h) + (1/(2 beta) - 1) a,
//!                    v* = (gamma/beta - 1) v + h (gamma/(2 beta) - 1) a.
//! What is held moves with the mean velocity of the frame: a hand's motion is given, and the trapezoidal rule would
//! make its velocity swing; the same for the [means](super::means) of patches. With Newmark's rule every impact would add energy, since the stiff forces of contact are those at
//! the end of a frame. So a frame that begins in contact follows backward Euler, and one in which contact begins ends with
//! its mean velocity.

use super::mass::MassMatrix;
use super::means::Means;
use super::{Dynamics, Integration};
use crate::equilibrium::system::Row;

/// The state of motion, with the terms a frame sets out with.
pub(super) struct Motion {
    pub mass: MassMatrix,
    pub damping: [f64; 2],
    /// That which was asked for, and that of the frame.
    integration: Integration,
    rule: Integration,
    time_step: f64,
    pub velocity: Vec<f64>,
    pub acceleration: Vec<f64>,
    /// Whether `acceleration` is that of the equation of motion.
    pub has_started: bool,
    /// What patches lead, under Newmark's rule; none until the first frame of what hands hold.
    means: Option<Means>,
    velocity_offset: Vec<f64>,
    acceleration_offset: Vec<f64>,
    /// Velocity and acceleration that end the frame after the displacement so far.
    pub trial_velocity: Vec<f64>,
    pub trial_acceleration: Vec<f64>,
}

impl Motion {
    pub fn new(dynamics: &Dynamics, time_step: f64, mass: MassMatrix, n_dofs: usize) -> Self {
        let zeros = || vec![0.0; n_dofs];
        Motion {
            mass,
            damping: dynamics.damping,
            integration: dynamics.integration,
            rule: dynamics.integration,
            time_step,
            velocity: zeros(),
            acceleration: zeros(),
            has_started: false,
            means: None,
            velocity_offset: zeros(),
            acceleration_offset: zeros(),
            trial_velocity: zeros(),
            trial_acceleration: zeros(),
        }
    }

    /// `[c_a, c_v]`.
    fn rates(&self) -> [f64; 2] {
        let h = self.time_step;
        match self.rule {
            Integration::BackwardEuler => [1.0 / (h * h), 1.0 / h],
            Integration::Newmark { beta, gamma } => [1.0 / (beta * h * h), gamma / (beta * h)],
        }
    }

    /// Factors of `M` and `K` in the tangent of a frame, `(c_a + c_v alpha) M + (1 + c_v beta) K`.
    pub fn tangent_factors(&self) -> [f64; 2] {
        let ([ca, cv], [alpha, beta]) = (self.rates(), self.damping);
        [ca + cv * alpha, 1.0 + cv * beta]
    }

    /// Other hands hold the body, or turn it.
    pub fn release(&mut self) {
        self.means = None;
    }

    /// Begins a frame, in contact with something or not; patches hold the means of these rows.
    pub fn begin(&mut self, touches: bool, rows: &[Row], is_held: impl Fn(usize) -> bool) {
        self.rule = if touches { Integration::BackwardEuler } else { self.integration };
        if self.rule != Integration::BackwardEuler && self.means.is_none() {
            self.means = Some(Means::new(rows, &self.mass, &is_held));
        }
        let h = self.time_step;
        for dof in 0..self.velocity.len() {
            let (v, a) = (self.velocity[dof], self.acceleration[dof]);
            let (velocity, acceleration) = match self.rule {
                Integration::Newmark { beta, gamma } if !is_held(dof) => (
                    (gamma / beta - 1.0) * v + h * (gamma / (2.0 * beta) - 1.0) * a,
                    v / (beta * h) + (0.5 / beta - 1.0) * a,
                ),
                _ => (0.0, v / h),
            };
            self.velocity_offset[dof] = velocity;
            self.acceleration_offset[dof] = acceleration;
        }
    }

    /// Velocity and acceleration that the displacement `D` within the frame means.
    pub fn follow(&mut self, increment: impl Fn(usize) -> f64, is_held: impl Fn(usize) -> bool) {
        let h = self.time_step;
        let free = self.rates();
        for dof in 0..self.velocity.len() {
            let [ca, cv] = if is_held(dof) { [1.0 / (h * h), 1.0 / h] } else { free };
            self.trial_velocity[dof] = cv * increment(dof) - self.velocity_offset[dof];
            self.trial_acceleration[dof] = ca * increment(dof) - self.acceleration_offset[dof];
        }
        if self.rule != Integration::BackwardEuler
            && let Some(means) = &self.means
        {
            means.lead(&mut self.trial_velocity, |dof| increment(dof) / h);
            let before = &self.velocity;
            means.lead(&mut self.trial_acceleration, |dof| (increment(dof) / h - before[dof]) / h);
        }
    }

    /// Ends a frame of Newmark's rule in which contact began.
    pub fn end_in_contact(&mut self, increment: impl Fn(usize) -> f64) {
        if self.rule != Integration::BackwardEuler {
            self.soften(increment);
        }
    }

    /// A frame that was cut back ends with its mean velocity and no acceleration, like a soft blow.
    pub fn soften(&mut self, increment: impl Fn(usize) -> f64) {
        for (dof, v) in self.trial_velocity.iter_mut().enumerate() {
            *v = increment(dof) / self.time_step;
        }
        self.trial_acceleration.fill(0.0);
    }

    /// Ends the frame with the velocity and the acceleration on trial.
    pub fn end(&mut self) {
        std::mem::swap(&mut self.velocity, &mut self.trial_velocity);
        std::mem::swap(&mut self.acceleration, &mut self.trial_acceleration);
    }
}
