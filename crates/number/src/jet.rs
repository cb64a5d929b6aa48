//! Truncated power series in one or several variables, of an order chosen at run time.
//!
//! In one variable a jet is the Taylor series along a load path (paper A); in three it is the
//! expansion in the components of a contact displacement. Elementary
//! functions use Euler's operator `D = sum_i x_i d/dx_i`, which multiplies the coefficient of
//! every monomial by its degree: `D f = f'(g) D g` gives each new degree from the lower ones, and
//! in one variable it is the recursion of paper A (eqs. 48-51), to any order.

use super::monomials::{Monomials, degree_of};
use super::pool::PooledVec;
use super::{Real, Scalar};
use crate::simd::{Kernel, dispatch_solver};
use std::fmt;
use std::ops::{Add, Mul, Neg, Sub};

/// A truncated power series `sum_c coefficients[c] x^c`.
///
/// Only the coefficients up to the highest degree present are stored (none for zero, one for a
/// constant), so arithmetic with constants costs nothing. Operations take memory and loop: they are never inlined, or the
/// tensors that laws write out entry by entry would take minutes to compile.
#[derive(Clone)]
pub struct Jet<T: Real> {
    table: &'static Monomials,
    coefficients: PooledVec<T>,
}

impl<T: Real> Jet<T> {
    /// The jet with the given coefficients: a whole number of degrees of `table`.
    pub fn new(table: &'static Monomials, coefficients: impl Into<PooledVec<T>>) -> Self {
        Jet { table, coefficients: coefficients.into() }
    }

    /// Its table of monomials.
    pub fn table(&self) -> &'static Monomials {
        self.table
    }

    /// The coefficient of monomial `c` (zero beyond those stored).
    pub fn coefficient(&self, c: usize) -> T {
        self.coefficients.get(c).copied().unwrap_or_default()
    }

    /// The stored coefficients; those beyond are zero.
    #[inline(always)]
    pub fn coefficients(&self) -> &[T] {
        &self.coefficients
    }

    /// Highest stored degree, or none for zero.
    fn degree(&self) -> Option<usize> {
        let n = self.coefficients.len();
        (0..=self.table.order()).find(|&d| self.table.up_to(d) >= n && n > 0)
    }

    #[inline(always)]
    fn zip(mut self, other: Self, f: impl Fn(T, T) -> T) -> Self {
        let n = self.coefficients.len().max(other.coefficients.len());
        self.coefficients.resize(n);
        for (a, &b) in self.coefficients.iter_mut().zip(other.coefficients.iter()) {
            *a = f(*a, b);
        }
        self
    }

    #[inline(always)]
    fn map(mut self, f: impl Fn(T) -> T) -> Self {
        for c in self.coefficients.iter_mut() {
            *c = f(*c);
        }
        self
    }

    #[inline(always)]
    fn shift(mut self, value: f64) -> Self {
        if self.coefficients.is_empty() {
            self.coefficients.resize(1);
        }
        self.coefficients[0] = self.coefficients[0] + value;
        self
    }

    /// `self^exponent` of a whole exponent, by squares.
    fn whole_power(&self, exponent: f64) -> Self {
        if exponent < 2.0 {
            return if exponent == 1.0 { self.clone() } else { self.constant(1.0) };
        }
        let square = self.whole_power((0.5 * exponent).floor()).square();
        if exponent % 2.0 == 1.0 { square * self.clone() } else { square }
    }

    /// Solves `rhs_c = sum over pairs` degree by degree: `f` of degree d from lower degrees.
    ///
    /// `step(out, d)` must add to `out` of degree `d`, which starts at zero.
    #[inline(always)]
    fn by_degree(&self, constant: T, step: impl FnMut(&mut [T], usize)) -> Self {
        let mut out = PooledVec::zeros(self.table.len());
        out[0] = constant;
        dispatch_solver(ByDegree { order: self.table.order(), out: &mut out, step });
        Jet { table: self.table, coefficients: out }
    }
}

struct ByDegree<'a, T, F> {
    order: usize,
    out: &'a mut [T],
    step: F,
}

impl<T: Real, F: FnMut(&mut [T], usize)> Kernel for ByDegree<'_, T, F> {
    type Output = ();
    #[inline(always)]
    fn run(mut self) {
        for degree in 1..=self.order {
            (self.step)(self.out, degree);
        }
    }
}

impl<T: Real + fmt::Debug> fmt::Debug for Jet<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.coefficients.iter()).finish()
    }
}

impl<T: Real> Add for Jet<T> {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl<T: Real> Sub for Jet<T> {
    type Output = Self;
    #[inline(never)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl<T: Real> Neg for Jet<T> {
    type Output = Self;
    #[inline(never)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl<T: Real> Add<f64> for Jet<T> {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: f64) -> Self {
        self.shift(other)
    }
}

impl<T: Real> Sub<f64> for Jet<T> {
    type Output = Self;
    #[inline(never)]
    fn sub(self, other: f64) -> Self {
        self.shift(-other)
    }
}

impl<T: Real> Mul<f64> for Jet<T> {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: f64) -> Self {
        self.map(|a| a * other)
    }
}

impl<T: Real> Mul for Jet<T> {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        let (Some(da), Some(db)) = (self.degree(), other.degree()) else {
            return Jet { table: self.table, coefficients: PooledVec::default() };
        };
        if db == 0 {
            let b = other.coefficients[0];
            return self.map(|a| a * b);
        }
        if da == 0 {
            let a = self.coefficients[0];
            return other.map(|b| a * b);
        }
        let degree = (da + db).min(self.table.order());
        let mut out = PooledVec::zeros(self.table.up_to(degree));
        let (a, b) = (&self.coefficients, &other.coefficients);
        dispatch_solver(Products { pairs: self.table.pairs(0..degree + 1), a, b, out: &mut out });
        Jet { table: self.table, coefficients: out }
    }
}

struct Products<'a, T> {
    pairs: &'a [[u16; 3]],
    a: &'a [T],
    b: &'a [T],
    out: &'a mut [T],
}

impl<T: Real> Kernel for Products<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        for &[i, j, k] in self.pairs {
            if let (Some(&a), Some(&b)) = (self.a.get(i as usize), self.b.get(j as usize)) {
                self.out[k as usize].add_product(a, b);
            }
        }
    }
}

impl<T: Real> Scalar for Jet<T> {
    const IS_SERIES: bool = true;

    #[inline(never)]
    fn constant(&self, value: f64) -> Self {
        let constant = [T::splat(value)];
        Jet::new(self.table, if value == 0.0 { &[] } else { &constant[..] })
    }

    /// `g f = 1`: `f_c = -(1/g_0) sum_{b /= 0} g_b f_{c-b}`.
    #[inline(never)]
    fn recip(&self) -> Self {
        let table = self.table;
        let r0 = self.coefficient(0).recip();
        self.by_degree(r0, |out, degree| {
            for &[b, a, c] in table.pairs(degree..degree + 1) {
                if b != 0 {
                    let (g, f) = (self.coefficient(b as usize), out[a as usize]);
                    out[c as usize].add_product(g, f);
                }
            }
            for c in table.of_degree(degree) {
                out[c] = -(out[c] * r0);
            }
        })
    }

    /// `g D f = D g`: `|c| g_0 f_c = |c| g_c - sum_{a /= c} |a| f_a g_{c-a}` (eq. 51 of paper A).
    #[inline(never)]
    fn ln(&self) -> Self {
        let table = self.table;
        let r0 = self.coefficient(0).recip();
        self.by_degree(self.coefficient(0).ln(), |out, degree| {
            for &[a, b, c] in table.pairs(degree..degree + 1) {
                if b != 0 && a != 0 {
                    let weight = degree_of(&table.exponents()[a as usize]) as f64;
                    let f = out[a as usize] * weight;
                    out[c as usize].add_product(f, self.coefficient(b as usize));
                }
            }
            for c in table.of_degree(degree) {
                out[c] = (self.coefficient(c) - out[c] * (1.0 / degree as f64)) * r0;
            }
        })
    }

    /// `D f = f D g`.
    #[inline(never)]
    fn exp(&self) -> Self {
        let table = self.table;
        self.by_degree(self.coefficient(0).exp(), |out, degree| {
            for &[b, a, c] in table.pairs(degree..degree + 1) {
                if b != 0 {
                    let weight = degree_of(&table.exponents()[b as usize]) as f64 / degree as f64;
                    let f = out[a as usize] * weight;
                    out[c as usize].add_product(self.coefficient(b as usize), f);
                }
            }
        })
    }

    #[inline(never)]
    fn heaviside(&self) -> Self {
        Jet::new(self.table, &[self.coefficient(0).heaviside()][..])
    }

    #[inline(never)]
    fn wall(&self) -> Self {
        Jet::new(self.table, &[self.coefficient(0).wall()][..])
    }

    /// `g D f = r f D g`, which divides by the constant of `g`; whole powers are products and have a series without one.
    #[inline(never)]
    fn powf(&self, exponent: f64) -> Self {
        if exponent >= 0.0 && exponent.fract() == 0.0 {
            return self.whole_power(exponent);
        }
        let table = self.table;
        let r0 = self.coefficient(0).recip();
        self.by_degree(self.coefficient(0).powf(exponent), |out, degree| {
            for &[b, a, c] in table.pairs(degree..degree + 1) {
                if b != 0 {
                    let db = degree_of(&table.exponents()[b as usize]) as f64;
                    let weight = (exponent * db - (degree as f64 - db)) / degree as f64;
                    let f = out[a as usize] * weight;
                    out[c as usize].add_product(self.coefficient(b as usize), f);
                }
            }
            for c in table.of_degree(degree) {
                out[c] = out[c] * r0;
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(table: &'static Monomials) -> Jet<f64> {
        let c = (0..table.len()).map(|i| if i == 0 { 1.7 } else { (i as f64 * 0.7).sin() * 0.3 });
        Jet::new(table, c.collect::<Vec<_>>())
    }

    fn close(a: &Jet<f64>, b: &Jet<f64>) {
        for c in 0..a.table.len() {
            let (x, y) = (a.coefficient(c), b.coefficient(c));
            assert!((x - y).abs() < 1e-12 * (1.0 + x.abs()), "coefficient {c}: {x} {y}");
        }
    }

    #[test]
    fn counts_are_binomials() {
        assert_eq!(Monomials::of(3, 4).len(), 35);
        assert_eq!(Monomials::of(3, 6).len(), 84);
        assert_eq!(Monomials::of(3, 4).pairs(0..5).len(), 210);
        assert_eq!(Monomials::of(1, 15).len(), 16);
    }

    #[test]
    fn halves_hold_each_pair_of_factors_once() {
        for table in [Monomials::of(1, 9), Monomials::of(2, 5), Monomials::of(3, 6)] {
            for c in 0..table.len() {
                let (halves, diagonal) = table.halves_of(c);
                let mirrored = halves.iter().rev().map(|&[a, b, c]| [b, a, c]);
                let middle = diagonal.map(|a| [a as u16, a as u16, c as u16]);
                let all: Vec<_> = halves.iter().copied().chain(middle).chain(mirrored).collect();
                assert_eq!(all, table.pairs_of(c));
                assert!(halves.iter().all(|&[a, b, _]| a < b));
            }
        }
    }

    #[test]
    fn elementary_functions_invert_each_other() {
        for (variables, order) in [(1, 12), (2, 5), (3, 6)] {
            let x = sample(Monomials::of(variables, order));
            close(&(x.recip() * x.clone()), &x.constant(1.0));
            close(&x.ln().exp(), &x);
            close(&x.powf(0.4).powf(2.5), &x);
            close(&x.powf(3.0), &(x.clone() * x.clone() * x.clone()));
            close(&(x.powf(-1.0)), &x.recip());
        }
    }

    /// Among them bases that begin with a higher degree, and one that is zero but for rounding.
    #[test]
    fn whole_powers_need_no_constant() {
        for (variables, order) in [(1, 12), (3, 6)] {
            let table = Monomials::of(variables, order);
            let x = sample(table);
            for base in [x.clone() - 1.7, (x.clone() - 1.7).square(), x.clone() - (1.7 - 1e-16), x]
            {
                let mut product = base.constant(1.0);
                for exponent in 0..8 {
                    close(&base.powf(f64::from(exponent)), &product);
                    product = product * base.clone();
                }
            }
        }
        let nothing = Jet::<f64>::new(Monomials::of(3, 4), &[][..]);
        assert_eq!(nothing.powf(0.0).coefficients(), &[1.0]);
        assert!(nothing.powf(3.0).coefficients().is_empty());
    }

    #[test]
    fn a_power_that_is_not_whole_has_no_series_about_zero() {
        let base = sample(Monomials::of(1, 4)) - 1.7;
        assert!(!base.powf(1.5).coefficient(2).is_finite());
    }

    #[test]
    fn series_of_the_exponential() {
        let table = Monomials::of(1, 6);
        let e = Jet::new(table, vec![0.0, 1.0]).exp();
        let factorials = [1.0, 1.0, 2.0, 6.0, 24.0, 120.0, 720.0];
        for (p, factorial) in factorials.iter().enumerate() {
            assert!((e.coefficient(p) - 1.0 / factorial).abs() < 1e-15);
        }
    }

    #[test]
    fn constants_and_zero_stay_short() {
        let x = sample(Monomials::of(3, 4));
        assert!((x.clone() * x.constant(0.0)).coefficients().is_empty());
        assert_eq!((x.constant(2.0) * x.constant(3.0)).coefficients(), &[6.0]);
        close(&(x.constant(2.0) * x.clone()), &(x * 2.0));
    }

    #[test]
    fn a_product_of_polynomials_is_evaluated_pointwise() {
        let table = Monomials::of(3, 6);
        let degree_two: Vec<f64> = (0..10).map(|i| 0.1 * i as f64 - 0.4).collect();
        let a = Jet::new(table, degree_two);
        let product = a.clone() * a.square();
        let mut monomials = vec![0.0; table.len()];
        table.evaluate([0.3, -0.7, 1.1], &mut monomials);
        let value = |j: &Jet<f64>| -> f64 {
            j.coefficients().iter().zip(&monomials).map(|(c, m)| c * m).sum()
        };
        assert!((value(&product) - value(&a).powi(3)).abs() < 1e-12);
    }
}
