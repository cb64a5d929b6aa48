//! The samples of a pair: where they are on the common pieces of both surfaces, and what they meet.

use super::{ActivePair, Sample, area, mean};
use crate::contact::facets::{Candidates, Gap, Placed};
use crate::contact::layer::Layer;
use crate::contact::meeting::Meeting;
use crate::mesh::{Boxes, cross, dot, norm, overlap_of, sub};

/// How far, over the reach, a surface moves before a step finds the pieces anew. After so many renewals they stay until the
/// iteration has converged on them, so that it ends as Newton's does, or until a surface has moved as far as `GONE`.
const STILL: f64 = 1e-5;
const RENEWALS: usize = 20;
const GONE: f64 = 0.25;

/// How far from the other surface triangles are sampled, over the reach: if both have moved as far as `GONE`, the others are still
/// out of reach.
const SAMPLED: f64 = 1.0 + 2.0 * GONE;

/// How deep a surface may be behind the face that it has come in by, over the height of the lower of the cells behind them. A
/// body is at least as thick as a cell is high: deeper, it is the far side of something thin, seen through both bodies.
pub(super) const DEEPEST: f64 = 0.5;

/// Cosine of the angle to the opposite direction below which normals of two surfaces face each other.
const FACING: f64 = 0.5;

/// A rule of degree 2 on a triangle: three points of equal weight.
pub(super) const RULE: [[f64; 3]; 3] = [
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];

impl ActivePair {
    /// Whether the samples are to be found anew.
    pub(super) fn is_due(&self) -> bool {
        let stays = self.is_kept || self.renewals >= RENEWALS;
        self.has_moved(if stays { GONE } else { STILL })
    }

    /// Has the pieces found anew where the surfaces are, unless these have stayed since they were found; whether they have
    /// not. With friction, which ties the samples, the pieces stay.
    pub(in super::super) fn renew(&mut self) -> bool {
        let is_old = self.friction.is_none() && !self.renewed.is_empty() && self.has_moved(STILL);
        if is_old {
            self.renewed.clear();
            self.is_placed = false;
        }
        is_old
    }

    /// Whether a surface has moved as far since its samples were found, over the reach.
    fn has_moved(&self, far: f64) -> bool {
        let mut pairs = self.places.iter().zip(&self.renewed);
        self.renewed.is_empty() || pairs.any(|(x, y)| norm(sub(*x, *y)) > far * self.reach)
    }

    /// Finds the samples where the surfaces are now: on their common pieces, and on whole triangles near the other surface
    /// that have none.
    pub(super) fn find_samples(&mut self) {
        let (places, own) = (&self.places, self.sampled.triangles());
        let mut is_covered = vec![false; own.len()];
        let mut samples = Vec::new();
        let (near, pairs) = self.near();
        for piece in overlap_of(places, own, self.other.triangles(), &pairs, self.reach) {
            let [triangle, other] = piece.triangles.map(|t| t as usize);
            let deepest = self.deepest(triangle, other);
            if piece.depth > deepest {
                continue;
            }
            is_covered[triangle] = true;
            let part = piece.area / area(places, &own[triangle]);
            let layer = softer(self.layers[0][triangle], self.layers[1][other]);
            for point in RULE {
                let weights = std::array::from_fn(|i| {
                    (0..3).map(|k| point[k] * piece.corners[k][0][i]).sum::<f64>()
                });
                let area = part * self.areas[triangle] / 3.0;
                samples.push(Sample {
                    triangle: triangle as u32,
                    weights,
                    area,
                    layer,
                    opposite: Some((other as u32, deepest)),
                    tied: None,
                });
            }
        }
        let softest = self.layers[1].iter().copied().reduce(softer);
        let is_bare = |&&triangle: &&u32| !is_covered[triangle as usize];
        for triangle in near.iter().filter(is_bare).map(|&triangle| triangle as usize) {
            let layer =
                softest.map_or(self.layers[0][triangle], |s| softer(s, self.layers[0][triangle]));
            let area = self.areas[triangle] / 3.0;
            let sample = |weights| Sample {
                triangle: triangle as u32,
                weights,
                area,
                layer,
                opposite: None,
                tied: None,
            };
            samples.extend(RULE.map(sample));
        }
        let mut is_far = vec![self.self_contact.is_none(); own.len()];
        near.iter().for_each(|&triangle| is_far[triangle as usize] = false);
        self.far = (0u32..).zip(is_far).filter(|(_, is_far)| *is_far).map(|(t, _)| t).collect();
        self.samples = samples;
    }

    /// The triangles of the sampled surface that are near the other, ascending, and the pairs of them and of triangles of the
    /// other that may have common pieces.
    fn near(&self) -> (Vec<u32>, Vec<[u32; 2]>) {
        if let Some(candidates) = &self.self_contact {
            return (candidates.triangles(), candidates.pairs().to_vec());
        }
        let boxes = Boxes::new(&self.places, self.other.triangles());
        let (mut near, mut pairs) = (Vec::new(), Vec::new());
        for (number, triangle) in (0u32..).zip(self.sampled.triangles()) {
            let corners = triangle.map(|corner| self.places[corner as usize]);
            if boxes.are_near(&corners, SAMPLED * self.reach) {
                near.push(number);
                let start = pairs.len();
                boxes.each_near(&corners, self.reach, |other| pairs.push([number, other as u32]));
                pairs[start..].sort_unstable();
            }
        }
        (near, pairs)
    }

    /// Place and gap of a sample, if the other surface is near. Just inside a sharp edge the side behind it may be closer
    /// than the face that has come in, and does not push it out: that face is the one which counts. A sample outside has not
    /// come in: it may face the far side of something thin, through both bodies. A surface meets itself
    /// only where it faces itself: in a sharp crease its two sides look past each other.
    pub(super) fn gap_at(
        &self,
        sample: &Sample,
        places: &[[f64; 3]],
        other: &Placed,
    ) -> Option<([f64; 3], Gap)> {
        let place = self.place_of(sample, places);
        let closest = other.gap(place, self.reach, self.candidates(sample))?;
        let faces = |gap: &Gap| {
            let [a, b, c] = self.sampled.triangles()[sample.triangle as usize]
                .map(|corner| places[corner as usize]);
            let normal = cross(sub(b, a), sub(c, a));
            dot(normal, gap.normal) < -FACING * norm(normal)
        };
        let gap = match sample.opposite {
            Some((opposite, deepest))
                if closest.triangle != opposite as usize
                    && closest.gap < 0.0
                    && !faces(&closest) =>
            {
                other.behind(opposite as usize, place, deepest).unwrap_or(closest)
            }
            _ => closest,
        };
        if self.self_contact.is_some() && !faces(&gap) {
            return None;
        }
        Some((place, gap))
    }

    /// How deep a triangle of the sampled surface may be behind one of the other [m].
    fn deepest(&self, triangle: usize, other: usize) -> f64 {
        (DEEPEST * self.heights[0][triangle].min(self.heights[1][other])).min(self.reach)
    }

    /// What a sample may touch.
    pub(super) fn candidates(&self, sample: &Sample) -> Candidates<'_> {
        let list = self.self_contact.as_ref();
        list.map_or(Candidates::All, |list| list.candidates(sample.triangle))
    }

    pub(super) fn place_of(&self, sample: &Sample, places: &[[f64; 3]]) -> [f64; 3] {
        let triangle = self.sampled.triangles()[sample.triangle as usize];
        mean(&triangle.map(|node| places[node as usize]), sample.weights)
    }

    pub(super) fn meeting(&self, number: usize, place: [f64; 3], gap: Gap) -> Option<Meeting> {
        let sample = &self.samples[number];
        let [energy, pressure, slope] = sample.layer.at(gap.gap);
        if pressure == 0.0 {
            return None;
        }
        let own = self.sampled.triangles()[sample.triangle as usize];
        let other = self.other.triangles()[gap.triangle];
        let still = [0.0; 3];
        Some(Meeting {
            sample: number,
            corners: std::array::from_fn(|i| if i < 3 { own[i] } else { other[i - 3] }),
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
            tie: None,
        })
    }
}

fn softer(one: Layer, other: Layer) -> Layer {
    if other.stiffness < one.stiffness { other } else { one }
}
