//! What a model is worth, measured before it is handed over: between positions, between the values
//! of a parameter.

use super::attend::attend;
use super::refused::refused;
use super::settings::{Progress, Reduction};
use super::solve::{Expanded, sketch};
use crate::error::Error;
use crate::mesh::Patch;
use crate::number::{Monomials, degree_of, evaluate_monomials};
use crate::series::{TouchExpansion, TouchSeries};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use viscera_touch::{Contact, Errors, MAX_ORDER, ReducedModel, pade_weights};

/// Points between positions at which a model is measured.
const INTERPOLATION_CHECKS: usize = 32;
/// Positions at which a model is measured for a value of its parameter.
const PARAMETER_CHECKS: usize = 32;
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

/// A touch between positions: what the model answers beside the exact series.
struct Between {
    /// Relative errors of force and field.
    errors: [f64; 2],
    /// What they should be in proportion to, where it is known.
    disagreement: Option<[f64; 2]>,
    /// What the next order changes, in units of what that should be in proportion to, where it is known.
    truncation: Option<f64>,
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
        let triangles: Vec<usize> = (0..count).map(|k| k * n_triangles / count).collect();
        let nodes = model.metadata().parameter.as_ref().map(|p| p.nodes.clone());
        for (j, Expanded { expansion, .. }) in members.iter().enumerate() {
            if let Some(nodes) = &nodes {
                model.set_parameter(nodes[j]).map_err(refused)?;
            }
            let mut is_wanted = || progress(Progress { done: total, total, stage: "check" });
            let errors = attend(&mut is_wanted, |stop| {
                let chunks = triangles.par_chunks(8);
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
                let found = shares(touches.iter().flatten().flatten());
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
    fn is_sketched(&self) -> bool {
        self.pade && self.order >= 3
    }

    /// Compares the model at a value between its nodes with exact series, at some positions, for
    /// shallow and for full touches along six axes; fields and forces.
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
            let series = chunks.map(|some| expansion.expand_while(&is_wanted, some, self.order));
            Ok(series.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect::<Vec<_>>())
        })?;
        let mut workspace = vec![0.0; model.workspace_len()];
        let mut largest: f64 = 0.0;
        for (&place, series) in places.iter().zip(&series) {
            let Some(contact) = model.locate(model.position(place)) else { continue };
            for (share, axis) in [0.1, 1.0].iter().flat_map(|s| (0..6).map(move |axis| (s, axis))) {
                let d = along(axis, share * self.depth);
                let weights = model.order_weights(&contact, d);
                let (exact, force) = sum(series, model.exponents(), weights, d);
                let mut field = vec![0.0; exact.len()];
                model.displacement(&contact, d, &mut workspace, &mut field);
                largest = largest.max(relative(&mut field.iter().map(|&u| f64::from(u)), &exact));
                let answer = model.respond(&contact, d).force;
                largest = largest.max(relative(&mut answer.into_iter(), &force));
            }
        }
        worst.parameter = worst.parameter.max(largest);
        Ok(())
    }

    /// Touches along six axes, to half and to full depth, at the centroids of some triangles.
    fn interpolation_errors(
        &self,
        expansion: &TouchExpansion,
        model: &ReducedModel,
        triangles: &[usize],
        stop: &AtomicBool,
    ) -> Result<Vec<[Vec<Between>; 2]>, Error> {
        let contacts: Vec<_> = triangles.iter().map(|&t| model.centroid(t)).collect();
        let patches: Vec<Patch> = contacts.iter().map(|c| model.patch(c)).collect();
        let patches: Vec<&Patch> = patches.iter().collect();
        let is_wanted = || !stop.load(Ordering::Relaxed);
        let series = expansion.expand_while(&is_wanted, &patches, self.next_order())?;
        let sketches: Vec<Vec<f32>> = series.iter().map(sketch).collect();
        let mut workspace = vec![0.0; model.workspace_len()];
        let mut touch = |contact: &Contact, series: &Sketched, d| {
            compare(model, contact, series, d, &mut workspace)
        };
        let at = contacts.iter().zip(series.iter().zip(&sketches)).map(|(contact, series)| {
            [0.5, 1.0].map(|share| {
                (0..6)
                    .map(|axis| touch(contact, &series, along(axis, share * self.depth)))
                    .collect()
            })
        });
        Ok(at.collect())
    }
}

/// A series, to one order more than the model's where there is one, and its sketches.
type Sketched<'a> = (&'a TouchSeries, &'a Vec<f32>);

/// What a model answers beside the exact series, whose orders count as much.
fn compare(
    model: &ReducedModel,
    contact: &Contact,
    &(series, sketches): &Sketched,
    d: [f64; 3],
    workspace: &mut [f32],
) -> Between {
    let answer = model.respond(contact, d).force;
    let (exact, force) = sum(series, model.exponents(), model.order_weights(contact, d), d);
    let mut field = vec![0.0; exact.len()];
    model.displacement(contact, d, workspace, &mut field);
    Between {
        errors: [
            relative(&mut answer.into_iter(), &force),
            relative(&mut field.iter().map(|&u| f64::from(u)), &exact),
        ],
        disagreement: model.disagreement(contact, d),
        truncation: model.truncation(contact, d).and_then(|scale| {
            let change = next_order_changes((series, sketches), model, d, (&exact, &force))?;
            (scale > LEAST_DISAGREEMENT).then_some(change / scale)
        }),
    }
}

/// What one order more changes in field or force, relative to it; the larger of the two.
fn next_order_changes(
    (series, sketches): Sketched,
    model: &ReducedModel,
    d: [f64; 3],
    (field, force): (&[f64], &[f64; 3]),
) -> Option<f64> {
    let order = model.metadata().order + 1;
    let table = (order <= MAX_ORDER).then(|| Monomials::of(3, order))?;
    let exponents = &table.exponents()[1..];
    let weights = pade_weights(sketches, exponents, d, order);
    let (next, next_force) = sum(series, exponents, weights, d);
    let force = relative(&mut force.iter().copied(), &next_force);
    Some(force.max(relative(&mut field.iter().copied(), &next)))
}

/// Root mean square of the errors of force and field, in units of the disagreement.
fn shares<'a>(touches: impl Iterator<Item = &'a Between>) -> [f64; 2] {
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for Between { errors, disagreement, .. } in touches {
        if let Some(disagreement) = disagreement.filter(|of| of[1] > LEAST_DISAGREEMENT) {
            squares = [0, 1].map(|k| squares[k] + (errors[k] / disagreement[k]).powi(2));
            count += 1.0;
        }
    }
    squares.map(|square| (square / f64::max(count, 1.0)).sqrt())
}

/// Root mean square of what the next order changes, in units of what that should be in proportion to.
fn truncation_share<'a>(touches: impl Iterator<Item = &'a Between>) -> Option<f64> {
    let changes: Vec<f64> = touches.filter_map(|touch| touch.truncation).collect();
    let squares: f64 = changes.iter().map(|change| change * change).sum();
    (!changes.is_empty()).then(|| (squares / changes.len() as f64).sqrt())
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
