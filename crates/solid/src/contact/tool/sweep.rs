//! How far a tool moves through a body in one step. One whose spine has passed the surface before the body could give way
//! would be pushed out on the other side.

use super::{ActiveTool, Tool};
use crate::body::Body;
use crate::contact::entry::{Way, depth, first_met, holds, meets, spine};
use crate::contact::pose::Pose;
use crate::mesh::{norm, sub};

/// Poses on the way that are looked at, at most.
const POSES: usize = 64;

/// Distance from one to the next, over the depth of the spine.
const SPACING: f64 = 0.5;

/// What is known of a tool that may be inside the body or come through it.
pub(super) struct Passage {
    /// See [`spine`].
    spine: Vec<[f64; 3]>,
    /// See [`depth`].
    pub depth: f64,
    /// The pose at the end of the last step that left the spine outside of the body.
    outside: Pose,
    /// Whether the body held the spine when that was last asked.
    is_held: bool,
    /// See [`ActiveTool::find_sweep`]; of the last step.
    is_swept: bool,
    /// See [`ActiveTool::find_entry`]; when that was last asked.
    pub is_inside: bool,
}

impl Passage {
    pub fn new(tool: &Tool) -> Self {
        let spine = spine(&tool.shape);
        let depth = depth(&tool.shape, &spine);
        let outside = tool.pose;
        Passage { spine, depth, outside, is_held: false, is_swept: false, is_inside: false }
    }

    /// Ends a step at a pose.
    pub fn end(&mut self, pose: &Pose) {
        if !self.is_held {
            self.outside = *pose;
        }
    }

    fn spine_in(&self, pose: &Pose) -> Vec<[f64; 3]> {
        self.spine.iter().map(|x| pose.outward(*x)).collect()
    }
}

impl ActiveTool {
    /// Whether it was inside the body or came through it when that was last asked.
    pub fn is_inside(&self) -> bool {
        self.passage.is_inside
    }

    /// Whether its spine is inside a body displaced by `u`, although no sample of the surface need touch it.
    pub fn is_in(&self, body: &Body, u: &[f64]) -> bool {
        holds(body, u, &self.passage.spine_in(&self.pose))
    }

    /// Finds whether it is inside a body displaced by `u`, or has come through it in this step, at whose start the body was
    /// displaced by `start`: from where its spine was outside last it has crossed the body, where that is and where it was.
    pub fn find_entry(&mut self, body: &Body, start: &[f64], u: &[f64]) {
        let Passage { is_swept, ref outside, .. } = self.passage;
        let ways = ways(&self.passage.spine_in(outside), &self.passage.spine_in(&self.pose));
        let leads_inside = meets(body, u, &ways);
        let is_held = leads_inside && self.is_in(body, u);
        let comes_through = leads_inside && !is_held && meets(body, start, &ways);
        self.passage.is_held = is_held;
        self.passage.is_inside = is_swept || is_held || comes_through;
    }

    /// The part of the load, above `from` and at most `to`, up to which the spine stays outside of a body displaced by `u`; a
    /// first stretch of the way it goes in any case. One with friction turns no farther than a load step may.
    pub fn reaches(&self, body: &Body, u: &[f64], from: f64, to: f64) -> f64 {
        let to = self.turned_to(from, to);
        let at = |part: f64| self.passage.spine_in(&self.tool.pose_at(from + (to - from) * part));
        let count = self.poses_along(&at(0.0), &at(1.0));
        let places: Vec<_> = (0..=count).map(|k| at(k as f64 / count as f64)).collect();
        match first_met(body, u, &stretches(&places)) {
            Some(first) => from + (to - from) * first.max(1) as f64 / count as f64,
            None => to,
        }
    }

    /// Finds whether its spine, outside of a body displaced by `u` at the end of the last step, has come to a place inside and
    /// gone on from there farther than its own depth: so far that the body cannot give way.
    pub fn find_sweep(&mut self, body: &Body, u: &[f64]) {
        self.passage.is_swept = self.sweeps(body, u);
    }

    fn sweeps(&self, body: &Body, u: &[f64]) -> bool {
        let [from, to] = [&self.before, &self.pose].map(|pose| self.passage.spine_in(pose));
        let way = longest_way(&from, &to);
        if way <= self.passage.depth || holds(body, u, &from) {
            return false;
        }
        let count = self.poses_along(&from, &to);
        let seen = ((1.0 - self.passage.depth / way) * count as f64).ceil() as usize;
        let at = |k: usize| -> Vec<[f64; 3]> {
            let part = k as f64 / count as f64;
            let between = |(a, b): (&[f64; 3], &[f64; 3])| {
                std::array::from_fn(|i| (1.0 - part) * a[i] + part * b[i])
            };
            from.iter().zip(&to).map(between).collect()
        };
        let places: Vec<_> = (0..=seen.min(count)).map(at).collect();
        first_met(body, u, &stretches(&places)).is_some()
    }

    /// Poses between two places of the spine, the last one included.
    fn poses_along(&self, from: &[[f64; 3]], to: &[[f64; 3]]) -> usize {
        let count = longest_way(from, to) / (SPACING * self.passage.depth);
        // As an integer, what is no number is none, and what is too large the largest.
        (count.ceil() as usize).clamp(1, POSES)
    }
}

/// The ways of points from some places to others.
fn ways(from: &[[f64; 3]], to: &[[f64; 3]]) -> Vec<Way> {
    from.iter().zip(to).map(|(a, b)| [*a, *b]).collect()
}

/// Those from each set of places to the next.
fn stretches(places: &[Vec<[f64; 3]>]) -> Vec<Vec<Way>> {
    places.windows(2).map(|pair| ways(&pair[0], &pair[1])).collect()
}

/// Longest way of a point [m].
fn longest_way(from: &[[f64; 3]], to: &[[f64; 3]]) -> f64 {
    from.iter().zip(to).map(|(a, b)| norm(sub(*b, *a))).fold(0.0, f64::max)
}
