//! The vector Pade form of a power series: the same vectors, a longer reach.
//!
//! Gram-Schmidt gives `u_n = sum_j A_nj q_j`; with `d_0 = 1` and
//! `d_i = -(1 / A_{N-i,N-i}) sum_{j<i} d_j A_{N-j,N-i}`,
//!   u(a) = u_0 + sum_{i=1}^{N-1} a^i u_i D_{N-1-i}(a) / D_{N-1}(a),   D_k = sum_{j<=k} d_j a^j,
//! one denominator for all components (Elhage-Hussein, Potier-Ferry and Damil, IJSS 37:6981, 2000).

use crate::{dot, norm};

/// Denominator coefficients of a series; none if its vectors are dependent to rounding.
#[derive(Clone, Debug)]
pub struct Pade {
    denominator: Option<Vec<f64>>,
}

impl Pade {
    /// Of the series `u_0, u_1, .. u_N` without its last `dropped` terms.
    pub fn new(series: &[Vec<f64>], dropped: usize) -> Self {
        let order = series.len() - 1 - dropped;
        Pade { denominator: denominator(&series[1..order + 1]) }
    }

    /// Order of the series it stands for.
    fn order(&self) -> Option<usize> {
        self.denominator.as_ref().map(Vec::len)
    }

    /// `D_k(a)`.
    fn partial(&self, k: usize, a: f64) -> f64 {
        let d = self.denominator.as_deref().unwrap_or(&[1.0]);
        d[..=k].iter().rev().fold(0.0, |sum, &d| sum * a + d)
    }

    /// Value at `a`; the polynomial itself where there is no rational form.
    pub fn evaluate(&self, series: &[Vec<f64>], a: f64) -> Vec<f64> {
        let mut value = series[0].clone();
        let Some(order) = self.order() else {
            for (p, u) in series.iter().enumerate().skip(1) {
                let power = a.powi(p as i32);
                value.iter_mut().zip(u).for_each(|(v, u)| *v += power * u);
            }
            return value;
        };
        let whole = self.partial(order - 1, a);
        for i in 1..order {
            let factor = a.powi(i as i32) * self.partial(order - 1 - i, a) / whole;
            value.iter_mut().zip(&series[i]).for_each(|(v, u)| *v += factor * u);
        }
        value
    }

    /// The first positive zero of the denominator below `limit`, found by sign changes.
    fn first_pole(&self, limit: f64) -> f64 {
        let Some(order) = self.order() else {
            return limit;
        };
        const SAMPLES: usize = 400;
        let at = |k: usize| limit * k as f64 / SAMPLES as f64;
        let sign_changes = (1..=SAMPLES)
            .find(|&k| self.partial(order - 1, at(k)) * self.partial(order - 1, at(k - 1)) <= 0.0);
        sign_changes.map_or(limit, |k| at(k - 1))
    }
}

fn denominator(vectors: &[Vec<f64>]) -> Option<Vec<f64>> {
    let n = vectors.len();
    if n < 2 {
        return None;
    }
    let mut orthonormal: Vec<Vec<f64>> = Vec::with_capacity(n - 1);
    let mut a = vec![vec![0.0; n]; n];
    for (row, u) in vectors.iter().enumerate() {
        let (mut rest, size) = (u.clone(), norm(u));
        // Twice, because the vectors of a series are nearly parallel.
        for _ in 0..2 {
            for (j, q) in orthonormal.iter().enumerate() {
                let c = dot(q, &rest);
                a[row][j] += c;
                rest.iter_mut().zip(q).for_each(|(r, q)| *r -= c * q);
            }
        }
        // The last vector is only projected: where it depends on the others, the form is exact.
        if row == n - 1 {
            break;
        }
        a[row][row] = norm(&rest);
        if !(a[row][row] > 1e-13 * size) {
            return None;
        }
        rest.iter_mut().for_each(|r| *r /= a[row][row]);
        orthonormal.push(rest);
    }
    // d_i in the paper's numbering from 1: A_{N-i,N-i} is a[n-1-i][n-1-i].
    let mut d = vec![1.0; n];
    for i in 1..n {
        let column = n - 1 - i;
        let sum: f64 = (0..i).map(|j| d[j] * a[n - 1 - j][column]).sum();
        d[i] = -sum / a[column][column];
    }
    Some(d)
}

/// `(tolerance |u_1| / |u_N|)^(1/(N-1))` (Cochelin).
pub fn taylor_range(series: &[Vec<f64>], tolerance: f64) -> f64 {
    let last = series.len() - 1;
    let (first, highest) = (norm(&series[1]), norm(&series[last]));
    if highest <= 1e-300 * first {
        return f64::INFINITY;
    }
    (tolerance * first / highest).powf(1.0 / (last - 1) as f64)
}

/// Where the forms of order N and N - 1 still agree to `tolerance`, before the first pole.
pub fn pade_range(series: &[Vec<f64>], tolerance: f64, taylor_range: f64) -> f64 {
    let (full, less) = (Pade::new(series, 0), Pade::new(series, 1));
    if full.order().is_none() || less.order().is_none() {
        return taylor_range;
    }
    let agree = |a: f64| {
        let (x, y) = (full.evaluate(series, a), less.evaluate(series, a));
        let difference: f64 = x.iter().zip(&y).map(|(x, y)| (x - y).powi(2)).sum();
        let size: f64 = x.iter().zip(&series[0]).map(|(x, u)| (x - u).powi(2)).sum();
        difference <= tolerance.powi(2) * size
    };
    let reach = 20.0 * taylor_range;
    let pole = full.first_pole(reach).min(less.first_pole(reach));
    let (mut low, mut high) = (0.0, pole);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if agree(middle) { low = middle } else { high = middle }
    }
    low.max(taylor_range.min(pole))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `u(a) = (1/(1 - a), a/(2 - a), exp a - 1)` up to an order.
    fn series(order: usize) -> Vec<Vec<f64>> {
        let mut factorial = 1.0;
        (0..=order)
            .map(|p| {
                factorial *= p.max(1) as f64;
                let half = if p == 0 { 0.0 } else { 0.5f64.powi(p as i32) };
                vec![1.0, half, if p == 0 { 0.0 } else { 1.0 / factorial }]
            })
            .collect()
    }

    #[test]
    fn a_rational_function_is_reproduced_beyond_its_radius_of_convergence() {
        // Two components with the denominators of 1/(1 + a) and 1/(2 + a), radius 1.
        let series: Vec<Vec<f64>> =
            (0..=3).map(|p| vec![(-1f64).powi(p), 0.5 * (-0.5f64).powi(p)]).collect();
        let pade = Pade::new(&series, 0);
        let value = pade.evaluate(&series, 3.0);
        assert!((value[0] - 0.25).abs() < 1e-12 && (value[1] - 0.2).abs() < 1e-12, "{value:?}");
    }

    #[test]
    fn dependent_vectors_fall_back_to_the_polynomial() {
        let series = vec![vec![0.0, 0.0], vec![1.0, 2.0], vec![2.0, 4.0], vec![1.0, 0.0]];
        let value = Pade::new(&series, 0).evaluate(&series, 0.5);
        assert_eq!(value, vec![1.125, 2.0]);
    }

    #[test]
    fn the_range_ends_before_the_pole_and_beyond_the_polynomials() {
        let series = series(3);
        let taylor = taylor_range(&series, 1e-4);
        let pade = pade_range(&series, 1e-2, taylor);
        assert!(taylor < pade && pade < 1.0, "{taylor} {pade}");
    }
}
