//! What does not change while contacts hold an organ: their patches and modes.

use super::model::Galerkin;
use super::subspace::Subspace;
use crate::error::Error;
use crate::mesh::Patch;
use crate::reduced::{Contact, ReducedModel};
use std::sync::Arc;

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

    /// The series model.
    pub fn model(&self) -> &ReducedModel {
        &self.owner.model
    }

    /// The patches, whose weighted means are displaced. Allocates.
    pub fn patches(&self) -> Vec<Patch> {
        self.places.iter().map(|c| self.owner.model.patch(c)).collect()
    }

    /// Number of modes.
    pub fn n_modes(&self) -> usize {
        self.subspace.len()
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
