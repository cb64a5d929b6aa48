//! Training: states that the superposed series predicts, and the forces of every cell in them.

use super::assembly::cell_forces;
use super::nnls::norm;
use super::sample::Sample;
use super::subspace::{Rest, Subspace};
use rayon::prelude::*;

/// A state in which some cell keeps less than this part of its volume is drawn back towards rest.
const SMALLEST_RATIO: f64 = 0.3;

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

/// States under displacements spread over the ball of radius `depth` [m], from number `first` on.
pub(super) fn states(
    rest: &Rest,
    subspace: &Subspace,
    depth: f64,
    numbers: std::ops::Range<usize>,
) -> Vec<State> {
    let contacts = subspace.means.len() / 3;
    numbers
        .into_par_iter()
        .map(|number| {
            let mut d: Vec<f64> = (0..contacts)
                .flat_map(|c| spread(contacts * number + c).map(|x| depth * x))
                .collect();
            let mut q = subspace.superposed(&d);
            let mut u = subspace.basis.field(&q);
            while !(rest.body.smallest_jacobian(&u).0 > SMALLEST_RATIO) {
                d.iter_mut().for_each(|x| *x *= 0.7);
                q = subspace.superposed(&d);
                u = subspace.basis.field(&q);
            }
            let mut force = vec![0.0; u.len()];
            rest.body.internal_force(&u, &mut force);
            State { q, force: subspace.basis.project(&force) }
        })
        .collect()
}

/// Forces of the cells along the modes in some states, each state in units of the force of the whole body.
pub(super) struct Forces {
    /// Rows: modes of a state after modes of another.
    pub rows: usize,
    /// Cell by cell.
    pub cells: Vec<f64>,
    /// Of the whole body.
    pub body: Vec<f64>,
}

impl Forces {
    /// Of the cells of a sample.
    pub fn new(sample: &Sample, subspace: &Subspace, states: &[State]) -> Self {
        let r = subspace.len();
        let modes = sample.restrict(&subspace.basis.modes);
        let rows = r * states.len();
        let (mut cells, mut body) = (vec![0.0; rows * sample.len()], Vec::with_capacity(rows));
        for (k, state) in states.iter().enumerate() {
            let unit = 1.0 / norm(&state.force).max(f64::MIN_POSITIVE);
            let forces = sample.by_cell(&cell_forces(sample, &modes, &state.q), r);
            for (out, force) in cells.chunks_exact_mut(rows).zip(forces.chunks_exact(r)) {
                let out = &mut out[k * r..(k + 1) * r];
                out.iter_mut().zip(force).for_each(|(out, f)| *out = unit * f);
            }
            body.extend(state.force.iter().map(|f| unit * f));
        }
        Forces { rows, cells, body }
    }

    /// Joins forces of the same cells in other states.
    pub fn join(parts: Vec<Forces>) -> Self {
        let rows = parts.iter().map(|p| p.rows).sum();
        let count = parts.first().map_or(0, |p| p.cells.len() / p.rows);
        let mut cells = Vec::with_capacity(rows * count);
        for cell in 0..count {
            for part in &parts {
                cells.extend_from_slice(&part.cells[cell * part.rows..(cell + 1) * part.rows]);
            }
        }
        Forces { rows, cells, body: parts.into_iter().flat_map(|p| p.body).collect() }
    }

    /// Leaves the forces of some cells only, of which the body then consists.
    pub fn restrict(&mut self, is_kept: impl Fn(usize) -> bool) {
        self.body.fill(0.0);
        for (cell, force) in self.cells.chunks_exact_mut(self.rows).enumerate() {
            if is_kept(cell) {
                self.body.iter_mut().zip(force).for_each(|(sum, f)| *sum += *f);
            } else {
                force.fill(0.0);
            }
        }
    }

    /// `|sum_e w_e f_e - f|`, root mean square over the states.
    pub fn error(&self, weights: &[f64], states: usize) -> f64 {
        let mut residual = self.body.clone();
        for (force, w) in self.cells.chunks_exact(self.rows).zip(weights) {
            residual.iter_mut().zip(force).for_each(|(r, f)| *r -= w * f);
        }
        norm(&residual) / (states as f64).sqrt()
    }
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
