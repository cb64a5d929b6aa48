//! Friction between two surfaces: the return mapping of tools. Since samples come and go with the pieces, the stretch of
//! the springs is carried along by the sampled surface: a sample takes that of the nearest one at the end of the last step,
//! and is tied to the point of the other surface that was so far behind it then.

use super::{ActivePair, mean};
use crate::contact::carried::Carried;
use crate::contact::meeting::{Meeting, Tie};
use crate::mesh::sub;

impl ActivePair {
    /// A step ends where it was linearized last.
    pub(in super::super) fn end(&mut self) {
        if self.friction.is_none() {
            return;
        }
        let before = std::mem::take(&mut self.dissipated);
        let mut left = vec![[0.0; 3]; self.samples.len()];
        for meeting in &self.touching {
            if let Some(tie) = &meeting.tie {
                left[meeting.sample] = tie.elastic();
                self.dissipated += tie.slip().1;
            }
        }
        let samples = self.samples.iter().zip(left);
        self.left =
            Some(Carried::new(samples.map(|(s, stretch)| (s.triangle, s.weights, stretch))));
        self.dissipation = self.dissipated - before;
    }

    /// Ties the samples that touch, as far as they are new, to the points of the other surface that they stick to. One that
    /// was out of reach at the start of the step is tied to the point that it touches first.
    pub(super) fn tie(&mut self, touching: &[Meeting]) {
        let is_new = |meeting: &&Meeting| self.samples[meeting.sample].tied.is_none();
        let new: Vec<usize> =
            touching.iter().filter(is_new).map(|meeting| meeting.sample).collect();
        if new.is_empty() {
            return;
        }
        let (before, now) = (self.other.at(&self.origin), self.other.at(&self.places));
        let (mut found, mut n_far) = (Vec::with_capacity(new.len()), 0);
        for &number in &new {
            let sample = &self.samples[number];
            let behind = self.stretches.nearest(sample.triangle, sample.weights);
            let start = sub(self.place_of(sample, &self.origin), behind.unwrap_or([0.0; 3]));
            let candidates = self.candidates(sample);
            let closest = before.closest(start, self.reach, candidates).or_else(|| {
                n_far += 1;
                now.closest(self.place_of(sample, &self.places), self.reach, candidates)
            });
            found.push(closest.map(|closest| (closest.triangle as usize, closest.barycentric)));
        }
        drop((before, now));
        self.was_out_of_reach |= n_far > 0;
        for (number, tied) in new.into_iter().zip(found) {
            self.samples[number].tied = tied;
        }
    }

    /// Adds friction to a sample that touches.
    pub(super) fn rub(&self, meeting: &mut Meeting) {
        let sample = &self.samples[meeting.sample];
        let Some((triangle, weights)) = sample.tied else { return };
        let (corners, place) = self.point_of_other(triangle, weights, &self.places);
        let bound = meeting.area * self.friction.bound(meeting.pressure);
        let tie = Tie::new(
            std::array::from_fn(|i| if i < 3 { meeting.corners[i] } else { corners[i - 3] }),
            std::array::from_fn(|i| if i < 3 { sample.weights[i] } else { -weights[i - 3] }),
            meeting.area * sample.layer.stiffness,
            bound,
        );
        let slid = self.slides.nearest(sample.triangle, sample.weights);
        meeting.tie(tie, sub(meeting.place, place), slid.unwrap_or([0.0; 3]));
    }

    /// The corners of a triangle of the other surface, and the point with these weights.
    pub(super) fn point_of_other(
        &self,
        triangle: usize,
        weights: [f64; 3],
        places: &[[f64; 3]],
    ) -> ([u32; 3], [f64; 3]) {
        let corners = self.other.triangles()[triangle];
        (corners, mean(&corners.map(|node| places[node as usize]), weights))
    }
}
