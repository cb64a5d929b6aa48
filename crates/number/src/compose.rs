//! A function of one variable of a power series in several: `f(g) = sum_k f^(k)(g_0)/k! (g - g_0)^k`.
//!
//! The function is expanded in one variable, where a product costs little; the powers of `g - g_0` start at degree `k`,
//! so all of them together cost about as much as one product in several variables.

use super::simd::{WideKernel, dispatch_wide};
use super::{Jet, Monomials, PooledVec, Real};

impl<T: Real> Jet<T> {
    /// The variable `g_0 + x` in which a function of this series is to be expanded, see [`Jet::substituted_in`]; the
    /// series itself, where it is one in a single variable or a constant.
    pub fn variable(&self) -> Self {
        match self.table().line().filter(|_| self.coefficients().len() > 1) {
            Some(line) => Jet::new(line, &[self.coefficient(0), T::splat(1.0)][..]),
            None => self.clone(),
        }
    }

    /// `sum_k taylor_k (g - g_0)^k`: a function of this series, from what it is of the [variable](Jet::variable).
    #[inline(never)]
    pub fn substituted_in(&self, taylor: &Self) -> Self {
        if std::ptr::eq(self.table(), taylor.table()) {
            return taylor.clone();
        }
        let table = self.table();
        if taylor.coefficients().len() < 2 {
            return Jet::new(table, taylor.coefficients());
        }
        let mut series = PooledVec::from(self.coefficients());
        series.resize(table.len());
        let mut out = PooledVec::zeros(table.len());
        dispatch_wide(Powers {
            table,
            taylor: taylor.coefficients(),
            series: &series,
            out: &mut out,
        });
        Jet::new(table, out)
    }
}

struct Powers<'a, T: Real> {
    table: &'static Monomials,
    taylor: &'a [T],
    series: &'a [T],
    out: &'a mut [T],
}

impl<T: Real> WideKernel for Powers<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Powers { table, taylor, series, out } = self;
        let n = table.len();
        out[0] = taylor.first().copied().unwrap_or_default();
        let mut power = PooledVec::from(series);
        let mut next = PooledVec::zeros(n);
        for (k, &factor) in taylor.iter().enumerate().skip(1) {
            // Where the monomials of degree k start, and of degree k - 1.
            let (start, before) = (table.of_degree(k).start, table.of_degree(k - 1).start);
            if k > 1 {
                for c in start..n {
                    next[c] = if k == 2 {
                        square(table, c, series)
                    } else {
                        product(table, c, before, &power, series)
                    };
                }
                std::mem::swap(&mut power, &mut next);
            }
            for c in start..n {
                out[c].add_product(power[c], factor);
            }
        }
    }
}

/// Monomial `c` of the square of a series without its constant: each pair of factors once.
#[inline(always)]
fn square<T: Real>(table: &Monomials, c: usize, series: &[T]) -> T {
    let (pairs, diagonal) = table.halves_of(c);
    let mut sum = T::default();
    for &[a, b, _] in &pairs[1..] {
        sum.add_product(series[a as usize], series[b as usize]);
    }
    sum = sum + sum;
    if let Some(a) = diagonal {
        sum.add_product(series[a], series[a]);
    }
    sum
}

/// Monomial `c` of the product of a series whose monomials below `first` are zero, and of one without its constant.
#[inline(always)]
fn product<T: Real>(table: &Monomials, c: usize, first: usize, power: &[T], series: &[T]) -> T {
    let mut sum = T::default();
    // Sorted by the first factor; the last pair has the second one constant.
    for &[a, b, _] in table.pairs_of(c).iter().rev().skip(1) {
        if (a as usize) < first {
            break;
        }
        sum.add_product(power[a as usize], series[b as usize]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scalar;

    #[test]
    fn a_composition_is_the_function_of_the_series() {
        for (variables, order) in [(1, 7), (2, 5), (3, 1), (3, 2), (3, 5), (3, 6)] {
            let table = Monomials::of(variables, order);
            let c = (0..table.len()).map(|i| 0.3 * (i as f64 * 0.7).sin());
            let g = Jet::new(table, c.collect::<Vec<_>>()) + 1.3;
            let compose =
                |g: &Jet<f64>, f: &dyn Fn(Jet<f64>) -> Jet<f64>| g.substituted_in(&f(g.variable()));
            let f = |x: Jet<f64>| x.ln().square() * 0.5 + x.recip() - x.powf(0.4);
            let cubic = |x: Jet<f64>| (x.clone() - 2.0) * x.square();
            let constant = |x: Jet<f64>| x.constant(3.0);
            for (composed, direct) in [
                (compose(&g, &f), f(g.clone())),
                (compose(&g, &cubic), cubic(g.clone())),
                (compose(&g, &constant), constant(g.clone())),
                (compose(&g.constant(0.7), &f), f(g.constant(0.7))),
            ] {
                for c in 0..table.len() {
                    let (a, b) = (composed.coefficient(c), direct.coefficient(c));
                    assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{order} {c}: {a} {b}");
                }
            }
        }
    }
}
