//! How far a step may go before the body is much deeper in a tool than it was.

use super::super::shape::Shape;
use super::ActiveTool;
use crate::mesh::{dot, norm};

/// How much deeper a step may lead a sample into a tool, over the depth of the tool's middle: what is beyond the middle is
/// pushed out on the other side.
const DEEPER: f64 = 0.5;

impl ActiveTool {
    /// The part of a step, possibly more than all of it, that leads no sample much deeper into the tool. The gap of a convex
    /// shape is convex, and along a step at least what the normal says. That of a closed surface falls at most as fast as the
    /// sample moves; samples that move away from its nearest point are not held back.
    ///
    /// A half-space has no other side. Of a body that next to nothing holds above it, a step may still be longer than any
    /// number of halvings makes short enough: it leads no deeper than the `diagonal` of the body.
    pub(in super::super) fn longest(&self, u: &[f64], step: &[f64], diagonal: f64) -> f64 {
        let deeper = (DEEPER * self.passage.depth).min(diagonal);
        let is_convex = !matches!(self.tool.shape, Shape::Solid(_));
        let fast = self.samples.by_face().filter(|(face, _)| face.speed(step) > deeper);
        let mut longest = f64::INFINITY;
        for sample in fast.flat_map(|(_, on_it)| on_it) {
            let (x, moved) = (self.samples.place(sample, u), self.samples.mean(sample, step));
            let speed = norm(moved);
            let out_of_reach = self.least(x) > speed;
            if speed <= deeper || out_of_reach || self.bond(sample).is_some() {
                continue;
            }
            let distance = self.distance(&self.pose, x);
            let towards = -dot(moved, distance.normal);
            let approach = if is_convex || towards <= 0.0 { towards } else { speed };
            if approach > 0.0 {
                longest = longest.min((distance.gap.max(0.0) + deeper) / approach);
            }
        }
        longest
    }
}
