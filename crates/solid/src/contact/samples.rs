//! Where a surface may touch: corners, middles of edges and centres of its faces, with the weights 1/20, 2/15 and 9/20
//! of a rule exact to the third degree, so that a uniform pressure gives the nodal forces of the element, linear or
//! quadratic. Where the surface has a sharp edge, a sample belongs to several sides, and a tool presses on those it meets.

use super::layer::Layer;
use crate::body::Body;
use crate::mesh::{cell_volume, cross, diagonal, dot, norm, sub, surface};
use std::collections::HashMap;

const CORNER: f64 = 1.0 / 20.0;
const MIDDLE: f64 = 2.0 / 15.0;
const CENTRE: f64 = 9.0 / 20.0;

/// Largest height of a cell that counts, over the diagonal of the body, so that tools do not enter coarse meshes
/// deeper.
const THICKEST: f64 = 0.015;

/// Cosine between the normals of two faces below which their edge is sharp.
const SHARP: f64 = 0.5;

/// The samples of a body's surface.
pub(super) struct Samples {
    samples: Vec<Sample>,
    /// Nodes with their weights in the place of a sample, by sample.
    nodes: Vec<(u32, f64)>,
    /// Those on sharp edges.
    sharp: Vec<usize>,
}

struct Sample {
    /// Where its nodes begin and end.
    range: [u32; 2],
    /// Place at rest [m].
    rest: [f64; 3],
    /// Its share of the surface at rest [m^2].
    area: f64,
    /// Plane strain modulus times area [N], and height of the cells behind times area [m^3].
    modulus: f64,
    height: f64,
    /// The smooth parts of the surface that meet here, where there are several.
    sides: Vec<Side>,
}

/// Faces around a sample with about the same normal.
#[derive(Default)]
struct Side {
    faces: Vec<Face>,
    /// The sample's share of them at rest [m^2].
    area: f64,
}

struct Face {
    nodes: [u32; 3],
    rest: [[f64; 3]; 3],
}

impl Samples {
    pub fn none() -> Self {
        Samples { samples: Vec::new(), nodes: Vec::new(), sharp: Vec::new() }
    }

    pub fn new(body: &Body) -> Self {
        let mut samples = Samples::none();
        let mut known = HashMap::new();
        let points = body.points();
        let middles: HashMap<[u32; 2], u32> =
            body.edges().iter().copied().zip(body.n_corners() as u32..).collect();
        let (behind, height) = (cells_behind(body), Height::new(body));
        for triangle in surface(points, body.cells()) {
            let x = triangle.map(|i| points[i as usize]);
            let normal = area_vector(x);
            let area = norm(normal);
            let mut key = triangle;
            key.sort_unstable();
            let cell = behind[&key];
            let height = height.of(cell, area);
            let modulus = modulus(body, cell);
            let mut add = |key: [u32; 3], weight: f64, nodes: &[(u32, f64)]| {
                let sample = *known.entry(key).or_insert_with(|| samples.push(points, nodes));
                let sample: &mut Sample = &mut samples.samples[sample];
                sample.area += weight * area;
                let side = sample.side_towards(normal);
                side.faces.push(Face { nodes: triangle, rest: x });
                side.area += weight * area;
                sample.modulus += weight * area * modulus;
                sample.height += weight * area * height;
            };
            let middle = |i: usize| {
                let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
                middles.get(&[a.min(b), a.max(b)]).copied()
            };
            for i in 0..3 {
                let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
                add([a, a, a], CORNER, &[(a, 1.0)]);
                let ends = [a.min(b), a.max(b)];
                match middle(i) {
                    Some(node) => add([ends[0], ends[0], ends[1]], MIDDLE, &[(node, 1.0)]),
                    None => add([ends[0], ends[0], ends[1]], MIDDLE, &[(a, 0.5), (b, 0.5)]),
                }
            }
            let nodes: Vec<(u32, f64)> = match middle(0) {
                Some(_) => (0..3)
                    .flat_map(|i| [(triangle[i], -1.0 / 9.0), (middle(i).unwrap_or(0), 4.0 / 9.0)])
                    .collect(),
                None => triangle.map(|a| (a, 1.0 / 3.0)).to_vec(),
            };
            add(key, CENTRE, &nodes);
        }
        let all = samples.samples.iter().enumerate();
        samples.sharp = all.filter(|(_, s)| s.sides.len() > 1).map(|(i, _)| i).collect();
        samples.samples.iter_mut().filter(|s| s.sides.len() == 1).for_each(|s| s.sides.clear());
        samples
    }

    fn push(&mut self, points: &[[f64; 3]], nodes: &[(u32, f64)]) -> usize {
        let start = self.nodes.len() as u32;
        self.nodes.extend(nodes);
        let mut rest = [0.0; 3];
        for &(node, weight) in nodes {
            (0..3).for_each(|i| rest[i] += weight * points[node as usize][i]);
        }
        let range = [start, self.nodes.len() as u32];
        let (area, modulus, height) = (0.0, 0.0, 0.0);
        self.samples.push(Sample { range, rest, area, modulus, height, sides: Vec::new() });
        self.samples.len() - 1
    }

    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Nodes and weights of a sample.
    pub fn nodes(&self, sample: usize) -> &[(u32, f64)] {
        let [start, end] = self.samples[sample].range;
        &self.nodes[start as usize..end as usize]
    }

    /// Its share of the surface at rest, of all sides [m^2].
    pub fn area(&self, sample: usize) -> f64 {
        self.samples[sample].area
    }

    /// The samples on sharp edges.
    pub fn sharp(&self) -> &[usize] {
        &self.sharp
    }

    /// The area at rest [m^2] with which a sample counts for a tool with a normal: the mean over its sides, weighted by
    /// the square of the cosine between the normals of side and tool under a displacement.
    pub fn area_towards(&self, sample: usize, tool: [f64; 3], u: &[f64]) -> f64 {
        let Sample { sides, area, .. } = &self.samples[sample];
        let mut sums = [0.0; 2];
        for side in sides {
            let normal = side.normal(u);
            let cosine = (-dot(normal, tool) / norm(normal)).max(0.0);
            sums[0] += cosine * cosine * side.area;
            sums[1] += cosine * cosine;
        }
        if sums[1] > 0.0 { sums[0] / sums[1] } else { *area }
    }

    /// A nodal field at a sample.
    pub fn mean(&self, sample: usize, u: &[f64]) -> [f64; 3] {
        let mut mean = [0.0; 3];
        for &(node, weight) in self.nodes(sample) {
            (0..3).for_each(|i| mean[i] += weight * u[3 * node as usize + i]);
        }
        mean
    }

    /// Where a sample is under a displacement [m].
    pub fn place(&self, sample: usize, u: &[f64]) -> [f64; 3] {
        let (rest, moved) = (self.samples[sample].rest, self.mean(sample, u));
        std::array::from_fn(|i| rest[i] + moved[i])
    }

    /// Height of the cells behind a sample, as far as it counts [m].
    pub fn height(&self, sample: usize) -> f64 {
        let Sample { area, height, .. } = self.samples[sample];
        height / area
    }

    /// The layer at a sample, for a tool of a stiffness.
    pub fn layer(&self, sample: usize, factor: f64) -> Layer {
        let Sample { area, modulus, .. } = self.samples[sample];
        Layer::new(modulus / area, self.height(sample), factor)
    }
}

impl Sample {
    /// The side that a face with this normal belongs to.
    fn side_towards(&mut self, normal: [f64; 3]) -> &mut Side {
        let is_near = |side: &Side| {
            let first = side.faces[0].normal(&[]);
            dot(first, normal) > SHARP * norm(first) * norm(normal)
        };
        let known = self.sides.iter().position(is_near);
        let side = known.unwrap_or(self.sides.len());
        if side == self.sides.len() {
            self.sides.push(Side::default());
        }
        &mut self.sides[side]
    }
}

impl Side {
    /// Sum of the area vectors of its faces under a displacement [m^2].
    fn normal(&self, u: &[f64]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for face in &self.faces {
            let normal = face.normal(u);
            (0..3).for_each(|i| sum[i] += normal[i]);
        }
        sum
    }
}

impl Face {
    /// Its area vector under a displacement, at rest where there is none [m^2].
    fn normal(&self, u: &[f64]) -> [f64; 3] {
        let at = |corner: usize| {
            let node = 3 * self.nodes[corner] as usize;
            let moved = u.get(node..node + 3).unwrap_or(&[0.0; 3]);
            std::array::from_fn(|i| self.rest[corner][i] + moved[i])
        };
        area_vector([at(0), at(1), at(2)])
    }
}

/// Normal of a triangle, as long as its area [m^2].
fn area_vector([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    cross(sub(b, a), sub(c, a)).map(|n| 0.5 * n)
}

/// The cell behind each face of the surface, by its ascending corners.
pub(super) fn cells_behind(body: &Body) -> HashMap<[u32; 3], usize> {
    let mut behind = HashMap::new();
    for (cell, corners) in body.cells().iter().enumerate() {
        for left_out in 0..4 {
            let mut key: [u32; 3] =
                std::array::from_fn(|i| corners[i + usize::from(i >= left_out)]);
            key.sort_unstable();
            behind.insert(key, cell);
        }
    }
    behind
}

/// `E / (1 - nu^2)` at rest [Pa], finite where volume is nearly kept.
pub(super) fn modulus(body: &Body, cell: usize) -> f64 {
    let material = body.material();
    let [shear, bulk] = material.moduli(material.of_cell(cell));
    4.0 * shear * (bulk + shear / 3.0) / (bulk + 4.0 / 3.0 * shear)
}

/// Heights of the cells behind a surface, as far as they count.
pub(super) struct Height<'a> {
    body: &'a Body,
    thickest: f64,
}

impl<'a> Height<'a> {
    pub fn new(body: &'a Body) -> Self {
        Height { body, thickest: THICKEST * diagonal(body.points()) }
    }

    /// Of a cell over a face of this area [m].
    pub fn of(&self, cell: usize, area: f64) -> f64 {
        let volume = cell_volume(self.body.points(), self.body.cells()[cell]).abs();
        (3.0 * volume / area).min(self.thickest)
    }
}
