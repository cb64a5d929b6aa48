//! Whether the last order and the next tell of the rest of the series. Under most laws they do. Under one whose stiffening
//! begins at an order beyond, as that of `(I1bar - 3)^4`, both are small, and deep touches would be trusted. The full organ
//! knows all orders.

use super::attend::attend;
use super::comparison::{Comparison, Comparisons, Deepest, Ray, allowed};
use super::departure::Ask;
use super::refused::unusable;
use super::settings::{Progress, Reduction};
use super::solve::Expanded;
use crate::body::Curvature;
use crate::error::Error;
use crate::mesh::Patch;
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use viscera_touch::{Contact, DIRECTIONS, ReducedModel, truncation_share};

/// Touches at which the full organ is asked.
const SAMPLE: usize = 48;
/// From one to the next, the directions turn by so many: coprime to their number.
const TURN: usize = 7;
/// Each raises the share as far as the touches that are still trusted ask for.
const ROUNDS: usize = 4;
/// If fewer than one touch in so many is beyond its allowance, they are for the survey of the departure.
const FEW: usize = 8;
/// A smaller rest of the series is rounding. It may be far smaller than in the survey: a law that stiffens late has hardly any.
const LEAST_REST: f64 = 1e-9;

/// The share of the rest of the series that a touch asks for; none if it is suspicious, or within its allowance.
type Demand = Option<f64>;

impl Reduction {
    /// The model with a share of the rest of the series by which nearly all touches of a sample are within their allowance,
    /// wherever they are trusted without suspicion, and which rays the survey of the departure has to ask then.
    pub(super) fn with_unseen_rest(
        &self,
        members: &[Expanded],
        fixed: &[u32],
        mut model: ReducedModel,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<(ReducedModel, Ask), Error> {
        let mut asked = Ask::Suspicious;
        if !self.is_sketched() {
            return Ok((model, asked));
        }
        for _ in 0..ROUNDS {
            let demands = self.beside_full_organs(members, fixed, &mut model, progress, sample)?;
            if demands.iter().flatten().any(Option::is_some) {
                asked = Ask::All;
            }
            let of_members = demands.iter().filter_map(|demands| demanded(demands));
            let Some(share) = of_members.reduce(f64::max) else {
                break;
            };
            let (mut metadata, arrays) = model.into_parts();
            let known = metadata.truncation_share.unwrap_or_default();
            metadata.truncation_share = Some(share.max(known));
            model = ReducedModel::new(metadata, arrays).map_err(unusable)?;
        }
        Ok((model, asked))
    }
}

/// The root mean square of the shares that touches ask for, unless few do.
fn demanded(demands: &[Demand]) -> Option<f64> {
    let shares: Vec<f64> = demands.iter().copied().flatten().collect();
    let squares: f64 = shares.iter().map(|x| x * x).sum();
    (FEW * shares.len() > demands.len()).then(|| (squares / shares.len() as f64).sqrt())
}

/// What the trusted touches of the sample ask for: along rays at positions spread over the surface, in directions spread over
/// the sphere.
fn sample(full: &Comparisons, is_wanted: &mut dyn FnMut() -> bool) -> Result<Vec<Demand>, Error> {
    let n_positions = full.positions.nodes.len();
    let demands = attend(is_wanted, |stop| {
        let each = (0..SAMPLE).into_par_iter().map(|k| match stop.load(Ordering::Relaxed) {
            true => Err(Error::Cancelled),
            false => {
                let (position, direction) = (k * n_positions / SAMPLE, k * TURN % DIRECTIONS);
                along(full, Ray { position, direction })
            }
        });
        each.collect::<Result<Vec<_>, Error>>()
    })?;
    if is_wanted() { Ok(demands.into_iter().flatten().collect()) } else { Err(Error::Cancelled) }
}

/// What the deepest trusted touch along a ray asks for; none where no touch is trusted.
fn along(full: &Comparisons, ray: Ray) -> Result<Option<Demand>, Error> {
    let Some((contact, Deepest { d, is_suspicious })) = full.deepest_trusted(ray) else {
        return Ok(None);
    };
    if is_suspicious {
        return Ok(Some(None));
    }
    let patch = &full.positions.patches[ray.position];
    full.with(|comparison| Some(demand(comparison, &contact, patch, d)))
}

/// The share with which the estimate of a touch is its error, if that is beyond the allowance. Where the tangent is not positive
/// definite, its projection leads to equilibrium, too, in more iterations.
fn demand(comparison: &mut Comparison, contact: &Contact, patch: &Patch, d: [f64; 3]) -> Demand {
    let mut error = |curvature| comparison.error(contact, patch, d, curvature);
    let error = error(Curvature::Exact).or_else(|| error(Curvature::Projected))?;
    let rest = comparison.rest(contact, d);
    let is_beyond = rest > LEAST_REST && error > allowed(comparison.model, d);
    is_beyond.then(|| truncation_share(error, rest))
}
