//! Friction under a tool that turns. The point that a sample sticks to goes round on an arc, whose chord would have a slide
//! of the wrong length and, beyond half a turn, of the wrong direction. So the return mapping follows the arc in parts, and
//! statics takes load steps in which a tool with friction turns little.

use super::super::friction::Friction;
use super::super::pose::{Pose, rotated};
use super::touching::along;
use super::{ActiveTool, Anchor};
use crate::mesh::{cross, dot, norm, sub};
use std::f64::consts::PI;

/// Largest turn in a part of the way [rad]: its chord is shorter than the arc by 0.5 %.
const PART: f64 = PI / 18.0;

/// Largest turn of a tool with friction in a load step [rad]: the tissue follows it from one to the next.
const LOAD_STEP: f64 = PI / 6.0;

/// How many load steps more than a whole number are that number.
const ROUNDING: f64 = 1e-9;

/// Ratio of the arms of a sample below which it has no direction from the axis.
const ON_AXIS: f64 = 1e-9;

/// The way of a tool in one step.
#[derive(Default)]
pub(super) struct Walk {
    /// The poses between its parts; none if it turns so little that there is only one.
    between: Vec<Pose>,
    /// The unit vector about which it turns, and its origin at the start.
    axis: [f64; 3],
    origin: [f64; 3],
}

impl Walk {
    pub fn new(from: &Pose, to: &Pose) -> Self {
        let turn = from.turn_to(to);
        let angle = norm(turn);
        if angle <= PART {
            return Walk::default();
        }
        let (count, way) = ((angle / PART).ceil(), sub(to.position, from.position));
        let at = |k: usize| {
            let part = k as f64 / count;
            from.moved(way.map(|w| part * w), turn.map(|t| part * t))
        };
        Walk {
            between: (1..count as usize).map(at).collect(),
            axis: turn.map(|t| t / angle),
            origin: from.position,
        }
    }

    /// The poses between its parts, and where a sample is in each that goes from one place to another: about the axis, as
    /// far as it follows the tool, since what sticks goes round with it.
    fn along(&self, from: [f64; 3], to: [f64; 3]) -> impl Iterator<Item = (&Pose, [f64; 3])> {
        let [a, b] = [from, to].map(|x| sub(x, self.origin));
        let heights = [a, b].map(|arm| dot(arm, self.axis));
        let arm = |x: [f64; 3], height: f64| sub(x, self.axis.map(|n| height * n));
        let (a, b) = (arm(a, heights[0]), arm(b, heights[1]));
        let sizes = [norm(a), norm(b)];
        let is_round = sizes[0] > ON_AXIS * sizes[1] && sizes[1] > ON_AXIS * sizes[0];
        let angle = if is_round { dot(cross(a, b), self.axis).atan2(dot(a, b)) } else { 0.0 };
        let count = self.between.len() as f64 + 1.0;
        self.between.iter().zip(1..).map(move |(pose, k)| {
            let part = f64::from(k) / count;
            let mix = |a: f64, b: f64| (1.0 - part) * a + part * b;
            let arm = match is_round {
                true => {
                    let turned = rotated(self.axis.map(|n| part * angle * n), a);
                    turned.map(|x| mix(1.0, sizes[1] / sizes[0]) * x)
                }
                false => std::array::from_fn(|i| mix(a[i], b[i])),
            };
            let height = mix(heights[0], heights[1]);
            (pose, std::array::from_fn(|i| self.origin[i] + height * self.axis[i] + arm[i]))
        })
    }
}

impl ActiveTool {
    /// The load, at most `to`, up to which a tool with friction turns no farther than a load step may: equal parts of the way.
    pub(super) fn turned_to(&self, from: f64, to: f64) -> f64 {
        let angle = norm(self.tool.turn) * (to - from);
        if self.tool.friction.is_none() || angle <= LOAD_STEP {
            return to;
        }
        from + (to - from) / (angle / LOAD_STEP - ROUNDING).ceil()
    }

    /// The point of the world that a sample is tied to at the end of the way, and the energy [J] that its slide has dissipated
    /// before the last part of it, for a spring of a stiffness [N/m] with a bound [N]. One that did not touch before is tied
    /// where it first does.
    pub(super) fn walked(
        &self,
        sample: usize,
        [from, to]: [[f64; 3]; 2],
        stiffness: f64,
        bound: f64,
    ) -> ([f64; 3], f64) {
        let anchor = self.anchors[sample];
        let mut point = anchor.map_or_else(|| self.before.inward(from), |anchor| anchor.point);
        let mut dissipated = 0.0;
        if self.walk.between.is_empty() || bound == 0.0 {
            return (self.pose.outward(point), dissipated);
        }
        let mut touches = anchor.is_some();
        let reach = self.samples.layer(sample, self.tool.stiffness).smooth;
        for (pose, place) in self.walk.along(from, to) {
            let distance = self.distance(pose, place);
            touches |= distance.gap < reach;
            let tied = if touches { pose.outward(point) } else { place };
            let slide = Slide::new(along(sub(place, tied), distance.normal), stiffness, bound);
            dissipated += slide.dissipated;
            point = pose.inward(slide.tied(place, tied));
        }
        (self.pose.outward(point), dissipated)
    }

    /// What a step leaves of the anchors of one that touches: where it is tied to, in axes of the tool.
    pub(super) fn anchor_left(
        &self,
        touching: &super::Touching,
        x: [f64; 3],
        stiffness: f64,
    ) -> (Anchor, f64) {
        let is_bond = self.tool.friction == Friction::Bonded;
        let (point, dissipated) = if is_bond {
            (std::array::from_fn(|i| x[i] + touching.force[i] / stiffness), 0.0)
        } else {
            let stretch = along(sub(x, touching.anchor), touching.normal);
            let slide = Slide::new(stretch, stiffness, touching.bound);
            (slide.tied(x, touching.anchor), touching.dissipated + slide.dissipated)
        };
        (Anchor { point: self.pose.inward(point), is_bond }, dissipated)
    }
}

/// What is left of the stretch of a spring beyond which its bound lets it slide; none if it sticks.
struct Slide {
    left: Option<[f64; 3]>,
    dissipated: f64,
}

impl Slide {
    fn new(stretch: [f64; 3], stiffness: f64, bound: f64) -> Self {
        let (size, most) = (norm(stretch), bound / stiffness);
        if size > most {
            let left = stretch.map(|s| most / size * s);
            Slide { left: Some(left), dissipated: bound * (size - most) }
        } else {
            Slide { left: None, dissipated: 0.0 }
        }
    }

    /// The point that a sample at a place is tied to after it. One that slid lies on the surface beside the sample: off it,
    /// where an arc has led, it would come nearer to the axis of a tool that turns with every slide.
    fn tied(&self, place: [f64; 3], before: [f64; 3]) -> [f64; 3] {
        self.left.map_or(before, |left| sub(place, left))
    }
}
