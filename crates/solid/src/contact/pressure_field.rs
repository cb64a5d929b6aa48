//! Pressures at nodes from those of samples, and the area that carries them.
//!
//! A node's pressure is its share of the normal forces over its share of the surface, touched or not:
//!   `p_i = sum_s |w_si| A_s p_s / integral of |N_i|`,
//! so `integral of sum_i p_i N_i` is the sum of the normal forces, for linear and quadratic faces. The area is
//!   `(sum_i A_i sqrt |p_i|)^2 / sum_i A_i |p_i|`, with `A_i` the integral of `N_i`:
//! that of a uniform pressure exactly, 0.96 of the ellipse of Hertz's. Which samples touch depends on the stiffness of the
//! layer and on how the faces lie to the tool; what the nodes carry hardly does.

use crate::mesh::{dot, norm};

/// Cosine between the normals of a face and of what presses its node above which the face bears a part of that.
const FACING: f64 = 0.5;

/// Forces on nodes across a surface, and the surface that bears them.
pub(super) struct PressureField {
    /// Sum of the forces [N], and of the normals weighted by their sizes.
    forces: Vec<f64>,
    normals: Vec<[f64; 3]>,
    /// The integrals of `|N_i|` and `N_i` [m^2]: over the faces turned towards what presses, and over all.
    facing: Vec<[f64; 2]>,
    all: Vec<[f64; 2]>,
}

impl PressureField {
    pub fn new(n_nodes: usize) -> Self {
        PressureField {
            forces: vec![0.0; n_nodes],
            normals: vec![[0.0; 3]; n_nodes],
            facing: vec![[0.0; 2]; n_nodes],
            all: vec![[0.0; 2]; n_nodes],
        }
    }

    /// Adds a force on a node [N] along a normal that points into the body.
    pub fn press(&mut self, node: usize, force: f64, normal: [f64; 3]) {
        self.forces[node] += force;
        (0..3).for_each(|i| self.normals[node][i] += force.abs() * normal[i]);
    }

    pub fn is_pressed(&self, node: usize) -> bool {
        self.forces[node] != 0.0
    }

    /// Adds a node's share of a face, the integrals of `|N_i|` and `N_i` at rest [m^2]; `outward` is along the face's normal
    /// now.
    pub fn bear(&mut self, node: usize, outward: [f64; 3], shares: [f64; 2]) {
        let normal = self.normals[node];
        let is_facing = -dot(outward, normal) > FACING * norm(outward) * norm(normal);
        let add = |sums: &mut [f64; 2]| sums.iter_mut().zip(shares).for_each(|(s, by)| *s += by);
        add(&mut self.all[node]);
        if is_facing {
            add(&mut self.facing[node]);
        }
    }

    /// The share of the surface that a node's pressure acts on; of all its faces where none is turned that way.
    fn borne(&self, node: usize) -> [f64; 2] {
        if self.facing[node][0] > 0.0 { self.facing[node] } else { self.all[node] }
    }

    /// The pressure at a node [Pa].
    fn pressure(&self, node: usize) -> f64 {
        let [share, _] = self.borne(node);
        if share > 0.0 { self.forces[node] / share } else { 0.0 }
    }

    /// The pressures at all nodes [Pa].
    pub fn pressures(&self) -> Vec<f64> {
        (0..self.forces.len()).map(|node| self.pressure(node)).collect()
    }

    /// The area that carries them [m^2].
    pub fn area(&self) -> f64 {
        let mut sums = [0.0; 2];
        for node in (0..self.forces.len()).filter(|&node| self.is_pressed(node)) {
            let (pressure, [_, area]) = (self.pressure(node).abs(), self.borne(node));
            sums[0] += area * pressure.sqrt();
            sums[1] += area * pressure;
        }
        if sums[1] > 0.0 { sums[0] * sums[0] / sums[1] } else { 0.0 }
    }
}
