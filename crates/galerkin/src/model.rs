//! The Galerkin model of an organ: its series model, and the body that it was reduced from.

use super::contacts::ReducedContacts;
use super::hyper_reduced::HyperReducedModel;
use super::origin::Origin;
use super::snapshots::Solvers;
use super::training::train;
use crate::clock::Instant;
use crate::error::Error;
use crate::reduced::{Contact, ReducedModel};
use std::sync::Arc;

/// More is taken for a mistake: every one is a solution on the whole body, and may be a mode.
pub(super) const MOST_SNAPSHOTS: usize = 200;

/// How the reduced energy is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Highest order of the series fields in the basis, 1 to that of the model.
    pub order: usize,
    /// Error of the forces of the sampled cells in training, relative to those of all.
    pub tolerance: f64,
    /// Largest displacement of a contact in training [m]: beyond it nothing is trusted.
    pub depth: f64,
    /// States of training that are solved on the whole body when contacts take hold, for the basis to hold them too.
    pub snapshots: usize,
}

/// The series model of an organ with what it takes to let several contacts act at once.
pub struct Galerkin {
    pub(super) model: ReducedModel,
    pub(super) origin: Origin,
    pub(super) sampling: Sampling,
    pub(super) solvers: Solvers,
}

impl Galerkin {
    /// Factorises the tangent in the state that touches start from.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(model: ReducedModel, sampling: Sampling) -> Result<Self, Error> {
        check(&model, &sampling)?;
        let origin = Origin::new(&model)?;
        Ok(Galerkin { model, origin, sampling, solvers: Solvers::default() })
    }

    /// Contacts take hold: basis, cells and weights for whatever they do next. Some tenths of a second without
    /// snapshots, seconds with them.
    ///
    /// # Errors
    /// No contact; one off the surface; contacts that cannot be told apart; no memory for a solver.
    pub fn grasp(self: &Arc<Self>, points: &[[f64; 3]]) -> Result<HyperReducedModel, Error> {
        self.grasp_while(points, &|| true)
    }

    /// As [`Galerkin::grasp`], as long as it is wanted.
    ///
    /// # Errors
    /// As [`Galerkin::grasp`]; [`Error::Cancelled`].
    pub fn grasp_while(
        self: &Arc<Self>,
        points: &[[f64; 3]],
        is_wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<HyperReducedModel, Error> {
        let (since, mut best) = (Instant::now(), None);
        let go_on = &mut |grasp| best = Some(grasp);
        train(&mut self.contacts(points)?, since, is_wanted, go_on)?;
        Ok(best.expect("training hands over a grasp or an error"))
    }

    /// Contacts take hold without snapshots, and are in use while a thread solves them: better grasps take the place of
    /// the first as they are ready.
    ///
    /// # Errors
    /// As [`Galerkin::grasp`]; no thread.
    pub fn grasp_in_background(
        self: &Arc<Self>,
        points: &[[f64; 3]],
    ) -> Result<HyperReducedModel, Error> {
        let since = Instant::now();
        HyperReducedModel::in_training(self.contacts(points)?, since)
    }

    fn contacts(self: &Arc<Self>, points: &[[f64; 3]]) -> Result<ReducedContacts, Error> {
        if points.is_empty() {
            return Err(Error::input(
                "no contact; give at least one point of the touchable surface",
            ));
        }
        let contacts = points
            .iter()
            .enumerate()
            .map(|(k, &point)| self.contact(k, point))
            .collect::<Result<Vec<_>, _>>()?;
        ReducedContacts::new(Arc::clone(self), contacts)
    }

    fn contact(&self, k: usize, point: [f64; 3]) -> Result<Contact, Error> {
        let found = self.model.locate(point).filter(|c| self.model.is_on_surface(c));
        found.ok_or_else(|| {
            Error::input(format!(
                "contact {k} at {point:?} is more than {:.4} m off the touchable surface; move it there",
                self.model.edge_length()
            ))
        })
    }
}

fn check(model: &ReducedModel, sampling: &Sampling) -> Result<(), Error> {
    let metadata = model.metadata();
    if !(1..=metadata.order).contains(&sampling.order) {
        return Err(Error::input(format!(
            "order {}; it must be between 1 and {}, the order of the series",
            sampling.order, metadata.order
        )));
    }
    if !(sampling.tolerance > 0.0 && sampling.tolerance < 1.0) {
        return Err(Error::input(format!(
            "tolerance {}; it must be above 0 and below 1",
            sampling.tolerance
        )));
    }
    if !(sampling.depth > 0.0 && sampling.depth < metadata.diagonal) {
        return Err(Error::input(format!(
            "depth {} m; it must be above 0 and below {:.4} m, the diagonal of the organ",
            sampling.depth, metadata.diagonal
        )));
    }
    if sampling.snapshots > MOST_SNAPSHOTS {
        return Err(Error::input(format!(
            "{} snapshots; a grasp takes at most {MOST_SNAPSHOTS}",
            sampling.snapshots
        )));
    }
    Ok(())
}
