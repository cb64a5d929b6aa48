//! A model beside its full organ: what iterations of Newton's method say about the error of an answer.

use super::correction::Correction;
use super::positions::Positions;
use super::refused::refused;
use super::settings::{Progress, Reduction};
use super::solve::Expanded;
use crate::body::{Body, Curvature};
use crate::error::Error;
use crate::mesh::Patch;
use std::sync::{Mutex, PoisonError};
use viscera_touch::{Contact, DIRECTIONS, Metadata, ReducedModel, Trust, allowance, directions};

/// Depths at which trust is asked for, as parts of the largest.
const DEPTHS: [f64; 6] = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5];
/// An estimate over the allowance that is larger than this makes a touch suspicious: few others were found to depart.
const SUSPICIOUS: f64 = 0.7;
/// The allowance no longer grows from this part of the diagonal on.
const GROWN: f64 = 0.1;

/// Touches in one of the directions at a position.
#[derive(Clone, Copy)]
pub(super) struct Ray {
    pub position: usize,
    pub direction: usize,
}

/// The deepest trusted touch along a ray.
pub(super) struct Deepest {
    pub d: [f64; 3],
    /// Whether its estimate is not far below the allowance.
    pub is_suspicious: bool,
}

/// What the full organ is made from.
#[derive(Clone, Copy)]
struct FullOrgan<'a> {
    settings: &'a Reduction,
    body: &'a Body,
    fixed: &'a [u32],
}

/// A model beside its full organ, for all threads.
pub(super) struct Comparisons<'a> {
    full: FullOrgan<'a>,
    pub model: &'a ReducedModel,
    pub positions: &'a Positions,
    pub directions: [[f64; 3]; DIRECTIONS],
    /// Those that are not in use: an organ's factor is analysed once for each thread.
    idle: Mutex<Vec<Comparison<'a>>>,
}

impl Reduction {
    /// What is found for each member of a family, with the model at its value of the parameter; or for the only one.
    pub(super) fn beside_full_organs<T>(
        &self,
        members: &[Expanded],
        fixed: &[u32],
        model: &mut ReducedModel,
        progress: &mut dyn FnMut(Progress) -> bool,
        mut find: impl FnMut(&Comparisons, &mut dyn FnMut() -> bool) -> Result<T, Error>,
    ) -> Result<Vec<T>, Error> {
        let nodes = model.metadata().parameter.as_ref().map(|p| p.nodes.clone());
        let mut found = Vec::with_capacity(members.len());
        for (j, Expanded { positions, expansion }) in members.iter().enumerate() {
            if let Some(nodes) = &nodes {
                model.set_parameter(nodes[j]).map_err(refused)?;
            }
            let total = positions.nodes.len();
            let mut is_wanted = || progress(Progress { done: total, total, stage: "check" });
            let full = FullOrgan { settings: self, body: expansion.body(), fixed };
            let (directions, idle) = (directions(), Mutex::new(Vec::new()));
            let comparisons = Comparisons { full, model, positions, directions, idle };
            found.push(find(&comparisons, &mut is_wanted)?);
        }
        Ok(found)
    }
}

impl<'a> Comparisons<'a> {
    /// What a comparison finds.
    pub fn with<T>(&self, find: impl FnOnce(&mut Comparison<'a>) -> T) -> Result<T, Error> {
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let waiting = idle().pop();
        let mut comparison = match waiting {
            Some(comparison) => comparison,
            None => Comparison::new(self.full, self.model)?,
        };
        let found = find(&mut comparison);
        idle().push(comparison);
        Ok(found)
    }

    /// The deepest trusted touch along a ray, unless that is shallow.
    pub fn deepest_trusted(&self, ray: Ray) -> Option<(Contact, Deepest)> {
        let contact = self.model.locate(self.model.position(ray.position))?;
        let direction = self.directions[ray.direction];
        let Metadata { depth, diagonal, .. } = *self.model.metadata();
        let largest = depth.min(GROWN * diagonal);
        let touches = DEPTHS.iter().map(|share| direction.map(|x| share * largest * x));
        let mut answers = touches.map(|d| (d, self.model.respond(&contact, d)));
        let (d, answer) = answers.find(|(_, answer)| answer.trust == Trust::Trusted)?;
        let is_suspicious = answer.error_estimate > SUSPICIOUS * allowed(self.model, d);
        Some((contact, Deepest { d, is_suspicious }))
    }
}

/// The error that is allowed at the depth of a touch.
pub(super) fn allowed(model: &ReducedModel, d: [f64; 3]) -> f64 {
    let depth = d.iter().map(|x| x * x).sum::<f64>().sqrt();
    allowance(depth / model.metadata().diagonal)
}

/// A model beside its full organ, with room for one correction.
pub(super) struct Comparison<'a> {
    pub model: &'a ReducedModel,
    correction: Correction<'a>,
    workspace: Vec<f32>,
    field: Vec<f32>,
}

impl<'a> Comparison<'a> {
    fn new(full: FullOrgan<'a>, model: &'a ReducedModel) -> Result<Self, Error> {
        let correction = Correction::new(full.body, full.fixed, &full.settings.preload)?;
        let workspace = vec![0.0; model.field_workspace_len()];
        Ok(Comparison { model, correction, workspace, field: vec![0.0; 3 * model.n_points()] })
    }

    /// What the rest of the series is in proportion to.
    pub fn rest(&self, contact: &Contact, d: [f64; 3]) -> f64 {
        self.model.truncation(contact, d).unwrap_or_default()
    }

    /// The error of field or force, whichever is larger, without what the field loses by compression; none where the tangent
    /// is not positive definite, or a cell is turned inside out.
    pub fn error(
        &mut self,
        contact: &Contact,
        patch: &Patch,
        d: [f64; 3],
        curvature: Curvature,
    ) -> Option<f64> {
        let answer = self.model.respond(contact, d);
        self.model.displacement(contact, d, &mut self.workspace, &mut self.field);
        let u: Vec<f64> = self.field.iter().map(|&u| f64::from(u)).collect();
        let [field, force] = self.correction.of(patch, &u, answer.force, curvature)?;
        let compression = answer.shape_error_estimate - answer.error_estimate;
        Some(force.max(field - compression))
    }
}
