//! What a model is worth, measured before it is handed over: between positions, between the values
//! of a parameter.

use super::attend::attend;
use super::refused::refused;
use super::settings::{Progress, Reduction};
use super::solve::Expanded;
use crate::error::Error;
use crate::mesh::Patch;
use crate::number::{Monomials, degree_of, evaluate_monomials, on_sphere};
use crate::series::{TouchExpansion, TouchSeries};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use viscera_touch::{Contact, Errors, MAX_ORDER, Metadata, ReducedModel, pade_weights};

/// Points between positions at which a model is measured.
const INTERPOLATION_CHECKS: usize = 32;
/// Positions at which a model is measured for a value of its parameter.
const PARAMETER_CHECKS: usize = 32;
/// Directions in which each of them is touched.
pub(super) const DIRECTIONS: usize = 6;
/// Corners that disagree less tell nothing: the error has other causes.
const LEAST_DISAGREEMENT: f64 = 1e-6;

/// What a model was found to be worth, beside exact series.
pub(super) struct Measured {
    pub errors: Errors,
    /// See [`Metadata::interpolation_shares`](viscera_touch::Metadata).
    pub interpolation_shares: Option<[f64; 2]>,
    /// See [`Metadata::truncation_share`](viscera_touch::Metadata).
    pub truncation_share: Option<f64>,
}

impl Measured {
    pub fn new(errors: Errors) -> Self {
        Measured { errors, interpolation_shares: None, truncation_share: None }
    }
}

/// Where a model is measured: a triangle, at its centroid, and unit vectors along which it is touched.
struct Place {
    triangle: usize,
    directions: [[f64; 3]; DIRECTIONS],
}

/// A touch between positions: what the model answers beside the exact series.
struct Between {
    /// Relative errors of force and field.
    errors: [f64; 2],
    /// What they should be in proportion to, where it is known.
    disagreement: Option<[f64; 2]>,
    /// What the next order changes, and what that should be in proportion to, where it is known.
    truncation: Option<[f64; 2]>,
}

impl Reduction {
    /// Compares the model with exact series at centroids of triangles spread over the surface.
    pub(super) fn measure_interpolation(
        &self,
        members: &[Expanded],
        model: &mut ReducedModel,
        measured: &mut Measured,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<(), Error> {
        let total = members[0].positions.nodes.len();
        let n_triangles = model.triangles().len();
        let count = INTERPOLATION_CHECKS.min(n_triangles);
        // Along the axes themselves orders may vanish, where the organ is symmetric.
        let places: Vec<Place> = (0..count)
            .map(|k| Place {
                triangle: k * n_triangles / count,
                directions: std::array::from_fn(|i| on_sphere(i * count + k, DIRECTIONS * count)),
            })
            .collect();
        let nodes = model.metadata().parameter.as_ref().map(|p| p.nodes.clone());
        for (j, Expanded { expansion, .. }) in members.iter().enumerate() {
            if let Some(nodes) = &nodes {
                model.set_parameter(nodes[j]).map_err(refused)?;
            }
            let mut is_wanted = || progress(Progress { done: total, total, stage: "check" });
            let errors = attend(&mut is_wanted, |stop| {
                let chunks = places.par_chunks(8);
                chunks
                    .map(|some| self.interpolation_errors(expansion, model, some, stop))
                    .collect::<Result<Vec<_>, _>>()
            })?;
            if !is_wanted() {
                return Err(Error::Cancelled);
            }
            let touches: Vec<[Vec<Between>; 2]> = errors.into_iter().flatten().collect();
            let [half, full] = [0, 1].map(|depth| {
                touches
                    .iter()
                    .flat_map(|at| &at[depth])
                    .fold(0.0, |w, touch| f64::max(w, touch.errors[1]))
            });
            let worst = &mut measured.errors;
            worst.interpolation_half_depth = worst.interpolation_half_depth.max(half);
            worst.interpolation = worst.interpolation.max(full);
            if self.is_sketched() {
                let found = interpolation_shares(touches.iter().flatten().flatten());
                let before = measured.interpolation_shares.unwrap_or_default();
                measured.interpolation_shares = Some([0, 1].map(|k| f64::max(before[k], found[k])));
                let found = truncation_share(touches.iter().flatten().flatten());
                let larger = |share: f64| share.max(measured.truncation_share.unwrap_or_default());
                measured.truncation_share = found.map(larger);
            }
        }
        Ok(())
    }

    /// The order that is measured beside the model's own: the next, where there is one.
    pub(super) fn next_order(&self) -> usize {
        if self.is_sketched() { (self.order + 1).min(MAX_ORDER) } else { self.order }
    }

    /// Whether a model of these settings has sketches to sum its orders by.
    pub(super) fn is_sketched(&self) -> bool {
        self.pade && self.order >= 3
    }

    /// Compares the model at a value between its nodes with exact series, at some positions, for shallow and for full
    /// touches along six axes: forces, and fields less what their compression loses, which an estimate adds by itself.
    pub(super) fn measure_parameter(
        &self,
        unseen: &Expanded,
        value: f64,
        model: &mut ReducedModel,
        worst: &mut Errors,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<(), Error> {
        model.set_parameter(value).map_err(refused)?;
        let Expanded { positions, expansion } = unseen;
        let count = PARAMETER_CHECKS.min(positions.nodes.len());
        let places: Vec<usize> = (0..count).map(|k| k * positions.nodes.len() / count).collect();
        let patches: Vec<&Patch> = places.iter().map(|&p| &positions.patches[p]).collect();
        let total = positions.nodes.len();
        let mut is_wanted = || progress(Progress { done: total, total, stage: "check" });
        let series = attend(&mut is_wanted, |stop| {
            let chunks = patches.par_chunks(8);
            let is_wanted = || !stop.load(Ordering::Relaxed);
            let series = chunks.map(|some| expansion.expand_while(&is_wanted, some, self.order, 1));
            Ok(series.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect::<Vec<_>>())
        })?;
        let mut workspace = vec![0.0; model.field_workspace_len()];
        let mut largest: f64 = 0.0;
        for (&place, series) in places.iter().zip(&series) {
            let Some(contact) = model.locate(model.position(place)) else { continue };
            for (share, axis) in [0.1, 1.0].iter().flat_map(|s| (0..6).map(move |axis| (s, axis))) {
                let d = along(axis, share * self.depth);
                let weights = model.order_weights(&contact, d);
                let (exact, force) = sum(series, model.exponents(), weights, d);
                let mut field = vec![0.0; exact.len()];
                model.displacement(&contact, d, &mut workspace, &mut field);
                let of_field = relative(&mut field.iter().map(|&u| f64::from(u)), &exact);
                largest = largest.max(of_field - model.compression(&contact, d));
                let answer = model.respond(&contact, d).force;
                largest = largest.max(relative(&mut answer.into_iter(), &force));
            }
        }
        worst.parameter = worst.parameter.max(largest);
        Ok(())
    }

    /// Touches at some places, to half and to full depth.
    fn interpolation_errors(
        &self,
        expansion: &TouchExpansion,
        model: &ReducedModel,
        places: &[Place],
        stop: &AtomicBool,
    ) -> Result<Vec<[Vec<Between>; 2]>, Error> {
        let contacts: Vec<_> = places.iter().map(|place| model.centroid(place.triangle)).collect();
        let patches: Vec<Patch> = contacts.iter().map(|c| model.patch(c)).collect();
        let patches: Vec<&Patch> = patches.iter().collect();
        let is_wanted = || !stop.load(Ordering::Relaxed);
        let series = expansion.expand_while(&is_wanted, &patches, self.next_order(), 1)?;
        let mut workspace = vec![0.0; model.field_workspace_len()];
        let mut touch = |contact: &Contact, series: &TouchSeries, d| {
            let exact = Orders::new(series, self.next_order(), d);
            compare(model, contact, &exact, d, &mut workspace)
        };
        let at = places.iter().zip(&contacts).zip(&series).map(|((place, contact), series)| {
            [0.5, 1.0].map(|share| {
                let pushed = |x: &[f64; 3]| x.map(|x| share * self.depth * x);
                let touches = place.directions.iter().map(pushed);
                touches.map(|d| touch(contact, series, d)).collect()
            })
        });
        Ok(at.collect())
    }
}

/// What a model answers beside the exact series, summed in its own Padé form where the model is in one.
fn compare(
    model: &ReducedModel,
    contact: &Contact,
    exact: &Orders,
    d: [f64; 3],
    workspace: &mut [f32],
) -> Between {
    // A model that is being made sees poles if and only if it is summed in the Padé form.
    let Metadata { order, is_pole_aware: is_pade, .. } = *model.metadata();
    let answer = model.respond(contact, d).force;
    let (field, force) = exact.sum(order, is_pade);
    let mut answered = vec![0.0; field.len()];
    model.displacement(contact, d, workspace, &mut answered);
    let truncation = model.truncation(contact, d).filter(|_| exact.fields.len() > order);
    Between {
        errors: [
            relative(&mut answer.into_iter(), &force),
            relative(&mut answered.iter().map(|&u| f64::from(u)), &field),
        ],
        disagreement: model.disagreement(contact, d),
        truncation: truncation.map(|scale| {
            let (next, next_force) = exact.sum(order + 1, is_pade);
            let of_force = relative(&mut force.into_iter(), &next_force);
            [of_force.max(relative(&mut field.iter().copied(), &next)), scale]
        }),
    }
}

/// The parts of a series at a displacement, order by order.
struct Orders {
    fields: Vec<Vec<f64>>,
    forces: Vec<[f64; 3]>,
}

impl Orders {
    /// Of a series to that order.
    fn new(series: &TouchSeries, order: usize, d: [f64; 3]) -> Self {
        let table = Monomials::of(3, order);
        let only = |p: usize| std::array::from_fn(|q| if q == p { 1.0 } else { 0.0 });
        let part = |p: usize| sum(series, &table.exponents()[1..], only(p), d);
        let (fields, forces) = (0..order).map(part).unzip();
        Orders { fields, forces }
    }

    /// Field and force summed to an order.
    fn sum(&self, order: usize, is_pade: bool) -> (Vec<f64>, [f64; 3]) {
        let weights = if is_pade { self.weights(order) } else { [1.0; MAX_ORDER] };
        let mut field = vec![0.0; self.fields[0].len()];
        let mut force = [0.0; 3];
        for ((u, f), w) in self.fields.iter().zip(&self.forces).zip(weights).take(order) {
            field.iter_mut().zip(u).for_each(|(field, u)| *field += w * u);
            force.iter_mut().zip(f).for_each(|(force, f)| *force += w * f);
        }
        (field, force)
    }

    /// How much each order counts, by inner products of the fields themselves.
    fn weights(&self, order: usize) -> [f64; MAX_ORDER] {
        let product = |p: usize, q: usize| match (self.fields.get(p), self.fields.get(q)) {
            (Some(u), Some(v)) => u.iter().zip(v).map(|(u, v)| u * v).sum(),
            _ => 0.0,
        };
        let products = std::array::from_fn(|p| std::array::from_fn(|q| product(p, q)));
        pade_weights(&products, order)
    }
}

/// Shares of the errors of force and field in the disagreement.
fn interpolation_shares<'a>(touches: impl Iterator<Item = &'a Between>) -> [f64; 2] {
    let pairs: Vec<([f64; 2], [f64; 2])> =
        touches.filter_map(|touch| Some((touch.errors, touch.disagreement?))).collect();
    [0, 1].map(|k| share(pairs.iter().map(|(error, scale)| [error[k], scale[k]])).unwrap_or(0.0))
}

/// Share of what the next order changes in what that should be in proportion to.
fn truncation_share<'a>(touches: impl Iterator<Item = &'a Between>) -> Option<f64> {
    share(touches.filter_map(|touch| touch.truncation))
}

/// Root mean square of errors in units of their scales. Left out are scales too small to tell, and errors relative to
/// nothing, where the exact answer is zero.
fn share(errors: impl Iterator<Item = [f64; 2]>) -> Option<f64> {
    let told = errors.filter(|[error, scale]| *scale > LEAST_DISAGREEMENT && error.is_finite());
    let ratios: Vec<f64> = told.map(|[error, scale]| error / scale).collect();
    let squares: f64 = ratios.iter().map(|ratio| ratio * ratio).sum();
    (!ratios.is_empty()).then(|| (squares / ratios.len() as f64).sqrt())
}

/// A displacement of the given size along one of six axes.
fn along(axis: usize, size: f64) -> [f64; 3] {
    let mut d = [0.0; 3];
    d[axis / 2] = if axis.is_multiple_of(2) { size } else { -size };
    d
}

/// Field and force of a series, the terms of these exponents alone, each order with its weight.
fn sum(
    series: &TouchSeries,
    exponents: &[[u8; 3]],
    weights: [f64; MAX_ORDER],
    d: [f64; 3],
) -> (Vec<f64>, [f64; 3]) {
    let mut monomials = vec![0.0; exponents.len()];
    evaluate_monomials(exponents, d, &mut monomials);
    let mut field = vec![0.0; series.displacement[0].len()];
    let mut force = [0.0; 3];
    let terms = series.displacement.iter().zip(&series.force).zip(exponents).zip(&monomials);
    for (((u, f), exponents), m) in terms {
        let m = weights[degree_of(exponents) - 1] * m;
        if m == 0.0 {
            continue;
        }
        field.iter_mut().zip(u).for_each(|(field, u)| *field += m * u);
        force.iter_mut().zip(f).for_each(|(force, f)| *force += m * f);
    }
    (field, force)
}

/// `|value - exact| / |exact|`.
fn relative(value: &mut dyn Iterator<Item = f64>, exact: &[f64]) -> f64 {
    let difference: f64 = value.zip(exact).map(|(a, b)| (a - b).powi(2)).sum();
    (difference / exact.iter().map(|x| x * x).sum::<f64>()).sqrt()
}
