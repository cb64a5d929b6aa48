//! Where a surface may touch: places on its faces, see [`rule`], as close together as a tool needs. Where the surface has a
//! sharp edge, a sample belongs to several sides, and a tool presses on those it meets.

mod face;
mod rule;
mod sides;

use super::layer::Layer;
use super::pressure_field::PressureField;
use super::weighted_nodes::WeightedNodes;
use crate::body::{Body, part_of_nodes};
use crate::mesh::{cell_volume, diagonal, norm};
use face::{Border, Face, faces_of};
use rule::{Place, parts, places};
use sides::{Sides, sharp_edges};
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

/// Largest height of a cell that counts, over the diagonal of the organ that it is of, so that tools do not enter coarse
/// meshes deeper, nor a small organ beside a large one.
const THICKEST: f64 = 0.015;

/// The samples of a body's surface.
pub(super) struct Samples {
    samples: Vec<Sample>,
    /// Nodes with their weights in the place of a sample, by sample.
    nodes: WeightedNodes,
    /// Those on sharp edges.
    sharp: BTreeMap<usize, Sides>,
    faces: Vec<Face>,
    /// Parts of the edges of each face, and the samples on it that no face before it has.
    parts: Vec<u32>,
    on: Vec<Range<usize>>,
    /// The shares of the nodes of a face with so many parts, see [`Face::shares`].
    shares: HashMap<u32, [[f64; 2]; 6]>,
    /// Largest height of a cell behind the surface, as far as it counts [m].
    thickest: f64,
}

struct Sample {
    /// Place at rest [m].
    rest: [f64; 3],
    /// Its share of the surface at rest [m^2].
    area: f64,
    /// Plane strain modulus times area [N], height of the cells behind times area [m^3], and thickness of the layer times
    /// area [m^3].
    modulus: f64,
    height: f64,
    thickness: f64,
    /// On held nodes alone.
    is_held: bool,
}

impl Samples {
    /// Samples at most `spacing` apart [m], as far as that can be afforded, on a body some of whose nodes are held.
    pub fn new(body: &Body, spacing: f64, is_held: &[bool]) -> Self {
        let faces = faces_of(body);
        let mut samples = Samples {
            samples: Vec::new(),
            nodes: WeightedNodes::default(),
            sharp: BTreeMap::new(),
            parts: parts(&longest_edges(&faces), spacing),
            on: Vec::with_capacity(faces.len()),
            shares: HashMap::new(),
            thickest: 0.0,
            faces,
        };
        samples.fill(body);
        for (number, sample) in samples.samples.iter_mut().enumerate() {
            let nodes = samples.nodes.of(number);
            sample.is_held = nodes.iter().all(|&(node, _)| is_held[node as usize]);
        }
        samples
    }

    /// Whether they are those of another spacing, too.
    pub fn are_those_of(&self, spacing: f64) -> bool {
        self.parts == parts(&longest_edges(&self.faces), spacing)
    }

    fn fill(&mut self, body: &Body) {
        let (behind, height) = (cells_behind(body), Height::new(body));
        let rules: HashMap<u32, Vec<Place>> = self.parts.iter().map(|&n| (n, places(n))).collect();
        let faces = std::mem::take(&mut self.faces);
        if let Some(face) = faces.first() {
            self.shares = rules.iter().map(|(&n, rule)| (n, face.shares(rule))).collect();
        }
        let (sharp, mut shared) = (sharp_edges(&faces), HashMap::new());
        for (number, face) in faces.iter().enumerate() {
            let whole = norm(face.normal());
            let mut key = face.corners();
            key.sort_unstable();
            let cell = behind[&key];
            let (modulus, height) = (modulus(body, cell), height.of(cell, whole));
            self.thickest = self.thickest.max(height);
            let begin = self.samples.len();
            for &Place { at, weight } in &rules[&self.parts[number]] {
                let border = face.border(at);
                let mut push = || self.push(body.points(), &face.weights(at));
                let index = match border {
                    Some(border) => *shared.entry(border).or_insert_with(push),
                    None => push(),
                };
                let area = weight * whole;
                let sample = &mut self.samples[index];
                sample.area += area;
                sample.modulus += area * modulus;
                sample.height += area * height;
                // What touches on a part of a face alone does so under a higher pressure.
                sample.thickness += area * height / f64::from(self.parts[number]);
                let at_edge = match border {
                    Some(Border::Corner(_)) => Some(&[][..]),
                    Some(Border::Edge(edge, _)) => sharp.get(&edge).map(|both| &both[..]),
                    None => None,
                };
                if let Some(others) = at_edge {
                    let sides = self.sharp.entry(index).or_default();
                    others.iter().for_each(|&other| sides.add(&faces, other, 0.0));
                    sides.add(&faces, number, area);
                }
            }
            self.on.push(begin..self.samples.len());
        }
        self.sharp.retain(|_, sides| sides.are_several());
        self.faces = faces;
    }

    fn push(&mut self, points: &[[f64; 3]], nodes: &[(u32, f64)]) -> usize {
        self.nodes.push(nodes.iter().copied());
        let mut rest = [0.0; 3];
        for &(node, weight) in nodes {
            (0..3).for_each(|i| rest[i] += weight * points[node as usize][i]);
        }
        let (area, modulus, height, thickness) = (0.0, 0.0, 0.0, 0.0);
        self.samples.push(Sample { rest, area, modulus, height, thickness, is_held: false });
        self.samples.len() - 1
    }

    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// The faces of the surface, and the samples on each that no face before it has.
    pub fn by_face(&self) -> impl Iterator<Item = (&Face, Range<usize>)> {
        self.faces.iter().zip(self.on.iter().cloned())
    }

    /// The same for one of them.
    pub fn face(&self, number: usize) -> (&Face, Range<usize>) {
        (&self.faces[number], self.on[number].clone())
    }

    pub fn n_faces(&self) -> usize {
        self.faces.len()
    }

    /// How much farther a sample moves than the node that moves most, at most.
    pub fn bulge(&self) -> f64 {
        self.faces.first().map_or(1.0, Face::bulge)
    }

    /// The nodes that carry the samples.
    pub fn nodes(&self) -> &WeightedNodes {
        &self.nodes
    }

    /// Its share of the surface at rest, of all sides [m^2].
    pub fn area(&self, sample: usize) -> f64 {
        self.samples[sample].area
    }

    /// The samples on sharp edges.
    pub fn sharp(&self) -> impl Iterator<Item = usize> {
        self.sharp.keys().copied()
    }

    /// The area at rest [m^2] with which a sample counts for a tool with a normal, see [`Sides::area_towards`].
    pub fn area_towards(&self, sample: usize, tool: [f64; 3], u: &[f64]) -> f64 {
        let sides = self.sharp.get(&sample);
        let area = sides.and_then(|sides| sides.area_towards(&self.faces, tool, u));
        area.unwrap_or(self.area(sample))
    }

    /// Adds to a field the faces around the nodes that it presses, of a body displaced by `u`.
    pub fn bear(&self, field: &mut PressureField, u: &[f64]) {
        for (face, parts) in self.faces.iter().zip(&self.parts) {
            if face.nodes().iter().any(|&node| field.is_pressed(node as usize)) {
                let (outward, whole) = (face.normal_at(u), norm(face.normal()));
                for (&node, shares) in face.nodes().iter().zip(&self.shares[parts]) {
                    field.bear(node as usize, outward, shares.map(|share| share * whole));
                }
            }
        }
    }

    /// A nodal field at a sample.
    pub fn mean(&self, sample: usize, u: &[f64]) -> [f64; 3] {
        self.nodes.mean(sample, u)
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
        let Sample { area, modulus, thickness, is_held, .. } = self.samples[sample];
        let layer = Layer::new(modulus / area, thickness / area, factor);
        if is_held { layer.abrupt() } else { layer }
    }

    /// The smallest gap at which no sample is in the layer of a tool of a stiffness [m].
    pub fn out_of_layer(&self, factor: f64) -> f64 {
        Layer::new(1.0, self.thickest, factor).smooth
    }
}

fn longest_edges(faces: &[Face]) -> Vec<f64> {
    faces.iter().map(Face::longest_edge).collect()
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
    let [shear, bulk] = material.moduli_of_cell(cell);
    4.0 * shear * (bulk + shear / 3.0) / (bulk + 4.0 / 3.0 * shear)
}

/// Heights of the cells behind a surface, as far as they count.
pub(super) struct Height<'a> {
    body: &'a Body,
    /// The organ of each node, and the largest height in each organ that counts [m].
    organ: Vec<u32>,
    thickest: Vec<f64>,
}

impl<'a> Height<'a> {
    /// For what touches each organ by itself.
    pub fn new(body: &'a Body) -> Self {
        let organ = part_of_nodes(body);
        let mut points = vec![Vec::new(); n_organs(&organ)];
        for (organ, x) in organ.iter().zip(body.points()) {
            points[*organ as usize].push(*x);
        }
        let thickest = points.iter().map(|points| THICKEST * diagonal(points)).collect();
        Height { body, organ, thickest }
    }

    /// For what presses the organs of these nodes on each other: they count as one.
    pub fn of_all(body: &'a Body, nodes: &[u32]) -> Self {
        let organ = part_of_nodes(body);
        let mut is_one = vec![false; n_organs(&organ)];
        nodes.iter().for_each(|&node| is_one[organ[node as usize] as usize] = true);
        let all = organ.iter().zip(body.points()).filter(|(organ, _)| is_one[**organ as usize]);
        let points: Vec<_> = all.map(|(_, x)| *x).collect();
        let thickest = vec![THICKEST * diagonal(&points); is_one.len()];
        Height { body, organ, thickest }
    }

    /// Of a cell over a face of this area [m], as far as it counts.
    pub fn of(&self, cell: usize, area: f64) -> f64 {
        let organ = self.organ[self.body.cells()[cell][0] as usize];
        height_of(self.body, cell, area).min(self.thickest[organ as usize])
    }
}

/// Of a cell over a face of this area [m].
pub(super) fn height_of(body: &Body, cell: usize, area: f64) -> f64 {
    3.0 * cell_volume(body.points(), body.cells()[cell]).abs() / area
}

fn n_organs(organ: &[u32]) -> usize {
    organ.iter().max().map_or(0, |last| *last as usize + 1)
}
