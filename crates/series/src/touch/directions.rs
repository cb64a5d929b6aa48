//! Forms in three variables from their values along directions.
//!
//! The coefficients of degree p of a series, `N_p(d) = sum_(|a|=p) d^a N_a`, follow from as many directions as there are
//! monomials. Along a direction the series is one in a single variable, of coefficients `u_k(d)`: work for a machine that
//! has many threads and few registers for each.

use crate::number::{Monomials, evaluate_monomials, on_sphere};
use faer::Mat;
use faer::linalg::solvers::DenseSolveCore;
use std::ops::Range;
use std::sync::OnceLock;

/// Directions to choose from.
const CANDIDATES: usize = 500;

/// Directions that determine the forms of a degree.
pub(super) struct Directions {
    table: &'static Monomials,
    /// By direction, all monomials of it but the constant.
    monomials: Vec<Vec<f64>>,
    /// By monomial of the degree, the weights of the values along the directions.
    weights: Vec<Vec<f64>>,
}

impl Directions {
    /// Those of a degree up to 8.
    pub fn of(degree: usize) -> &'static Self {
        static KNOWN: [OnceLock<Directions>; 9] = [const { OnceLock::new() }; 9];
        KNOWN[degree].get_or_init(|| Self::new(degree))
    }

    /// The candidates that a QR decomposition with pivots takes first: approximate Fekete points (Sommariva and Vianello,
    /// Comput. Math. Appl. 57 (2009) 1324).
    fn new(degree: usize) -> Self {
        let table = Monomials::of(3, degree);
        let top = table.of_degree(degree);
        let candidates: Vec<Vec<f64>> = (0..CANDIDATES)
            .map(|n| {
                let mut monomials = vec![0.0; table.len() - 1];
                let direction = on_sphere(n, 2 * CANDIDATES); // of half the sphere
                evaluate_monomials(&table.exponents()[1..], direction, &mut monomials);
                monomials
            })
            .collect();
        let at = |a: usize, candidate: usize| candidates[candidate][top.start - 1 + a];
        let forms = Mat::from_fn(top.len(), CANDIDATES, at);
        let order = forms.col_piv_qr();
        let chosen = &order.P().arrays().0[..top.len()];
        let values = Mat::from_fn(top.len(), top.len(), |d, a| at(a, chosen[d]));
        let inverse = values.partial_piv_lu().inverse();
        let row = |a: usize| (0..top.len()).map(|d| inverse[(a, d)]).collect();
        Directions {
            table,
            monomials: chosen.iter().map(|&c| candidates[c].clone()).collect(),
            weights: (0..top.len()).map(row).collect(),
        }
    }

    /// How many they are.
    pub fn len(&self) -> usize {
        self.monomials.len()
    }

    /// The monomials of lower degree k at a direction, and where they are in the table.
    #[inline(always)]
    pub fn monomials(&self, direction: usize, degree: usize) -> (Range<usize>, &[f64]) {
        let range = self.table.of_degree(degree);
        (range.clone(), &self.monomials[direction][range.start - 1..range.end - 1])
    }

    /// By direction, what its value gives to the coefficient of monomial `a` of the degree.
    #[inline(always)]
    pub fn weights(&self, a: usize) -> &[f64] {
        &self.weights[a]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients come back from the values, and an error of the values hardly grows.
    #[test]
    fn forms_follow_from_their_values() {
        for degree in 2..=8 {
            let directions = Directions::of(degree);
            let (top, all) = (directions.table.of_degree(degree).len(), directions.len());
            assert_eq!(top, all);
            let form: Vec<f64> = (0..top).map(|a| (1.7 * a as f64).sin()).collect();
            let values: Vec<f64> = (0..all)
                .map(|d| {
                    let monomials = directions.monomials(d, degree).1;
                    monomials.iter().zip(&form).map(|(m, c)| m * c).sum()
                })
                .collect();
            let mut growth = 0.0f64;
            for (a, exact) in form.iter().enumerate() {
                let weights = directions.weights(a);
                let found: f64 = weights.iter().zip(&values).map(|(w, v)| w * v).sum();
                assert!((found - exact).abs() < 1e-11, "{degree} {a}: {found} {exact}");
                // A monomial is at most this large on the sphere.
                let e = directions.table.exponents()[directions.table.of_degree(degree).start + a];
                let factor = |k: u8| match k {
                    0 => 1.0,
                    k => (f64::from(k) / degree as f64).powf(0.5 * f64::from(k)),
                };
                let size: f64 = e.iter().map(|&k| factor(k)).product();
                growth = growth.max(size * weights.iter().map(|w| w.abs()).sum::<f64>());
            }
            println!("degree {degree}: an error grows by at most {growth:.1}");
            assert!(growth < 25.0, "degree {degree}: {growth}"); // single precision keeps five digits
        }
    }
}
