//! How fast the full organ departs from the path that a series continues. A thin part that is pushed along itself turns
//! aside, as a column does that is not quite straight. The cause is a tangent that is nearly singular beside the path,
//! which a few orders about rest do not show, but an iteration of Newton's method at the series' own answer does.

use super::attend::attend;
use super::correction::Correction;
use super::measure::on_sphere;
use super::refused::refused;
use super::settings::{Progress, Reduction};
use super::solve::Expanded;
use crate::body::Body;
use crate::error::Error;
use crate::mesh::Patch;
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use viscera_touch::{Contact, Metadata, ReducedModel, Trust, allowance};

/// Directions in which trust is followed from each position.
const DIRECTIONS: usize = 24;
/// How many of them are suspect, those with the largest rest of the series. A correction takes a factorisation, so neighbours
/// share the directions: one position of each `EVERY` measures in one direction, and all take the largest of what they and
/// their neighbours find.
const SUSPECTS: usize = 6;
const EVERY: usize = 2;
/// Depths at which trust is asked for, as parts of the largest.
const DEPTHS: [f64; 6] = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5];
/// Parts of the deepest trusted touch at which it is corrected: at the first at which the organ is stable.
const CORRECTED: [f64; 2] = [0.9, 0.8];
/// The allowance no longer grows from this part of the diagonal on.
const GROWN: f64 = 0.1;
/// A smaller rest of the series tells nothing.
const LEAST_REST: f64 = 1e-6;

impl Reduction {
    /// The error that is found by a correction at each position, in units of the square of what the rest of the series is
    /// in proportion to: the largest of some trusted touches of the position and its neighbours, 0 where those are all
    /// within the allowance. A list for each member; empty ones where orders are summed as a polynomial.
    pub(super) fn measure_departure(
        &self,
        members: &[Expanded],
        fixed: &[u32],
        model: &mut ReducedModel,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Vec<Vec<f32>>, Error> {
        if !self.is_sketched() {
            return Ok(vec![Vec::new(); members.len()]);
        }
        let nodes = model.metadata().parameter.as_ref().map(|p| p.nodes.clone());
        let mut found = Vec::with_capacity(members.len());
        for (j, Expanded { positions, expansion }) in members.iter().enumerate() {
            if let Some(nodes) = &nodes {
                model.set_parameter(nodes[j]).map_err(refused)?;
            }
            let total = positions.nodes.len();
            let mut is_wanted = || progress(Progress { done: total, total, stage: "check" });
            let own = attend(&mut is_wanted, |stop| {
                let chunks = positions.patches.par_chunks(32).enumerate();
                let departures = chunks.map(|(chunk, patches)| {
                    let first = 32 * chunk;
                    let mut place = Place::new(self, expansion.body(), fixed, model)?;
                    let at = (first..).zip(patches).map(|(position, patch)| {
                        match stop.load(Ordering::Relaxed) {
                            true => Err(Error::Cancelled),
                            false => Ok(place.departure(position, patch) as f32),
                        }
                    });
                    at.collect::<Result<Vec<f32>, Error>>()
                });
                Ok(departures.collect::<Result<Vec<_>, _>>()?.concat())
            })?;
            if !is_wanted() {
                return Err(Error::Cancelled);
            }
            let mut largest = own.clone();
            for &[a, b] in &positions.edges {
                let (a, b) = (a as usize, b as usize);
                largest[a] = largest[a].max(own[b]);
                largest[b] = largest[b].max(own[a]);
            }
            found.push(largest);
        }
        Ok(found)
    }
}

/// A model beside its full organ.
struct Place<'a> {
    model: &'a ReducedModel,
    correction: Correction<'a>,
    workspace: Vec<f32>,
    field: Vec<f32>,
}

impl<'a> Place<'a> {
    fn new(
        settings: &Reduction,
        body: &'a Body,
        fixed: &[u32],
        model: &'a ReducedModel,
    ) -> Result<Self, Error> {
        let correction = Correction::new(body, fixed, &settings.preload)?;
        let workspace = vec![0.0; model.field_workspace_len()];
        Ok(Place { model, correction, workspace, field: vec![0.0; 3 * model.n_points()] })
    }

    /// That of the direction whose turn it is; 0 of a position that is left to its neighbours.
    fn departure(&mut self, position: usize, patch: &Patch) -> f64 {
        if !position.is_multiple_of(EVERY) {
            return 0.0;
        }
        let Some(contact) = self.model.locate(self.model.position(position)) else { return 0.0 };
        let mut deepest: Vec<(f64, [f64; 3])> = (0..DIRECTIONS)
            .filter_map(|k| self.deepest(&contact, on_sphere(k, DIRECTIONS)))
            .collect();
        deepest.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let turn = (position / EVERY) % SUSPECTS.min(deepest.len()).max(1);
        deepest.get(turn).map_or(0.0, |&touch| self.along(&contact, patch, touch))
    }

    /// The deepest trusted touch in a direction, behind what its rest of the series is in proportion to; none if that is
    /// shallow, or tells nothing.
    fn deepest(&self, contact: &Contact, direction: [f64; 3]) -> Option<(f64, [f64; 3])> {
        let Metadata { depth, diagonal, .. } = *self.model.metadata();
        let largest = depth.min(GROWN * diagonal);
        let touches = DEPTHS.iter().map(|share| direction.map(|x| share * largest * x));
        let is_trusted = |d: &[f64; 3]| self.model.respond(contact, *d).trust == Trust::Trusted;
        let d = { touches }.find(is_trusted)?;
        let rest = self.model.truncation(contact, d)?;
        (rest > LEAST_REST).then_some((rest, d))
    }

    /// The departure of a trusted touch whose error turns out to be larger than its allowance; 0 of any other.
    fn along(&mut self, contact: &Contact, patch: &Patch, (rest, d): (f64, [f64; 3])) -> f64 {
        let departure = self.corrected(contact, patch, d);
        if departure * rest * rest > self.allowance(d) { departure } else { 0.0 }
    }

    /// The departure just above a touch. Where the organ is not even stable there, a touch is not to be trusted.
    fn corrected(&mut self, contact: &Contact, patch: &Patch, d: [f64; 3]) -> f64 {
        let mut departure = 0.0;
        for share in CORRECTED {
            let d = d.map(|x| share * x);
            let rest = self.model.truncation(contact, d).unwrap_or_default();
            if !(rest > LEAST_REST) {
                return 0.0;
            }
            if let Some(error) = self.error(contact, patch, d) {
                return error / (rest * rest);
            }
            departure = self.allowance(d) / (rest * rest);
        }
        departure
    }

    fn allowance(&self, d: [f64; 3]) -> f64 {
        let depth = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        allowance(depth / self.model.metadata().diagonal)
    }

    /// The error of field or force, whichever is larger; without what the field loses by compression.
    fn error(&mut self, contact: &Contact, patch: &Patch, d: [f64; 3]) -> Option<f64> {
        let answer = self.model.respond(contact, d);
        self.model.displacement(contact, d, &mut self.workspace, &mut self.field);
        let u: Vec<f64> = self.field.iter().map(|&u| f64::from(u)).collect();
        let [field, force] = self.correction.of(patch, &u, answer.force)?;
        let compression = answer.shape_error_estimate - answer.error_estimate;
        Some(force.max(field - compression))
    }
}
