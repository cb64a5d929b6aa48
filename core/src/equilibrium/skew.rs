//! A tangent with a small unsymmetric part: pressure on a free rim gives `K + S` with a skew `S` of few rows.

use super::system::System;
use crate::linear::{FactorError, gmres};

/// Below this fraction of the right-hand side, the unsymmetric part of a tangent is rounding.
const SYMMETRIC: f64 = 1e-10;

/// Residual of the solution, relative: Newton's convergence stays quadratic.
const TOLERANCE: f64 = 1e-10;

/// Solves `(K + S) s - W^T f = b`, `W s = c` with the factor of `K`, by GMRES on `1 + K^-1 S`; `rhs` becomes `s`, and
/// the change `f` of the patch forces is returned. `skew` is `S` on the free degrees of freedom.
///
/// # Errors
/// Those of the solves.
pub(super) fn solve(
    system: &System,
    skew: impl Fn(&[f64]) -> Vec<f64>,
    rhs: &mut [f64],
    gap: &[f64],
) -> Result<Vec<f64>, FactorError> {
    let plain = rhs.to_vec();
    let change = system.solve(rhs, gap)?;
    let size = plain.iter().fold(0.0f64, |max, b| max.max(b.abs()));
    if skew(rhs).iter().all(|d| d.abs() <= SYMMETRIC * size) {
        return Ok(change);
    }
    let held = vec![0.0; gap.len()];
    let apply = |s: &[f64]| {
        let mut out = skew(s);
        system.solve(&mut out, &held)?;
        out.iter_mut().zip(s).for_each(|(o, s)| *o += s);
        Ok(out)
    };
    let step = gmres(apply, rhs, TOLERANCE, 60)?;
    for ((b, plain), s) in rhs.iter_mut().zip(&plain).zip(skew(&step)) {
        *b = plain - s;
    }
    system.solve(rhs, gap)
}
