//! Two surfaces of a body that touch each other, without friction.
//!
//! The finer surface is sampled, the gap `g` of a sample is its signed distance from the other surface where that is
//! now, and the layer between them is that of tools: `sum A e(g)`, with the areas `A` at rest. The samples are points of
//! the common pieces of both surfaces, so that the nodal forces of a uniform pressure are consistent on both sides. The
//! pieces are found anew while a step converges. The force at a sample and that at its closest point are opposite and on
//! one line, so force and torque of a pair cancel.

use super::facets::{Facets, Gap, Placed};
use super::layer::Layer;
use super::samples::{Height, cells_behind, modulus};
use super::tool::Report;
use crate::body::{BlockPattern, Body, ContactPair, Curvature, SymmetricBlocks};
use crate::error::Error;
use crate::mesh::{cross, diagonal, dot, norm, overlap, sub};

/// How often a step finds the pieces anew at most, and how far, relative to the reach, a surface moves before it does:
/// where they stay, the iteration ends as Newton's does.
const RENEWALS: usize = 20;
const STILL: f64 = 1e-5;

/// How much deeper a step may lead one surface into the other, over the reach: the tangent knows no more than its face.
const DEEPER: f64 = 0.1;

/// Largest depth of one surface in the other at rest, over the diagonal of both: rounding of a mesh.
const SHALLOW: f64 = 1e-4;

/// A rule of degree 2 on a triangle: three points of equal weight.
const RULE: [[f64; 3]; 3] = [
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];

/// A contact pair at work.
pub(super) struct ActivePair {
    /// Nodes of both surfaces, their places at rest and at the displacement found last.
    nodes: Vec<u32>,
    rest: Vec<[f64; 3]>,
    places: Vec<[f64; 3]>,
    /// The sampled surface and the other, by the place of their corners in `nodes`.
    sampled: Facets,
    other: Facets,
    /// Areas at rest [m^2] of the triangles of the sampled surface.
    areas: Vec<f64>,
    /// The layers on the triangles of both.
    layers: [Vec<Layer>; 2],
    reach: f64,
    /// 1 if the first surface is the sampled one, else -1.
    sign: f64,
    samples: Vec<Sample>,
    renewals: usize,
    /// The places for which the samples were found.
    renewed: Vec<[f64; 3]>,
    is_placed: bool,
    touching: Vec<Meeting>,
    in_tangent: Vec<Meeting>,
    gap: f64,
}

/// A point of the sampled surface.
#[derive(Clone, Copy)]
struct Sample {
    triangle: u32,
    weights: [f64; 3],
    area: f64,
    layer: Layer,
}

/// A sample that touches.
#[derive(Clone)]
struct Meeting {
    /// The corners of its triangle, then those of the other; what each adds to the gap along the normal.
    nodes: [u32; 6],
    weights: [f64; 6],
    /// How fast the weights of the other triangle change in its plane [1/m]; zero if the tangent leaves that out.
    slopes: [[f64; 3]; 6],
    normal: [f64; 3],
    gap: f64,
    place: [f64; 3],
    area: f64,
    energy: f64,
    pressure: f64,
    /// Fall of the force with the gap [N/m].
    stiffness: f64,
}

impl ActivePair {
    pub fn new(body: &Body, pair: &ContactPair) -> Self {
        let points = body.points();
        let finer = pair.finer(points);
        let triangles = [&pair.surfaces[finer], &pair.surfaces[1 - finer]];
        let mut nodes: Vec<u32> =
            triangles.iter().flat_map(|t| t.iter().flatten().copied()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let local = |node: u32| nodes.partition_point(|&other| other < node) as u32;
        let rest: Vec<[f64; 3]> = nodes.iter().map(|&node| points[node as usize]).collect();
        let [sampled, other] = triangles.map(|triangles| {
            Facets::new(triangles.iter().map(|triangle| triangle.map(local)).collect())
        });
        let (behind, height) = (cells_behind(body), Height::new(body));
        let layers = triangles.map(|triangles| {
            let layer = |triangle: &[u32; 3]| {
                let mut key = *triangle;
                key.sort_unstable();
                let cell = behind[&key];
                Layer::new(
                    modulus(body, cell),
                    height.of(cell, area(points, triangle)),
                    pair.stiffness,
                )
            };
            triangles.iter().map(layer).collect()
        });
        let areas = sampled.triangles().iter().map(|triangle| area(&rest, triangle)).collect();
        ActivePair {
            places: rest.clone(),
            nodes,
            rest,
            sampled,
            other,
            areas,
            layers,
            reach: pair.reach,
            sign: if finer == 0 { 1.0 } else { -1.0 },
            samples: Vec::new(),
            renewals: 0,
            renewed: Vec::new(),
            is_placed: false,
            touching: Vec::new(),
            in_tangent: Vec::new(),
            gap: f64::INFINITY,
        }
    }

    /// # Errors
    /// Surfaces that overlap at rest.
    pub fn check(&self, number: usize) -> Result<(), Error> {
        let allowed = SHALLOW * diagonal(&self.rest);
        let [one, other] = [&self.sampled, &self.other].map(|facets| facets.at(&self.rest));
        let mut deepest = (allowed, None);
        for (facets, into) in [(&self.sampled, other), (&self.other, one)] {
            for triangle in facets.triangles() {
                let x = triangle.map(|node| self.rest[node as usize]);
                let centre = std::array::from_fn(|i| x.iter().map(|x| x[i]).sum::<f64>() / 3.0);
                for place in [x[0], x[1], x[2], centre] {
                    let depth = into.gap(place, f64::INFINITY).map_or(0.0, |gap| -gap.gap);
                    if depth > deepest.0 {
                        deepest = (depth, Some(place));
                    }
                }
            }
        }
        match deepest {
            (depth, Some(x)) => Err(Error::input(format!(
                "the surfaces of contact pair {number} overlap at rest: the point ({:.6}, {:.6}, {:.6}) m of the one is \
                 {depth:.3e} m inside the other; at most {allowed:.1e} m is rounding. Move them apart, or correct the \
                 meshes",
                x[0], x[1], x[2]
            ))),
            _ => Ok(()),
        }
    }

    /// A step begins.
    pub fn begin(&mut self) {
        self.renewals = 0;
        self.is_placed = false;
        self.renewed.clear();
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
        if self.separation(&self.places) > self.reach {
            self.samples.clear();
            self.renewed.clear();
            return;
        }
        if self.renewals < RENEWALS && self.has_moved() {
            self.renewals += 1;
            self.samples = self.pieces();
            self.renewed.clone_from(&self.places);
        }
        let other = self.other.at(&self.places);
        let (mut touching, mut least) = (std::mem::take(&mut self.touching), f64::INFINITY);
        for sample in &self.samples {
            let Some((place, gap)) = self.gap_at(sample, &self.places, &other) else { continue };
            least = least.min(gap.gap);
            touching.extend(self.meeting(sample, place, gap));
        }
        drop(other);
        (self.touching, self.gap) = (touching, least);
    }

    /// Energy of the layer at a displacement [J].
    pub fn energy(&self, u: &[f64]) -> f64 {
        let places = self.places_at(u);
        if self.samples.is_empty() || self.separation(&places) > self.reach {
            return 0.0;
        }
        let other = self.other.at(&places);
        let of = |sample: &Sample| {
            let gap = self.gap_at(sample, &places, &other);
            gap.map_or(0.0, |(_, gap)| sample.area * sample.layer.at(gap.gap)[0])
        };
        self.samples.iter().map(of).sum()
    }

    /// Adds the last forces on both surfaces [N].
    pub fn add_force(&self, force: &mut [f64]) {
        for meeting in &self.touching {
            let size = meeting.area * meeting.pressure;
            for (&node, weight) in meeting.nodes.iter().zip(meeting.weights) {
                let own = &mut force[3 * node as usize..3 * node as usize + 3];
                own.iter_mut().zip(meeting.normal).for_each(|(f, n)| *f += weight * size * n);
            }
        }
    }

    /// Adds the negative derivative of the forces to a tangent; the part by the rotation of normals, which is not definite,
    /// only if it is to be exact.
    pub fn add_stiffness(&mut self, curvature: Curvature, blocks: &mut SymmetricBlocks) {
        self.in_tangent.clone_from(&self.touching);
        for meeting in &mut self.in_tangent {
            if curvature == Curvature::Projected {
                meeting.slopes = [[0.0; 3]; 6];
            }
            meeting.each_block(|row, column, block| {
                if row <= column {
                    let position = blocks.pattern().position(row, column);
                    position.into_iter().for_each(|position| blocks.add(position, &block));
                }
            });
        }
    }

    /// Adds a multiple of the product of the last contribution to the tangent with `x`.
    pub fn add_product(&self, factor: f64, x: &[f64], out: &mut [f64]) {
        for meeting in &self.in_tangent {
            meeting.each_block(|row, column, block| {
                let (row, column) = (3 * row as usize, 3 * column as usize);
                for i in 0..3 {
                    let product = (0..3).map(|k| block[3 * i + k] * x[column + k]).sum::<f64>();
                    out[row + i] += factor * product;
                }
            });
        }
    }

    /// Whether surfaces touch between which a tangent of this pattern has no blocks.
    pub fn is_beyond(&self, pattern: &BlockPattern) -> bool {
        let mut last = None;
        self.touching.iter().any(|meeting| {
            if last.replace(meeting.nodes) == Some(meeting.nodes) {
                return false; // of the same piece
            }
            let (own, other) = meeting.nodes.split_at(3);
            own.iter().any(|&a| other.iter().any(|&b| pattern.position(a, b).is_none()))
        })
    }

    /// Force of the second surface on the first, and torque about the origin of space.
    pub fn report(&self) -> Report {
        let mut report = Report { gap: self.gap, ..Report::default() };
        for meeting in &self.touching {
            let size = self.sign * meeting.area * meeting.pressure;
            let force = meeting.normal.map(|n| size * n);
            let torque = cross(meeting.place, force);
            for i in 0..3 {
                report.force[i] += force[i];
                report.torque[i] += torque[i];
            }
            report.area += meeting.area;
            report.energy += meeting.energy;
            report.touching += 1;
        }
        report
    }

    /// Mean pressure [Pa] of the touching samples around each node; zero if none touches.
    pub fn pressures(&self, n_nodes: usize) -> Vec<f64> {
        let mut sums = vec![[0.0; 2]; n_nodes];
        for meeting in &self.touching {
            for (&node, weight) in meeting.nodes.iter().zip(meeting.weights) {
                let [force, area] = &mut sums[node as usize];
                *force += weight.abs() * meeting.area * meeting.pressure;
                *area += weight.abs() * meeting.area;
            }
        }
        sums.into_iter().map(|[force, area]| if area > 0.0 { force / area } else { 0.0 }).collect()
    }

    fn places_at(&self, u: &[f64]) -> Vec<[f64; 3]> {
        let place = |(&node, rest): (&u32, &[f64; 3])| {
            std::array::from_fn(|i| rest[i] + u[3 * node as usize + i])
        };
        self.nodes.iter().zip(&self.rest).map(place).collect()
    }

    /// How far apart the boxes around both surfaces are along an axis; negative where they overlap along all.
    fn separation(&self, places: &[[f64; 3]]) -> f64 {
        let [one, other] = [&self.sampled, &self.other].map(|facets| {
            let corners = facets.triangles().iter().flatten().map(|&node| places[node as usize]);
            let mut ends = [[f64::MAX; 3], [f64::MIN; 3]];
            for x in corners {
                (0..3).for_each(|k| ends[0][k] = ends[0][k].min(x[k]));
                (0..3).for_each(|k| ends[1][k] = ends[1][k].max(x[k]));
            }
            ends
        });
        let along = |k: usize| (one[0][k] - other[1][k]).max(other[0][k] - one[1][k]);
        (0..3).map(along).fold(f64::MIN, f64::max)
    }

    /// Whether a surface has moved since its samples were found.
    fn has_moved(&self) -> bool {
        let still = STILL * self.reach;
        let pairs = self.places.iter().zip(&self.renewed);
        self.renewed.is_empty() || pairs.into_iter().any(|(x, y)| norm(sub(*x, *y)) > still)
    }

    /// The part of a step, possibly more than all of it, that leads no surface much deeper into the other.
    pub fn longest(&self, u: &[f64], step: &[f64]) -> f64 {
        let places = self.places_at(u);
        let motion: Vec<[f64; 3]> =
            self.nodes.iter().map(|&n| std::array::from_fn(|i| step[3 * n as usize + i])).collect();
        let fastest = |facets: &Facets| {
            let nodes = facets.triangles().iter().flatten();
            nodes.map(|&node| norm(motion[node as usize])).fold(0.0, f64::max)
        };
        let (own_speed, its_speed) = (fastest(&self.sampled), fastest(&self.other));
        let (deeper, speed) = (DEEPER * self.reach, own_speed + its_speed);
        let apart = self.separation(&places);
        if speed <= deeper || apart > self.reach {
            return (apart.max(0.0) + deeper) / speed;
        }
        let other = self.other.at(&places);
        let mut longest = f64::INFINITY;
        for sample in &self.samples {
            let place = self.place_of(sample, &places);
            let own =
                self.sampled.triangles()[sample.triangle as usize].map(|n| motion[n as usize]);
            let own = mean(&own, sample.weights);
            let Some(gap) = other.gap(place, self.reach) else {
                // Wherever it goes, it meets nothing before it has gone so far.
                let free = other.distance(place);
                longest = longest.min((free + deeper) / (norm(own) + its_speed));
                continue;
            };
            let its = self.other.triangles()[gap.triangle].map(|n| motion[n as usize]);
            let moved = sub(own, mean(&its, gap.weights));
            let (away, free) = (dot(moved, gap.normal), gap.gap.max(0.0));
            longest = longest.min((free + self.reach) / norm(moved));
            if away < 0.0 {
                longest = longest.min((free + deeper) / -away);
            }
        }
        longest
    }

    /// The samples where the surfaces are now: on their common pieces, and on whole triangles that have none.
    fn pieces(&self) -> Vec<Sample> {
        let (places, own) = (&self.places, self.sampled.triangles());
        let mut is_covered = vec![false; own.len()];
        let mut samples = Vec::new();
        for piece in overlap(places, own, self.other.triangles(), self.reach) {
            let [triangle, other] = piece.triangles.map(|t| t as usize);
            is_covered[triangle] = true;
            let part = piece.area / area(places, &own[triangle]);
            let layer = softer(self.layers[0][triangle], self.layers[1][other]);
            for point in RULE {
                let weights = std::array::from_fn(|i| {
                    (0..3).map(|k| point[k] * piece.corners[k][0][i]).sum::<f64>()
                });
                let area = part * self.areas[triangle] / 3.0;
                samples.push(Sample { triangle: triangle as u32, weights, area, layer });
            }
        }
        let softest = self.layers[1].iter().copied().reduce(softer);
        for triangle in (0..own.len()).filter(|&triangle| !is_covered[triangle]) {
            let layer =
                softest.map_or(self.layers[0][triangle], |s| softer(s, self.layers[0][triangle]));
            let area = self.areas[triangle] / 3.0;
            let sample = |weights| Sample { triangle: triangle as u32, weights, area, layer };
            samples.extend(RULE.map(sample));
        }
        samples
    }

    /// Place and gap of a sample, if the other surface is near.
    fn gap_at(
        &self,
        sample: &Sample,
        places: &[[f64; 3]],
        other: &Placed,
    ) -> Option<([f64; 3], Gap)> {
        let place = self.place_of(sample, places);
        Some((place, other.gap(place, self.reach)?))
    }

    fn place_of(&self, sample: &Sample, places: &[[f64; 3]]) -> [f64; 3] {
        let triangle = self.sampled.triangles()[sample.triangle as usize];
        mean(&triangle.map(|node| places[node as usize]), sample.weights)
    }

    fn meeting(&self, sample: &Sample, place: [f64; 3], gap: Gap) -> Option<Meeting> {
        let [energy, pressure, slope] = sample.layer.at(gap.gap);
        if pressure == 0.0 {
            return None;
        }
        let own = self.sampled.triangles()[sample.triangle as usize];
        let other = self.other.triangles()[gap.triangle];
        let corner = |i: usize| if i < 3 { own[i] } else { other[i - 3] };
        let still = [0.0; 3];
        Some(Meeting {
            nodes: std::array::from_fn(|i| self.nodes[corner(i) as usize]),
            weights: std::array::from_fn(|i| {
                if i < 3 { sample.weights[i] } else { -gap.weights[i - 3] }
            }),
            slopes: std::array::from_fn(|i| if i < 3 { still } else { gap.slopes[i - 3] }),
            normal: gap.normal,
            gap: gap.gap,
            place,
            area: sample.area,
            energy: sample.area * energy,
            pressure,
            stiffness: sample.area * slope,
        })
    }
}

impl Meeting {
    /// Calls with row and column node and the entries `[i][k]` of each block.
    ///
    /// With the weights `w`, the normal `n` and the slopes `s`, the block of nodes a and b is
    ///   `A e'' w_a w_b n n + A p (w_a s_b n + w_b n s_a + g s_a . s_b n n)`.
    fn each_block(&self, mut take: impl FnMut(u32, u32, [f64; 9])) {
        let (n, force) = (self.normal, self.area * self.pressure);
        for a in 0..6 {
            for b in 0..6 {
                let ([w, v], [s, t]) =
                    ([a, b].map(|k| self.weights[k]), [a, b].map(|k| self.slopes[k]));
                let turn: f64 = s.iter().zip(t).map(|(s, t)| s * t).sum();
                let along = self.stiffness * w * v + force * self.gap * turn;
                let entries = std::array::from_fn(|entry| {
                    let (i, k) = (entry / 3, entry % 3);
                    along * n[i] * n[k] + force * (w * t[i] * n[k] + v * n[i] * s[k])
                });
                take(self.nodes[a], self.nodes[b], entries);
            }
        }
    }
}

/// The mean of the values at the corners of a triangle.
fn mean(corners: &[[f64; 3]; 3], weights: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|k| weights[k] * corners[k][i]).sum())
}

fn softer(one: Layer, other: Layer) -> Layer {
    if other.stiffness < one.stiffness { other } else { one }
}

fn area(points: &[[f64; 3]], triangle: &[u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|node| points[node as usize]);
    0.5 * norm(cross(sub(b, a), sub(c, a)))
}
