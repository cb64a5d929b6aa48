//! Rigid tools in frames: where they are to be, they are, and the body gives way.

use super::Stepper;
use crate::body::Body;
use crate::contact::{Contact, Pose, Tool};
use crate::error::Error;

/// Part of the power that a step set out with beyond which, with the other sign, it has gone too far.
pub(super) const OVERSHOT: f64 = 0.5;
/// Times that a step may go back.
pub(super) const MAX_RETURNS: usize = 4;

impl Stepper {
    /// Adds a tool, from the next frame on; its number.
    ///
    /// # Errors
    /// Values out of range; a tool that starts inside the body.
    pub fn add_tool(&mut self, body: &Body, tool: Tool) -> Result<usize, Error> {
        self.contact.add(body, tool, &self.displacement)
    }

    /// Puts a tool elsewhere with the next frame.
    ///
    /// # Errors
    /// No such tool; a pose that is not finite, or no rotation.
    pub fn place_tool(&mut self, tool: usize, pose: Pose) -> Result<(), Error> {
        self.contact.place(tool, pose)
    }

    /// Takes a tool away with the next frame.
    pub fn remove_tool(&mut self, tool: usize) {
        self.contact.remove(tool);
    }

    /// What the tools did in the last frame.
    pub fn contact(&self) -> &Contact {
        &self.contact
    }
}
