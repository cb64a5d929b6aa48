//! What does not change while contacts hold an organ: their patches and modes; and what an answer in them is worth.
//!
//! With the force `f(u)` of the whole body in an answer and its contact forces `A^T F`, the step
//!   z = -K^-1 (f(u) - A^T F),     moved so that the means of the patches stay,
//! K the tangent at rest, is nearly what is missing: `|z| / |u|` is the error that is expected.

use super::grasp::Solution;
use super::model::Galerkin;
use super::nnls::norm;
use super::solver::Status;
use super::subspace::Subspace;
use super::training::{State, train};
use crate::equilibrium::patch_mean;
use crate::error::Error;
use crate::mesh::Patch;
use crate::reduced::{Contact, allowance};
use std::sync::Arc;

/// Whether a solution may be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// The expected error is within what is allowed at this depth.
    Trusted,
    /// No equilibrium was found.
    NotConverged,
    /// A sampled cell is inside out.
    Inverted,
    /// A contact is displaced by more than it was in training.
    BeyondDepth,
    /// The expected error is larger than allowed.
    ErrorTooLarge,
}

/// What the whole body says of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assessment {
    /// Expected error of the field relative to its norm, at most 1.
    pub error: f64,
    /// Whether to rely on it.
    pub trust: Trust,
}

/// Contacts, and the modes that their displacements are solved in.
pub struct Hold {
    pub(super) owner: Arc<Galerkin>,
    pub(super) subspace: Subspace,
    contacts: Vec<Contact>,
}

impl Hold {
    /// Also the states that cells and weights are to be found by.
    pub(super) fn new(
        owner: Arc<Galerkin>,
        contacts: Vec<Contact>,
    ) -> Result<(Self, Vec<State>), Error> {
        let order = owner.sampling.order;
        let patches: Vec<Patch> = contacts.iter().map(|c| owner.model.patch(c)).collect();
        let mut subspace = Subspace::new(&owner.model, &owner.rest, &contacts, order)?;
        let training = train(&owner, &patches, &mut subspace)?;
        Ok((Hold { owner, subspace, contacts }, training))
    }

    /// Where the contacts are.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Their patches, the weighted means of which are displaced. Allocates.
    pub fn patches(&self) -> Vec<Patch> {
        self.contacts.iter().map(|c| self.owner.model.patch(c)).collect()
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

    /// Asks the whole body: one evaluation of its force, one substitution. Some milliseconds; not for every tick.
    pub fn assess(&self, solution: &Solution) -> Assessment {
        let metadata = self.owner.model.metadata();
        let error = self.error(solution);
        let trust = if solution.status != Status::Converged {
            Trust::NotConverged
        } else if !(solution.smallest_jacobian > 0.0) {
            Trust::Inverted
        } else if !(solution.depth <= self.owner.sampling.depth * (1.0 + 1e-9)) {
            Trust::BeyondDepth
        } else if !(error <= allowance(solution.depth / metadata.diagonal)) {
            Trust::ErrorTooLarge
        } else {
            Trust::Trusted
        };
        Assessment { error, trust }
    }

    fn error(&self, solution: &Solution) -> f64 {
        if solution.depth == 0.0 {
            return 0.0;
        }
        let u = self.displacement(solution);
        let error = self.missing(&u, &solution.forces).map_or(1.0, |z| norm(&z) / norm(&u));
        if error < 1.0 { error } else { 1.0 }
    }

    /// The step `z`; none where it is not finite.
    fn missing(&self, u: &[f64], forces: &[[f64; 3]]) -> Option<Vec<f64>> {
        let rest = &self.owner.rest;
        let mut residual = vec![0.0; u.len()];
        rest.body.internal_force(u, &mut residual);
        let patches = self.patches();
        for (patch, force) in patches.iter().zip(forces) {
            for (&node, w) in patch.nodes.iter().zip(&patch.weights) {
                (0..3).for_each(|i| residual[3 * node as usize + i] -= w * force[i]);
            }
        }
        let free = rest.system.free();
        let mut step: Vec<f64> = free.iter().map(|&dof| -residual[dof as usize]).collect();
        rest.system.solve_free(&mut step, 1).ok()?;
        let mut z = vec![0.0; u.len()];
        free.iter().zip(step).for_each(|(&dof, x)| z[dof as usize] = x);
        let moved: Vec<f64> = patches.iter().flat_map(|patch| patch_mean(patch, &z)).collect();
        let back = self.subspace.basis.field(&self.subspace.first_order(&moved));
        z.iter_mut().zip(back).for_each(|(z, x)| *z -= x);
        Some(z)
    }

    pub(super) fn check(&self, displacements: &[[f64; 3]]) -> Result<(), Error> {
        if displacements.len() != self.contacts.len() {
            return Err(Error::input(format!(
                "{} displacements for {} contacts; give one for each",
                displacements.len(),
                self.contacts.len()
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
