//! Training: states that the superposed series predicts, some of them solved, and the forces of every cell in them.

use super::assembly::cell_forces;
use super::model::{Galerkin, Sampling};
use super::nnls::norm;
use super::sample::Sample;
use super::subspace::{Rest, Subspace};
use crate::body::Body;
use crate::error::Error;
use crate::mesh::Patch;
use rayon::prelude::*;

/// States by which cells and weights of a grasp are found, at least.
const STATES: usize = 24;
/// What a snapshot has beyond the span is left out below this part of the largest snapshot.
const SMALLEST_PART: f64 = 1e-3;
/// A state in which some cell keeps less than this part of its volume is drawn back towards rest.
const SMALLEST_RATIO: f64 = 0.3;
/// Cells that a thread takes at once.
const CHUNK: usize = 256;

/// A state of training.
pub(super) struct State {
    /// Its coordinates.
    pub q: Vec<f64>,
    /// `phi . f_int` of the whole body.
    force: Vec<f64>,
}

impl State {
    /// Squared norm of its coordinates.
    pub fn square(&self) -> f64 {
        self.q.iter().map(|q| q * q).sum()
    }
}

/// The states that a grasp is trained by; the first of them, as many as snapshots are wanted, are solved on the whole
/// body, and the span takes in what it lacks of them.
///
/// # Errors
/// No memory for a solver.
pub(super) fn train(
    owner: &Galerkin,
    patches: &[Patch],
    subspace: &mut Subspace,
) -> Result<Vec<State>, Error> {
    let Sampling { depth, snapshots, .. } = owner.sampling;
    let guesses = guesses(&owner.rest, subspace, depth, 0..STATES.max(snapshots));
    let solve = |q: &Vec<f64>| owner.snapshot(patches, &subspace.basis.field(q));
    let solved: Vec<Option<Vec<f64>>> =
        guesses[..snapshots].par_iter().map(solve).collect::<Result<_, _>>()?;
    let found: Vec<Vec<f64>> = solved.iter().flatten().cloned().collect();
    subspace.enrich(&found, SMALLEST_PART, patches, &owner.rest);
    let solved = solved.into_iter().chain(std::iter::repeat(None));
    let states = guesses.into_iter().zip(solved).map(|(mut q, solved)| match solved {
        Some(u) => subspace.basis.nearest(&u, &owner.rest.stiffness),
        None => {
            q.resize(subspace.len(), 0.0);
            q
        }
    });
    Ok(with_forces(&owner.rest.body, subspace, states.collect()))
}

/// Superposed series under displacements spread over the ball of radius `depth` [m].
fn guesses(
    rest: &Rest,
    subspace: &Subspace,
    depth: f64,
    numbers: std::ops::Range<usize>,
) -> Vec<Vec<f64>> {
    let contacts = subspace.means.len() / 3;
    numbers
        .into_par_iter()
        .map(|number| {
            let mut d: Vec<f64> = (0..contacts)
                .flat_map(|c| spread(contacts * number + c).map(|x| depth * x))
                .collect();
            let mut q = subspace.superposed(&d);
            let is_sound = |q: &[f64]| {
                rest.body.smallest_jacobian(&subspace.basis.field(q)).0 > SMALLEST_RATIO
            };
            while !is_sound(&q) {
                d.iter_mut().for_each(|x| *x *= 0.7);
                q = subspace.superposed(&d);
            }
            q
        })
        .collect()
}

/// States that the superposed series predicts.
#[cfg(test)]
pub(super) fn states(
    rest: &Rest,
    subspace: &Subspace,
    depth: f64,
    numbers: std::ops::Range<usize>,
) -> Vec<State> {
    with_forces(&rest.body, subspace, guesses(rest, subspace, depth, numbers))
}

fn with_forces(body: &Body, subspace: &Subspace, coordinates: Vec<Vec<f64>>) -> Vec<State> {
    coordinates
        .into_par_iter()
        .map(|q| {
            let u = subspace.basis.field(&q);
            let mut force = vec![0.0; u.len()];
            body.internal_force(&u, &mut force);
            State { q, force: subspace.basis.project(&force) }
        })
        .collect()
}

/// Forces of some cells along the modes in some states, each state in units of the force of the whole body.
pub(super) struct Forces {
    /// Rows: modes of a state after modes of another.
    pub rows: usize,
    /// Cell by cell.
    pub cells: Vec<f64>,
    /// Of the whole body.
    pub body: Vec<f64>,
}

impl Forces {
    /// Of some cells of a body.
    pub fn new(body: &Body, cells: &[usize], subspace: &Subspace, states: &[State]) -> Self {
        let units: Vec<f64> =
            states.iter().map(|s| 1.0 / norm(&s.force).max(f64::MIN_POSITIVE)).collect();
        let (r, rows) = (subspace.len(), subspace.len() * states.len());
        let of_some = |some: &[usize]| {
            let sample = Sample::new(body.points(), body.cells(), body.material(), some);
            let modes = sample.restrict(&subspace.basis.modes);
            let mut columns = vec![0.0; rows * some.len()];
            for (k, (state, unit)) in states.iter().zip(&units).enumerate() {
                let forces = sample.by_cell(&cell_forces(&sample, &modes, &state.q), r);
                for (column, force) in columns.chunks_exact_mut(rows).zip(forces.chunks_exact(r)) {
                    let out = &mut column[k * r..(k + 1) * r];
                    out.iter_mut().zip(force).for_each(|(out, f)| *out = unit * f);
                }
            }
            columns
        };
        let cells = cells.par_chunks(CHUNK).map(of_some).collect::<Vec<_>>().concat();
        let body = states.iter().zip(&units);
        let body = body.flat_map(|(s, unit)| s.force.iter().map(move |f| unit * f)).collect();
        Forces { rows, cells, body }
    }

    /// The norm of each cell's forces.
    pub fn sizes(&self) -> Vec<f64> {
        self.cells.chunks_exact(self.rows).map(norm).collect()
    }
}

/// About `count` places, evenly spaced along the running sum of their sizes: what counts more is taken more often.
pub(super) fn systematic(sizes: &[f64], count: usize) -> Vec<usize> {
    let step = sizes.iter().sum::<f64>() / count as f64;
    let (mut sum, mut next, mut taken) = (0.0, 0.5 * step, Vec::with_capacity(count));
    for (place, size) in sizes.iter().enumerate() {
        sum += size;
        if sum > next {
            taken.push(place);
            next = step * ((sum / step - 0.5).floor() + 1.5);
        }
    }
    taken
}

/// The points of a sequence that fills the unit ball evenly, more densely towards its centre: direction from two
/// terms of Roberts' R3 sequence, radius from the third.
fn spread(number: usize) -> [f64; 3] {
    const GOLDEN: f64 = 1.220_744_084_605_76;
    let term = |k: i32| (0.5 + (number + 1) as f64 / GOLDEN.powi(k)).fract();
    let (height, turn) = (2.0 * term(1) - 1.0, std::f64::consts::TAU * term(2));
    let radius = 0.2 + 0.8 * term(3);
    let width = (1.0 - height * height).sqrt();
    [radius * width * turn.cos(), radius * width * turn.sin(), radius * height]
}
