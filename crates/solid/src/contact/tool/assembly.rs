//! Energy, forces and stiffness of a tool, into vectors and tangents of the body.

use super::super::friction::spring;
use super::ActiveTool;
use super::touching::{STEADY, Touching, along};
use crate::body::{Curvature, SymmetricBlocks};
use crate::mesh::{dot, norm, sub};

impl ActiveTool {
    /// Energy at a displacement, with the bounds of friction found last [J].
    pub(in super::super) fn energy(&self, u: &[f64]) -> f64 {
        let samples = &*self.samples;
        let out_of_layer = samples.out_of_layer(self.tool.stiffness);
        let mut energy = 0.0;
        for (face, on_it) in samples.by_face() {
            let (middle, radius) = face.ball(u);
            if self.least(middle) - radius > out_of_layer {
                continue;
            }
            for sample in on_it.filter(|&sample| self.bond(sample).is_none()) {
                let x = samples.place(sample, u);
                let layer = samples.layer(sample, self.tool.stiffness);
                if self.least(x) < layer.smooth {
                    energy += self.areas[sample] * layer.at(self.distance(&self.pose, x).gap)[0];
                }
            }
        }
        for touching in self.touching.iter().filter(|touching| touching.bound > 0.0) {
            let sample = touching.sample;
            let layer = samples.layer(sample, self.tool.stiffness);
            let stiffness = self.areas[sample] * layer.stiffness;
            let mut stretch = sub(samples.place(sample, u), touching.anchor);
            if self.bond(sample).is_none() {
                stretch = along(stretch, touching.normal);
            }
            energy += spring(norm(stretch), stiffness, touching.bound)[0];
        }
        energy
    }

    /// Adds the last forces on the body [N].
    pub(in super::super) fn add_force(&self, force: &mut [f64]) {
        for touching in &self.touching {
            self.samples.nodes().add_force(touching.sample, touching.force, force);
        }
    }

    /// Whether a sample slides.
    pub(in super::super) fn slides(&self) -> bool {
        self.touching.iter().any(Touching::slides)
    }

    /// Adds what the forces of friction change by along a step: the bound of what slides follows its pressure.
    pub(in super::super) fn add_change_of_friction(&self, step: &[f64], force: &mut [f64]) {
        for touching in self.touching.iter().filter(|touching| touching.slides()) {
            let Touching { sample, normal, pressure, fall, bound, slide, .. } = *touching;
            let opening = dot(self.samples.mean(sample, step), normal);
            let across = self.areas[sample] * pressure - fall * opening;
            let change = self.tool.friction.bound(across.max(0.0)) - bound;
            self.samples.nodes().add_force(sample, slide.map(|along| -change * along), force);
        }
    }

    /// Adds the negative derivative of the forces to a tangent, with the part by the gap's curvature or without.
    pub(in super::super) fn add_stiffness(
        &mut self,
        curvature: Curvature,
        blocks: &mut SymmetricBlocks,
    ) {
        self.soften();
        self.in_tangent.clone_from(&self.touching);
        for touching in &mut self.in_tangent {
            if curvature == Curvature::Exact {
                for (sum, row) in touching.stiffness.iter_mut().zip(&touching.curvature) {
                    sum.iter_mut().zip(row).for_each(|(sum, k)| *sum += k);
                }
            }
            let nodes = self.samples.nodes().of(touching.sample);
            for &(row, a) in nodes {
                for &(column, b) in nodes.iter().filter(|(column, _)| *column >= row) {
                    let block = std::array::from_fn(|k| a * b * touching.stiffness[k / 3][k % 3]);
                    let position = blocks.pattern().position(row, column);
                    position.into_iter().for_each(|position| blocks.add(position, &block));
                }
            }
        }
    }

    /// Adds a multiple of the product of the last contribution to the tangent with `x`.
    pub(in super::super) fn add_product(&self, factor: f64, x: &[f64], out: &mut [f64]) {
        for touching in &self.in_tangent {
            let at = self.samples.mean(touching.sample, x);
            let product = touching.stiffness.map(|row| factor * dot(row, at));
            self.samples.nodes().add_force(touching.sample, product, out);
        }
    }

    /// For samples that slide in the same direction as before, the tangent takes the derivative instead of the chord;
    /// it has no stiffness along the slide. For others, steps would oscillate between two directions.
    fn soften(&mut self) {
        if self.anchors.is_empty() {
            return;
        }
        for touching in &mut self.touching {
            let slide = touching.slide;
            if dot(slide, self.slides[touching.sample]) > STEADY {
                for (row, a) in touching.stiffness.iter_mut().zip(slide) {
                    row.iter_mut().zip(slide).for_each(|(k, b)| *k -= touching.pull * a * b);
                }
            }
        }
        for touching in &self.in_tangent {
            self.slides[touching.sample] = [0.0; 3];
        }
        for touching in &self.touching {
            self.slides[touching.sample] = touching.slide;
        }
    }
}
