//! The faces near a tool, found once for as long as body and tool move little: most of a surface is far away from it.

use super::ActiveTool;
use crate::mesh::{norm, sub};

/// How far from a tool and its layer a face is near, over the reach of the tool.
const NEAR: f64 = 0.25;

/// The faces near a tool, where it and the body were when they were found.
#[derive(Clone, Debug, Default)]
pub struct Near {
    faces: Vec<usize>,
    /// No sample of the other faces had a smaller gap [m].
    beyond: f64,
    position: [f64; 3],
    /// Empty before the first time.
    u: Vec<f64>,
}

impl Near {
    pub fn faces(&self) -> impl Iterator<Item = usize> {
        self.faces.iter().copied()
    }

    /// How far a sample and the tool have moved towards each other at most since then [m].
    fn moved(&self, position: [f64; 3], u: &[f64], bulge: f64) -> f64 {
        let (now, then) = (u.as_chunks::<3>().0, self.u.as_chunks::<3>().0);
        let squares = now.iter().zip(then).map(|(a, b)| sub(*a, *b).map(|w| w * w));
        let farthest = squares.map(|[x, y, z]| x + y + z).fold(0.0, f64::max);
        bulge * farthest.sqrt() + norm(sub(position, self.position))
    }
}

impl ActiveTool {
    /// Finds the faces near the tool at `u` anew, if body or tool have moved far since they were found. Returns the least gap
    /// that a sample of another face can have.
    pub(super) fn find_near(&mut self, u: &[f64]) -> f64 {
        let margin = NEAR * self.tool.shape.reach();
        if !self.near.u.is_empty() {
            let moved = self.near.moved(self.pose.position, u, self.samples.bulge());
            if moved <= margin {
                return self.near.beyond - moved;
            }
        }
        let samples = self.samples.clone();
        let most = samples.out_of_layer(self.tool.stiffness) + margin;
        let mut near = std::mem::take(&mut self.near);
        near.faces.clear();
        near.beyond = f64::INFINITY;
        for (number, (face, _)) in samples.by_face().enumerate() {
            let (middle, radius) = face.ball(u);
            let least = self.least(middle) - radius;
            if least > most {
                near.beyond = near.beyond.min(least);
            } else {
                near.faces.push(number);
            }
        }
        near.position = self.pose.position;
        near.u.clear();
        near.u.extend_from_slice(u);
        self.near = near;
        self.near.beyond
    }

    /// The near faces are to be found anew.
    #[cfg(test)]
    pub(in super::super) fn forget_near(&mut self) {
        self.near = Near::default();
    }
}
