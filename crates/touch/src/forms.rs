//! Quadratic and cubic forms in three variables.

use viscera_number::tensor::Mat3;
use viscera_number::unroll::tabulate;

/// Monomials of degree 2: xx, xy, xz, yy, yz, zz.
pub(super) const QUADRATIC: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];
/// Monomials of degree 3, in the order of the series: xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz.
pub(super) const CUBIC: [[usize; 3]; N_CUBIC] = [
    [0, 0, 0],
    [0, 0, 1],
    [0, 0, 2],
    [0, 1, 1],
    [0, 1, 2],
    [0, 2, 2],
    [1, 1, 1],
    [1, 1, 2],
    [1, 2, 2],
    [2, 2, 2],
];
/// Numbers of a cubic form in three variables.
pub const N_CUBIC: usize = 10;
/// Where the terms of second order begin, and where they end.
pub(super) const SECOND: std::ops::Range<usize> = 3..9;

/// A cubic form in three variables: the factors of its monomials.
pub type Cubic = [f64; N_CUBIC];

/// The place of `x_i x_j x_k` in a cubic form.
pub fn cubic_index(factors: [usize; 3]) -> usize {
    let mut sorted = factors;
    sorted.sort_unstable();
    CUBIC.iter().position(|of| *of == sorted).unwrap_or(0)
}

pub(super) fn gradient(form: &Cubic, x: [f64; 3]) -> [f64; 3] {
    let mut out = [0.0; 3];
    for (c, [i, j, k]) in form.iter().zip(CUBIC) {
        out[i] += c * x[j] * x[k];
        out[j] += c * x[i] * x[k];
        out[k] += c * x[i] * x[j];
    }
    out
}

pub(super) fn hessian(form: &Cubic, x: [f64; 3]) -> Mat3<f64> {
    let mut out = tabulate!(|_, _| 0.0);
    for (c, [i, j, k]) in form.iter().zip(CUBIC) {
        for [p, q, r] in [[i, j, k], [i, k, j], [j, k, i]] {
            out[p][q] += c * x[r];
            out[q][p] += c * x[r];
        }
    }
    out
}

/// Slope of a quadratic form with values in three dimensions.
pub(super) fn quadratic_slope(coefficients: &[f64], x: [f64; 3]) -> Mat3<f64> {
    let mut out = tabulate!(|_, _| 0.0);
    for (values, [p, q]) in coefficients.chunks_exact(3).zip(QUADRATIC) {
        for i in 0..3 {
            out[i][p] += values[i] * x[q];
            out[i][q] += values[i] * x[p];
        }
    }
    out
}

/// `S A S` of a symmetric S.
pub(super) fn congruent(s: &Mat3<f64>, a: &Mat3<f64>) -> Mat3<f64> {
    let product = |x: &Mat3<f64>, y: &Mat3<f64>| -> Mat3<f64> {
        tabulate!(|i, j| (0..3).map(|k| x[i][k] * y[k][j]).sum::<f64>())
    };
    product(&product(s, a), s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradient_and_hessian_are_those_of_the_form() {
        let form: Cubic = std::array::from_fn(|k| (1.3 * k as f64 + 0.4).sin());
        let value = |x: [f64; 3]| -> f64 {
            form.iter().zip(CUBIC).map(|(c, [i, j, k])| c * x[i] * x[j] * x[k]).sum()
        };
        let x = [0.3, -0.7, 0.5];
        for i in 0..3 {
            let moved = |step: f64| std::array::from_fn(|k| x[k] + if k == i { step } else { 0.0 });
            let slope = (value(moved(1e-5)) - value(moved(-1e-5))) / 2e-5;
            assert!((gradient(&form, x)[i] - slope).abs() < 1e-9);
            let (plus, minus) = (gradient(&form, moved(1e-5)), gradient(&form, moved(-1e-5)));
            for j in 0..3 {
                assert!((hessian(&form, x)[i][j] - (plus[j] - minus[j]) / 2e-5).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn every_product_of_three_has_its_place() {
        for (place, [i, j, k]) in CUBIC.into_iter().enumerate() {
            assert!([[i, j, k], [k, j, i], [j, k, i]].iter().all(|f| cubic_index(*f) == place));
        }
    }
}
