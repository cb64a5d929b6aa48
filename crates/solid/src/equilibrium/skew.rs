//! A tangent with a small unsymmetric part: pressure on a free rim gives `K + S` with a skew `S` of few rows.

use super::system::{ConstrainedSystem, Solved, Until};
use crate::linear::{FactorError, gmres};

/// Below this fraction of the right-hand side, the unsymmetric part of a tangent is rounding.
const SYMMETRIC: f64 = 1e-10;

/// Residual of the solution, relative: Newton's convergence stays quadratic.
const TOLERANCE: f64 = 1e-10;

/// Solves `(K + S) s - W^T f = b`, `W s = c` with a solver of `K`, by GMRES on `1 + K^-1 S`: for the step `s` and the
/// change `f` of the patch forces. `skew` is `S` on all degrees of freedom; held ones stay zero.
///
/// # Errors
/// Those of the solves.
pub(super) fn solve(
    solver: &mut ConstrainedSystem,
    skew: impl Fn(&[f64]) -> Vec<f64>,
    b: &mut [f64],
    gap: &[f64],
    step: &mut [f64],
    forces: &mut Vec<f64>,
    until: Until<'_>,
) -> Result<Solved, FactorError> {
    let plain = b.to_vec();
    let solved = solver.solve_until(b, gap, step, forces, until)?;
    let size = b.iter().fold(0.0f64, |max, b| max.max(b.abs()));
    let mut pull = skew(step);
    solver.project(&mut pull);
    if pull.iter().all(|d| d.abs() <= SYMMETRIC * size) {
        return Ok(solved);
    }
    let still = vec![0.0; gap.len()];
    let apply = |s: &[f64]| {
        let mut out = vec![0.0; s.len()];
        solver.solve_until(&mut skew(s), &still, &mut out, &mut Vec::new(), until)?;
        out.iter_mut().zip(s).for_each(|(o, s)| *o += s);
        Ok(out)
    };
    let whole = gmres(apply, step, TOLERANCE, 60)?;
    for ((b, plain), s) in b.iter_mut().zip(&plain).zip(skew(&whole)) {
        *b = plain - s;
    }
    solver.solve_until(b, gap, step, forces, until)
}
