//! First guesses of states: displacements spread over a ball, and the superposed series under them.

use super::newton::{ReducedNewton, ReducedStatus, Search};
use super::origin::Origin;
use super::subspace::Subspace;
use crate::number::norm;
use rayon::prelude::*;
use std::ops::Range;

/// A state in which the volume ratio of a cell is below this is moved back towards rest.
const SMALLEST_RATIO: f64 = 0.3;

/// A superposed series and its displacements of all contacts [m].
pub(super) struct Guess {
    d: Vec<f64>,
    /// Coordinates of the series.
    pub q: Vec<f64>,
}

impl Guess {
    /// Largest displacement of a contact [m].
    pub fn depth(&self) -> f64 {
        self.d.chunks_exact(3).map(norm).fold(0.0, f64::max)
    }

    /// Coordinates of the model's answer to the displacements; the guess itself if the search fails.
    pub fn answer(&self, subspace: &Subspace, model: &mut ReducedNewton) -> Vec<f64> {
        let mut means = vec![0.0; self.d.len()];
        let guess = subspace.guess(&self.d, &mut means);
        match model.find(&self.d, guess, &mut Search::default()) {
            ReducedStatus::Converged => model.q.clone(),
            _ => self.q.clone(),
        }
    }
}

/// Superposed series under displacements spread over the ball of radius `depth` [m].
pub(super) fn guesses(
    origin: &Origin,
    subspace: &Subspace,
    depth: f64,
    numbers: Range<usize>,
) -> Vec<Guess> {
    let contacts = subspace.constraints.len() / 3;
    numbers
        .into_par_iter()
        .map(|number| {
            let mut d: Vec<f64> = (0..contacts)
                .flat_map(|c| spread(contacts * number + c).map(|x| depth * x))
                .collect();
            let mut q = subspace.superposed(&d);
            let is_sound =
                |q: &[f64]| origin.smallest_jacobian(&subspace.basis.field(q)) > SMALLEST_RATIO;
            while !is_sound(&q) {
                d.iter_mut().for_each(|x| *x *= 0.7);
                q = subspace.superposed(&d);
            }
            Guess { d, q }
        })
        .collect()
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
