//! What the reduced energy is summed over: linear cells one by one, in panels that are made for them; of other elements,
//! units that are a body of their own. Linear cells could be units, too: their forces then take two to three times as
//! long, their tangents up to twice (`panels_beside_units` of the tests, which `make bench` prints).

use super::cells::SampledCells;
use super::origin::Origin;
use super::reduced_energy::{Reduced, Wanted};
use super::units::SamplingUnits;
use crate::body::SharedNodes;
use crate::element::Element;
use crate::equilibrium::Rounding;
use crate::number::dot;

/// Sampling units of a body ([`crate::body::WeightedSubset`]), and the modes on them. Energies and forces are those of
/// the law alone.
#[derive(Clone)]
enum SampledEnergy {
    /// Linear cells.
    Cells(SampledCells),
    /// Cells of other elements, or clusters of them.
    Units(Box<SamplingUnits>),
}

impl SampledEnergy {
    fn new(
        origin: &Origin,
        units: &[usize],
        weights: &[f64],
        shared: SharedNodes,
        modes: &[Vec<f64>],
    ) -> Self {
        match origin.body.element() {
            Element::P1 => SampledEnergy::Cells(SampledCells::new(origin, units, weights, modes)),
            Element::P1MeanVolume | Element::P2 => {
                let subset = origin.body.subset(units, weights, shared);
                let units = SamplingUnits::new(subset, &origin.displacement, modes);
                SampledEnergy::Units(Box::new(units))
            }
        }
    }

    fn evaluate(&mut self, q: &[f64], wanted: Wanted, reduced: &mut Reduced) {
        match self {
            SampledEnergy::Cells(cells) => cells.evaluate(q, wanted, reduced),
            SampledEnergy::Units(units) => units.evaluate(q, wanted, reduced),
        }
    }

    fn share(&mut self, is_shared: bool) {
        match self {
            SampledEnergy::Cells(_) => {}
            SampledEnergy::Units(units) => units.stay_on_one_thread(!is_shared),
        }
    }

    fn forces(&mut self, q: &[f64]) -> Vec<f64> {
        match self {
            SampledEnergy::Cells(cells) => cells.forces(q),
            SampledEnergy::Units(units) => units.forces(q),
        }
    }
}

/// Some units with weights: the energy of a body in the coordinates of the modes.
#[derive(Clone)]
pub(super) struct Sampled {
    sum: SampledEnergy,
    /// Energy and force in the origin, where a load that stays is in balance with them.
    energy: f64,
    force: Vec<f64>,
    rounding: Rounding,
    is_shared: bool,
}

impl Sampled {
    /// Some units, each counting `weights` times; `modes` are runs of all degrees of freedom. It has all the memory that
    /// its evaluations on one thread need.
    pub fn new(origin: &Origin, units: &[usize], weights: &[f64], modes: &[Vec<f64>]) -> Self {
        let mut sum = SampledEnergy::new(origin, units, weights, SharedNodes::Merged, modes);
        let mut there = Reduced::new(modes.len());
        sum.share(false);
        sum.evaluate(&vec![0.0; modes.len()], Wanted::Tangent, &mut there);
        sum.share(true);
        let (energy, force, rounding) = (there.energy, there.force, origin.rounding);
        Sampled { sum, energy, force, rounding, is_shared: true }
    }

    /// Whether threads share the work.
    pub fn share(&mut self, is_shared: bool) {
        self.sum.share(is_shared);
        self.is_shared = is_shared;
    }

    /// Energy and force at `q`, and the tangent where asked for.
    pub fn evaluate(&mut self, q: &[f64], with_tangent: bool, reduced: &mut Reduced) {
        let wanted = match (with_tangent, self.is_shared) {
            (false, _) => Wanted::Force,
            (true, false) => Wanted::Tangent,
            (true, true) => Wanted::SharedTangent,
        };
        self.sum.evaluate(q, wanted, reduced);
        reduced.energy -= self.energy + dot(&self.force, q);
        reduced.force.iter_mut().zip(&self.force).for_each(|(f, there)| *f -= there);
    }

    /// Whether an energy is not higher than a bound, as far as rounding lets them be compared.
    pub fn is_no_higher(&self, energy: f64, bound: f64) -> bool {
        self.rounding.is_no_higher(energy, bound, bound.abs() + self.energy.abs())
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        match &self.sum {
            SampledEnergy::Cells(cells) => cells.len(),
            SampledEnergy::Units(units) => units.n_cells(),
        }
    }
}

/// Some units without a node in common, for the force of each of them.
pub(super) struct OneByOne {
    sum: SampledEnergy,
    /// Their forces in the origin.
    there: Vec<f64>,
}

impl OneByOne {
    /// Of these units; `modes` are runs of all degrees of freedom.
    pub fn new(origin: &Origin, units: &[usize], modes: &[Vec<f64>]) -> Self {
        let ones = vec![1.0; units.len()];
        let mut sum = SampledEnergy::new(origin, units, &ones, SharedNodes::Duplicated, modes);
        let there = sum.forces(&vec![0.0; modes.len()]);
        OneByOne { sum, there }
    }

    /// The force of each along each mode at `q`: runs of all modes, unit by unit.
    pub fn forces(&mut self, q: &[f64]) -> Vec<f64> {
        let mut forces = self.sum.forces(q);
        forces.iter_mut().zip(&self.there).for_each(|(f, there)| *f -= there);
        forces
    }
}
