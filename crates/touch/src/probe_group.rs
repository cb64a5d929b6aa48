//! Several probes on one model, which feel each other through the organ.
//!
//! Each meets the surface as the others leave it. The fields of single touches are superposed: with the contacts `s_j` and
//! the displacements `d_j` of their patches, the surface at `s_k` has moved by `w_k = sum_{j != k} u(s_k; s_j, d_j)`, so
//! probe `k` touches as if its centre were at `c_k - w_k`. The force of a touch acts at its own contact alone, so this is
//! exact in linear elasticity; what large strains add is part of the estimate. A tick finds the common equilibrium by a
//! sweep or two over the probes, from the touches of the last tick.

use super::balance::is_duration;
use super::contact::Contact;
use super::evaluate::Trust;
use super::felt::{Felt, Grip};
use super::interpolation::Interpolation;
use super::model::ReducedModel;
use super::probe::{Probe, State};
use std::ops::DerefMut;
use viscera_mesh::{norm, sub};

/// Sweeps over all probes in a tick, at most.
const SWEEPS: usize = 2;

/// How far from where a probe has met it the others may leave the surface, in units of its radius, without another sweep.
const STILL: f64 = 1e-3;

/// Part of what a sweep has left that the next one leaves, at most.
const SLOWEST: f64 = 0.9;

/// Part of the sum of the radii of two spheres, nearer than which their centres are not: no two rigid bodies are in one place,
/// and how they would share what the organ gives is left open.
const APART: f64 = 0.5;

/// Memory of several probes on one model: what each felt last.
#[derive(Clone, Debug)]
pub struct ProbeGroup {
    /// How far the others had moved the surface where each probe met it [m].
    carried: Vec<[f64; 3]>,
    /// What the last sweep has left of that [m].
    left: Vec<f64>,
    begun: Vec<State>,
    /// Of each probe that has been placed.
    felt: Vec<Felt>,
    workspace: Vec<f32>,
}

impl ProbeGroup {
    /// For so many probes on a model.
    pub fn new(model: &ReducedModel, probes: usize) -> Self {
        ProbeGroup {
            carried: vec![[0.0; 3]; probes],
            left: vec![0.0; probes],
            begun: vec![State::default(); probes],
            felt: Vec::with_capacity(probes),
            workspace: vec![0.0; model.workspace_len()],
        }
    }

    /// Moves the centres of all probes to places, and tells what each feels there. It allocates nothing.
    ///
    /// # Panics
    /// If there are not as many probes and places as it was made for.
    pub fn place(
        &mut self,
        model: &ReducedModel,
        probes: &mut [impl DerefMut<Target = Probe>],
        centers: &[[f64; 3]],
    ) -> &[Felt] {
        self.step(model, probes, |k, probe| probe.place(model, centers[k]))
    }

    /// Draws all probes by their couplings to devices, `dt` seconds after the last step, as [`Probe::follow`]. It allocates
    /// nothing. None, with all as they were, unless `dt` is at least 0 and finite.
    ///
    /// # Panics
    /// As [`ProbeGroup::place`].
    pub fn follow(
        &mut self,
        model: &ReducedModel,
        probes: &mut [impl DerefMut<Target = Probe>],
        devices: &[[f64; 3]],
        dt: f64,
    ) -> Option<&[Felt]> {
        is_duration(dt)
            .then(|| self.step(model, probes, |k, probe| probe.drawn(model, devices[k], dt)))
    }

    fn step(
        &mut self,
        model: &ReducedModel,
        probes: &mut [impl DerefMut<Target = Probe>],
        act: impl Fn(usize, &mut Probe) -> Felt,
    ) -> &[Felt] {
        assert_eq!(probes.len(), self.begun.len(), "probes that this was not made for");
        self.begun.iter_mut().zip(probes.iter()).for_each(|(begun, probe)| *begun = probe.state);
        for sweep in 0..SWEEPS {
            if sweep > 0 && self.is_still(model, probes) {
                break;
            }
            for (k, probe) in probes.iter_mut().enumerate() {
                probe.state = self.begun[k];
                probe.balanced = self.felt.get(k).filter(|_| sweep > 0).map(|felt| felt.center);
                self.carried[k] = self.carried(model, k);
                probe.carried = self.carried[k];
                let felt = act(k, &mut *probe);
                (probe.carried, probe.balanced) = ([0.0; 3], None);
                match self.felt.get_mut(k) {
                    Some(last) => *last = felt,
                    None => self.felt.push(felt),
                }
            }
        }
        self.doubt(model, probes);
        &self.felt
    }

    /// What the sweeps have left open is part of the estimates: each leaves a part of what the one before it has left, and so
    /// would all that follow. It counts for every probe, since what one has still to move moves the others, too. Where a probe
    /// is too deep for the model its field is not known, nor then is what the others feel of it. Nor is what probes feel that
    /// are in one place, one of which may seem free.
    fn doubt(&mut self, model: &ReducedModel, probes: &[impl DerefMut<Target = Probe>]) {
        let mut open: f64 = 0.0;
        for k in 0..probes.len() {
            let (before, now) = (self.left[k], self.off(model, k));
            let part = if now < before { now / before } else { SLOWEST };
            open = open.max(now / (1.0 - part.min(SLOWEST)));
        }
        let is_too_deep = |felt: &Felt| felt.trust == Trust::BeyondDepth;
        let too_deep = self.felt.iter().filter(|felt| is_too_deep(felt)).count();
        for (k, probe) in probes.iter().enumerate() {
            let felt = self.felt[k];
            if self.shares_its_place(k, probes) {
                self.felt[k] = probe.doubt(felt, 1.0);
                continue;
            }
            let is_carried = norm(self.carried[k]) > STILL * probe.radius();
            if !presses(&felt) || !is_carried {
                continue;
            }
            let knows_others = too_deep == usize::from(is_too_deep(&felt));
            self.felt[k] = probe.doubt(felt, if knows_others { open / -felt.gap } else { 1.0 });
        }
    }

    /// Whether another probe is in the place of a probe, and one of them presses.
    fn shares_its_place(&self, k: usize, probes: &[impl DerefMut<Target = Probe>]) -> bool {
        let here = &self.felt[k];
        let shares = |(j, there): (usize, &Felt)| {
            let least = APART * (probes[k].radius() + probes[j].radius());
            j != k
                && (presses(here) || presses(there))
                && norm(sub(here.center, there.center)) < least
        };
        self.felt.iter().enumerate().any(shares)
    }

    /// Whether each probe has met the surface about where the others leave it.
    fn is_still(&mut self, model: &ReducedModel, probes: &[impl DerefMut<Target = Probe>]) -> bool {
        for k in 0..probes.len() {
            self.left[k] = self.off(model, k);
        }
        self.left.iter().zip(probes).all(|(left, probe)| *left <= STILL * probe.radius())
    }

    /// How far the others have moved the surface since a probe met it [m].
    fn off(&mut self, model: &ReducedModel, k: usize) -> f64 {
        norm(sub(self.carried(model, k), self.carried[k]))
    }

    /// How far the others have moved the surface where a probe met it last [m].
    fn carried(&mut self, model: &ReducedModel, k: usize) -> [f64; 3] {
        let mut carried = [0.0; 3];
        let Some(here) = self.felt.get(k) else { return carried };
        for (j, felt) in self.felt.iter().enumerate() {
            if j != k && presses(felt) {
                let moved = model.moved_at(&here.contact, felt, &mut self.workspace);
                (0..3).for_each(|i| carried[i] += moved[i]);
            }
        }
        carried
    }
}

fn presses(felt: &Felt) -> bool {
    matches!(felt.grip, Grip::Sticks | Grip::Slides)
}

impl ReducedModel {
    /// Displacement of a point of the touchable surface under what a probe presses [m].
    fn moved_at(&self, at: &Contact, touch: &Felt, workspace: &mut [f32]) -> [f64; 3] {
        let here = Interpolation::new(self, &touch.contact);
        let slots = here.amplitudes(touch.displacement, workspace);
        let nodes = &self.arrays.surface_nodes;
        let width = 3 * nodes.len();
        let rows = self.triangles[at.triangle].map(|position| {
            let node = self.arrays.positions[position as usize];
            nodes.binary_search(&node).unwrap_or(0)
        });
        let mut moved = [0.0; 3];
        for (slot, amplitudes) in slots.iter().zip(workspace.chunks_exact(self.largest_region)) {
            let Some(region) = *slot else { continue };
            for (mode, amplitude) in self.region_modes(region).zip(amplitudes) {
                let factor = f64::from(amplitude * self.arrays.mode_scale[mode]);
                let mode = &self.arrays.surface_modes[mode * width..(mode + 1) * width];
                for (row, weight) in rows.iter().zip(at.weights) {
                    let share = factor * weight;
                    (0..3).for_each(|i| moved[i] += share * f64::from(mode[3 * row + i]));
                }
            }
        }
        moved
    }
}
