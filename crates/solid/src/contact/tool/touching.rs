//! A sample that a tool touches: its force, and friction along the surface.

use super::super::friction::spring;
use crate::mesh::{dot, norm, sub};
use crate::tensor::Mat3;

/// Cosine between the directions of a slide in two iterations above which they count as the same.
pub(super) const STEADY: f64 = 0.5;

/// How far below its bound, relative to it, friction is at the bound.
const ROUNDING: f64 = 1e-6;

/// A sample that a tool touches.
#[derive(Clone, Debug)]
pub struct Touching {
    pub sample: usize,
    /// Where it is [m].
    pub place: [f64; 3],
    pub normal: [f64; 3],
    pub pressure: f64,
    /// Force on the body [N].
    pub force: [f64; 3],
    /// Its negative derivative [N/m]: the semidefinite part, and that by the curvature of the gap.
    pub stiffness: Mat3<f64>,
    pub curvature: Mat3<f64>,
    /// Fall of the force across the surface with the gap [N/m].
    pub fall: f64,
    /// Largest force along the surface [N]; none without friction.
    pub bound: f64,
    /// Which way it slides, zero where it sticks, and the force along the surface over the stretch [N/m].
    pub slide: [f64; 3],
    pub pull: f64,
    /// The point of the tool it is tied to, in the world.
    pub anchor: [f64; 3],
    pub energy: f64,
    /// What its slide has dissipated before the last part of the tool's way [J].
    pub dissipated: f64,
}

impl Touching {
    /// Whether it slides.
    pub fn slides(&self) -> bool {
        self.slide != [0.0; 3]
    }

    /// Adds friction, with the stiffness of a chord, which never makes a step too long.
    pub fn rub(&mut self, stiffness: f64, slid: [f64; 3]) {
        let n = self.normal;
        let stretch = along(sub(self.place, self.anchor), n);
        let size = norm(stretch);
        let [energy, _, pull] = spring(size, stiffness, self.bound);
        // What slid ends a step at the bound; it is to slide on in the next, not to stick to within rounding.
        let slack = if dot(stretch, slid) > STEADY * size { ROUNDING * self.bound } else { 0.0 };
        let is_sliding = stiffness * size > self.bound - slack;
        self.energy += if is_sliding { 0.5 * self.bound * self.bound / stiffness } else { energy };
        self.slide = if is_sliding { stretch.map(|s| s / size) } else { [0.0; 3] };
        self.pull = pull;
        for i in 0..3 {
            self.force[i] -= pull * stretch[i];
            for j in 0..3 {
                self.stiffness[i][j] += pull * (f64::from(i == j) - n[i] * n[j]);
            }
        }
    }
}

/// The part of a vector along the surface.
pub fn along(v: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let across = dot(v, normal);
    std::array::from_fn(|i| v[i] - across * normal[i])
}
