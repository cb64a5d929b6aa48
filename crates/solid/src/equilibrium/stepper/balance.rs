//! The residual before a step, with the motion of the hands and inertia, and after it.

use super::pressed::Linearization;
use super::regions::{magnitude, square};
use super::{Input, Stepper};
use crate::body::{Body, Curvature};

/// Relative residual that is reported if the residual is rounding.
const ROUNDED: f64 = 1e-9;

/// Part of the residual at which a frame is settled that its linear systems may leave; with tools or pairs, whose frames mostly end
/// with more than that out of balance.
const NEGLIGIBLE: f64 = 0.01;
const NEGLIGIBLE_IN_CONTACT: f64 = 0.1;

/// Part of a body's length that is no motion: hands end where they were to be, but for rounding.
const STILL: f64 = 1e-15;

impl Stepper {
    /// Tells the solver; with inertia, the acceleration of the start, where it is not known, and the terms of the frame.
    pub(super) fn begin_frame(&mut self) {
        let part = if self.contact.is_empty() { NEGLIGIBLE } else { NEGLIGIBLE_IN_CONTACT };
        let enough = part * self.settings.settled * self.magnitude;
        let extrapolated = self.extrapolated_force();
        self.solver.begin_frame(enough, extrapolated);
        let Some(motion) = &mut self.motion else {
            return;
        };
        let solver = &self.solver;
        if !motion.has_started {
            // M a = f_ext - f_int - C v
            let [alpha, beta] = motion.damping;
            self.tangent.multiply(&motion.velocity, &mut self.residual);
            for (dof, r) in self.residual.iter_mut().enumerate() {
                *r = self.external[dof] - self.internal[dof] - beta * *r;
            }
            motion.mass.add_product(-alpha, &motion.velocity, &mut self.residual);
            solver.project(&mut self.residual);
            motion.acceleration =
                motion.mass.accelerations(&self.residual, &|dof| solver.is_held(dof));
            motion.has_started = true;
        }
        motion.begin(self.contact.touches(), solver.rows(), |dof| solver.is_held(dof));
    }

    /// The increment of what is held, in `step`; and with it the motion that the frame would end with.
    pub(super) fn move_hands(&mut self, input: &Input<'_>) {
        self.step.fill(0.0);
        for (&dof, value) in self.grasped.iter().zip(input.values) {
            self.step[dof as usize] =
                self.motion_fraction * (value - self.displacement[dof as usize]);
        }
        if let Some(motion) = &mut self.motion {
            let (u, start, step) = (&self.displacement, &self.start, &self.step);
            let solver = &self.solver;
            motion.follow(|dof| u[dof] - start[dof] + step[dof], |dof| solver.is_held(dof));
        }
    }

    /// `f_ext - f_int - K s - M a - C v` with the step `s` of the hands, in `residual`; the tangent becomes that of
    /// the frame.
    pub(super) fn balance(&mut self, body: &Body, curvature: Curvature) {
        if let Some(damping) = &mut self.stiffness_damping {
            damping.linearize(&self.displacement, curvature);
        }
        let beta = self.motion.as_ref().map_or(0.0, |motion| motion.damping[1]);
        self.increment.copy_from_slice(&self.step);
        if let Some(motion) = self.motion.as_ref().filter(|_| beta > 0.0) {
            self.increment.iter_mut().zip(&motion.trial_velocity).for_each(|(w, v)| *w += beta * v);
        }
        if self.increment.iter().any(|&w| w.abs() > STILL * self.length) {
            self.tangent.multiply(&self.increment, &mut self.residual);
        } else {
            self.residual.fill(0.0);
        }
        for (dof, r) in self.residual.iter_mut().enumerate() {
            *r = self.external[dof] - self.internal[dof] - *r;
        }
        if let Some(motion) = &self.motion {
            let (mass, alpha) = (&motion.mass, motion.damping[0]);
            mass.add_product(-1.0, &motion.trial_acceleration, &mut self.residual);
            if alpha > 0.0 {
                mass.add_product(-alpha, &motion.trial_velocity, &mut self.residual);
            }
            let [of_mass, of_stiffness] = motion.tangent_factors();
            if beta > 0.0 {
                self.tangent.scale(of_stiffness);
            }
            mass.add_to(of_mass, self.tangent.blocks_mut());
        }
        self.stiffen(body, curvature);
    }

    /// What is out of balance where the body is, in `residual`, and its size relative to the nodal forces of its
    /// [region](super::regions::Regions); with what the tools feel, and the motion that a frame would end with.
    pub(super) fn measure(&mut self, body: &Body, is_cut: bool) -> f64 {
        self.press(body, Linearization::Here);
        let mut scale = Vec::new();
        self.regions.raise(&mut scale, &self.internal);
        self.regions.raise(&mut scale, &self.external);
        self.inertia.fill(0.0);
        if let Some(motion) = &mut self.motion {
            let (u, start, solver) = (&self.displacement, &self.start, &self.solver);
            let increment = |dof: usize| u[dof] - start[dof];
            motion.follow(increment, |dof| solver.is_held(dof));
            if is_cut {
                motion.soften(increment);
            }
            let (velocity, acceleration) = (&motion.trial_velocity, &motion.trial_acceleration);
            motion.mass.add_product(1.0, acceleration, &mut self.inertia);
            self.regions.raise(&mut scale, &self.inertia);
            let [alpha, _] = motion.damping;
            motion.mass.add_product(alpha, velocity, &mut self.inertia);
            if let Some(damping) = &mut self.stiffness_damping {
                damping.velocity.copy_from_slice(velocity);
                // K of the last iteration's start, out of its tangent `of_mass M + of_stiffness K` and that of loads.
                let [of_mass, of_stiffness] = motion.tangent_factors();
                self.tangent.multiply(velocity, &mut self.increment);
                motion.mass.add_product(-of_mass, velocity, &mut self.increment);
                let (u, product) = (&damping.displacement, &mut self.increment);
                self.pressure.add_product(body, u, -1.0, velocity, product);
                self.contact.add_product(-1.0, velocity, product);
                let factor = damping.beta / of_stiffness;
                self.inertia.iter_mut().zip(&self.increment).for_each(|(r, k)| *r += factor * k);
            }
        }
        for (dof, r) in self.residual.iter_mut().enumerate() {
            *r = self.external[dof] - (self.internal[dof] + self.inertia[dof]);
        }
        self.forces = self.solver.patch_forces(&self.residual);
        self.solver.project(&mut self.residual);
        let relative = self.regions.relative(&self.residual, &scale, &self.rounding, ROUNDED);
        let norm = square(&self.residual).sqrt();
        let is_of_one = scale.len() == 1 || relative == 0.0;
        self.magnitude = if is_of_one { magnitude(&scale) } else { norm / relative };
        relative
    }

    /// Keeps what the step of a number has left out of balance, relative to all nodal forces.
    pub(super) fn keep_residual(&mut self, number: usize, residual: f64) {
        if self.residuals.len() <= number {
            self.residuals.resize(number + 1, 0.0);
        }
        self.residuals[number] = residual * self.magnitude;
    }

    /// Ends a frame: the motion is that of the last measurement, and what is remembered becomes the past.
    pub(super) fn end(&mut self, body: &Body) {
        self.contact.end(&self.displacement);
        if let Some(relaxation) = &mut self.relaxation {
            relaxation.end(body.material(), &self.displacement);
        }
        if let Some(motion) = &mut self.motion {
            if self.contact.touches() {
                let (u, start) = (&self.displacement, &self.start);
                motion.end_in_contact(|dof| u[dof] - start[dof]);
            }
            motion.end();
            self.internal.iter_mut().zip(&self.inertia).for_each(|(f, i)| *f += i);
        }
    }
}
