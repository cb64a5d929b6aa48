//! The smooth parts of the surface that meet at a sharp edge: a tool presses on those it meets.

use super::face::Face;
use crate::mesh::{dot, norm};
use std::collections::HashMap;

/// Cosine between the normals of two faces below which their edge is sharp.
const SHARP: f64 = 0.5;

/// The smooth parts of the surface around a sample, by the numbers of their faces.
#[derive(Default)]
pub struct Sides(Vec<Side>);

struct Side {
    faces: Vec<usize>,
    /// The sample's share of them at rest [m^2].
    area: f64,
}

/// The two faces at each sharp edge.
pub fn sharp_edges(faces: &[Face]) -> HashMap<[u32; 2], [usize; 2]> {
    let (mut first, mut sharp) = (HashMap::new(), HashMap::new());
    for (number, face) in faces.iter().enumerate() {
        for edge in face.edges() {
            match first.insert(edge, number) {
                Some(other) if is_sharp(&faces[other], face) => {
                    sharp.insert(edge, [other, number]);
                }
                _ => {}
            }
        }
    }
    sharp
}

fn is_sharp(one: &Face, other: &Face) -> bool {
    let (a, b) = (one.normal(), other.normal());
    dot(a, b) <= SHARP * norm(a) * norm(b)
}

impl Sides {
    /// Adds a face, or more of it: the sample's share [m^2].
    pub fn add(&mut self, faces: &[Face], face: usize, area: f64) {
        let known = self.0.iter().position(|side| side.faces.contains(&face));
        let near = || self.0.iter().position(|side| !is_sharp(&faces[side.faces[0]], &faces[face]));
        match known.or_else(near) {
            Some(side) => {
                if known.is_none() {
                    self.0[side].faces.push(face);
                }
                self.0[side].area += area;
            }
            None => self.0.push(Side { faces: vec![face], area }),
        }
    }

    pub fn are_several(&self) -> bool {
        self.0.len() > 1
    }

    /// The area at rest [m^2] with which the sample counts for a tool with a normal: the mean over its sides, weighted by
    /// the square of the cosine between the normals of side and tool under a displacement. None if the tool meets no side.
    pub fn area_towards(&self, faces: &[Face], tool: [f64; 3], u: &[f64]) -> Option<f64> {
        let mut sums = [0.0; 2];
        for side in &self.0 {
            let normal = side.normal(faces, u);
            let cosine = (-dot(normal, tool) / norm(normal)).max(0.0);
            sums[0] += cosine * cosine * side.area;
            sums[1] += cosine * cosine;
        }
        (sums[1] > 0.0).then(|| sums[0] / sums[1])
    }
}

impl Side {
    /// Sum of the area vectors of its faces under a displacement [m^2].
    fn normal(&self, faces: &[Face], u: &[f64]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for &face in &self.faces {
            let normal = faces[face].normal_at(u);
            (0..3).for_each(|i| sum[i] += normal[i]);
        }
        sum
    }
}
