//! Where a body has no energy: a cell is turned inside out, or strained to where the energy of its law ends.

use crate::body::Body;
use crate::error::Error;

/// A cell without energy, and its `J`.
#[derive(Clone, Copy)]
pub(super) struct NoEnergy {
    pub cell: usize,
    pub jacobian: f64,
}

impl NoEnergy {
    /// The cell of a body that has no energy at a displacement: the one turned inside out farthest, else the first without
    /// one of its own.
    pub fn of(body: &Body, u: &[f64]) -> Self {
        let (jacobian, cell) = body.smallest_jacobian(u);
        let points = body.quadrature_points(u);
        let lost = points.iter().position(|point| !point.energy.is_finite());
        match lost.filter(|_| jacobian > 0.0) {
            None => NoEnergy { cell, jacobian },
            Some(point) => {
                let of_cell = points.len() / body.cells().len();
                NoEnergy { cell: point / of_cell, jacobian: body.volume_ratios(u)[point] }
            }
        }
    }

    /// What has happened to the cell, after "the step" and the like.
    pub fn sentence(&self) -> String {
        let &NoEnergy { cell, jacobian } = self;
        if jacobian > 0.0 {
            format!("strains cell {cell} to where its law has no energy (J = {jacobian:.3})")
        } else {
            format!("turns cell {cell} inside out (J = {jacobian:.3})")
        }
    }
}

/// Refuses a displacement to start from at which the body has no energy.
pub(super) fn check_start(body: &Body, start: &[f64]) -> Result<(), Error> {
    if body.energy(start).is_finite() {
        return Ok(());
    }
    let what = NoEnergy::of(body, start).sentence();
    Err(Error::input(format!("the start displacement {what}; start from rest")))
}
