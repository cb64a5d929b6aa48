//! A function of a power series in several variables: `f(g) = sum_k f^(k)(g_0)/k! (g - g_0)^k`; and functions of three of
//! them, `f(g) = sum_c f_c (g - g_0)^c` over the monomials `c`.
//!
//! A function of one variable is expanded in one, where a product costs little; the powers of `g - g_0` start at degree
//! `k`, so all of them together cost about as much as one product in several variables. Those of three are expanded in
//! three, which pays where many series have the same constants.

use super::monomials::degree_of;
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

/// Highest order of an expansion in three variables.
const MAX_ORDER: usize = 8;

/// Functions of three variables, as Taylor series about the constants of three series.
pub struct Expansion<T: Real> {
    functions: [Jet<T>; 3],
    steps: Vec<Step>,
}

/// One monomial of `g - g_0`, which is the last one of a lower degree times a variable.
struct Step {
    monomial: usize,
    degree: usize,
    variable: usize,
}

impl<T: Real> Expansion<T> {
    /// The variables `g_0 + x` in which functions of three series are to be expanded; one that is constant stays so.
    pub fn variables(series: &[Jet<T>; 3]) -> [Jet<T>; 3] {
        let table = Self::table(series[0].table());
        let of = |k: usize| match series[k].coefficients() {
            [constant, _, ..] => {
                let mut variable = [*constant, T::default(), T::default(), T::default()];
                variable[1 + k] = T::splat(1.0);
                Jet::new(table, &variable[..])
            }
            constant => Jet::new(table, constant),
        };
        [of(0), of(1), of(2)]
    }

    /// The table of the functions, for series of a table.
    fn table(of_series: &'static Monomials) -> &'static Monomials {
        if of_series.variables() == 3 { of_series } else { Monomials::of(3, of_series.order()) }
    }

    /// About as many times as much work an expansion is than functions of series of a table; none where there is no table
    /// for it.
    pub fn work(of_series: &'static Monomials) -> Option<usize> {
        let order = of_series.order();
        (1..=MAX_ORDER).contains(&order).then(|| {
            let products = |table: &Monomials| table.pairs(0..order + 1).len();
            products(Self::table(of_series)) / products(of_series)
        })
    }

    /// From what the functions are of the [variables](Expansion::variables).
    pub fn new(functions: [Jet<T>; 3]) -> Self {
        let mut expansion = Expansion { functions, steps: Vec::new() };
        expansion.walk([0; 3], 0);
        expansion
    }

    /// Depth first through the monomials that follow from one by multiplication with this variable or a later one. Left
    /// out are those that no function has and from which none follows that one has.
    fn walk(&mut self, exponents: [u8; 3], first: usize) {
        let table = self.functions[0].table();
        if degree_of(&exponents) == table.order() {
            return;
        }
        for variable in first..3 {
            let mut next = exponents;
            next[variable] += 1;
            let monomial = table.exponents().iter().position(|e| *e == next).unwrap_or_default();
            let before = self.steps.len();
            self.steps.push(Step { monomial, degree: degree_of(&next), variable });
            self.walk(next, variable);
            let is_wanted = self.functions.iter().any(|f| f.coefficient(monomial) != T::default());
            if !is_wanted && self.steps.len() == before + 1 {
                self.steps.truncate(before);
            }
        }
    }

    /// The functions of series that have the constants they were expanded about.
    #[inline(never)]
    pub fn at(&self, series: &[Jet<T>; 3]) -> [Jet<T>; 3] {
        let table = series[0].table();
        let whole = |jet: &Jet<T>| {
            let mut coefficients = PooledVec::from(jet.coefficients());
            coefficients.resize(table.len());
            coefficients
        };
        let series = [whole(&series[0]), whole(&series[1]), whole(&series[2])];
        let of = |f: &Jet<T>| match f.coefficients() {
            [constant, _, ..] => {
                let mut sum = PooledVec::zeros(table.len());
                sum[0] = *constant;
                sum
            }
            constant => PooledVec::from(constant),
        };
        let mut sums = [of(&self.functions[0]), of(&self.functions[1]), of(&self.functions[2])];
        dispatch_wide(Products { expansion: self, table, series: &series, sums: &mut sums });
        sums.map(|sum| Jet::new(table, sum))
    }
}

struct Products<'a, T: Real> {
    expansion: &'a Expansion<T>,
    table: &'static Monomials,
    series: &'a [PooledVec<T>; 3],
    sums: &'a mut [PooledVec<T>; 3],
}

impl<T: Real> WideKernel for Products<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Products { expansion: Expansion { functions, steps }, table, series, sums } = self;
        let n = table.len();
        // The last monomial of each degree.
        let mut last = PooledVec::zeros((table.order() + 1) * n);
        for &Step { monomial, degree, variable } in steps {
            let (before, power) = last.split_at_mut(degree * n);
            let (start, power) = (table.of_degree(degree).start, &mut power[..n]);
            if degree == 1 {
                power.copy_from_slice(&series[variable]);
            } else {
                let before = &before[(degree - 1) * n..];
                let first = table.of_degree(degree - 1).start;
                for c in start..n {
                    power[c] = product(table, c, first, before, &series[variable]);
                }
            }
            for (f, sum) in functions.iter().zip(sums.iter_mut()) {
                let factor = f.coefficient(monomial);
                if factor != T::default() {
                    let terms = sum[start..].iter_mut().zip(&power[start..]);
                    terms.for_each(|(sum, &power)| sum.add_product(power, factor));
                }
            }
        }
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

    #[test]
    fn functions_of_three_series_are_those_of_the_series() {
        type Functions = dyn Fn([Jet<f64>; 3]) -> [Jet<f64>; 3];
        let smooth = |[x, y, z]: [Jet<f64>; 3]| {
            let xy = x.clone() * y.clone();
            [(xy.clone() * z.powf(-0.7)).ln(), y.square() * z.clone(), x * (xy * 0.1).exp()]
        };
        let sparse = |[x, y, z]: [Jet<f64>; 3]| [x * 2.0 + 1.0, y.constant(3.0), z.constant(0.0)];
        for (variables, order) in (1..7).flat_map(|order| [(1, order), (2, order), (3, order)]) {
            let table = Monomials::of(variables, order);
            let series = |k: usize| {
                let c = (0..table.len()).map(|i| 0.3 * ((i + 5 * k) as f64 * 0.7).sin());
                Jet::new(table, c.collect::<Vec<_>>()) + (1.3 + k as f64)
            };
            let constant = Jet::new(table, &[0.9][..]);
            for g in [[series(0), series(1), series(2)], [series(3), constant, series(4)]] {
                for functions in [&smooth as &Functions, &sparse] {
                    let variables = Expansion::variables(&g);
                    let composed = Expansion::new(functions(variables)).at(&g);
                    for (composed, direct) in composed.iter().zip(functions(g.clone())) {
                        for c in 0..table.len() {
                            let (a, b) = (composed.coefficient(c), direct.coefficient(c));
                            assert!(
                                (a - b).abs() < 1e-12 * (1.0 + b.abs()),
                                "{order} {c}: {a} {b}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn monomials_that_no_function_has_are_left_out() {
        let table = Monomials::of(3, 5);
        let steps = |functions: &dyn Fn([Jet<f64>; 3]) -> [Jet<f64>; 3]| {
            let at = |value: f64| Jet::new(table, &[value, 0.1, 0.2, 0.3][..]);
            let variables = Expansion::variables(&[at(3.0), at(3.0), at(1.0)]);
            Expansion::new(functions(variables)).steps.len()
        };
        assert_eq!(steps(&|[x, y, z]| [x, y, z]), 3);
        assert_eq!(steps(&|[x, _, z]| [z.clone(), x * z.square(), z]), 5, "x, xz, xzz, z, zz");
        assert_eq!(steps(&|[x, y, z]| [x.exp(), y.constant(1.0), z.constant(0.0)]), 5);
        assert_eq!(Expansion::<f64>::work(table), Some(1));
        assert_eq!(Expansion::<f64>::work(Monomials::of(1, 8)), Some(3003 / 45));
        assert_eq!(Expansion::<f64>::work(Monomials::of(1, 15)), None, "too many terms");
    }
}
