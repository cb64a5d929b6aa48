//! Stress of the whole organ, as the element balances it.

use super::Hands;
use super::grasp;
use crate::all_finite;
use crate::model::finite_or_zero;
use crate::put;
use crate::status::{self, viscera_status};
use std::panic::{AssertUnwindSafe, catch_unwind};
use viscera_galerkin::UNBALANCED;

/// A tensor, row by row.
type Tensor = [f64; 9];

impl Hands {
    /// Cauchy stress of each cell [Pa], the mean over its points; none where a cell is inside out.
    fn stress(&self, u: &[f64]) -> Option<Vec<Tensor>> {
        let points = self.galerkin.quadrature_points(u);
        let metadata = self.galerkin.model().metadata();
        let of_cell = points.len() / (self.galerkin.model().arrays().cells.len() / 4);
        // The stress of the linear law is the same in the shape at rest and in the deformed one.
        let is_linear = metadata.law == "linear";
        let mut stresses = Vec::with_capacity(points.len() / of_cell);
        for points in points.chunks_exact(of_cell) {
            let mut mean = [0.0; 9];
            for point in points {
                let (f, p) = (&point.gradient, &point.stress);
                let j = determinant(f);
                if !is_linear && !(j > 0.0) {
                    return None;
                }
                for k in 0..9 {
                    let (row, column) = (k / 3, k % 3);
                    let cauchy = if is_linear {
                        p[row][column]
                    } else {
                        (0..3).map(|l| p[row][l] * f[column][l]).sum::<f64>() / j
                    };
                    mean[k] += cauchy / of_cell as f64;
                }
            }
            stresses.push(mean);
        }
        Some(stresses)
    }

    /// Displacements of nodes [m].
    fn field_in(&self, moved: &[f64]) -> Vec<f64> {
        moved.as_chunks().0.iter().flat_map(|&u| self.frame.length_in(u)).collect()
    }
}

fn determinant(f: &[[f64; 3]; 3]) -> f64 {
    let minor = |i: usize, j: usize| f[1][i] * f[2][j] - f[1][j] * f[2][i];
    f[0][0] * minor(1, 2) - f[0][1] * minor(0, 2) + f[0][2] * minor(0, 1)
}

/// Cauchy stress of the cells under displacements of all nodes.
///
/// # Safety
/// `hands` is null or made; `moved` is null or readable and `stress` null or writable for their lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_hands_stress(
    hands: *const Hands,
    moved: *const f64,
    moved_len: usize,
    stress: *mut f64,
    stress_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let Some(hands) = (unsafe { hands.as_ref() }) else { return status::NULL_POINTER };
    if moved.is_null() || stress.is_null() {
        return status::NULL_POINTER;
    }
    let model = hands.galerkin.model();
    let needed = (3 * model.n_points(), 9 * model.arrays().cells.len() / 4);
    if moved_len < needed.0 || stress_len < needed.1 {
        return status::SHORT_BUFFER;
    }
    // SAFETY: not null, and at least as long as what is taken.
    let (moved, out) = unsafe {
        (
            std::slice::from_raw_parts(moved, needed.0),
            std::slice::from_raw_parts_mut(stress, needed.1),
        )
    };
    out.fill(0.0);
    if !all_finite(moved) {
        return status::NOT_FINITE;
    }
    let (frame, u) = (&hands.frame, hands.field_in(moved));
    let Ok(found) = catch_unwind(AssertUnwindSafe(|| hands.stress(&u))) else {
        return status::BAD_SETTING;
    };
    let Some(found) = found else { return status::INVERTED };
    for (out, s) in out.as_chunks_mut::<9>().0.iter_mut().zip(found) {
        let turned =
            frame.stress_out(&std::array::from_fn(|i| std::array::from_fn(|j| s[3 * i + j])));
        *out = std::array::from_fn(|k| turned[k / 3][k % 3]);
    }
    finite_or_zero(status::OK, out)
}

/// What that stress leaves unbalanced, and whether its pressure may be relied on.
///
/// # Safety
/// `hands` is null or made; `points` is readable for `contacts` points or null; `moved` is null or readable for its
/// length, `error_estimate` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_hands_stress_error(
    hands: *const Hands,
    points: *const f64,
    contacts: usize,
    moved: *const f64,
    moved_len: usize,
    error_estimate: *mut f64,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    unsafe { put(error_estimate, 1.0) };
    let Some(hands) = (unsafe { hands.as_ref() }) else { return status::NULL_POINTER };
    if moved.is_null() || error_estimate.is_null() {
        return status::NULL_POINTER;
    }
    let needed = 3 * hands.galerkin.model().n_points();
    if moved_len < needed {
        return status::SHORT_BUFFER;
    }
    let Ok(points) = (unsafe { grasp::contacts(hands, points, contacts) }) else {
        return status::NULL_POINTER;
    };
    let moved = unsafe { std::slice::from_raw_parts(moved, needed) };
    if !all_finite(moved) || !all_finite(points.as_flattened()) {
        return status::NOT_FINITE;
    }
    let u = hands.field_in(moved);
    let estimate = || hands.galerkin.stress_error_estimate(&points, &u);
    let (estimate, status) = match catch_unwind(AssertUnwindSafe(estimate)) {
        Ok(Ok(part)) if part <= UNBALANCED => (part, status::OK),
        Ok(Ok(part)) if part.is_finite() => (part, status::ERROR_TOO_LARGE),
        Ok(Ok(_)) => (1.0, status::INVERTED),
        Ok(Err(_)) => (1.0, status::OFF_SURFACE),
        Err(_) => (1.0, status::BAD_SETTING),
    };
    unsafe { put(error_estimate, estimate) };
    status
}

/// `sqrt(3/2 s : s)` with the deviator `s` of each stress.
///
/// # Safety
/// `stress` is null or readable for `count` tensors, `von_mises` null or writable for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_von_mises(
    stress: *const f64,
    count: usize,
    von_mises: *mut f64,
) -> viscera_status {
    if stress.is_null() || von_mises.is_null() || count > isize::MAX as usize / size_of::<Tensor>()
    {
        return status::NULL_POINTER;
    }
    // SAFETY: not null, and as long as the caller says.
    let (stress, out) = unsafe {
        (
            std::slice::from_raw_parts(stress.cast::<Tensor>(), count),
            std::slice::from_raw_parts_mut(von_mises, count),
        )
    };
    for (out, s) in out.iter_mut().zip(stress) {
        let mean = (s[0] + s[4] + s[8]) / 3.0;
        let square = |k: usize| (s[k] - if k.is_multiple_of(4) { mean } else { 0.0 }).powi(2);
        *out = (1.5 * (0..9).map(square).sum::<f64>()).sqrt();
    }
    finite_or_zero(status::OK, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_von_mises_stress_is_finite_or_refused() {
        let shear = |s: f64| [0.0, s, 0.0, s, 0.0, 0.0, 0.0, 0.0, 0.0];
        let of = |s: f64| {
            let (stresses, mut found) = ([shear(2.0), shear(s)].concat(), [7.0; 2]);
            // SAFETY: two tensors and two numbers.
            (unsafe { viscera_von_mises(stresses.as_ptr(), 2, found.as_mut_ptr()) }, found)
        };
        let (status, found) = of(1.0);
        assert_eq!(status, status::OK);
        let expected = [2.0, 1.0].map(|s| s * 3.0f64.sqrt());
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-12), "{found:?}");
        for refused in [f64::NAN, f64::INFINITY, 1e200] {
            assert_eq!(of(refused), (status::NOT_FINITE, [0.0; 2]), "{refused}");
        }
    }
}
