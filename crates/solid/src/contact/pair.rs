//! Two surfaces of a body that touch each other, or one that touches itself.
//!
//! The finer surface is sampled, the gap `g` of a sample is its signed distance from the other surface where that is
//! now, and the layer between them is that of tools: `sum A e(g)`, with the areas `A` at rest. The samples are points of
//! the common pieces of both surfaces, so that the nodal forces of a uniform pressure are consistent on both sides. The
//! pieces are found anew while a step converges. A surface that touches itself is both: each of two triangles is sampled, with
//! half the area.

mod candidate_list;
mod met;
mod passage;
mod pieces;
mod report;
mod rubbing;
mod steps;

use super::carried::Carried;
use super::facets::{Candidates, Facets};
use super::friction::{Friction, spring};
use super::layer::Layer;
use super::meeting::{Meeting, stretch};
use super::samples::{Height, cells_behind, height_of, modulus};
use super::weighted_nodes::WeightedNodes;
use crate::body::{BlockPattern, Body, ContactPair, Curvature, SymmetricBlocks};
use crate::error::Error;
use crate::mesh::{cross, crossing, diagonal, norm, sub};
use candidate_list::CandidateList;
pub use met::Met;
use passage::Passage;

/// Largest depth of one surface in the other at rest, over the diagonal of both: rounding of a mesh.
const SHALLOW: f64 = 1e-4;

/// A contact pair at work.
pub(super) struct ActivePair {
    /// Corners of both surfaces, the nodes that carry them, their places at rest and at the displacement found last.
    corners: Vec<u32>,
    carriers: WeightedNodes,
    rest: Vec<[f64; 3]>,
    places: Vec<[f64; 3]>,
    /// The sampled surface and the other, by the place of their corners in `corners`.
    sampled: Facets,
    other: Facets,
    /// If both are the same.
    self_contact: Option<CandidateList>,
    /// Areas at rest [m^2] of the triangles of the sampled surface, half of them if both surfaces are the same.
    areas: Vec<f64>,
    /// The layers on the triangles of both.
    layers: [Vec<Layer>; 2],
    /// The heights [m] of the cells behind them.
    heights: [Vec<f64>; 2],
    reach: f64,
    /// 1 if the first surface is the sampled one, -1 if it is the second, 0 if both are the same.
    sign: f64,
    samples: Vec<Sample>,
    /// The triangles of the sampled surface that were so far from the other that they have no samples.
    far: Vec<u32>,
    renewals: usize,
    /// The places for which the samples were found.
    renewed: Vec<[f64; 3]>,
    is_placed: bool,
    /// Whether the samples stay, wherever the surfaces move.
    is_kept: bool,
    friction: Friction,
    /// Whether a sample touched in this step that was out of reach at its start: where it came down is not known well.
    was_out_of_reach: bool,
    /// The places at the start of the step.
    start: Vec<[f64; 3]>,
    /// Where slides set out from: the places at the start of the step, or of the one that it goes on, and the stretch of the
    /// springs there.
    origin: Vec<[f64; 3]>,
    stretches: Carried,
    /// The stretch at the end of the last step, and which way samples slid in the last tangent.
    left: Option<Carried>,
    slides: Carried,
    touching: Vec<Meeting>,
    in_tangent: Vec<Meeting>,
    gap: f64,
    /// By friction: in the last step, and since slides set out [J].
    dissipation: f64,
    dissipated: f64,
    passage: Passage,
}

/// A point of the sampled surface.
#[derive(Clone, Copy)]
struct Sample {
    triangle: u32,
    weights: [f64; 3],
    area: f64,
    layer: Layer,
    /// The triangle of the other surface that it was found on, and how deep it may be behind that [m].
    opposite: Option<(u32, f64)>,
    /// The point of the other surface that friction ties it to: triangle and weights.
    tied: Option<(usize, [f64; 3])>,
}

impl ActivePair {
    pub fn new(body: &Body, pair: &ContactPair) -> Self {
        let points = body.points();
        let finer = pair.finer(points);
        let triangles = [&pair.surfaces[finer], &pair.surfaces[1 - finer]];
        let mut corners: Vec<u32> =
            triangles.iter().flat_map(|t| t.iter().flatten().copied()).collect();
        corners.sort_unstable();
        corners.dedup();
        let local = |node: u32| corners.partition_point(|&other| other < node) as u32;
        let rest: Vec<[f64; 3]> = corners.iter().map(|&corner| points[corner as usize]).collect();
        let [sampled, other] = triangles.map(|triangles| {
            Facets::new(triangles.iter().map(|triangle| triangle.map(local)).collect())
        });
        let (behind, height) = (cells_behind(body), Height::of_all(body, &corners));
        let behind_of = |triangle: &[u32; 3]| {
            let face = pair.face_of(triangle);
            (behind[&face], area(points, &face))
        };
        let layers = triangles.map(|triangles| {
            let layer = |(cell, area)| {
                Layer::new(modulus(body, cell), height.of(cell, area), pair.stiffness)
            };
            triangles.iter().map(behind_of).map(layer).collect()
        });
        let heights = triangles.map(|triangles| {
            let height = |(cell, area)| height_of(body, cell, area);
            triangles.iter().map(behind_of).map(height).collect()
        });
        let self_contact =
            pair.self_contact().map(|rule| CandidateList::new(rule.clone(), pair.reach));
        let (share, sign) = match (&self_contact, finer) {
            (Some(_), _) => (0.5, 0.0),
            (None, 0) => (1.0, 1.0),
            (None, _) => (1.0, -1.0),
        };
        let areas =
            sampled.triangles().iter().map(|triangle| share * area(&rest, triangle)).collect();
        let mut carriers = WeightedNodes::default();
        corners.iter().for_each(|&corner| carriers.push(pair.nodes_of(corner)));
        ActivePair {
            places: rest.clone(),
            start: rest.clone(),
            origin: rest.clone(),
            carriers,
            corners,
            rest,
            sampled,
            other,
            self_contact,
            areas,
            layers,
            heights,
            reach: pair.reach,
            sign,
            samples: Vec::new(),
            far: Vec::new(),
            renewals: 0,
            renewed: Vec::new(),
            is_placed: false,
            is_kept: false,
            friction: Friction::Coulomb(pair.friction),
            was_out_of_reach: false,
            stretches: Carried::default(),
            left: None,
            slides: Carried::default(),
            touching: Vec::new(),
            in_tangent: Vec::new(),
            gap: f64::INFINITY,
            dissipation: 0.0,
            dissipated: 0.0,
            passage: Passage::default(),
        }
    }

    /// # Errors
    /// Surfaces that overlap at rest, or one that crosses itself.
    pub fn check(&self, number: usize) -> Result<(), Error> {
        let allowed = SHALLOW * diagonal(&self.rest);
        if self.self_contact.is_some() {
            return match crossing(&self.rest, self.sampled.triangles(), allowed) {
                Some(x) => Err(Error::input(format!(
                    "the surface of contact pair {number} crosses itself at rest at the point ({:.6}, {:.6}, {:.6}) m; \
                     correct the mesh",
                    x[0], x[1], x[2]
                ))),
                None => Ok(()),
            };
        }
        let [one, other] = [&self.sampled, &self.other].map(|facets| facets.at(&self.rest));
        let mut deepest = (allowed, None);
        for (facets, into) in [(&self.sampled, other), (&self.other, one)] {
            for triangle in facets.triangles() {
                let x = triangle.map(|node| self.rest[node as usize]);
                let centre = std::array::from_fn(|i| x.iter().map(|x| x[i]).sum::<f64>() / 3.0);
                for place in [x[0], x[1], x[2], centre] {
                    let depth = into.gap(place, f64::INFINITY, Candidates::All);
                    let depth = depth.map_or(0.0, |gap| -gap.gap);
                    if depth > deepest.0 {
                        deepest = (depth, Some(place));
                    }
                }
            }
        }
        match deepest {
            (depth, Some(x)) => Err(Error::input(format!(
                "the surfaces of contact pair {number} overlap at rest: the point ({:.6}, {:.6}, {:.6}) m of the one is \
                 {depth:.3e} m inside the other; at most {allowed:.1e} m is rounding. Move them apart, correct the \
                 meshes, or name only what faces each other from outside",
                x[0], x[1], x[2]
            ))),
            _ => Ok(()),
        }
    }

    /// A step begins at `u`: slides of the last are permanent.
    pub fn begin(&mut self, u: &[f64]) {
        self.go_on(u);
        self.origin.clone_from(&self.start);
        if let Some(left) = self.left.take() {
            self.stretches = left;
        }
        self.dissipated = 0.0;
        self.renewals = 0;
        self.renewed.clear();
        self.was_out_of_reach = false;
    }

    /// A step begins at `u` which goes on with the last, that has not converged: what friction ties to each other stays so,
    /// and so do pieces that are kept until the iteration has converged.
    pub fn go_on(&mut self, u: &[f64]) {
        self.start = self.places_at(u);
        self.is_placed = false;
    }

    /// Finds what touches at `u`.
    pub fn linearize(&mut self, u: &[f64]) {
        let places = self.places_at(u);
        if self.is_placed && places == self.places {
            return;
        }
        (self.places, self.is_placed) = (places, true);
        self.touching.clear();
        self.gap = f64::INFINITY;
        if let Some(candidates) = &mut self.self_contact {
            candidates.update(self.sampled.triangles(), &self.places);
        }
        if self.are_apart(&self.places) {
            self.samples.clear();
            self.renewed.clear();
            return;
        }
        if self.is_due() {
            self.renewals += 1;
            self.find_samples();
            self.renewed.clone_from(&self.places);
        }
        let other = self.other.at(&self.places);
        let (mut touching, mut least) = (std::mem::take(&mut self.touching), f64::INFINITY);
        for number in 0..self.samples.len() {
            let sample = &self.samples[number];
            let Some((place, gap)) = self.gap_at(sample, &self.places, &other) else { continue };
            least = least.min(gap.gap);
            touching.extend(self.meeting(number, place, gap));
        }
        drop(other);
        if !self.friction.is_none() {
            self.tie(&touching);
            touching.iter_mut().for_each(|meeting| self.rub(meeting));
        }
        (self.touching, self.gap) = (touching, least);
    }

    /// Keeps the samples from now on, or finds them anew where the surfaces are next.
    pub fn keep(&mut self, is_kept: bool) {
        self.is_kept = is_kept;
        self.is_placed &= !self.is_due();
    }

    /// Energy at a displacement [J]: that of the layer, and that of friction with the last bounds.
    pub fn energy(&self, u: &[f64]) -> f64 {
        let places = self.places_at(u);
        if self.samples.is_empty() || self.are_apart(&places) {
            return 0.0;
        }
        let other = self.other.at(&places);
        let mut ties =
            self.touching.iter().filter_map(|m| Some((m.sample, m.tie.as_ref()?))).peekable();
        let mut energy = 0.0;
        for (number, sample) in self.samples.iter().enumerate() {
            let found = self.gap_at(sample, &places, &other);
            energy += found.map_or(0.0, |(_, gap)| sample.area * sample.layer.at(gap.gap)[0]);
            let Some((_, tie)) = ties.next_if(|&(of, _)| of == number) else { continue };
            let Some((triangle, weights)) = sample.tied else { continue };
            let (_, tied) = self.point_of_other(triangle, weights, &places);
            let place = self.place_of(sample, &places);
            let (normal, gap) = found.map_or(([0.0; 3], 0.0), |(_, gap)| (gap.normal, gap.gap));
            let (_, stretch) = stretch(place, sub(place, tied), normal, gap);
            energy += spring(stretch, tie.stiffness, tie.bound)[0];
        }
        energy
    }

    /// Adds the last forces on both surfaces [N].
    pub fn add_force(&self, force: &mut [f64]) {
        for meeting in &self.touching {
            meeting.each_force(|corner, f| self.carriers.add_force(corner as usize, f, force));
        }
    }

    pub fn friction(&self) -> Friction {
        self.friction
    }

    pub fn was_out_of_reach(&self) -> bool {
        self.was_out_of_reach
    }

    /// Whether a sample touches.
    pub fn touches(&self) -> bool {
        !self.touching.is_empty()
    }

    /// Whether a sample slides.
    pub fn slides(&self) -> bool {
        self.touching.iter().any(Meeting::slides)
    }

    /// Adds what the forces of friction change by along a step: the bound of what slides follows its pressure.
    pub fn add_change_of_friction(&self, step: &[f64], force: &mut [f64]) {
        for meeting in &self.touching {
            meeting.each_change_of_friction(
                self.friction,
                |corner| self.carriers.mean(corner as usize, step),
                |corner, f| self.carriers.add_force(corner as usize, f, force),
            );
        }
    }

    /// Adds the negative derivative of the forces to a tangent; the part by the rotation of normals, which is not definite,
    /// only if it is to be exact.
    pub fn add_stiffness(&mut self, curvature: Curvature, blocks: &mut SymmetricBlocks) {
        self.in_tangent.clear();
        self.in_tangent.extend(self.touching.iter().map(|meeting| match curvature {
            Curvature::Exact => meeting.clone(),
            Curvature::Projected => meeting.convex(),
        }));
        for meeting in &self.in_tangent {
            meeting.each_block(|row, column, block| {
                self.carriers.each_pair(row as usize, column as usize, |[row, column], weight| {
                    if row <= column {
                        let position = blocks.pattern().position(row, column);
                        let block = block.map(|k| weight * k);
                        position.into_iter().for_each(|position| blocks.add(position, &block));
                    }
                });
            });
        }
        self.slides = Carried::new(self.touching.iter().filter_map(|meeting| {
            let sample = &self.samples[meeting.sample];
            Some((sample.triangle, sample.weights, meeting.tie.as_ref()?.slide))
        }));
    }

    /// Adds a multiple of the product of the last contribution to the tangent with `x`.
    pub fn add_product(&self, factor: f64, x: &[f64], out: &mut [f64]) {
        for meeting in &self.in_tangent {
            meeting.each_block(|row, column, block| {
                let x = self.carriers.mean(column as usize, x);
                let product = |i: usize| (0..3).map(|k| block[3 * i + k] * x[k]).sum::<f64>();
                let products = std::array::from_fn(|i| factor * product(i));
                self.carriers.add_force(row as usize, products, out);
            });
        }
    }

    /// Whether surfaces touch between which a tangent of this pattern has no blocks.
    pub fn is_beyond(&self, pattern: &BlockPattern) -> bool {
        let mut last = None;
        self.touching.iter().any(|meeting| {
            let corners = (meeting.corners, meeting.tie.as_ref().map(|tie| tie.corners));
            if last.replace(corners) == Some(corners) {
                return false; // of the same piece
            }
            let is_beyond = |corners: &[u32; 6]| {
                let (own, other) = corners.split_at(3);
                let mut is_beyond = false;
                let mut look = |[a, b]: [u32; 2], _| is_beyond |= pattern.position(a, b).is_none();
                for &a in own {
                    other
                        .iter()
                        .for_each(|&b| self.carriers.each_pair(a as usize, b as usize, &mut look));
                }
                is_beyond
            };
            // A slide that is longer than the pattern reaches stays out of the tangent.
            let tie = meeting.tie.as_ref().filter(|tie| norm(tie.offset) < self.reach);
            is_beyond(&meeting.corners) || tie.is_some_and(|tie| is_beyond(&tie.corners))
        })
    }

    fn places_at(&self, u: &[f64]) -> Vec<[f64; 3]> {
        let place = |(corner, rest): (usize, &[f64; 3])| {
            let moved = self.carriers.mean(corner, u);
            std::array::from_fn(|i| rest[i] + moved[i])
        };
        self.rest.iter().enumerate().map(place).collect()
    }
}

/// The mean of the values at the corners of a triangle.
fn mean(corners: &[[f64; 3]; 3], weights: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|k| weights[k] * corners[k][i]).sum())
}

fn area(points: &[[f64; 3]], triangle: &[u32; 3]) -> f64 {
    norm(area_vector(points, triangle))
}

fn area_vector(points: &[[f64; 3]], triangle: &[u32; 3]) -> [f64; 3] {
    let [a, b, c] = triangle.map(|node| points[node as usize]);
    cross(sub(b, a), sub(c, a)).map(|n| 0.5 * n)
}
