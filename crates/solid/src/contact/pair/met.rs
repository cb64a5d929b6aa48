//! What a pair met where a step has ended, kept while the next one is tried: one that fails leaves its own pieces.

use super::{ActivePair, Sample};
use crate::contact::meeting::Meeting;

/// The samples of a pair with its surfaces at these places, what they meet, and the smallest gap.
#[derive(Clone)]
pub struct Met {
    places: Vec<[f64; 3]>,
    samples: Vec<Sample>,
    touching: Vec<Meeting>,
    gap: f64,
}

impl ActivePair {
    /// What it met where it was linearized last.
    pub(in super::super) fn met(&self) -> Met {
        let ActivePair { places, samples, touching, gap, .. } = self;
        let (places, samples) = (places.clone(), samples.clone());
        Met { places, samples, touching: touching.clone(), gap: *gap }
    }

    /// Goes back there: linearized at that displacement again, it meets the same.
    pub(in super::super) fn go_back(&mut self, met: Met) {
        let Met { places, samples, touching, gap } = met;
        (self.places, self.samples, self.touching, self.gap) = (places, samples, touching, gap);
        self.is_placed = true;
    }
}
