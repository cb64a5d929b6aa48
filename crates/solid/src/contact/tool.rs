//! A rigid tool, and the samples of the surface that it touches.

mod anchored;
mod assembly;
mod near;
mod report;
mod steps;
mod sweep;
mod touching;
mod walk;

pub use anchored::Anchored;
pub use report::Report;
pub(super) use touching::Touching;

use super::distance::Distance;
use super::friction::Friction;
use super::layer::STIFFNESS;
use super::pose::Pose;
use super::samples::Samples;
use super::shape::Shape;
use crate::error::Error;
use crate::mesh::{dot, norm, sub};
use crate::tensor::Mat3;
use near::Near;
use std::sync::Arc;
use sweep::Passage;
use walk::Walk;

/// Largest part of a cell's stiffness that the curvature of a shape may take from the tangent; at sharp edges it would
/// be unbounded.
const CURVED: f64 = 1.0;

/// Largest motion of a tool across the surface, over the height of the cell behind, with which the body is taken to go
/// along.
const FAR: f64 = 1.0;

/// A rigid tool and its motion in a solve.
#[derive(Clone, Debug)]
pub struct Tool {
    /// Its shape.
    pub shape: Shape,
    /// Its friction.
    pub friction: Friction,
    /// Stiffness of the layer between tool and body, see [`STIFFNESS`].
    pub stiffness: f64,
    /// Where it starts.
    pub pose: Pose,
    /// Displacement [m] up to the full load.
    pub displacement: [f64; 3],
    /// Rotation about its origin up to the full load: a rotation vector [rad] in axes of the world.
    pub turn: [f64; 3],
}

/// The point of a tool, in its axes, that a sample sticks to.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    point: [f64; 3],
    is_bond: bool,
}

/// A tool at work.
pub(super) struct ActiveTool {
    pub tool: Tool,
    pub pose: Pose,
    pub samples: Arc<Samples>,
    /// The pose at the end of the last step.
    before: Pose,
    anchors: Vec<Option<Anchor>>,
    /// Share of the surface that each sample gives to it [m^2]; those that touched at the end of the last step keep theirs.
    areas: Vec<f64>,
    kept: Vec<usize>,
    /// Which way each sample slid when the tangent was last formed.
    slides: Vec<[f64; 3]>,
    pub touching: Vec<Touching>,
    /// The samples that touched in the last tangent.
    in_tangent: Vec<Touching>,
    gap: f64,
    near: Near,
    dissipation: f64,
    /// Pressures of the samples at the ends of the last two steps, the last one first [Pa]; none without friction.
    pressures: Vec<[f64; 2]>,
    /// The part of the last motion by which pressures are extrapolated for the bounds of friction; zero for those that are.
    pub extrapolated: f64,
    passage: Passage,
    /// Its way in this step.
    walk: Walk,
}

impl Tool {
    /// At rest in a pose.
    pub fn new(shape: Shape, friction: Friction, pose: Pose) -> Self {
        Tool { shape, friction, stiffness: STIFFNESS, pose, displacement: [0.0; 3], turn: [0.0; 3] }
    }

    /// The pose at a part of its motion.
    pub fn pose_at(&self, load: f64) -> Pose {
        self.pose.moved(self.displacement.map(|w| load * w), self.turn.map(|t| load * t))
    }

    /// What and where it is, in errors.
    pub(super) fn told(&self) -> String {
        let [x, y, z] = self.pose.position;
        format!("{} at ({x:.4}, {y:.4}, {z:.4}) m", self.shape.name())
    }

    pub(super) fn check(&self, number: usize) -> Result<(), Error> {
        self.shape.check(number)?;
        self.friction.check(number)?;
        self.pose.check(number)?;
        if self.displacement.iter().chain(&self.turn).any(|v| !v.is_finite()) {
            return Err(Error::input(format!(
                "the displacement of tool {number} is {:?} m with a turn of {:?}; both must be finite",
                self.displacement, self.turn
            )));
        }
        if !(self.stiffness > 0.0 && self.stiffness.is_finite()) {
            return Err(Error::input(format!(
                "the stiffness of tool {number} is {}; it must be positive, {STIFFNESS} for instance",
                self.stiffness
            )));
        }
        Ok(())
    }
}

impl ActiveTool {
    pub fn new(tool: Tool, samples: Arc<Samples>) -> Self {
        let n = samples.len();
        let anchors = if tool.friction.is_none() { Vec::new() } else { vec![None; n] };
        ActiveTool {
            pose: tool.pose,
            before: tool.pose,
            passage: Passage::new(&tool),
            tool,
            slides: vec![[0.0; 3]; anchors.len()],
            pressures: vec![[0.0; 2]; anchors.len()],
            extrapolated: 0.0,
            anchors,
            areas: (0..n).map(|sample| samples.area(sample)).collect(),
            kept: Vec::new(),
            samples,
            touching: Vec::new(),
            in_tangent: Vec::new(),
            gap: f64::INFINITY,
            near: Near::default(),
            dissipation: 0.0,
            walk: Walk::default(),
        }
    }

    /// Smallest gap found last [m].
    pub fn gap(&self) -> f64 {
        self.gap
    }

    /// A step begins at `u`: samples on a sharp edge choose the sides that the tool meets.
    pub fn begin(&mut self, u: &[f64]) {
        let samples = self.samples.clone();
        for sample in samples.sharp() {
            if self.kept.binary_search(&sample).is_err() {
                let normal = self.distance(&self.pose, samples.place(sample, u)).normal;
                self.areas[sample] = samples.area_towards(sample, normal, u);
            }
        }
    }

    /// Finds the samples that touch at `u`. Those that did not touch at the start of the step are tied to the point of
    /// the tool where they were then.
    pub fn linearize(&mut self, u: &[f64], start: &[f64]) {
        self.walk = Walk::new(&self.before, &self.pose);
        let beyond = self.find_near(u);
        let near = std::mem::take(&mut self.near);
        self.meet_on(near.faces(), u, start);
        if self.gap > beyond {
            self.meet_on(0..self.samples.n_faces(), u, start);
        }
        self.near = near;
    }

    /// Finds what touches at `u` on some faces, and the smallest gap on them.
    fn meet_on(&mut self, faces: impl Iterator<Item = usize>, u: &[f64], start: &[f64]) {
        let samples = self.samples.clone();
        self.touching.clear();
        self.gap = f64::INFINITY;
        for &sample in &self.kept {
            if let Some(anchor) = self.bond(sample) {
                let x = samples.place(sample, u);
                let distance = self.distance(&self.pose, x);
                self.gap = self.gap.min(distance.gap);
                self.touching.push(self.bonded(sample, x, anchor, distance.normal));
            }
        }
        let out_of_layer = samples.out_of_layer(self.tool.stiffness);
        for number in faces {
            let (face, on_it) = samples.face(number);
            let (middle, radius) = face.ball(u);
            let least = self.least(middle) - radius;
            if least > out_of_layer && least >= self.gap {
                continue;
            }
            for sample in on_it {
                if self.bond(sample).is_none() {
                    self.meet(sample, u, start);
                }
            }
        }
    }

    /// Adds a sample to those that touch, if it does.
    fn meet(&mut self, sample: usize, u: &[f64], start: &[f64]) {
        let x = self.samples.place(sample, u);
        let layer = self.samples.layer(sample, self.tool.stiffness);
        let least = self.least(x);
        if least > layer.smooth && least >= self.gap {
            return;
        }
        let distance = self.distance(&self.pose, x);
        self.gap = self.gap.min(distance.gap);
        let pressed = layer.at(distance.gap);
        if pressed[1] > 0.0 {
            let from = self.samples.place(sample, start);
            self.touching.push(self.touched(sample, x, from, distance, pressed));
        }
    }

    /// The smallest gap that a point can have [m].
    fn least(&self, x: [f64; 3]) -> f64 {
        norm(sub(x, self.pose.position)) - self.tool.shape.reach()
    }

    /// Instead of [`ActiveTool::linearize`] at the start of a step, where the tool has moved and the body has not: the
    /// samples that touched are taken to stay on the tool, with the pressure and the stiffness that they had, and no
    /// others are taken to touch, though the tool is over them as long as the body has not given way. False if the tool
    /// has moved too far for that.
    pub fn lead(&mut self, u: &[f64]) -> bool {
        let samples = self.samples.clone();
        if self.kept.is_empty() || self.tool.friction == Friction::Bonded {
            return false;
        }
        self.walk = Walk::new(&self.before, &self.pose);
        self.touching.clear();
        for &sample in &self.kept {
            let x = samples.place(sample, u);
            let layer = samples.layer(sample, self.tool.stiffness);
            let distance = self.distance(&self.pose, x);
            let before = self.distance(&self.before, x).gap;
            if (distance.gap - before).abs() > FAR * samples.height(sample) {
                return false;
            }
            let [energy, pressure, slope] = layer.at(before);
            let pressed = [energy, pressure + slope * (before - distance.gap), slope];
            self.touching.push(self.touched(sample, x, x, distance, pressed));
        }
        true
    }

    /// A sample at `x`, and `from` at the start of the step, under energy per area, pressure and slope of the layer.
    fn touched(
        &self,
        sample: usize,
        x: [f64; 3],
        from: [f64; 3],
        distance: Distance,
        [energy, pressure, slope]: [f64; 3],
    ) -> Touching {
        let layer = self.samples.layer(sample, self.tool.stiffness);
        let area = self.areas[sample];
        let Distance { normal: n, curvature, .. } = distance;
        // At sharp edges the curvature of the gap has no end.
        let size = curvature.iter().flatten().map(|k| k * k).sum::<f64>().sqrt();
        let most = CURVED * layer.stiffness / self.tool.stiffness;
        let bent = pressure.max(0.0);
        let part = area * if bent * size > most { most / size } else { bent };
        let mut touching = Touching {
            sample,
            place: x,
            normal: n,
            pressure,
            force: n.map(|n| area * pressure * n),
            stiffness: std::array::from_fn(|i| std::array::from_fn(|j| area * slope * n[i] * n[j])),
            curvature: curvature.map(|row| row.map(|k| -part * k)),
            fall: area * slope,
            bound: 0.0,
            slide: [0.0; 3],
            pull: 0.0,
            anchor: x,
            energy: area * energy,
            dissipated: 0.0,
        };
        if !self.anchors.is_empty() {
            let stiffness = area * layer.stiffness;
            touching.bound =
                area * self.tool.friction.bound(self.expected(sample, pressure.max(0.0)));
            (touching.anchor, touching.dissipated) =
                self.walked(sample, [from, x], stiffness, touching.bound);
            if touching.bound > 0.0 {
                touching.rub(stiffness, self.slides[sample]);
            }
        }
        touching
    }

    /// The pressure that a sample is expected to end the step with: that which it has or, at an extrapolated start, the last
    /// one extrapolated.
    fn expected(&self, sample: usize, pressure: f64) -> f64 {
        match self.pressures.get(sample) {
            Some([last, before]) if self.extrapolated > 0.0 && *last > 0.0 => {
                (last + self.extrapolated * (last - before)).max(0.0)
            }
            _ => pressure,
        }
    }

    /// A sample tied across the surface as well as along it.
    fn bonded(&self, sample: usize, x: [f64; 3], anchor: Anchor, normal: [f64; 3]) -> Touching {
        let area = self.areas[sample];
        let stiffness = area * self.samples.layer(sample, self.tool.stiffness).stiffness;
        let point = self.pose.outward(anchor.point);
        let stretch = sub(x, point);
        let force = stretch.map(|s| -stiffness * s);
        Touching {
            sample,
            place: x,
            normal,
            pressure: dot(force, normal) / area,
            force,
            stiffness: std::array::from_fn(|i| {
                std::array::from_fn(|j| if i == j { stiffness } else { 0.0 })
            }),
            curvature: [[0.0; 3]; 3],
            fall: stiffness,
            bound: f64::INFINITY,
            slide: [0.0; 3],
            pull: 0.0,
            anchor: point,
            energy: 0.5 * stiffness * dot(stretch, stretch),
            dissipated: 0.0,
        }
    }

    /// Ends a step: samples that slid are tied to their new point, samples that touch a bonded tool to their present
    /// one.
    pub fn end(&mut self, u: &[f64]) {
        let samples = self.samples.clone();
        self.dissipation = 0.0;
        self.before = self.pose;
        self.passage.end(&self.pose);
        let before = std::mem::take(&mut self.kept);
        self.kept.extend(self.touching.iter().map(|touching| touching.sample));
        self.kept.sort_unstable();
        if self.anchors.is_empty() {
            return;
        }
        for &sample in &before {
            self.anchors[sample] = None;
            self.pressures[sample] = [0.0, self.pressures[sample][0]];
        }
        for touching in &self.touching {
            let sample = touching.sample;
            let layer = samples.layer(sample, self.tool.stiffness);
            let stiffness = self.areas[sample] * layer.stiffness;
            let (anchor, dissipated) =
                self.anchor_left(touching, samples.place(sample, u), stiffness);
            self.anchors[sample] = Some(anchor);
            self.dissipation += dissipated;
            self.pressures[sample][0] = touching.pressure;
        }
        // What has let go has no past when it touches again.
        for &sample in before.iter().filter(|&&sample| self.anchors[sample].is_none()) {
            self.pressures[sample] = [0.0; 2];
        }
    }

    /// The point that a sample is bonded to, if it is.
    fn bond(&self, sample: usize) -> Option<Anchor> {
        self.anchors.get(sample).copied().flatten().filter(|anchor| anchor.is_bond)
    }

    /// Signed distance in the world from the tool in a pose.
    fn distance(&self, pose: &Pose, x: [f64; 3]) -> Distance {
        let local = self.tool.shape.distance(pose.inward(x));
        let r = &pose.rotation;
        let half: Mat3<f64> = std::array::from_fn(|i| {
            std::array::from_fn(|k| (0..3).map(|j| r[i][j] * local.curvature[j][k]).sum())
        });
        Distance {
            gap: local.gap,
            normal: pose.turn(local.normal),
            curvature: std::array::from_fn(|i| std::array::from_fn(|l| dot(half[i], r[l]))),
        }
    }
}
