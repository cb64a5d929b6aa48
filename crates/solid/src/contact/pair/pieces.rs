//! The samples of a pair: where they are on the common pieces of both surfaces, and what they meet.

use super::{ActivePair, Sample, area, mean};
use crate::contact::facets::{Candidates, Gap, Placed};
use crate::contact::layer::Layer;
use crate::contact::meeting::Meeting;
use crate::mesh::{cross, dot, norm, overlap, sub};

/// How often a step finds the pieces anew at most, and how far, relative to the reach, a surface moves before it does:
/// where they stay, the iteration ends as Newton's does.
const RENEWALS: usize = 20;
const STILL: f64 = 1e-5;

/// Cosine of the angle to the opposite direction below which normals of two surfaces face each other.
const FACING: f64 = 0.5;

/// A rule of degree 2 on a triangle: three points of equal weight.
const RULE: [[f64; 3]; 3] = [
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];

impl ActivePair {
    /// Whether the samples are to be found anew.
    pub(super) fn is_due(&self) -> bool {
        !self.is_kept && self.renewals < RENEWALS && self.has_moved()
    }

    /// Whether a surface has moved since its samples were found.
    fn has_moved(&self) -> bool {
        let still = STILL * self.reach;
        let pairs = self.places.iter().zip(&self.renewed);
        self.renewed.is_empty() || pairs.into_iter().any(|(x, y)| norm(sub(*x, *y)) > still)
    }

    /// The samples where the surfaces are now: on their common pieces, and on whole triangles that have none.
    pub(super) fn pieces(&self) -> Vec<Sample> {
        let (places, own) = (&self.places, self.sampled.triangles());
        let mut is_covered = vec![false; own.len()];
        let mut samples = Vec::new();
        let pieces = match &self.own {
            Some(surface) => surface.pieces(own, places),
            None => overlap(places, own, self.other.triangles(), self.reach),
        };
        for piece in pieces {
            let [triangle, other] = piece.triangles.map(|t| t as usize);
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
                    opposite: Some(other as u32),
                    tied: None,
                });
            }
        }
        let softest = self.layers[1].iter().copied().reduce(softer);
        let near: Vec<usize> = match &self.own {
            Some(surface) => surface.near().collect(),
            None => (0..own.len()).collect(),
        };
        for triangle in near.into_iter().filter(|&triangle| !is_covered[triangle]) {
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
        samples
    }

    /// Place and gap of a sample, if the other surface is near. Just inside a sharp edge the side behind it may be closer
    /// than the face that has come in, and does not push it out: that face is the one which counts. A surface meets itself
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
            Some(opposite) if closest.triangle != opposite as usize && !faces(&closest) => {
                other.behind(opposite as usize, place, self.reach).unwrap_or(closest)
            }
            _ => closest,
        };
        if self.own.is_some() && !faces(&gap) {
            return None;
        }
        Some((place, gap))
    }

    /// What a sample may touch.
    pub(super) fn candidates(&self, sample: &Sample) -> Candidates<'_> {
        self.own.as_ref().map_or(Candidates::All, |own| own.candidates(sample.triangle))
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
