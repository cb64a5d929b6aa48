//! How far a tool moves through a body in one step. One whose spine has passed the surface before the body could give way
//! would be pushed out on the other side.

use super::ActiveTool;
use crate::body::Body;
use crate::contact::entry::{first_held, holds};
use crate::contact::pose::Pose;
use crate::mesh::{norm, sub};

/// Poses on the way that are looked at, at most.
const POSES: usize = 64;

/// Distance from one to the next, over the depth of the spine.
const SPACING: f64 = 0.5;

impl ActiveTool {
    /// Whether it is inside the body, although no sample of the surface need touch it.
    pub fn enters(&self, body: &Body, u: &[f64]) -> bool {
        holds(body, u, &self.spine_in(&self.pose))
    }

    /// The part of the load, above `from` and at most `to`, up to which the spine stays outside of a body displaced by `u`; a
    /// first stretch of the way it goes in any case.
    pub fn reaches(&self, body: &Body, u: &[f64], from: f64, to: f64) -> f64 {
        let at = |part: f64| self.spine_in(&self.tool.pose_at(from + (to - from) * part));
        let count = self.poses_along(&at(0.0), &at(1.0));
        let places: Vec<_> = (1..=count).map(|k| at(k as f64 / count as f64)).collect();
        match first_held(body, u, &places) {
            Some(first) => from + (to - from) * first.max(1) as f64 / count as f64,
            None => to,
        }
    }

    /// Whether its spine, outside of a body displaced by `u` at the end of the last step, has come to a place inside and
    /// gone on from there farther than its own depth.
    pub fn sweeps(&self, body: &Body, u: &[f64]) -> bool {
        let [from, to] = [&self.before, &self.pose].map(|pose| self.spine_in(pose));
        let way = longest_way(&from, &to);
        if way <= self.depth {
            return false;
        }
        let count = self.poses_along(&from, &to);
        let seen = ((1.0 - self.depth / way) * count as f64).ceil() as usize;
        let at = |k: usize| -> Vec<[f64; 3]> {
            let part = k as f64 / count as f64;
            let between = |(a, b): (&[f64; 3], &[f64; 3])| {
                std::array::from_fn(|i| (1.0 - part) * a[i] + part * b[i])
            };
            from.iter().zip(&to).map(between).collect()
        };
        first_held(body, u, &(0..=seen.min(count)).map(at).collect::<Vec<_>>())
            .is_some_and(|k| k > 0)
    }

    /// Poses between two places of the spine, the last one included.
    fn poses_along(&self, from: &[[f64; 3]], to: &[[f64; 3]]) -> usize {
        let count = longest_way(from, to) / (SPACING * self.depth);
        // As an integer, what is no number is none, and what is too large the largest.
        (count.ceil() as usize).clamp(1, POSES)
    }

    fn spine_in(&self, pose: &Pose) -> Vec<[f64; 3]> {
        self.spine.iter().map(|x| pose.outward(*x)).collect()
    }
}

/// Longest way of a point [m].
fn longest_way(from: &[[f64; 3]], to: &[[f64; 3]]) -> f64 {
    from.iter().zip(to).map(|(a, b)| norm(sub(*b, *a))).fold(0.0, f64::max)
}
