//! Monomials of several variables up to an order, and the table of their products.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Mutex, OnceLock};

/// All monomials of a number of variables up to an order, sorted by degree, and the table of
/// their products. Tables of lower order are prefixes of those of higher order.
pub struct Monomials {
    variables: usize,
    order: usize,
    exponents: Vec<[u8; 3]>,
    degree_start: Vec<usize>,
    /// `(a, b, c)` with `x^a x^b = x^c`, sorted by `c`.
    pairs: Vec<[u16; 3]>,
    /// Where the pairs of each monomial `c` start.
    pair_start: Vec<usize>,
    /// The table of one variable, if this has several.
    line: Option<&'static Monomials>,
}

/// Highest order of a table: beyond it power series in double precision carry no information.
pub const MAX_ORDER: usize = 64;

impl Monomials {
    /// The shared table for 1 to 3 variables and an order of at most [`MAX_ORDER`] (1 variable)
    /// or 12 (several).
    ///
    /// # Panics
    /// Outside these bounds; callers validate orders where users enter.
    pub fn of(variables: usize, order: usize) -> &'static Monomials {
        static TABLES: OnceLock<Mutex<HashMap<(usize, usize), &'static Monomials>>> =
            OnceLock::new();
        assert!((1..=3).contains(&variables));
        assert!(order <= if variables == 1 { MAX_ORDER } else { 12 });
        let tables = TABLES.get_or_init(Default::default);
        let line = (variables > 1).then(|| Monomials::of(1, order)); // before the lock is held
        let mut tables = tables.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        tables
            .entry((variables, order))
            .or_insert_with(|| Box::leak(Box::new(Monomials::build(variables, order, line))))
    }

    fn build(variables: usize, order: usize, line: Option<&'static Monomials>) -> Self {
        let mut exponents = Vec::new();
        let mut degree_start = vec![0];
        for degree in 0..=order {
            push_monomials(variables, degree, &mut exponents);
            degree_start.push(exponents.len());
        }
        let index: HashMap<[u8; 3], usize> =
            exponents.iter().enumerate().map(|(k, &e)| (e, k)).collect();
        let mut pairs = Vec::new();
        for (a, ea) in exponents.iter().enumerate() {
            for (b, eb) in exponents.iter().enumerate() {
                let sum = [ea[0] + eb[0], ea[1] + eb[1], ea[2] + eb[2]];
                if let Some(&c) = index.get(&sum) {
                    pairs.push([a as u16, b as u16, c as u16]);
                }
            }
        }
        pairs.sort_unstable_by_key(|&[a, b, c]| (c, a, b));
        let pair_start =
            (0..=exponents.len()).map(|c| pairs.partition_point(|p| (p[2] as usize) < c)).collect();
        Monomials { variables, order, exponents, degree_start, pairs, pair_start, line }
    }

    /// The table of one variable to the same order, if this has several.
    pub fn line(&self) -> Option<&'static Monomials> {
        self.line
    }

    /// Number of variables.
    pub fn variables(&self) -> usize {
        self.variables
    }

    /// Highest total degree.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Number of monomials, the constant included.
    pub fn len(&self) -> usize {
        self.exponents.len()
    }

    /// A table always holds the constant.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Exponents of each monomial; unused variables have exponent 0.
    pub fn exponents(&self) -> &[[u8; 3]] {
        &self.exponents
    }

    /// Indices of the monomials of one degree.
    pub fn of_degree(&self, degree: usize) -> Range<usize> {
        self.degree_start[degree]..self.degree_start[degree + 1]
    }

    /// Number of monomials of degree at most `degree`.
    pub fn up_to(&self, degree: usize) -> usize {
        self.degree_start[degree + 1]
    }

    /// `(a, b, c)` with `x^a x^b = x^c`, for all products of the given degrees.
    #[inline(always)]
    pub fn pairs(&self, degrees: Range<usize>) -> &[[u16; 3]] {
        let monomials = self.degree_start[degrees.start]..self.degree_start[degrees.end];
        &self.pairs[self.pair_start[monomials.start]..self.pair_start[monomials.end]]
    }

    /// The pairs `(a, b, c)` whose product is monomial `c`.
    #[inline(always)]
    pub fn pairs_of(&self, c: usize) -> &[[u16; 3]] {
        &self.pairs[self.pair_start[c]..self.pair_start[c + 1]]
    }

    /// The pairs `(a, b, c)` of two series whose highest degree is zero: those of a monomial of that degree have the constant
    /// of the other series as a factor at both ends of the list.
    #[inline(always)]
    pub fn pairs_below_top(&self, c: usize) -> &[[u16; 3]] {
        let pairs = self.pairs_of(c);
        let is_top = c > 0 && c >= self.degree_start[self.order];
        if is_top { &pairs[1..pairs.len() - 1] } else { pairs }
    }

    /// The pairs `(a, b, c)` with `a < b` whose product is monomial `c`, and `a` with `x^a x^a = x^c`: the factors of a
    /// square, each pair once. The pairs of a monomial are sorted by the first factor, the list read backwards has the
    /// factors exchanged.
    #[inline(always)]
    pub fn halves_of(&self, c: usize) -> (&[[u16; 3]], Option<usize>) {
        let pairs = self.pairs_of(c);
        let half = pairs.len() / 2;
        (&pairs[..half], (pairs.len() % 2 == 1).then(|| pairs[half][0] as usize))
    }

    /// Values of all monomials at `x`, written to `out` (length at least `len()`).
    ///
    /// Allocation-free: the real-time evaluator calls it.
    pub fn evaluate(&self, x: [f64; 3], out: &mut [f64]) {
        evaluate_monomials(&self.exponents, x, out);
    }
}

/// Values of the monomials with the given exponents at `x`.
#[inline]
pub fn evaluate_monomials(exponents: &[[u8; 3]], x: [f64; 3], out: &mut [f64]) {
    for (value, e) in out.iter_mut().zip(exponents) {
        *value = power(x[0], e[0]) * power(x[1], e[1]) * power(x[2], e[2]);
    }
}

#[inline]
fn power(x: f64, exponent: u8) -> f64 {
    (0..exponent).fold(1.0, |product, _| product * x)
}

/// Total degree.
#[inline]
pub fn degree_of(exponents: &[u8; 3]) -> usize {
    exponents.iter().map(|&e| e as usize).sum()
}

fn push_monomials(variables: usize, degree: usize, out: &mut Vec<[u8; 3]>) {
    let d = degree as u8;
    match variables {
        1 => out.push([d, 0, 0]),
        2 => out.extend((0..=d).rev().map(|i| [i, d - i, 0])),
        _ => {
            for i in (0..=d).rev() {
                out.extend((0..=d - i).rev().map(|j| [i, j, d - i - j]));
            }
        }
    }
}
