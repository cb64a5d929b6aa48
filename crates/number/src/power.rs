//! The trace of a real power of an isochoric `C`, `x_1^s + x_2^s + x_3^s` with `x_1 x_2 x_3 = 1`, from its invariants.
//!
//! For `0 < r < 1` the integral `x^r = sin(pi r)/pi int_0^inf t^(r-1) x/(x + t) dt` becomes a sum of resolvents, whose
//! traces are rational in the invariants: smooth where eigenvalues coincide, and good for duals and power series.
//! On the axis `ln t` the trapezoidal rule of step `h` errs by `exp(-2 pi^2/h)`; beyond the nodes the resolvent is a
//! geometric series in `x/t` or `t/x`, and the rule's sums over it are closed forms.

use super::Scalar;
use std::f64::consts::PI;

/// Step of the trapezoidal rule: its error is 1e-17.
const STEP: f64 = 0.5;
/// Nodes `t = exp(STEP j)`, `|j| <= NODES`.
const NODES: i32 = 20;
/// Terms of the series beyond the nodes: the rest is 1e-15 for stretches between 1/5 and 5, 1e-7 at 1/20 and 20. An
/// odd number: the last term is positive, and so is an energy far outside.
const TAIL: usize = 5;
/// Traces of integer powers that the tails of `x^r` and its two neighbours ask for.
const POWERS: usize = TAIL + 1;

/// `x_1^s + x_2^s + x_3^s` of the numbers with the elementary symmetric functions `I1`, `I2` and 1.
#[inline(always)]
#[allow(non_snake_case)]
pub(super) fn trace_of_power<S: Scalar>(I1: &S, I2: &S, s: f64) -> S {
    // The inverses of the numbers have the functions I2, I1 and 1.
    let (I1, I2) = if s < 0.0 { (I2, I1) } else { (I1, I2) };
    let s = s.abs();
    let (whole, r) = (s.floor(), s - s.floor());
    // Traces of the powers r - 1, r, r + 1, and by Cayley-Hamilton of those above.
    let [mut low, mut middle, mut high] =
        if r == 0.0 { [I2.clone(), I1.constant(3.0), I1.clone()] } else { fractional(I1, I2, r) };
    for _ in 0..whole as usize {
        let next = I1.clone() * high.clone() - I2.clone() * middle.clone() + low;
        (low, middle, high) = (middle, high, next);
    }
    middle
}

/// Traces of the powers `r - 1`, `r` and `r + 1`, `0 < r < 1`.
#[inline(always)]
#[allow(non_snake_case)]
fn fractional<S: Scalar>(I1: &S, I2: &S, r: f64) -> [S; 3] {
    // 1 - r is exact from 1/2 on; the sine of pi r next to pi would be rounding alone.
    let factor = STEP * (PI * r.min(1.0 - r)).sin() / PI;
    // sum_j w_j t_j^m / det(C + t_j), m = 0, 1, 2: all that the nodes contribute.
    let mut moments: [S; 3] = std::array::from_fn(|_| I1.constant(0.0));
    for j in -NODES..=NODES {
        let t = (STEP * f64::from(j)).exp();
        let weight = factor * (r * STEP * f64::from(j)).exp();
        let inverse = (I1.clone() * (t * t) + I2.clone() * t + (t * t * t + 1.0)).recip() * weight;
        moments = [
            moments[0].clone() + inverse.clone(),
            moments[1].clone() + inverse.clone() * t,
            moments[2].clone() + inverse * (t * t),
        ];
    }
    let [m0, m1, m2] = moments;
    // tr(x^k x/(x + t)) det(C + t), k = -1, 0, 1, as polynomials in t.
    let nodes = [
        m2.clone() * 3.0 + I1.clone() * m1.clone() * 2.0 + I2.clone() * m0.clone(),
        I1.clone() * m2.clone() + I2.clone() * m1.clone() * 2.0 + m0.clone() * 3.0,
        (I1.square() - I2.clone() * 2.0) * m2
            + (I1.clone() * I2.clone() - 3.0) * m1
            + I1.clone() * m0,
    ];
    let (traces, inverses) = (integer_powers(I1, I2), integer_powers(I2, I1));
    let trace = |k: i32| {
        if k < 0 { &inverses[-k as usize] } else { &traces[k as usize] }
    };
    let mut sums = nodes;
    for m in 0..TAIL {
        let sign = if m % 2 == 0 { factor } else { -factor };
        // Below the nodes x/(x + t) = sum (-t/x)^m, above them -sum (-x/t)^(m + 1).
        let below = sign * beyond(r + m as f64);
        let above = sign * beyond(m as f64 + 1.0 - r);
        for (k, sum) in (-1..).zip(&mut sums) {
            let m = m as i32;
            let tails = trace(k - m).clone() * below + trace(k + m + 1).clone() * above;
            *sum = sum.clone() + tails;
        }
    }
    sums
}

/// `sum over j > NODES of exp(-rate STEP j)`.
fn beyond(rate: f64) -> f64 {
    (-rate * STEP * f64::from(NODES + 1)).exp() / -(-rate * STEP).exp_m1()
}

/// Traces of the powers 0, 1, 2, ... (Newton's identities).
#[inline(always)]
#[allow(non_snake_case)]
fn integer_powers<S: Scalar>(I1: &S, I2: &S) -> [S; POWERS + 1] {
    let mut p: [S; POWERS + 1] = std::array::from_fn(|_| I1.constant(3.0));
    p[1] = I1.clone();
    p[2] = I1.square() - I2.clone() * 2.0;
    for k in 3..=POWERS {
        p[k] = I1.clone() * p[k - 1].clone() - I2.clone() * p[k - 2].clone() + p[k - 3].clone();
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Hessian, Jet, Monomials};

    /// Among them the neighbours of whole numbers.
    const EXPONENTS: [f64; 16] = [
        -7.3,
        -2.0 - 4e-15,
        -2.0,
        -2.0 + 1e-15,
        -1.0,
        -0.5,
        1e-15,
        1e-3,
        0.3,
        0.65,
        0.999,
        1.0 - 1e-15,
        1.0,
        2.0,
        2.5,
        12.4,
    ];

    /// Stretches of an isochoric deformation, all the way from 1/5 to 5, some of them equal.
    fn deformations() -> impl Iterator<Item = [f64; 3]> {
        let axis = [0.2f64, 0.5, 0.9, 1.0, 1.0 + 1e-9, 1.3, 2.0, 5.0];
        axis.into_iter().flat_map(move |a| axis.map(|b| [a * a, b * b, 1.0 / (a * b).powi(2)]))
    }

    fn invariants(x: [f64; 3]) -> [f64; 2] {
        [x[0] + x[1] + x[2], x[0] * x[1] + x[1] * x[2] + x[2] * x[0]]
    }

    #[test]
    fn powers_are_those_of_the_stretches() {
        for s in EXPONENTS {
            for x in deformations().filter(|x| x[2] > 0.039 && x[2] < 25.1) {
                let [i1, i2] = invariants(x);
                let exact: f64 = x.iter().map(|x| x.powf(s)).sum();
                let error = (trace_of_power(&i1, &i2, s) / exact - 1.0).abs();
                assert!(error < 1e-13, "{x:?}^{s}: {error:e}");
            }
        }
    }

    /// Far outside it grows wrong slowly, and stays on the side of large energies.
    #[test]
    fn extreme_stretches_keep_their_sense() {
        for (a, tolerance) in [(10.0f64, 1e-9), (20.0, 1e-5)] {
            let x = [a * a, 1.0 / a, 1.0 / a];
            let [i1, i2] = invariants(x);
            for s in [-2.3, -0.5, 0.6, 1.7] {
                let exact: f64 = x.iter().map(|x| x.powf(s)).sum();
                let value = trace_of_power(&i1, &i2, s);
                assert!((value / exact - 1.0).abs() < tolerance, "{a}^{s}: {value} {exact}");
            }
        }
        for x in [[1e8, 1e-4, 1e-4], [1e-8, 1e4, 1e4]] {
            let [i1, i2] = invariants(x);
            for s in [-2.3, -0.5, 0.6, 1.7] {
                assert!(trace_of_power(&i1, &i2, s) > 1e2, "{x:?}^{s}");
            }
        }
    }

    /// Derivatives in the invariants at a triple eigenvalue and at a pair, against exact ones of the powers: with
    /// `x = (y, z, 1/(y z))` the chain rule links both.
    #[test]
    fn derivatives_survive_coincident_stretches() {
        for s in [-1.3, 0.35, 2.6] {
            for (y, z) in [(1.0f64, 1.0f64), (1.8, 1.8), (0.6, 1.4)] {
                let table = Monomials::of(1, 8);
                let line = |slope: f64, at: f64| Jet::new(table, vec![at, slope]);
                let (jy, jz) = (line(0.2, y), line(-0.1, z));
                let w = (jy.clone() * jz.clone()).recip();
                let i1 = jy.clone() + jz.clone() + w.clone();
                let i2 = jy.clone() * jz.clone() + jz.clone() * w.clone() + w.clone() * jy.clone();
                let sum = trace_of_power(&i1, &i2, s);
                let exact = jy.powf(s) + jz.powf(s) + w.powf(s);
                for p in 0..=8 {
                    let (a, b) = (sum.coefficient(p), exact.coefficient(p));
                    assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{s} {y} {z}: {p}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn second_derivatives_are_those_of_the_first() {
        let (s, h) = (0.8, 1e-5);
        let at = |i1: f64, i2: f64| {
            let [a, b, _] = Hessian::variables([i1, i2, 0.0]);
            trace_of_power(&a, &b, s)
        };
        let centre = at(3.4, 3.3);
        let (plus, minus) = (at(3.4 + h, 3.3), at(3.4 - h, 3.3));
        assert!(((plus.value - minus.value) / (2.0 * h) - centre.first[0]).abs() < 1e-9);
        for k in 0..2 {
            let difference = (plus.first[k] - minus.first[k]) / (2.0 * h);
            assert!((difference - centre.second(0, k)).abs() < 1e-8);
        }
    }
}
