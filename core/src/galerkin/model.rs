//! The Galerkin model of an organ: its series model, and the body that it was reduced from.

use super::grasp::Grasp;
use super::hold::Hold;
use super::snapshots::Solvers;
use super::subspace::Rest;
use super::training::train;
use crate::body::Body;
use crate::clock::Instant;
use crate::element::Element;
use crate::equilibrium::System;
use crate::error::Error;
use crate::law::Material;
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
    pub(super) rest: Rest,
    pub(super) sampling: Sampling,
    pub(super) solvers: Solvers,
}

impl Galerkin {
    /// Factorises the tangent at rest.
    ///
    /// # Errors
    /// Settings out of range; an element other than linear tetrahedra; touches that start from a preload.
    pub fn new(model: ReducedModel, sampling: Sampling) -> Result<Self, Error> {
        check(&model, &sampling)?;
        let rest = rest_of(&model)?;
        Ok(Galerkin { model, rest, sampling, solvers: Solvers::default() })
    }

    /// Contacts take hold: basis, cells and weights for whatever they do next. Some tenths of a second without
    /// snapshots, seconds with them.
    ///
    /// # Errors
    /// No contact; one off the surface; contacts that cannot be told apart; no memory for a solver.
    pub fn grasp(self: &Arc<Self>, points: &[[f64; 3]]) -> Result<Grasp, Error> {
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
    ) -> Result<Grasp, Error> {
        let (since, mut best) = (Instant::now(), None);
        let hold_on = &mut |grasp| best = Some(grasp);
        train(&mut self.hold(points)?, since, is_wanted, hold_on)?;
        Ok(best.expect("training hands over a grasp or an error"))
    }

    /// Contacts take hold without snapshots, and are in use while a thread solves them: better grasps take the place of
    /// the first as they are ready.
    ///
    /// # Errors
    /// As [`Galerkin::grasp`]; no thread.
    pub fn grasp_and_learn(self: &Arc<Self>, points: &[[f64; 3]]) -> Result<Grasp, Error> {
        let since = Instant::now();
        Grasp::learning(self.hold(points)?, since)
    }

    fn hold(self: &Arc<Self>, points: &[[f64; 3]]) -> Result<Hold, Error> {
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
        Hold::new(Arc::clone(self), contacts)
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
    if metadata.element != Element::P1.name() {
        return Err(Error::input(format!(
            "the model is of element {:?}; cells can be sampled one by one only with \"P1\"",
            metadata.element
        )));
    }
    if !model.arrays().preload.is_empty() {
        return Err(Error::input(
            "the touches of this model start from a preload; several at once need one that starts from rest",
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

/// The body that the model was reduced from, with its tangent at rest factorised.
fn rest_of(model: &ReducedModel) -> Result<Rest, Error> {
    let (metadata, arrays) = (model.metadata(), model.arrays());
    let points = arrays.points.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    let cells = arrays.cells.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect();
    let rows = arrays.law_parameters.chunks_exact(metadata.law_parameter_names.len());
    let material = Material::new(&metadata.law, rows.map(<[f64]>::to_vec).collect())?;
    let body = Body::new(points, cells, material)?;
    let mut stiffness = body.zero_tangent();
    let zero = vec![0.0; body.n_dofs()];
    body.internal_force_and_tangent(&zero, &mut zero.clone(), &mut stiffness);
    let fixed: Vec<u32> =
        arrays.fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i)).collect();
    let mut system = System::new(&stiffness, body.n_dofs(), fixed.iter().copied())?;
    system.factorize(&stiffness, 0.0)?;
    Ok(Rest { body, stiffness, system, fixed })
}
