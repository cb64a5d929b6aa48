//! The faces near a tool, found once for as long as body and tool move little: most of a surface is far away from it, at
//! every linearization of a frame.

use super::ActiveTool;
use crate::mesh::{norm, sub};

/// How far from a tool and its layer a face is near, over the reach of the tool.
const NEAR: f64 = 0.25;

/// The faces near a tool, where it and the body were when they were found.
#[derive(Clone, Debug, Default)]
pub struct Near {
    faces: Vec<usize>,
    /// No sample of the others has a smaller gap [m].
    beyond: f64,
    position: [f64; 3],
    /// Empty before the first time.
    u: Vec<f64>,
}

impl Near {
    /// How far a sample and the tool have moved towards each other at most since then [m].
    fn moved(&self, position: [f64; 3], u: &[f64], bulge: f64) -> f64 {
        if self.u.len() != u.len() {
            return f64::INFINITY;
        }
        let (now, then) = (u.as_chunks::<3>().0, self.u.as_chunks::<3>().0);
        let squares = now.iter().zip(then).map(|(a, b)| sub(*a, *b).map(|w| w * w));
        let farthest = squares.map(|[x, y, z]| x + y + z).fold(0.0, f64::max);
        bulge * farthest.sqrt() + norm(sub(position, self.position))
    }
}

impl ActiveTool {
    /// Finds the samples that touch at `u` and the smallest gap, as [`ActiveTool::linearize`]: among the faces near the tool
    /// or, if none of them is as close as others may be, among all.
    pub(super) fn meet_near(&mut self, u: &[f64], start: &[f64]) {
        let (position, bulge) = (self.pose.position, self.samples.bulge());
        let mut moved = self.near.moved(position, u, bulge);
        if moved > NEAR * self.tool.shape.reach() {
            self.find_near(u);
            moved = 0.0;
        }
        let near = std::mem::take(&mut self.near);
        self.meet_on(near.faces.iter().copied(), u, start);
        if self.gap > near.beyond - moved {
            self.meet_on(0..self.samples.n_faces(), u, start);
        }
        self.near = near;
    }

    /// Finds the near faces anew next time.
    #[cfg(test)]
    pub(in super::super) fn forget_near(&mut self) {
        self.near = Near::default();
    }

    fn find_near(&mut self, u: &[f64]) {
        let samples = self.samples.clone();
        let most = samples.out_of_layer(self.tool.stiffness) + NEAR * self.tool.shape.reach();
        let Near { faces, beyond, .. } = &mut self.near;
        faces.clear();
        *beyond = f64::INFINITY;
        for (number, (face, _)) in samples.by_face().enumerate() {
            let (middle, radius) = face.ball(u);
            let least = norm(sub(middle, self.pose.position)) - self.tool.shape.reach() - radius;
            if least > most {
                *beyond = beyond.min(least);
            } else {
                faces.push(number);
            }
        }
        self.near.position = self.pose.position;
        self.near.u.clear();
        self.near.u.extend_from_slice(u);
    }
}
