//! The Galerkin model of an organ: the series model, the body it came from, and the cells each region needs.

use super::grasp::Grasp;
use super::nnls::{Columns, greedy};
use super::sample::Sample;
use super::subspace::{Rest, Subspace};
use super::training::{Forces, states};
use crate::body::Body;
use crate::element::Element;
use crate::equilibrium::System;
use crate::error::Error;
use crate::law::Material;
use crate::mesh::{norm, sub};
use crate::reduced::{Contact, Progress, ReducedModel};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// Contacts of a region whose forces its cells are chosen for.
const CONTACTS: usize = 5;
/// States of each of them alone, and of each together with another contact.
const STATES: [usize; 2] = [2, 4];
/// Other contacts are at least this far away, in radii of the patch.
const APART: f64 = 1.2;

/// How the reduced energy is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Highest order of the series fields in the basis, 1 to that of the model.
    pub order: usize,
    /// Relative error of the forces of a region's cells in its training states.
    pub tolerance: f64,
    /// Largest displacement of a contact in training [m]: beyond it nothing is trusted.
    pub depth: f64,
}

/// The series model of an organ with what it takes to let several contacts act at once.
pub struct Galerkin {
    pub(super) model: ReducedModel,
    pub(super) rest: Rest,
    pub(super) sampling: Sampling,
    /// Cells chosen by each region.
    pub(super) cells: Vec<Vec<u32>>,
    /// Time spent choosing them [s].
    pub seconds: f64,
}

impl Galerkin {
    /// Lets every region choose its cells; `progress` may return false to stop.
    ///
    /// # Errors
    /// Settings out of range; an element other than linear tetrahedra; a stop on request.
    pub fn new(
        model: ReducedModel,
        sampling: Sampling,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Self, Error> {
        let clock = Instant::now();
        check(&model, &sampling)?;
        let rest = rest_of(&model)?;
        let all: Vec<usize> = (0..rest.body.cells().len()).collect();
        let body = &rest.body;
        let sample = Sample::new(body.points(), body.cells(), body.material(), &all);
        let regions: Vec<usize> = (0..model.n_regions()).collect();
        let (total, mut cells) = (regions.len(), Vec::with_capacity(regions.len()));
        // A few at a time, so that this thread can say how far it is, and stop.
        for some in regions.chunks(rayon::current_num_threads()) {
            if !progress(Progress { done: cells.len(), total, stage: "sample" }) {
                return Err(Error::Cancelled);
            }
            let choose = |&region: &usize| choose_cells(&model, &rest, &sampling, &sample, region);
            cells.extend(some.par_iter().map(choose).collect::<Result<Vec<_>, _>>()?);
        }
        Ok(Galerkin { model, rest, sampling, cells, seconds: clock.elapsed().as_secs_f64() })
    }

    /// The same with cells chosen before.
    ///
    /// # Errors
    /// As there.
    pub(super) fn with_cells(
        model: ReducedModel,
        sampling: Sampling,
        cells: Vec<Vec<u32>>,
        seconds: f64,
    ) -> Result<Self, Error> {
        check(&model, &sampling)?;
        let rest = rest_of(&model)?;
        Ok(Galerkin { model, rest, sampling, cells, seconds })
    }

    /// Contacts take hold: basis and weights for whatever they do next. Tens of milliseconds.
    ///
    /// # Errors
    /// No contact; one off the surface; contacts that cannot be told apart.
    pub fn grasp(self: &Arc<Self>, points: &[[f64; 3]]) -> Result<Grasp, Error> {
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
        Grasp::new(Arc::clone(self), contacts)
    }

    /// The series model.
    pub fn model(&self) -> &ReducedModel {
        &self.model
    }

    /// How it is sampled.
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// Cells chosen by each region.
    pub fn cells(&self) -> &[Vec<u32>] {
        &self.cells
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
    let held = arrays.fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i));
    let mut system = System::new(&stiffness, body.n_dofs(), held)?;
    system.factorize(&stiffness, 0.0)?;
    Ok(Rest { body, stiffness, system })
}

/// The cells by which a region's contacts feel nearly the forces of all cells: each contact on its own those of the
/// whole body, and together with another one those of the cells that are nearer to it.
fn choose_cells(
    model: &ReducedModel,
    rest: &Rest,
    sampling: &Sampling,
    all: &Sample,
    region: usize,
) -> Result<Vec<u32>, Error> {
    let centroids: Vec<Contact> = (0..model.n_triangles()).map(|t| model.centroid(t)).collect();
    let is_own = |contact: &&Contact| model.regions_of(contact).contains(&region);
    let own: Vec<&Contact> = centroids.iter().filter(is_own).collect();
    let count = CONTACTS.min(own.len());
    let apart = APART * model.metadata().radius;
    let mut forces = Vec::with_capacity(2 * count);
    for k in 0..count {
        let contact = *own[k * own.len() / count];
        let [alone, together] = STATES.map(|states| k * states..(k + 1) * states);
        forces.push(forces_of(model, rest, sampling, all, &[contact], alone)?);
        let others: Vec<&Contact> =
            centroids.iter().filter(|c| norm(sub(c.point, contact.point)) > apart).collect();
        // A stride that is no divisor of anything spreads the choices over the surface.
        if let Some(&&other) = others.get((region * CONTACTS + k) * 977 % others.len().max(1)) {
            let pair = [contact, other];
            let mut shared = forces_of(model, rest, sampling, all, &pair, together)?;
            shared.restrict(|cell| {
                let middle = middle_of(&rest.body, cell);
                norm(sub(middle, contact.point)) <= norm(sub(middle, other.point))
            });
            forces.push(shared);
        }
    }
    if forces.is_empty() {
        return Ok(Vec::new());
    }
    let joined = Forces::join(forces);
    let columns = Columns { rows: joined.rows, values: &joined.cells };
    let chosen = greedy(&columns, &joined.body, sampling.tolerance);
    Ok(chosen.into_iter().map(|cell| cell as u32).collect())
}

/// Forces of all cells in some training states of some contacts.
fn forces_of(
    model: &ReducedModel,
    rest: &Rest,
    sampling: &Sampling,
    all: &Sample,
    contacts: &[Contact],
    numbers: Range<usize>,
) -> Result<Forces, Error> {
    let subspace = Subspace::new(model, rest, contacts, sampling.order)?;
    let states = states(rest, &subspace, sampling.depth, numbers);
    Ok(Forces::new(all, &subspace, &states))
}

fn middle_of(body: &Body, cell: usize) -> [f64; 3] {
    let corners = body.cells()[cell].map(|node| body.points()[node as usize]);
    std::array::from_fn(|i| corners.iter().map(|x| x[i]).sum::<f64>() / 4.0)
}
