//! Greedy enrichment by alternating directions: one pair of modes after the other (paper A, section 3).
//!
//! With the pairs found so far taken off the right-hand side `E(s)`, a new pair `R(x) S(s)` satisfies
//!   S fixed: (int S^2) K R = int S E ds,      R fixed: (R . K R) S(s) = R . E(s),
//! which are repeated until the direction of `S` rests. Each half-step minimises the energy of what is left,
//! so the energy error falls with every pair, by exactly the energy of the pair.

use super::separated::Separated;
use crate::equilibrium::ConstrainedSystem;
use crate::error::Error;
use crate::settings::{self, Setting, Values};
use rayon::prelude::*;

/// Rows per task.
const ROWS: usize = 1024;

/// When to stop. The readable text of paper A gives no rule, so these are settings; the tolerances by default are
/// those of the code that its authors published with their book of 2016.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Enrichment {
    /// An order is complete when the energy norm of a pair falls below this part of the largest norm in its order; that
    /// pair is left out.
    pub tolerance: f64,
    /// Largest number of pairs in an order.
    pub max_terms: usize,
    /// Change of the unit vector along `S` below which a pair is found.
    pub stagnation: f64,
    /// Largest number of iterations for a pair.
    pub max_iterations: usize,
}

impl Default for Enrichment {
    fn default() -> Self {
        Enrichment { tolerance: 0.05, max_terms: 100, stagnation: 0.05, max_iterations: 30 }
    }
}

/// The result of an enrichment.
#[derive(Clone, Debug, Default)]
pub(super) struct Enriched {
    pub field: Separated,
    /// Energy norm of each pair.
    pub sizes: Vec<f64>,
    /// Fixed-point iterations of each pair.
    pub iterations: Vec<usize>,
    /// Whether `max_terms` ended the enrichment before `tolerance` did.
    pub is_cut: bool,
}

struct Pair {
    /// `R` and `K R` on the free degrees of freedom.
    space: Vec<f64>,
    force: Vec<f64>,
    position: Vec<f64>,
    size: f64,
    iterations: usize,
}

impl Enrichment {
    /// The settings that users may choose.
    pub const SETTINGS: [Setting<Self>; 4] = [
        Setting {
            name: "tolerance",
            means: "energy norm of a pair, relative to the largest of its order, that ends an order",
            values: Values::Fraction,
            get: |enrichment| enrichment.tolerance,
            set: |enrichment, value| enrichment.tolerance = value,
        },
        Setting {
            name: "max_terms",
            means: "pairs of an order at most",
            values: Values::Whole(1, 1_000_000),
            get: |enrichment| enrichment.max_terms as f64,
            set: |enrichment, value| enrichment.max_terms = value as usize,
        },
        Setting {
            name: "stagnation",
            means: "change of the direction along the positions below which a pair is found",
            values: Values::Fraction,
            get: |enrichment| enrichment.stagnation,
            set: |enrichment, value| enrichment.stagnation = value,
        },
        Setting {
            name: "max_iterations",
            means: "iterations for a pair at most",
            values: Values::Whole(1, 1_000_000),
            get: |enrichment| enrichment.max_iterations as f64,
            set: |enrichment, value| enrichment.max_iterations = value as usize,
        },
    ];

    pub(super) fn check(&self) -> Result<(), Error> {
        settings::check(&Self::SETTINGS, self, "enrichment")
    }

    /// Separates `K^-1 E`; `residual` holds a column of the free degrees of freedom for each position and is left
    /// with what was not captured. `go_on` is asked after each pair.
    pub(super) fn separate(
        &self,
        system: &ConstrainedSystem,
        residual: &mut [f64],
        weights: &[f64],
        go_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Enriched, Error> {
        let mut found = Enriched::default();
        let mut largest: f64 = 0.0;
        while let Some(pair) = self.pair(system, residual, weights)? {
            largest = largest.max(pair.size);
            if pair.size < self.tolerance * largest {
                break;
            }
            if found.field.len() == self.max_terms {
                found.is_cut = true;
                break;
            }
            residual.par_chunks_mut(system.n_free()).zip(&pair.position).for_each(|(column, g)| {
                column.iter_mut().zip(&pair.force).for_each(|(e, f)| *e -= g * f);
            });
            found.sizes.push(pair.size);
            found.iterations.push(pair.iterations);
            let norm = pair.space.iter().map(|r| r * r).sum::<f64>().sqrt();
            let unit: Vec<f64> = pair.space.iter().map(|r| r / norm).collect();
            found.field.space.push(system.scatter(&unit));
            found.field.position.push(pair.position.iter().map(|g| g * norm).collect());
            if !go_on(found.field.len()) {
                return Err(Error::Cancelled);
            }
        }
        Ok(found)
    }

    /// The next pair; none if nothing is left to capture.
    fn pair(
        &self,
        system: &ConstrainedSystem,
        residual: &[f64],
        weights: &[f64],
    ) -> Result<Option<Pair>, Error> {
        let mut position = start(residual, system.n_free())?;
        let mut iterations = 0;
        loop {
            iterations += 1;
            let square = inner(&position, &position, weights);
            if !is_left(square)? {
                return Ok(None);
            }
            let force = combine(residual, system.n_free(), &position, weights, 1.0 / square);
            let mut space = force.clone();
            system.solve_columns(&mut space)?;
            let stiffness: f64 = space.iter().zip(&force).map(|(r, f)| r * f).sum();
            if !is_left(stiffness)? {
                return Ok(None);
            }
            let next: Vec<f64> = residual
                .par_chunks(system.n_free())
                .map(|e| e.iter().zip(&space).map(|(e, r)| e * r).sum::<f64>() / stiffness)
                .collect();
            let turned = turn(&position, &next, weights);
            position = next;
            if turned < self.stagnation || iterations == self.max_iterations {
                let size = (stiffness * inner(&position, &position, weights)).sqrt();
                return Ok(Some(Pair { space, force, position, size, iterations }));
            }
        }
    }
}

/// Whether something is left where a square tells. One that is no number says nothing.
fn is_left(square: f64) -> Result<bool, Error> {
    if square.is_finite() {
        return Ok(square > 0.0);
    }
    Err(Error::input(
        "the squares of the forces overflow; check the units of the load and of the law",
    ))
}

/// The unit load on the position with the largest remainder: a start that always has a part in it.
fn start(residual: &[f64], n: usize) -> Result<Vec<f64>, Error> {
    let squares: Vec<f64> =
        residual.par_chunks(n).map(|e| e.iter().map(|x| x * x).sum::<f64>()).collect();
    let worst = (0..squares.len()).max_by(|&a, &b| squares[a].total_cmp(&squares[b])).unwrap_or(0);
    let is_any = squares.get(worst).map_or(Ok(false), |&square| is_left(square))?;
    Ok((0..squares.len()).map(|s| if is_any && s == worst { 1.0 } else { 0.0 }).collect())
}

/// `factor sum_s w_s S(s) E(s)`, summed in the same order on any number of threads.
fn combine(residual: &[f64], n: usize, position: &[f64], weights: &[f64], factor: f64) -> Vec<f64> {
    let mut sum = vec![0.0; n];
    sum.par_chunks_mut(ROWS).enumerate().for_each(|(chunk, sum)| {
        for (s, (g, w)) in position.iter().zip(weights).enumerate() {
            let column = &residual[s * n + chunk * ROWS..][..sum.len()];
            let share = factor * w * g;
            sum.iter_mut().zip(column).for_each(|(sum, e)| *sum += share * e);
        }
    });
    sum
}

fn inner(a: &[f64], b: &[f64], weights: &[f64]) -> f64 {
    a.iter().zip(b).zip(weights).map(|((a, b), w)| w * a * b).sum()
}

/// Distance of the unit vectors along `a` and `b`.
fn turn(a: &[f64], b: &[f64], weights: &[f64]) -> f64 {
    let size = (inner(a, a, weights) * inner(b, b, weights)).sqrt();
    if size > 0.0 { (2.0 - 2.0 * inner(a, b, weights) / size).max(0.0).sqrt() } else { 0.0 }
}
