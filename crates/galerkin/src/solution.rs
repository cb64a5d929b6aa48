//! The result of a search for equilibrium, and its assessment.
//!
//! With force `f` and tangent `K` of the whole body in an answer `u`, two steps of Newton's method by this tangent,
//!   K z_1 - A^T F_1 = -f(u),   K z_2 - A^T F_2 = -f(u + z_1),   A z_1 = A z_2 = 0,
//! with `A` the means of the patches, lead towards the equilibrium. They shrink by `r = |z_2| / |z_1|`, and so will those
//! to come: the field is about `|z_1| / (1 - r)` away from it, and its forces are near `F_2`, with
//! `|F_2 - F_1| r / (1 - r)` still to come (the simplified Newton method: Deuflhard, Newton Methods for Nonlinear
//! Problems, 2011, section 2.1). The first step alone would miss how much softer the organ is there. If the tangent is
//! not positive definite, the organ would not stay in this state, however small the steps are.

use super::contacts::ReducedContacts;
use super::newton::ReducedStatus;
use super::snapshots::Correction;
use crate::error::Error;
use crate::number::norm;
use crate::reduced::allowance;
use std::sync::Arc;

/// Whether a solution is trusted, and if not, why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// The error estimate is within the allowance at this depth.
    Trusted,
    /// No equilibrium was found.
    NotConverged,
    /// The search ran out of time.
    OutOfTime,
    /// A sampled cell is inverted.
    Inverted,
    /// A contact is displaced farther than in training.
    BeyondDepth,
    /// The whole organ would not stay in this state.
    Unstable,
    /// The error estimate is larger than allowed.
    ErrorTooLarge,
}

/// Assessment of a solution by the whole body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assessment {
    /// Error estimate of the forces, relative to their norm over all contacts; at most 1.
    pub force_error: f64,
    /// Error estimate of the field, relative to its norm; at most 1.
    pub shape_error: f64,
    /// Whether the solution is trusted: its forces and its field.
    pub trust: Trust,
}

impl Assessment {
    /// The larger of both error estimates.
    pub fn error(&self) -> f64 {
        self.force_error.max(self.shape_error)
    }
}

/// An equilibrium of the reduced energy, or the last iterate of a search that failed.
#[derive(Clone)]
pub struct Solution {
    /// The contacts and their modes.
    pub contacts: Arc<ReducedContacts>,
    /// Coordinates in the modes.
    pub coordinates: Vec<f64>,
    /// Force of each tool on the organ [N]; zero if the search ended before the first step.
    pub forces: Vec<[f64; 3]>,
    /// Derivative of the forces with respect to the displacements [N/m], rows and columns by contact and component;
    /// empty if it was not requested.
    pub stiffness: Vec<f64>,
    /// Reduced strain energy [J].
    pub energy: f64,
    /// Largest displacement of a contact [m].
    pub depth: f64,
    /// How the search ended.
    pub status: ReducedStatus,
    /// Smallest volume ratio of a sampled cell.
    pub smallest_jacobian: f64,
    /// Newton steps.
    pub iterations: usize,
    /// Number of tangents that were evaluated.
    pub tangents: usize,
    /// Last step, relative to the coordinates.
    pub residual: f64,
    /// Time spent [s].
    pub seconds: f64,
}

impl Solution {
    /// Room for solutions in at most `modes` modes; nothing has been searched for yet.
    pub(super) fn with_room(contacts: Arc<ReducedContacts>, modes: usize) -> Self {
        let n = contacts.places().len();
        Solution {
            contacts,
            coordinates: Vec::with_capacity(modes),
            forces: Vec::with_capacity(n),
            stiffness: Vec::with_capacity(9 * n * n),
            energy: 0.0,
            depth: 0.0,
            status: ReducedStatus::TooManyIterations,
            smallest_jacobian: 1.0,
            iterations: 0,
            tangents: 0,
            residual: 0.0,
            seconds: 0.0,
        }
    }

    /// Displacement of all nodes [m]. Allocates.
    pub fn displacement(&self) -> Vec<f64> {
        self.contacts.subspace.basis.field(&self.coordinates)
    }

    /// Displacement of a node [m].
    pub fn displacement_of(&self, node: usize) -> [f64; 3] {
        let mut u = [0.0; 3];
        for (mode, q) in self.contacts.subspace.basis.modes.iter().zip(&self.coordinates) {
            (0..3).for_each(|i| u[i] += q * mode[3 * node + i]);
        }
        u
    }

    /// What the search alone tells: trusted until it is assessed.
    pub fn trust_of_search(&self) -> Trust {
        match self.status {
            ReducedStatus::OutOfTime => Trust::OutOfTime,
            ReducedStatus::StepTooSmall | ReducedStatus::TooManyIterations => Trust::NotConverged,
            ReducedStatus::Converged if !(self.smallest_jacobian > 0.0) => Trust::Inverted,
            ReducedStatus::Converged if !self.contacts.is_within(self.depth) => Trust::BeyondDepth,
            ReducedStatus::Converged => Trust::Trusted,
        }
    }

    /// Assesses it by the whole body: a factorised tangent and two substitutions. Takes as long as a frame of a simulator,
    /// so not for every tick.
    ///
    /// # Errors
    /// No memory for a solver.
    pub fn assess(&self) -> Result<Assessment, Error> {
        let allowed = allowance(self.depth / self.contacts.model().metadata().diagonal);
        let ([force_error, shape_error], is_stable) = self.expected_errors()?;
        let is_near = force_error <= allowed && shape_error <= allowed;
        let trust = match self.trust_of_search() {
            Trust::Trusted if !is_stable => Trust::Unstable,
            Trust::Trusted if !is_near => Trust::ErrorTooLarge,
            known => known,
        };
        Ok(Assessment { force_error, shape_error, trust })
    }

    /// Error estimates of forces and field, and whether the state is stable.
    fn expected_errors(&self) -> Result<([f64; 2], bool), Error> {
        if self.depth == 0.0 {
            return Ok(([0.0; 2], true));
        }
        let u = self.displacement();
        Ok(match self.contacts.owner.correction(&self.contacts.patches(), &u)? {
            Some(correction) => {
                let errors = correction.errors(norm(&u), self.forces.as_flattened());
                (errors, correction.is_stable)
            }
            None => ([1.0; 2], false),
        })
    }
}

impl Correction {
    /// How far forces and a field of norm `size` are from equilibrium, relative to their norms.
    pub(super) fn errors(&self, size: f64, forces: &[f64]) -> [f64; 2] {
        let ([first, second], [before, after]) = (self.steps, &self.forces);
        // `r / (1 - r)`; steps that do not shrink lead nowhere.
        let to_come = match second / first {
            _ if second == 0.0 => 0.0,
            r if r < 1.0 => r / (1.0 - r),
            _ => return [1.0; 2],
        };
        let of_forces = distance(after, forces) + to_come * distance(after, before);
        [part(of_forces, norm(after)), part((1.0 + to_come) * first, size)]
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// A part of a whole, at most 1; what is not a number counts as 1.
fn part(part: f64, whole: f64) -> f64 {
    match part {
        0.0 => 0.0,
        part if part < whole => part / whole,
        _ => 1.0,
    }
}
