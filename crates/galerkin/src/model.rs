//! The Galerkin model of an organ: its series model, and the body that it was reduced from.

use super::origin::Origin;
use super::solvers::Solvers;
use crate::body::QuadraturePoint;
use crate::error::Error;
use crate::reduced::ReducedModel;

/// A larger number is refused as a mistake: every snapshot is a solution on the whole body, and may become a mode.
pub(super) const MOST_SNAPSHOTS: usize = 200;

/// How the reduced energy is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Highest order of the series fields in the basis, 1 to that of the model.
    pub order: usize,
    /// Error of the forces of the sampled cells in training, relative to the forces of all cells.
    pub tolerance: f64,
    /// Largest displacement [m] of a contact in training; beyond it no answer is trusted.
    pub depth: f64,
    /// Largest number of states of training that are solved on the whole body when contacts take hold and join the
    /// basis.
    pub snapshots: usize,
}

/// The series model of an organ, and what several contacts at once need beside it.
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

    /// The series model.
    pub fn model(&self) -> &ReducedModel {
        &self.model
    }

    /// Stress and energy of the whole body where touches have displaced its nodes by `u` [m].
    pub fn quadrature_points(&self, u: &[f64]) -> Vec<QuadraturePoint> {
        self.origin.body.quadrature_points(&self.origin.moved(u))
    }
}

fn check(model: &ReducedModel, sampling: &Sampling) -> Result<(), Error> {
    let metadata = model.metadata();
    if !model.arrays().tie_start.is_empty() {
        return Err(Error::input(
            "several touches at once do not know elastic supports and bonds yet; touch with one finger, or fix nodes instead",
        ));
    }
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
