//! The orders of a touch summed in their vector Padé form instead of as a polynomial.
//!
//! Along a direction the parts u_p of order p nearly follow a linear recurrence, as the few
//! singularities next to the base state rule them. The coefficients d_j, with d_0 = 1, that leave least of
//!   u_N + d_1 u_(N-1) + .. + d_(N-1) u_1
//! are those of a common denominator. The series times that denominator, cut after order N, gives
//!   u = sum_p w_p u_p,   w_p = D_(N-p) / D_(N-1),   D_k = d_0 + .. + d_k,
//! equal to the series to order N; so w_1 = 1, and for a small touch all weights go to 1.
//! (Elhage-Hussein, Potier-Ferry and Damil, IJSS 37 (2000) 6981, drop u_N from the sum, which costs
//! the last order.) Least is meant in the norm of a sketch: a few random sums over the field.

use viscera_number::simd::{Kernel, dispatch};
use viscera_number::unroll::array;
use viscera_number::{Gradient, Scalar};

/// Highest order of a series.
pub const MAX_ORDER: usize = 8;
/// Numbers in a sketch: more than orders, by a margin that keeps angles between fields.
pub const SKETCH: usize = 24;
/// Keeps the recurrence from following noise in the last orders.
const RIDGE: f64 = 1e-3;
/// Denominators between which the polynomial takes over, because a pole is near.
const POLE: [f64; 2] = [0.1, 0.3];

/// A number with its derivatives in the displacement of the tool.
pub(super) type Dual = Gradient<f64>;
/// An order of a touch in the sketch, with its derivatives in the displacement of the tool.
#[derive(Clone)]
pub(super) struct Part {
    pub value: [f64; SKETCH],
    pub first: [[f64; SKETCH]; 3],
}

/// The part of each order.
pub(super) type Parts = [Part; MAX_ORDER];

/// Where parts are added up.
pub(super) const NO_PARTS: Parts =
    [const { Part { value: [0.0; SKETCH], first: [[0.0; SKETCH]; 3] } }; MAX_ORDER];

pub(super) fn constant(value: f64) -> Dual {
    Gradient { value, first: [0.0; 3] }
}

/// How a series is summed at a displacement.
pub(super) struct Form {
    /// `w_p`; all 1 below order 3 and where a pole is near.
    pub weights: [Dual; MAX_ORDER],
    /// `D_(N-1)`, not below the least that is taken; 1 where the orders are summed as a polynomial at any displacement.
    pub denominator: f64,
}

/// How much each of the first `order` orders of a series counts, by the inner products of its parts at a displacement.
pub fn pade_weights(products: &[[f64; MAX_ORDER]; MAX_ORDER], order: usize) -> [f64; MAX_ORDER] {
    form_of(|p, q| constant(products[p][q]), order).weights.map(|weight| weight.value)
}

/// Inner products of the parts of a touch, those with `p <= q < order`.
pub(super) struct Products([[Dual; MAX_ORDER]; MAX_ORDER]);

impl Products {
    /// Of the first `order` parts.
    pub fn new(parts: &Parts, order: usize) -> Self {
        dispatch(InnerProducts { parts, order })
    }

    /// The same of parts times `factors`, without their derivatives.
    pub fn scaled(&self, factors: &[f64; MAX_ORDER]) -> Self {
        Products(std::array::from_fn(|p| {
            std::array::from_fn(|q| constant(factors[p] * factors[q] * self.0[p][q].value))
        }))
    }

    /// The form of the first `order` parts, or of fewer.
    pub fn form(&self, order: usize) -> Form {
        form_of(|p, q| self.0[p.min(q)][p.max(q)].clone(), order)
    }
}

struct InnerProducts<'a> {
    parts: &'a Parts,
    order: usize,
}

impl Kernel for InnerProducts<'_> {
    type Output = Products;

    #[inline(always)]
    fn run(self) -> Products {
        let mut products =
            Products(std::array::from_fn(|_| std::array::from_fn(|_| constant(0.0))));
        for q in 0..self.order {
            for p in 0..=q {
                let (a, b) = (&self.parts[p], &self.parts[q]);
                products.0[p][q] = Gradient {
                    value: dot(&a.value, &b.value),
                    first: array!(3, |i| dot(&a.first[i], &b.value) + dot(&a.value, &b.first[i])),
                };
            }
        }
        products
    }
}

/// The inner product of two vectors, summed in four parts side by side.
#[inline(always)]
fn dot(a: &[f64; SKETCH], b: &[f64; SKETCH]) -> f64 {
    let mut sums = [0.0; 4];
    for (a, b) in a.as_chunks::<4>().0.iter().zip(b.as_chunks::<4>().0) {
        (0..4).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

fn form_of(product: impl Fn(usize, usize) -> Dual, order: usize) -> Form {
    let polynomial =
        |denominator: f64| Form { weights: std::array::from_fn(|_| constant(1.0)), denominator };
    let is_sound = |square: f64| square > 0.0 && square.is_finite();
    if order < 3 || !(0..order).all(|p| is_sound(product(p, p).value)) {
        return polynomial(1.0);
    }
    let last = order - 1;
    let size: [Dual; MAX_ORDER] =
        std::array::from_fn(|p| if p < order { root(&product(p, p)) } else { constant(1.0) });
    let inner = |p: usize, q: usize| product(p, q) * (size[p].clone() * size[q].clone()).recip();
    let recurrence = recurrence(last, inner);
    let mut sums: [Dual; MAX_ORDER] = std::array::from_fn(|_| constant(1.0));
    for k in 1..order {
        let p = last - k;
        let ratio = size[last].clone() * size[p].recip();
        sums[k] = sums[k - 1].clone() + recurrence[p].clone() * ratio;
    }
    let whole = sums[last].clone();
    let Some(share) = away_from_pole(&whole) else { return polynomial(POLE[0]) };
    let inverse = whole.recip();
    let weights = std::array::from_fn(|p| {
        if p > last {
            return constant(1.0);
        }
        (sums[last - p].clone() * inverse.clone() - 1.0) * share.clone() + 1.0
    });
    Form { weights, denominator: whole.value }
}

/// The square root of a positive number.
fn root(square: &Dual) -> Dual {
    let value = square.value.sqrt();
    Gradient { value, first: square.first.map(|slope| 0.5 * slope / value) }
}

/// `c` that leaves least of `part_n + sum_(p < n) c_p part_p`, for parts of unit size with the given inner products.
fn recurrence(n: usize, inner: impl Fn(usize, usize) -> Dual) -> [Dual; MAX_ORDER] {
    // L D L^T of the inner products, solved on the way down.
    let mut lower: [[Dual; MAX_ORDER]; MAX_ORDER] =
        std::array::from_fn(|_| std::array::from_fn(|_| constant(0.0)));
    let mut pivots: [Dual; MAX_ORDER] = std::array::from_fn(|_| constant(1.0));
    let mut c: [Dual; MAX_ORDER] = std::array::from_fn(|_| constant(0.0));
    for i in 0..n {
        let (mut pivot, mut rest) = (inner(i, i) + RIDGE, -inner(i, n));
        for j in 0..i {
            let mut entry = inner(i, j);
            for k in 0..j {
                entry = entry - lower[i][k].clone() * lower[j][k].clone() * pivots[k].clone();
            }
            entry = entry * pivots[j].recip();
            pivot = pivot - entry.square() * pivots[j].clone();
            rest = rest - entry.clone() * c[j].clone();
            lower[i][j] = entry;
        }
        pivots[i] = pivot;
        c[i] = rest;
    }
    for i in (0..n).rev() {
        c[i] = c[i].clone() * pivots[i].recip();
        for k in i + 1..n {
            c[i] = c[i].clone() - lower[k][i].clone() * c[k].clone();
        }
    }
    c
}

/// The share of the Padé form: 1 away from a pole, 0 next to one.
fn away_from_pole(denominator: &Dual) -> Option<Dual> {
    let [none, all] = POLE;
    // Written so that a denominator that is not a number gives nothing.
    if !(denominator.value > none) {
        return None;
    }
    if denominator.value >= all {
        return Some(constant(1.0));
    }
    let t = (denominator.clone() - none) * (1.0 / (all - none));
    Some(t.square() * (-t * 2.0 + 3.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights(parts: &Parts, order: usize) -> [Dual; MAX_ORDER] {
        Products::new(parts, order).form(order).weights
    }

    /// Parts of `sum_q a_q / (1 - r_q t)`: a function of few poles, known in all orders.
    fn parts(poles: &[f64], t: f64) -> Parts {
        let mut parts = NO_PARTS;
        for (p, part) in parts.iter_mut().enumerate() {
            for s in 0..SKETCH {
                let vector = |q: usize| ((3 * q + 1) as f64 * (s as f64 + 0.3)).sin();
                let value = poles.iter().enumerate().map(|(q, r)| vector(q) * r.powi(p as i32));
                let (value, power) = (value.sum::<f64>(), p as i32 + 1);
                part.value[s] = value * t.powi(power);
                part.first[0][s] = value * f64::from(power) * t.powi(power - 1);
            }
        }
        parts
    }

    fn sum(parts: &Parts, order: usize, is_pade: bool) -> [f64; SKETCH] {
        let weights = weights(parts, if is_pade { order } else { 0 });
        std::array::from_fn(|s| (0..order).map(|p| weights[p].value * parts[p].value[s]).sum())
    }

    fn distance(a: &[f64; SKETCH], b: &[f64; SKETCH]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    }

    /// Few poles are found: at the radius of convergence, where the polynomial fails.
    #[test]
    fn a_function_of_few_poles_is_summed_beyond_its_radius() {
        let poles = [-1.0, 0.45];
        let exact = std::array::from_fn(|s| {
            let vector = |q: usize| ((3 * q + 1) as f64 * (s as f64 + 0.3)).sin();
            let terms = poles.iter().enumerate().map(|(q, r)| vector(q) * 1.3 / (1.0 - 1.3 * r));
            terms.sum()
        });
        let parts = parts(&poles, 1.3);
        let (pade, polynomial) = (sum(&parts, 6, true), sum(&parts, 6, false));
        assert!(distance(&polynomial, &exact) > 100.0 * distance(&pade, &exact));
    }

    #[test]
    fn small_touches_are_those_of_the_polynomial() {
        for order in [3, 4, 6] {
            let gap = |t: f64| {
                let parts = parts(&[0.8, -1.0, 0.5, 0.2], t);
                distance(&sum(&parts, order, true), &sum(&parts, order, false))
            };
            let slope = (gap(0.02) / gap(0.01)).log2();
            assert!((slope - (order + 1) as f64).abs() < 0.2, "order {order}: {slope}");
            let first = &weights(&parts(&[0.8, -1.0, 0.5, 0.2], 0.5), order)[0];
            assert!((first.value - 1.0).abs() < 1e-12, "the first order is exact");
        }
    }

    #[test]
    fn inner_products_are_all_that_weights_need() {
        let parts = parts(&[0.8, -1.0, 0.5], 0.7);
        let product = |p: usize, q: usize| {
            parts[p].value.iter().zip(&parts[q].value).map(|(a, b)| a * b).sum()
        };
        let products = std::array::from_fn(|p| std::array::from_fn(|q| product(p, q)));
        for (alone, known) in pade_weights(&products, 5).iter().zip(weights(&parts, 5)) {
            assert!((alone - known.value).abs() < 1e-12);
        }
        assert_eq!(pade_weights(&[[0.0; MAX_ORDER]; MAX_ORDER], 5), [1.0; MAX_ORDER]);
    }

    /// The product of `1 - r t` of two poles, and the least that is taken next to one.
    #[test]
    fn the_denominator_tells_how_near_a_pole_is() {
        let denominator = |t: f64| Products::new(&parts(&[0.9, -0.7], t), 3).form(3).denominator;
        for t in [-0.6, 0.3, 0.6, 0.9, 1.0] {
            let exact = (1.0 - 0.9 * t) * (1.0 + 0.7 * t);
            assert!((denominator(t) - exact).abs() < 2e-3, "{t}: {} not {exact}", denominator(t));
        }
        assert_eq!(denominator(1.1), POLE[0]);
        assert_eq!(denominator(f64::NAN), 1.0);
    }

    #[test]
    fn weights_come_with_their_derivatives() {
        let poles = [0.9, -0.7, 0.3];
        // One of them with its pole so near that the polynomial has begun to take over.
        for t in [0.4, 0.8, 1.0 / 0.9 - 0.24] {
            let at = |t: f64| weights(&parts(&poles, t), 5);
            let (plus, minus, here) = (at(t + 1e-6), at(t - 1e-6), at(t));
            for p in 0..5 {
                let slope = (plus[p].value - minus[p].value) / 2e-6;
                assert!((here[p].first[0] - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{t} {p}");
            }
        }
    }

    #[test]
    fn at_a_pole_and_without_numbers_it_is_the_polynomial() {
        for t in [1.0 / 0.9, 1.3, 0.0, f64::NAN, f64::INFINITY, 1e200] {
            let weights = weights(&parts(&[0.9], t), 4);
            assert!(weights.iter().all(|w| w.value == 1.0 && w.first == [0.0; 3]), "{t}");
        }
    }
}
