//! How fast the full organ departs from the path that a series continues. A thin part that is pushed along itself turns
//! aside, as a column does that is not quite straight. The cause is a tangent that is nearly singular beside the path,
//! which a few orders about rest do not show, but an iteration of Newton's method at the series' own answer does.

use super::attend::attend;
use super::correction::Correction;
use super::positions::Positions;
use super::refused::refused;
use super::settings::{Progress, Reduction};
use super::solve::Expanded;
use crate::body::Body;
use crate::error::Error;
use crate::mesh::Patch;
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};
use viscera_touch::{Contact, DIRECTIONS, Metadata, ReducedModel, Trust, allowance, directions};

/// One ray in so many is asked first. Where the organ departs the rays around are asked, too.
const TURNS: usize = 2;
/// A touch is corrected if its estimate, over the allowance, is larger than this: few others were found to depart.
const SUSPICIOUS: f64 = 0.7;
/// Cosine of the angle between directions that are near each other: about five around each.
const NEAR: f64 = 0.68;
/// Depths at which trust is asked for, as parts of the largest.
const DEPTHS: [f64; 6] = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5];
/// Parts of the deepest trusted touch at which it is corrected: the second where the organ is not stable at the first.
const CORRECTED: [f64; 2] = [0.9, 0.8];
/// The allowance no longer grows from this part of the diagonal on.
const GROWN: f64 = 0.1;
/// A smaller rest of the series tells nothing.
const LEAST_REST: f64 = 1e-6;

impl Reduction {
    /// The error that is found by a correction at each position in each direction, in units of the cube of what the rest
    /// of the series is in proportion to; 0 where trusted touches are within the allowance. A list for each member; empty
    /// ones where orders are summed as a polynomial.
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
            let full = FullOrgan { settings: self, body: expansion.body(), fixed };
            let own = Survey::new(full, model, positions).run(&mut is_wanted)?;
            found.push(own);
        }
        Ok(found)
    }
}

/// What the full organ is made from.
#[derive(Clone, Copy)]
struct FullOrgan<'a> {
    settings: &'a Reduction,
    body: &'a Body,
    fixed: &'a [u32],
}

/// Corrections over a surface, as far as they find something. A ray is a direction at a position, numbered position by
/// position.
struct Survey<'a> {
    full: FullOrgan<'a>,
    model: &'a ReducedModel,
    positions: &'a Positions,
    neighbours: Vec<Vec<usize>>,
    directions: [[f64; 3]; DIRECTIONS],
    /// Those that are not in use: an organ's factor is analysed once for each thread.
    idle: Mutex<Vec<Comparison<'a>>>,
}

impl<'a> Survey<'a> {
    fn new(full: FullOrgan<'a>, model: &'a ReducedModel, positions: &'a Positions) -> Self {
        let mut neighbours = vec![Vec::new(); positions.nodes.len()];
        for &[a, b] in &positions.edges {
            neighbours[a as usize].push(b as usize);
            neighbours[b as usize].push(a as usize);
        }
        let (directions, idle) = (directions(), Mutex::new(Vec::new()));
        Survey { full, model, positions, neighbours, directions, idle }
    }

    /// The departure along each ray; 0 where none was found.
    fn run(&self, is_wanted: &mut dyn FnMut() -> bool) -> Result<Vec<f32>, Error> {
        let n_rays = DIRECTIONS * self.positions.nodes.len();
        let mut departures = vec![0.0; n_rays];
        let mut is_asked: Vec<bool> = (0..n_rays).map(is_in_turn).collect();
        let mut rays: Vec<usize> = (0..n_rays).filter(|&ray| is_asked[ray]).collect();
        while !rays.is_empty() {
            let found = attend(is_wanted, |stop| {
                let each = rays.par_iter().map(|&ray| match stop.load(Ordering::Relaxed) {
                    true => Err(Error::Cancelled),
                    false => self.along(ray),
                });
                each.collect::<Result<Vec<f64>, Error>>()
            })?;
            let mut next = Vec::new();
            for (&ray, departure) in rays.iter().zip(found).filter(|(_, found)| *found > 0.0) {
                departures[ray] = departure as f32;
                let is_new = |ray: &usize| !std::mem::replace(&mut is_asked[*ray], true);
                next.extend(self.around(ray).into_iter().filter(is_new));
            }
            rays = next;
        }
        if is_wanted() { Ok(departures) } else { Err(Error::Cancelled) }
    }

    /// The same direction at the neighbours of a position, and the directions near by at itself.
    fn around(&self, ray: usize) -> Vec<usize> {
        let (position, k) = (ray / DIRECTIONS, ray % DIRECTIONS);
        let beside = self.neighbours[position].iter().map(|n| DIRECTIONS * n + k);
        let here = self.directions[k];
        let is_near = |n: &[f64; 3]| n[0] * here[0] + n[1] * here[1] + n[2] * here[2] > NEAR;
        let near = (0..DIRECTIONS).filter(|&other| is_near(&self.directions[other]));
        beside.chain(near.map(|other| DIRECTIONS * position + other)).collect()
    }

    fn along(&self, ray: usize) -> Result<f64, Error> {
        let position = ray / DIRECTIONS;
        let Some(contact) = self.model.locate(self.model.position(position)) else {
            return Ok(0.0);
        };
        let Some(d) = self.suspect(&contact, self.directions[ray % DIRECTIONS]) else {
            return Ok(0.0);
        };
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let waiting = idle().pop();
        let mut comparison = match waiting {
            Some(comparison) => comparison,
            None => Comparison::new(self.full, self.model)?,
        };
        let departure = comparison.departure(&contact, &self.positions.patches[position], d);
        idle().push(comparison);
        Ok(departure)
    }

    /// The deepest trusted touch in a direction, unless that is shallow, or its estimate far below the allowance.
    fn suspect(&self, contact: &Contact, direction: [f64; 3]) -> Option<[f64; 3]> {
        let Metadata { depth, diagonal, .. } = *self.model.metadata();
        let largest = depth.min(GROWN * diagonal);
        let touches = DEPTHS.iter().map(|share| direction.map(|x| share * largest * x));
        let estimates = touches.map(|d| (d, self.model.respond(contact, d)));
        let (d, answer) = { estimates }.find(|(_, answer)| answer.trust == Trust::Trusted)?;
        (answer.error_estimate > SUSPICIOUS * allowed(self.model, d)).then_some(d)
    }
}

/// Whether a ray is among those that are asked first.
fn is_in_turn(ray: usize) -> bool {
    (ray / DIRECTIONS + ray % DIRECTIONS).is_multiple_of(TURNS)
}

/// The error that is allowed at the depth of a touch.
fn allowed(model: &ReducedModel, d: [f64; 3]) -> f64 {
    let depth = d.iter().map(|x| x * x).sum::<f64>().sqrt();
    allowance(depth / model.metadata().diagonal)
}

/// A model beside its full organ.
struct Comparison<'a> {
    model: &'a ReducedModel,
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

    /// The departure of a trusted touch if it, or one just above, turns out to be beyond the allowance; 0 of any other.
    /// Where the organ is not even stable just above, no deeper touch is to be trusted.
    fn departure(&mut self, contact: &Contact, patch: &Patch, deepest: [f64; 3]) -> f64 {
        let (mut departure, mut is_beyond): (f64, bool) = (0.0, false);
        for share in CORRECTED {
            let d = deepest.map(|x| share * x);
            let (allowed, rest) = (allowed(self.model, d), self.rest(contact, d));
            if rest < LEAST_REST {
                break;
            }
            let error = self.error(contact, patch, d);
            departure = departure.max(error.unwrap_or(allowed) / rest.powi(3));
            is_beyond |= error.is_none_or(|error| error > allowed);
            if error.is_some() {
                break;
            }
        }
        let at_the_deepest = departure * self.rest(contact, deepest).powi(3);
        if is_beyond || at_the_deepest > allowed(self.model, deepest) { departure } else { 0.0 }
    }

    /// What the rest of the series is in proportion to.
    fn rest(&self, contact: &Contact, d: [f64; 3]) -> f64 {
        self.model.truncation(contact, d).unwrap_or_default()
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
