//! A sample of a surface that touches another one: its forces on the corners of both triangles, and their derivatives.
//!
//! With the place `x` of the sample, the closest point `y` of the other surface, the gap `g` between them along the normal
//! `n`, and the point `a` of the other surface that the sample is tied to, the stretch `s` of the tie is taken as
//!   `s^2 = |x - a|^2 - g^2`,
//! on a plane the distance of `a` from `y`. Its forces lie on the lines from `x` to `a` and from `x` to `y`, so force and
//! torque on both surfaces cancel.

use super::friction::{Friction, spring};
use crate::mesh::{dot, norm, sub};

/// Cosine between the directions of a slide in two iterations above which they count as the same.
const STEADY: f64 = 0.5;

/// Rise over a plane, relative to the distance from the origin, that is rounding.
const FLAT: f64 = 8.0 * f64::EPSILON;

/// How far below its bound, relative to it, friction is at the bound.
const ROUNDING: f64 = 1e-6;

/// A sample that touches.
#[derive(Clone)]
pub(super) struct Meeting {
    pub sample: usize,
    /// The corners of its triangle, then those of the other; what each adds to the gap along the normal.
    pub corners: [u32; 6],
    pub weights: [f64; 6],
    /// How fast the weights of the other triangle change in its plane [1/m].
    pub slopes: [[f64; 3]; 6],
    pub normal: [f64; 3],
    pub gap: f64,
    pub place: [f64; 3],
    pub area: f64,
    pub energy: f64,
    pub pressure: f64,
    /// Fall of the force with the gap [N/m].
    pub stiffness: f64,
    pub tie: Option<Tie>,
}

/// The spring of friction between a sample and a point of the other surface.
#[derive(Clone)]
pub(super) struct Tie {
    /// The corners of the triangle of the sample, then those of that of the point; the weights of `x - a`.
    pub corners: [u32; 6],
    pub weights: [f64; 6],
    /// `x - a` [m].
    pub offset: [f64; 3],
    /// Stiffness [N/m] and largest force [N].
    pub stiffness: f64,
    pub bound: f64,
    /// `y - a`, as long as the stretch on a plane, and the stretch [m].
    along: [f64; 3],
    stretch: f64,
    /// Force over stretch [N/m].
    pull: f64,
    /// Which way it slides; zero where it sticks.
    pub slide: [f64; 3],
    /// Whether it slid this way in the tangent before: then the tangent has no stiffness along the slide. For others,
    /// steps would oscillate between two directions.
    is_steady: bool,
}

impl Tie {
    pub fn new(corners: [u32; 6], weights: [f64; 6], stiffness: f64, bound: f64) -> Self {
        let zero = [0.0; 3];
        Tie {
            corners,
            weights,
            offset: zero,
            stiffness,
            bound,
            along: zero,
            stretch: 0.0,
            pull: 0.0,
            slide: zero,
            is_steady: false,
        }
    }

    /// How much of its stretch has become a slide: the part, and the energy dissipated [J].
    pub fn slip(&self) -> (f64, f64) {
        let most = self.bound / self.stiffness;
        let slip = (self.stretch - most).max(0.0);
        (if slip > 0.0 { slip / self.stretch } else { 0.0 }, self.bound * slip)
    }

    /// The stretch that is left of it.
    pub fn elastic(&self) -> [f64; 3] {
        let (slid, _) = self.slip();
        self.along.map(|s| (1.0 - slid) * s)
    }
}

/// The tie of a sample at a place, `offset` away from the point that it is tied to, with the gap along the normal: `y - a`, and
/// the stretch `s^2 = |y - a|^2 + 2 g n . (y - a)`. On a plane the last product is rounding of the place, which would be most of
/// what is left of a small stretch.
pub(super) fn stretch(
    place: [f64; 3],
    offset: [f64; 3],
    normal: [f64; 3],
    gap: f64,
) -> ([f64; 3], f64) {
    let along = sub(offset, normal.map(|n| gap * n));
    let rise = dot(normal, along);
    let rise = if rise.abs() > FLAT * norm(place) { rise } else { 0.0 };
    (along, (dot(along, along) + 2.0 * gap * rise).max(0.0).sqrt())
}

impl Meeting {
    /// Ties the sample, `offset` away from the point it is tied to; it slid this way in the tangent before.
    pub fn tie(&mut self, mut tie: Tie, offset: [f64; 3], slid: [f64; 3]) {
        tie.offset = offset;
        (tie.along, tie.stretch) = stretch(self.place, offset, self.normal, self.gap);
        let [energy, _, pull] = spring(tie.stretch, tie.stiffness, tie.bound);
        let size = norm(tie.along);
        let is_steady = dot(tie.along, slid) > STEADY * size;
        // What slid ends a step at the bound; it is to slide on in the next, not to stick to within rounding.
        let slack = if is_steady { ROUNDING * tie.bound } else { 0.0 };
        let is_sliding = size > 0.0 && tie.stiffness * tie.stretch > tie.bound - slack;
        self.energy +=
            if is_sliding { 0.5 * tie.bound * tie.bound / tie.stiffness } else { energy };
        tie.slide = if is_sliding { tie.along.map(|s| s / size) } else { [0.0; 3] };
        (tie.pull, tie.is_steady) = (pull, is_sliding && is_steady);
        self.tie = Some(tie);
    }

    fn pull(&self) -> f64 {
        self.tie.as_ref().map_or(0.0, |tie| tie.pull)
    }

    /// Size of its force along the normal, at `x` and at `y` [N].
    fn across(&self) -> f64 {
        self.area * self.pressure + self.pull() * self.gap
    }

    /// Force on the sampled surface [N].
    pub fn force(&self) -> [f64; 3] {
        let offset = self.tie.as_ref().map_or([0.0; 3], |tie| tie.offset);
        std::array::from_fn(|i| self.across() * self.normal[i] - self.pull() * offset[i])
    }

    /// Whether it slides.
    pub fn slides(&self) -> bool {
        self.tie.as_ref().is_some_and(|tie| tie.slide != [0.0; 3])
    }

    /// Calls with each corner and its force [N].
    pub fn each_force(&self, add: impl FnMut(u32, [f64; 3])) {
        self.each_force_of(self.across(), self.pull(), add);
    }

    /// Calls with each corner and its share of a force across the surfaces [N], and of that of a tie with this force over its
    /// stretch [N/m].
    fn each_force_of(&self, across: f64, pull: f64, mut add: impl FnMut(u32, [f64; 3])) {
        let mut share = |corners: [u32; 6], weights: [f64; 6], whole: [f64; 3]| {
            let shares = corners.into_iter().zip(weights);
            shares.for_each(|(corner, weight)| add(corner, whole.map(|w| weight * w)));
        };
        share(self.corners, self.weights, self.normal.map(|n| across * n));
        if let Some(tie) = &self.tie {
            share(tie.corners, tie.weights, tie.offset.map(|d| -pull * d));
        }
    }

    /// Calls with each corner and what its force changes by along a step, which `moved` tells, if the sample slides: the bound
    /// of friction follows the pressure.
    pub fn each_change_of_friction(
        &self,
        friction: Friction,
        moved: impl Fn(u32) -> [f64; 3],
        add: impl FnMut(u32, [f64; 3]),
    ) {
        let Some(tie) = self.tie.as_ref().filter(|_| self.slides()) else { return };
        let corners = self.corners.iter().zip(self.weights);
        let opening: f64 = corners.map(|(&c, w)| w * dot(self.normal, moved(c))).sum();
        let across = self.area * self.pressure - self.stiffness * opening;
        let pull = (friction.bound(across.max(0.0)) - tie.bound) / tie.stretch;
        self.each_force_of(pull * self.gap, pull, add);
    }

    /// The same without what is not positive semidefinite in its derivative: the rotation of the normal.
    pub fn convex(&self) -> Self {
        let mut convex = Meeting { slopes: [[0.0; 3]; 6], ..self.clone() };
        convex.stiffness += self.pull(); // which [`Meeting::each_block`] takes off
        convex
    }

    /// Calls with row and column corner and the entries `[i][k]` of each block of the negative derivative of its forces, with
    /// the bound of friction as it is.
    ///
    /// With the weights `w`, the normal `n` and the slopes `s`, the block of corners a and b of the gap is
    ///   `A e'' w_a w_b n n + A p (w_a s_b n + w_b n s_a + g s_a . s_b n n)`,
    /// and a tie, whose force is `p` times the derivative of `s^2 / 2`, takes `p` off the first factor, adds `p g` to the
    /// second, and adds `p w_a w_b 1` with the weights of `x - a`; if it slides on, it takes the part along the slide off.
    pub fn each_block(&self, mut take: impl FnMut(u32, u32, [f64; 9])) {
        let (n, force, stiffness) = (self.normal, self.across(), self.stiffness - self.pull());
        for a in 0..6 {
            for b in 0..6 {
                let ([w, v], [s, t]) =
                    ([a, b].map(|k| self.weights[k]), [a, b].map(|k| self.slopes[k]));
                let along = stiffness * w * v + force * self.gap * dot(s, t);
                let entries = std::array::from_fn(|entry| {
                    let (i, k) = (entry / 3, entry % 3);
                    along * n[i] * n[k] + force * (w * t[i] * n[k] + v * n[i] * s[k])
                });
                take(self.corners[a], self.corners[b], entries);
            }
        }
        let Some(tie) = self.tie.as_ref().filter(|tie| tie.pull > 0.0) else { return };
        for a in 0..6 {
            for b in 0..6 {
                let factor = tie.pull * tie.weights[a] * tie.weights[b];
                let entries = std::array::from_fn(|entry| {
                    let (i, k) = (entry / 3, entry % 3);
                    let along = if tie.is_steady { tie.slide[i] * tie.slide[k] } else { 0.0 };
                    factor * (f64::from(i == k) - along)
                });
                take(tie.corners[a], tie.corners[b], entries);
            }
        }
    }
}
