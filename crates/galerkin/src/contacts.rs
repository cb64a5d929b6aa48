//! What does not change while contacts hold an organ: their patches and modes. Also assesses answers.
//!
//! With force `f` and tangent `K` of the whole body in an answer `u`, Newton's step
//!   K z - A^T F = -f,   A z = 0,
//! with `A` the means of the patches, is close to the error: `|z| / |u|` is the error estimate. If the tangent is not
//! positive definite, the organ would not stay in this state, however small the step is.

use super::model::Galerkin;
use super::newton::ReducedStatus;
use super::snapshots::Step;
use super::solution::Solution;
use super::subspace::Subspace;
use crate::error::Error;
use crate::mesh::Patch;
use crate::number::norm;
use crate::reduced::{Contact, allowance};
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
    /// Error estimate of the field, relative to its norm; at most 1.
    pub error: f64,
    /// Whether the solution is trusted.
    pub trust: Trust,
}

/// Contacts, and the modes that their displacements are solved in.
#[derive(Clone)]
pub struct ReducedContacts {
    pub(super) owner: Arc<Galerkin>,
    pub(super) subspace: Subspace,
    places: Vec<Contact>,
}

impl ReducedContacts {
    /// Contacts in the span of the series.
    pub(super) fn new(owner: Arc<Galerkin>, contacts: Vec<Contact>) -> Result<Self, Error> {
        let subspace = Subspace::new(&owner.model, &owner.origin, &contacts, owner.sampling.order)?;
        Ok(ReducedContacts { owner, subspace, places: contacts })
    }

    /// Where the contacts are.
    pub fn places(&self) -> &[Contact] {
        &self.places
    }

    /// The patches, whose weighted means are displaced. Allocates.
    pub fn patches(&self) -> Vec<Patch> {
        self.places.iter().map(|c| self.owner.model.patch(c)).collect()
    }

    /// Number of modes.
    pub fn n_modes(&self) -> usize {
        self.subspace.len()
    }

    /// Displacement of all nodes [m] in a solution. Allocates.
    pub fn displacement(&self, solution: &Solution) -> Vec<f64> {
        self.subspace.basis.field(&solution.coordinates)
    }

    /// Displacement of all nodes [m] by the superposed series, which solutions start from. Allocates.
    ///
    /// # Errors
    /// A displacement that is not finite; a number of them other than that of the contacts.
    pub fn superposed(&self, displacements: &[[f64; 3]]) -> Result<Vec<f64>, Error> {
        self.check(displacements)?;
        let q = self.subspace.superposed(displacements.as_flattened());
        Ok(self.subspace.basis.field(&q))
    }

    /// Assesses a solution by the whole body: a factorised tangent and a substitution. Takes as long as a frame of a
    /// simulator, so not for every tick.
    ///
    /// # Errors
    /// No memory for a solver.
    pub fn assess(&self, solution: &Solution) -> Result<Assessment, Error> {
        let model = &self.owner.model;
        let (error, is_stable) = self.expected_error(solution)?;
        let trust = if solution.status == ReducedStatus::OutOfTime {
            Trust::OutOfTime
        } else if solution.status != ReducedStatus::Converged {
            Trust::NotConverged
        } else if !(solution.smallest_jacobian > 0.0) {
            Trust::Inverted
        } else if !self.is_within(solution.depth) {
            Trust::BeyondDepth
        } else if !is_stable {
            Trust::Unstable
        } else if !(error <= allowance(solution.depth / model.metadata().diagonal)) {
            Trust::ErrorTooLarge
        } else {
            Trust::Trusted
        };
        Ok(Assessment { error, trust })
    }

    /// Newton's step relative to the field, at most 1, and whether the state is stable.
    fn expected_error(&self, solution: &Solution) -> Result<(f64, bool), Error> {
        if solution.depth == 0.0 {
            return Ok((0.0, true));
        }
        let u = self.displacement(solution);
        Ok(match self.owner.newton_step(&self.patches(), &u)? {
            Some(Step { increment, is_stable }) => {
                let error = norm(&increment) / norm(&u);
                (if error < 1.0 { error } else { 1.0 }, is_stable)
            }
            None => (1.0, false),
        })
    }

    /// Whether displacements of at most `depth` [m] are within the depth of training.
    pub(super) fn is_within(&self, depth: f64) -> bool {
        depth <= self.owner.sampling.depth * (1.0 + 1e-9)
    }

    pub(super) fn check(&self, displacements: &[[f64; 3]]) -> Result<(), Error> {
        if displacements.len() != self.places.len() {
            return Err(Error::input(format!(
                "{} displacements for {} contacts; give one for each",
                displacements.len(),
                self.places.len()
            )));
        }
        match displacements.iter().position(|d| d.iter().any(|x| !x.is_finite())) {
            Some(k) => Err(Error::input(format!(
                "contact {k} is displaced by {:?}; it must be finite",
                displacements[k]
            ))),
            None => Ok(()),
        }
    }
}
