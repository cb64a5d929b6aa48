//! How fast the full organ departs from the path that a series continues. A thin part that is pushed along itself turns
//! aside, as a column does that is not quite straight. The cause is a tangent that is nearly singular beside the path,
//! which a few orders about rest do not show, but an iteration of Newton's method at the series' own answer does.

use super::attend::attend;
use super::comparison::{Comparison, Comparisons, Deepest, Ray, allowed};
use super::settings::{Progress, Reduction};
use super::solve::Expanded;
use crate::body::Curvature;
use crate::error::Error;
use crate::mesh::Patch;
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use viscera_touch::{Contact, DIRECTIONS, ReducedModel};

/// One ray in so many is asked first. Where the organ departs the rays around are asked, too.
const TURNS: usize = 2;
/// Cosine of the angle between directions that are near each other: about five around each.
const NEAR: f64 = 0.68;
/// Parts of the deepest trusted touch at which it is corrected: the second where the organ is not stable at the first.
const CORRECTED: [f64; 2] = [0.9, 0.8];
/// The allowance is smallest up to this part of the diagonal.
const TIGHT: f64 = 0.05;
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
        (model, asked): (&mut ReducedModel, Ask),
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Vec<Vec<f32>>, Error> {
        if !self.is_sketched() {
            return Ok(vec![Vec::new(); members.len()]);
        }
        self.beside_full_organs(members, fixed, model, progress, |full, is_wanted| {
            Survey::new(full, asked).run(is_wanted)
        })
    }
}

/// Which rays are asked.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Ask {
    /// Those whose estimate is not far below the allowance.
    Suspicious,
    /// All: estimates far below were found to be wrong.
    All,
}

/// Corrections over a surface, as far as they find something. A ray is a direction at a position, numbered position by
/// position.
struct Survey<'s, 'a> {
    full: &'s Comparisons<'a>,
    asked: Ask,
    neighbours: Vec<Vec<usize>>,
}

impl<'s, 'a> Survey<'s, 'a> {
    fn new(full: &'s Comparisons<'a>, asked: Ask) -> Self {
        let mut neighbours = vec![Vec::new(); full.positions.nodes.len()];
        for &[a, b] in &full.positions.edges {
            neighbours[a as usize].push(b as usize);
            neighbours[b as usize].push(a as usize);
        }
        Survey { full, asked, neighbours }
    }

    /// The departure along each ray; 0 where none was found. Rays in turn are asked, and those around where something was found.
    fn run(&self, is_wanted: &mut dyn FnMut() -> bool) -> Result<Vec<f32>, Error> {
        let n_rays = DIRECTIONS * self.full.positions.nodes.len();
        let mut departures = vec![0.0; n_rays];
        let mut is_asked: Vec<bool> = (0..n_rays).map(is_in_turn).collect();
        let mut rays: Vec<usize> = (0..n_rays).filter(|&ray| is_asked[ray]).collect();
        while !rays.is_empty() {
            let mut next = Vec::new();
            for (ray, departure) in self.ask(&rays, is_wanted)? {
                departures[ray] = departure as f32;
                let is_new = |ray: &usize| !std::mem::replace(&mut is_asked[*ray], true);
                next.extend(self.around(ray).into_iter().filter(is_new));
            }
            rays = next;
        }
        Ok(departures)
    }

    /// The rays along which something is found, with the departure.
    fn ask(
        &self,
        rays: &[usize],
        is_wanted: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<(usize, f64)>, Error> {
        let found = attend(is_wanted, |stop| {
            let each = rays.par_iter().map(|&ray| match stop.load(Ordering::Relaxed) {
                true => Err(Error::Cancelled),
                false => Ok((ray, self.along(ray)?)),
            });
            each.collect::<Result<Vec<_>, Error>>()
        })?;
        if !is_wanted() {
            return Err(Error::Cancelled);
        }
        Ok(found.into_iter().filter(|(_, departure)| *departure > 0.0).collect())
    }

    /// The same direction at the neighbours of a position, and the directions near by at itself.
    fn around(&self, ray: usize) -> Vec<usize> {
        let (position, k) = (ray / DIRECTIONS, ray % DIRECTIONS);
        let beside = self.neighbours[position].iter().map(|n| DIRECTIONS * n + k);
        let directions = &self.full.directions;
        let here = directions[k];
        let is_near = |n: &[f64; 3]| n[0] * here[0] + n[1] * here[1] + n[2] * here[2] > NEAR;
        let near = (0..DIRECTIONS).filter(|&other| is_near(&directions[other]));
        beside.chain(near.map(|other| DIRECTIONS * position + other)).collect()
    }

    /// The departure that is found along a ray; 0 if it is not asked.
    fn along(&self, ray: usize) -> Result<f64, Error> {
        let ray = Ray { position: ray / DIRECTIONS, direction: ray % DIRECTIONS };
        let Some((contact, Deepest { d, is_suspicious })) = self.full.deepest_trusted(ray) else {
            return Ok(0.0);
        };
        let tight = match self.asked {
            Ask::All => at_tight_allowance(self.full.model, d),
            Ask::Suspicious if is_suspicious => None,
            Ask::Suspicious => return Ok(0.0),
        };
        let patch = &self.full.positions.patches[ray.position];
        self.full.with(|comparison| {
            let touches = [Some(d), tight].into_iter().flatten();
            touches.map(|d| departure(comparison, &contact, patch, d)).fold(0.0, f64::max)
        })
    }
}

/// Whether a ray is among those that are asked first.
fn is_in_turn(ray: usize) -> bool {
    (ray / DIRECTIONS + ray % DIRECTIONS).is_multiple_of(TURNS)
}

/// The touch in the same direction to the depth up to which the allowance is smallest, if that is shallower by far.
fn at_tight_allowance(model: &ReducedModel, d: [f64; 3]) -> Option<[f64; 3]> {
    let share = TIGHT * model.metadata().diagonal / d.iter().map(|x| x * x).sum::<f64>().sqrt();
    (share < CORRECTED[0]).then(|| d.map(|x| share * x))
}

/// The departure of a trusted touch if it, or one just above, turns out to be beyond the allowance; 0 of any other. Where the
/// organ is not even stable just above, no deeper touch is to be trusted.
fn departure(
    comparison: &mut Comparison,
    contact: &Contact,
    patch: &Patch,
    deepest: [f64; 3],
) -> f64 {
    let (model, mut departure, mut is_beyond) = (comparison.model, 0.0_f64, false);
    for share in CORRECTED {
        let d = deepest.map(|x| share * x);
        let (allowed, rest) = (allowed(model, d), comparison.rest(contact, d));
        if rest < LEAST_REST {
            break;
        }
        let error = comparison.error(contact, patch, d, Curvature::Exact);
        departure = departure.max(error.unwrap_or(allowed) / rest.powi(3));
        is_beyond |= error.is_none_or(|error| error > allowed);
        if error.is_some() {
            break;
        }
    }
    let at_the_deepest = departure * comparison.rest(contact, deepest).powi(3);
    if is_beyond || at_the_deepest > allowed(model, deepest) { departure } else { 0.0 }
}
