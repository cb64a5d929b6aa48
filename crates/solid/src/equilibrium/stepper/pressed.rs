//! Loads in frames that follow the body at every iteration: pressure on its surface, and contact.
//!
//! The tangent of a frame has the symmetric part of its derivative, which is all of it on a closed surface or one whose
//! rim is held. On a free rim frames lose their quadratic convergence and find the same equilibrium.

use super::Stepper;
use crate::body::{Body, Curvature};
use crate::equilibrium::Pressure;
use crate::error::Error;

/// How the tools of a frame are linearized.
#[derive(Clone, Copy)]
pub(super) enum Linearization {
    /// Where body and tools are.
    Here,
    /// Tools lead what they touched: the first step from the last state.
    Led,
    /// Ahead by this part of the last motion: the first step from where that leads.
    Ahead(f64),
}

impl Stepper {
    /// This pressure, and no other, acts from the next frame on. It may change with every frame, as in a beating heart.
    ///
    /// # Errors
    /// Those of [`Pressure::check`].
    pub fn set_pressure(&mut self, body: &Body, pressure: Pressure) -> Result<(), Error> {
        if pressure.faces == self.pressure.faces {
            pressure.check_values()?;
        } else {
            pressure.check(body)?;
        }
        self.pressure = pressure;
        Ok(())
    }

    /// The external forces at the displacement, those of tools and torques among them.
    pub(super) fn press(&mut self, body: &Body, linearization: Linearization) {
        self.external.copy_from_slice(&self.dead);
        self.pressure.add_force(body, &self.displacement, 1.0, &mut self.external);
        for torque in &self.torques {
            torque.add_force(body, &self.displacement, &mut self.external);
        }
        match linearization {
            Linearization::Here => self.contact.linearize(&self.displacement),
            Linearization::Led => self.contact.lead(&self.displacement),
            Linearization::Ahead(part) => self.contact.linearize_ahead(&self.displacement, part),
        }
        self.contact.add_force(&mut self.external);
    }

    /// Adds the stiffness of pressure and contact to the tangent, and takes what they change by along the step of the
    /// hands from the residual. That comes after the rest, which damping multiplies: a load damps nothing.
    pub(super) fn stiffen(&mut self, body: &Body, curvature: Curvature) {
        let (u, step, residual) = (&self.displacement, &self.step, &mut self.residual);
        if !self.pressure.is_empty() {
            self.pressure.add_stiffness(body, u, 1.0, self.tangent.blocks_mut());
            self.pressure.add_product(body, u, -1.0, step, residual);
        }
        if !self.contact.is_empty() {
            self.contact.add_stiffness(curvature, self.tangent.blocks_mut());
            self.contact.add_product(-1.0, step, residual);
        }
    }
}
