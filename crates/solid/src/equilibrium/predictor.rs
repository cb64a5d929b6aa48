//! The path that leaves an equilibrium, as a series in the part `a` of a load step: `u(a) = sum a^p u_p`, where `u_1` is
//! the linear step and every further order a solve with the same tangent (paper A),
//!   K u_p - W^T F_p = -N_p,   W u_p = 0.
//! A slender body turns where it bends; a linear step stretches it instead, and Newton's method spends many iterations on
//! taking that back. The series turns with the body, and its Pade form says how far it holds.

use super::problem::Problem;
use super::skew;
use super::system::{ConstrainedSystem, Until};
use crate::linear::FactorError;
use crate::number::Monomials;
use crate::number::pade::{Pade, pade_range, taylor_range};

/// Order of the series.
const ORDER: usize = 8;

/// Relative accuracy of the displacement where the prediction ends: Newton's method does the rest.
const TOLERANCE: f64 = 1e-2;

/// A series of displacements, and how far it holds.
pub(super) struct Predictor {
    series: Vec<Vec<f64>>,
    pade: Pade,
    /// The part of the load step up to which it can be relied on, at most 1.
    pub range: f64,
}

impl Predictor {
    /// From the equilibrium `u` at `load` with the linear step to `load + increment`, the solver holding the tangent at `u`.
    ///
    /// # Errors
    /// Those of the solves.
    pub fn new(
        problem: &Problem,
        solver: &mut ConstrainedSystem,
        u: &[f64],
        first: &[f64],
        [load, increment]: [f64; 2],
        until: Until<'_>,
    ) -> Result<Self, FactorError> {
        let (body, pressure, stride) = (problem.body, &problem.pressure, ORDER + 1);
        let mut coefficients = vec![0.0; u.len() * stride];
        for (dof, run) in coefficients.chunks_exact_mut(stride).enumerate() {
            (run[0], run[1]) = (u[dof], first[dof]);
        }
        let (mut series, mut loads) = (vec![u.to_vec(), first.to_vec()], vec![load, increment]);
        let stay = vec![0.0; 3 * problem.patches.len()];
        for p in 2..=ORDER {
            let mut force = vec![0.0; u.len()];
            body.force_series(Monomials::of(1, p), &coefficients, stride, &mut force);
            force.iter_mut().for_each(|f| *f = -*f);
            loads.push(0.0);
            pressure.add_force_series(body, &loads, &coefficients, stride, &mut force);
            let mut term = vec![0.0; u.len()];
            let forces = &mut Vec::new();
            if pressure.is_empty() {
                solver.solve_until(&mut force, &stay, &mut term, forces, until)?;
            } else {
                let skew = |x: &[f64]| {
                    let mut force = vec![0.0; x.len()];
                    pressure.add_skew(body, u, load, x, &mut force);
                    force
                };
                skew::solve(solver, skew, &mut force, &stay, &mut term, forces, until)?;
            }
            let runs = coefficients.chunks_exact_mut(stride);
            runs.zip(&term).for_each(|(run, u)| run[p] = *u);
            series.push(term);
        }
        let taylor = taylor_range(&series, TOLERANCE);
        let range =
            if taylor < 1.0 { pade_range(&series, TOLERANCE, taylor).min(1.0) } else { 1.0 };
        Ok(Predictor { pade: Pade::new(&series, 0), series, range })
    }

    /// The displacement at a part of the load step. What is prescribed, linear in it, is met as far as the series holds.
    pub fn at(&self, a: f64) -> Vec<f64> {
        self.pade.evaluate(&self.series, a)
    }
}
