//! A face of the surface with its nodes, linear or quadratic.

use super::rule::{Place, UNITS};
use crate::body::Body;
use crate::mesh::{cross, norm, sub, surface};
use std::collections::HashMap;

/// Sum of the absolute weights of nodes at a place of a quadratic face, at most.
const QUADRATIC: f64 = 5.0 / 3.0;

/// A face of the surface.
pub struct Face {
    /// Its corners and, where it is quadratic, the middles of the edges from the first, the second and the third.
    nodes: [u32; 6],
    rest: [[f64; 3]; 6],
    is_quadratic: bool,
}

/// A place that a face shares with others.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub enum Border {
    Corner(u32),
    /// On the edge between two nodes, in ascending order, so many units of barycentric coordinates from the first.
    Edge([u32; 2], u32),
}

/// The faces of a body's surface.
pub fn faces_of(body: &Body) -> Vec<Face> {
    let points = body.points();
    let middles: HashMap<[u32; 2], u32> =
        body.edges().iter().copied().zip(body.n_corners() as u32..).collect();
    let face = |corners: [u32; 3]| {
        let middle = |i: usize| {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            middles.get(&ascending(a, b)).copied().unwrap_or(a)
        };
        let nodes: [u32; 6] =
            std::array::from_fn(|i| if i < 3 { corners[i] } else { middle(i - 3) });
        let rest = nodes.map(|node| points[node as usize]);
        Face { nodes, rest, is_quadratic: !middles.is_empty() }
    };
    surface(points, body.cells()).into_iter().map(face).collect()
}

impl Face {
    pub fn corners(&self) -> [u32; 3] {
        [self.nodes[0], self.nodes[1], self.nodes[2]]
    }

    /// Its edges, from each corner to the next.
    pub fn edges(&self) -> [[u32; 2]; 3] {
        [0, 1, 2].map(|i| ascending(self.nodes[i], self.nodes[(i + 1) % 3]))
    }

    /// Length of its longest edge at rest [m].
    pub fn longest_edge(&self) -> f64 {
        (0..3).map(|i| norm(sub(self.rest[(i + 1) % 3], self.rest[i]))).fold(0.0, f64::max)
    }

    /// Its area vector at rest [m^2].
    pub fn normal(&self) -> [f64; 3] {
        area_vector([self.rest[0], self.rest[1], self.rest[2]])
    }

    /// Its area vector under a displacement [m^2].
    pub fn normal_at(&self, u: &[f64]) -> [f64; 3] {
        area_vector([0, 1, 2].map(|i| self.place(i, u)))
    }

    /// Middle and radius [m] of a ball that holds it under a displacement.
    pub fn ball(&self, u: &[f64]) -> ([f64; 3], f64) {
        let corners = [0, 1, 2].map(|i| self.place(i, u));
        let middle = std::array::from_fn(|i| corners.iter().map(|x| x[i]).sum::<f64>() / 3.0);
        let distance = |i: usize| norm(sub(self.place(i, u), middle));
        (middle, self.bulge() * (0..self.n_nodes()).map(distance).fold(0.0, f64::max))
    }

    /// How far a place on it moves at most in a step [m].
    pub fn speed(&self, step: &[f64]) -> f64 {
        let speed = |&node: &u32| {
            let node = 3 * node as usize;
            norm([step[node], step[node + 1], step[node + 2]])
        };
        self.bulge() * self.nodes[..self.n_nodes()].iter().map(speed).fold(0.0, f64::max)
    }

    /// What a place with these barycentric coordinates, in [`UNITS`], is shared by.
    pub fn border(&self, at: [u32; 3]) -> Option<Border> {
        let on = (0..3).filter(|&i| at[i] > 0).collect::<Vec<_>>();
        match on[..] {
            [i] => Some(Border::Corner(self.nodes[i])),
            [i, j] => {
                let ends = ascending(self.nodes[i], self.nodes[j]);
                let from_first = if ends[0] == self.nodes[i] { at[j] } else { at[i] };
                Some(Border::Edge(ends, from_first))
            }
            _ => None,
        }
    }

    /// Nodes and their weights at a place with these barycentric coordinates, in [`UNITS`].
    pub fn weights(&self, at: [u32; 3]) -> Vec<(u32, f64)> {
        let all = (0..self.n_nodes()).map(|i| (self.nodes[i], self.weight(i, at)));
        all.filter(|&(_, weight)| weight != 0.0).collect()
    }

    fn weight(&self, i: usize, at: [u32; 3]) -> f64 {
        let b = at.map(|units| f64::from(units) / f64::from(UNITS));
        match i {
            _ if !self.is_quadratic => b[i],
            0..3 => b[i] * (2.0 * b[i] - 1.0),
            _ => 4.0 * b[i - 3] * b[(i - 2) % 3],
        }
    }

    /// The integrals of the absolute weight of each node, by a rule, and of its weight, over the area of the face. The weight
    /// of a corner of a quadratic face has the integral zero.
    pub fn shares(&self, rule: &[Place]) -> [[f64; 2]; 6] {
        let is_mean = |i: usize| self.is_quadratic == (i >= 3);
        std::array::from_fn(|i| {
            if i >= self.n_nodes() {
                return [0.0; 2];
            }
            let sizes = rule.iter().map(|place| place.weight * self.weight(i, place.at).abs());
            [sizes.sum(), if is_mean(i) { 1.0 / 3.0 } else { 0.0 }]
        })
    }

    /// Its corners and the middles of its edges, if it has such nodes.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.n_nodes()]
    }

    fn n_nodes(&self) -> usize {
        if self.is_quadratic { 6 } else { 3 }
    }

    /// How much farther from its middle its places may be than its nodes.
    pub fn bulge(&self) -> f64 {
        if self.is_quadratic { QUADRATIC } else { 1.0 }
    }

    fn place(&self, i: usize, u: &[f64]) -> [f64; 3] {
        let node = 3 * self.nodes[i] as usize;
        std::array::from_fn(|k| self.rest[i][k] + u[node + k])
    }
}

fn ascending(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Normal of a triangle, as long as its area [m^2].
fn area_vector([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    cross(sub(b, a), sub(c, a)).map(|n| 0.5 * n)
}
