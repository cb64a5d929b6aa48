//! How far a step may go before a surface is much deeper in the other than it was.

use super::passage::but_for_the_mean;
use super::pieces::RULE;
use super::{ActivePair, mean};
use crate::contact::facets::{Candidates, Facets};
use crate::contact::layer::Layer;
use crate::mesh::{dot, norm, sub};

/// How much deeper a step may lead one surface into the other, over the reach: the tangent knows no more than its face.
const DEEPER: f64 = 0.1;

/// The same over the depth at which the layer bears the modulus. Up to there its stiffness is much the same, and the next step
/// finds where it balances. From beyond its stiffer part a step would lead out of it again, the next one as deep, and so on.
const INTO_LAYER: f64 = 1.0;

impl ActivePair {
    /// The part of a step, possibly more than all of it, that leads no surface much deeper into the other.
    pub(in super::super) fn longest(&self, u: &[f64], step: &[f64]) -> f64 {
        self.longest_into(u, step, f64::INFINITY)
    }

    /// The same that leads none beyond where the layer is as stiff as at its beginning.
    pub(in super::super) fn longest_in_layer(&self, u: &[f64], step: &[f64]) -> f64 {
        self.longest_into(u, step, INTO_LAYER)
    }

    /// The same that leads none deeper by so much of the layer.
    fn longest_into(&self, u: &[f64], step: &[f64], part: f64) -> f64 {
        let places = self.places_at(u);
        let motion = self.motion(step);
        let fastest = |facets: &Facets| {
            let nodes = facets.triangles().iter().flatten();
            nodes.map(|&node| norm(motion[node as usize])).fold(0.0, f64::max)
        };
        let (own_speed, its_speed) = (fastest(&self.sampled), fastest(&self.other));
        let into = |layer: &Layer| (part * layer.depth).min(DEEPER * self.reach);
        let layers = self.layers.iter().flatten();
        let deeper = layers.map(into).fold(f64::INFINITY, f64::min);
        let speed = own_speed + its_speed;
        let most = (self.apart(&places).max(0.0) + deeper) / speed;
        if speed <= deeper || self.are_apart(&places) {
            return most;
        }
        let other = self.other.at(&places);
        let mut longest = if self.self_contact.is_some() { most.min(1.0) } else { 1.0 };
        for sample in &self.samples {
            let place = self.place_of(sample, &places);
            let own =
                self.sampled.triangles()[sample.triangle as usize].map(|n| motion[n as usize]);
            let own = mean(&own, sample.weights);
            let (candidates, deeper) = (self.candidates(sample), into(&sample.layer));
            let Some(closest) = other.closest(place, self.reach, candidates) else {
                let free = || other.closest(place, f64::INFINITY, candidates).map(|c| c.distance);
                longest = self.before_touch(longest, norm(own) + its_speed, deeper, free);
                continue;
            };
            let Some(gap) = other.gap_to(place, closest, candidates) else {
                longest = longest.min((closest.distance + deeper) / (norm(own) + its_speed));
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
        // What has no samples is to come no nearer than to touch: a step does not see its energy.
        for &far in &self.far {
            let triangle = self.sampled.triangles()[far as usize];
            let own = triangle.iter().map(|&n| norm(motion[n as usize])).fold(0.0, f64::max);
            let corners = triangle.map(|n| places[n as usize]);
            let distance = |point| {
                let place = mean(&corners, point);
                other.closest(place, f64::INFINITY, Candidates::All).map(|c| c.distance)
            };
            let free = || RULE.into_iter().filter_map(distance).reduce(f64::min);
            longest = self.before_touch(longest, own + its_speed, 0.0, free);
        }
        longest
    }

    /// The part of a step, at most `longest`, in which something out of reach goes no farther than it is away, and as deep. It
    /// is asked how far that is only if it matters.
    fn before_touch(
        &self,
        longest: f64,
        speed: f64,
        deeper: f64,
        free: impl FnOnce() -> Option<f64>,
    ) -> f64 {
        if (self.reach + deeper) / speed >= longest {
            return longest;
        }
        free().map_or(longest, |free| longest.min((free + deeper) / speed))
    }

    /// How the nodes of both surfaces move, but for what they all do: that brings nothing together.
    fn motion(&self, step: &[f64]) -> Vec<[f64; 3]> {
        let corners = 0..self.corners.len();
        but_for_the_mean(corners.map(|corner| self.carriers.mean(corner, step)).collect())
    }

    /// Whether the surfaces are too far apart to touch.
    pub(super) fn are_apart(&self, places: &[[f64; 3]]) -> bool {
        match &self.self_contact {
            Some(candidates) => candidates.is_empty(),
            None => self.separation(places) > self.reach,
        }
    }

    /// How far apart the surfaces are at least, or what of one surface is not listed as near [m].
    fn apart(&self, places: &[[f64; 3]]) -> f64 {
        match &self.self_contact {
            Some(candidates) => candidates.clearance(places),
            None => self.separation(places),
        }
    }

    /// How far apart the boxes around both surfaces are along an axis; negative where they overlap along all.
    fn separation(&self, places: &[[f64; 3]]) -> f64 {
        let [one, other] = self.boxes(places);
        let along = |k: usize| (one[0][k] - other[1][k]).max(other[0][k] - one[1][k]);
        (0..3).map(along).fold(f64::MIN, f64::max)
    }

    /// Lower and upper corners of the boxes around the sampled surface and the other.
    pub(super) fn boxes(&self, places: &[[f64; 3]]) -> [[[f64; 3]; 2]; 2] {
        [&self.sampled, &self.other].map(|facets| {
            let corners = facets.triangles().iter().flatten().map(|&node| places[node as usize]);
            let mut ends = [[f64::MAX; 3], [f64::MIN; 3]];
            for x in corners {
                (0..3).for_each(|k| ends[0][k] = ends[0][k].min(x[k]));
                (0..3).for_each(|k| ends[1][k] = ends[1][k].max(x[k]));
            }
            ends
        })
    }
}
