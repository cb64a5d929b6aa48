//! Two probes on a model, one in each hand, which feel each other through the organ.

use viscera_touch::{Felt, Probe, ProbeGroup, ReducedModel};

/// The probes of the first hand and of the second, and what each has felt last.
pub struct Pair {
    probes: [Probe; 2],
    group: ProbeGroup,
    felt: [Option<Felt>; 2],
}

impl Pair {
    /// The probe that a hand, 0 or 1, holds goes on from where it is; the other one is like it, and nowhere yet.
    pub fn new(model: &ReducedModel, held: &Probe, hand: usize) -> Self {
        let mut probes = [held.clone(), held.clone()];
        probes[1 - hand.min(1)].lift();
        Pair { probes, group: ProbeGroup::new(model, 2), felt: [None; 2] }
    }

    /// Moves the centres of both.
    pub fn place(&mut self, model: &ReducedModel, centers: [[f64; 3]; 2]) {
        let [one, other] = &mut self.probes;
        let told = self.group.place(model, &mut [one, other], &centers);
        self.felt.iter_mut().zip(told).for_each(|(felt, &told)| *felt = Some(told));
    }

    /// What the probe of a hand has felt last; none before it has been placed.
    pub fn felt(&self, hand: usize) -> Option<Felt> {
        self.felt[hand.min(1)]
    }

    /// The probe of a hand, where it is.
    pub fn into_probe(self, hand: usize) -> Probe {
        let [one, other] = self.probes;
        if hand == 0 { one } else { other }
    }
}
