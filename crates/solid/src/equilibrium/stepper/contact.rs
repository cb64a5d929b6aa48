//! Contact in frames: rigid tools reach their poses, and the body gives way; surfaces that come together are coupled.

use super::Stepper;
use crate::body::Body;
use crate::clock::Instant;
use crate::contact::{Contact, Pose, Tool};
use crate::equilibrium::system::{ConstrainedSystem, mean_rows};
use crate::error::Error;
use crate::number::norm;
use std::sync::Arc;

/// Part of the initial power of a step. If the final power has the opposite sign and exceeds it, the step was too long.
pub(super) const OVERSHOT: f64 = 0.2;
/// Largest number of places that are tried on the way back.
pub(super) const MAX_RETURNS: usize = 6;
/// Least part of what lies between a place before the balance and one beyond it that the next try leaves behind: beyond,
/// a stiff layer may have a power hundreds of times as large.
pub(super) const LEAST_PART: f64 = 0.1;

/// A change of friction is followed if it exceeds this part of the residual at which a frame is settled, and this part of the
/// residual that the step of the same number left in the last frame.
const FELT: f64 = 0.8;
const FELT_BESIDE: f64 = 0.2;
/// How often a step is followed up at most.
const MAX_FOLLOWED: usize = 3;

/// Iterations that go on with one step of contact, over frames. Where friction goes in circles, a new one sets out elsewhere.
const MOST_UNSETTLED: usize = 60;

impl Stepper {
    /// Contact begins a step, or goes on with that of the last frame. A frame of few iterations is not in equilibrium: where
    /// hands, tools and loads stay, the next one solves for the same, with what friction ties and on the pieces that are
    /// kept.
    pub(super) fn begin_contact(&mut self, all_stay: bool) {
        let is_unsettled = (1..MOST_UNSETTLED).contains(&self.unsettled);
        if all_stay && is_unsettled && self.motion.is_none() {
            self.contact.go_on(&self.displacement);
        } else {
            self.unsettled = 0;
            self.contact.begin(&self.displacement);
        }
    }

    /// Adds a tool, from the next frame on; returns its number.
    ///
    /// # Errors
    /// Values out of range; a tool that starts inside the body.
    pub fn add_tool(&mut self, body: &Body, tool: Tool) -> Result<usize, Error> {
        self.extrapolation.forget();
        self.contact.add(body, tool, &self.displacement)
    }

    /// Sets the pose of a tool in the next frame.
    ///
    /// # Errors
    /// No such tool; a pose that is not finite, or no rotation.
    pub fn place_tool(&mut self, tool: usize, pose: Pose) -> Result<(), Error> {
        self.contact.place(tool, pose)
    }

    /// Removes a tool with the next frame.
    pub fn remove_tool(&mut self, tool: usize) {
        self.extrapolation.forget();
        self.contact.remove(tool);
    }

    /// The contacts of the tools in the last frame.
    pub fn contact(&self) -> &Contact {
        &self.contact
    }

    /// Corrects a step for friction. The tangent, which is symmetric, holds the bounds of friction; at the end of the step the
    /// pressures give others. What that changes of the forces is balanced with the factor that there is, until it is too small
    /// to matter. Returns the iterations of the linear solver.
    pub(super) fn follow_friction(
        &mut self,
        number: usize,
        deadline: Option<Instant>,
    ) -> Result<usize, Error> {
        let mut iterations = 0;
        if !self.follows_friction || !self.contact.slides() {
            return Ok(iterations);
        }
        let last_frame = self.residuals.get(number).copied().unwrap_or(0.0);
        let felt = (FELT * self.settings.settled * self.magnitude).max(FELT_BESIDE * last_frame);
        let n = self.step.len();
        let [mut known, mut change, mut answer] = [(); 3].map(|()| vec![0.0; n]);
        let mut last = f64::INFINITY;
        for _ in 0..MAX_FOLLOWED {
            change.fill(0.0);
            self.contact.add_change_of_friction(&self.step, &mut change);
            known.iter_mut().zip(&change).for_each(|(known, change)| *known = change - *known);
            let size = norm(&known);
            if size <= felt || size >= last {
                break;
            }
            iterations += self.solver.respond(&known, &mut answer, deadline)?;
            self.step.iter_mut().zip(&answer).for_each(|(step, by)| *step += by);
            self.increment.iter_mut().zip(&answer).for_each(|(free, by)| *free += by);
            last = size;
            std::mem::swap(&mut known, &mut change);
        }
        Ok(iterations)
    }

    /// Takes a wider pattern for the tangent where surfaces have come to touch that it does not couple.
    pub(super) fn widen(&mut self, body: &Body) -> Result<(), Error> {
        let known = self.widened.as_deref().unwrap_or(body).pattern();
        if !self.contact.is_beyond(known, &self.displacement) {
            return Ok(());
        }
        let wider = body.widened(&self.displacement);
        let fixed = self.fixed.iter().copied();
        self.solver =
            ConstrainedSystem::new(self.settings.method, &wider, fixed, Vec::new())?.for_frames();
        let mut rows = mean_rows(&self.patches);
        rows.extend(self.turning.iter().flat_map(|turning| turning.rows.clone()));
        self.solver.hold(&self.grasped, rows);
        self.tangent = self.settings.method.tangent(&wider);
        if let Some(motion) = &mut self.motion {
            motion.mass.place(wider.pattern());
        }
        if let Some(relaxation) = &mut self.relaxation {
            relaxation.place(wider.pattern());
        }
        self.widened = Some(Arc::new(wider));
        Ok(())
    }
}
