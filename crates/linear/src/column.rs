//! One right-hand side through a supernodal Cholesky factor, without allocation: what a frame asks for.
//!
//! The factor is read once forward and once backward, four of its columns at a time; it is the traffic of the
//! factor that takes the time, and a dense kernel called for each supernode takes as long again.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

use super::Precision;
use super::substitution::Factor;
use viscera_number::simd::{Kernel, dispatch};

/// A right-hand side in elimination order, with room for one supernode's rows below its diagonal block.
pub struct Column<T> {
    values: Vec<T>,
    below: Vec<T>,
}

impl<T: Precision> Column<T> {
    pub(super) fn new(symbolic: &SymbolicSupernodalCholesky<u32>) -> Self {
        let rows_below = |s| symbolic.supernode(s).pattern().len();
        let tallest = (0..symbolic.n_supernodes()).map(rows_below).max().unwrap_or(0);
        Self { values: vec![T::default(); symbolic.nrows()], below: vec![T::default(); tallest] }
    }

    /// `x[rows] = L⁻ᵀ L⁻¹ b[rows]`, scaled to stay within the range of `T`.
    pub(super) fn solve(&mut self, factor: &Factor<'_, T>, rows: &[u32], b: &[f64], x: &mut [f64]) {
        let largest = rows.iter().fold(0.0, |max: f64, &row| max.max(b[row as usize].abs()));
        let scale = if largest > 0.0 { largest } else { 1.0 };
        let inverse = scale.recip();
        for (value, &row) in self.values.iter_mut().zip(rows) {
            *value = T::round(b[row as usize] * inverse);
        }
        dispatch(Substitution { factor, column: self });
        for (value, &row) in self.values.iter().zip(rows) {
            x[row as usize] = value.double() * scale;
        }
    }
}

struct Substitution<'a, T> {
    factor: &'a Factor<'a, T>,
    column: &'a mut Column<T>,
}

impl<T: Precision> Kernel for Substitution<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Column { values, below } = self.column;
        let symbolic = self.factor.symbolic;
        for s in 0..symbolic.n_supernodes() {
            forward(self.factor, s, values, below);
        }
        for s in (0..symbolic.n_supernodes()).rev() {
            backward(self.factor, s, values, below);
        }
    }
}

/// First row, number of columns, rows below, and the column-major values of a supernode.
#[inline(always)]
fn supernode<'a, T>(factor: &Factor<'a, T>, s: usize) -> (usize, usize, &'a [u32], &'a [T]) {
    let symbolic = factor.symbolic;
    let first = symbolic.supernode_begin()[s] as usize;
    let columns = symbolic.supernode_end()[s] as usize - first;
    let offsets = symbolic.col_ptr_for_val();
    let values = &factor.values[offsets[s] as usize..offsets[s + 1] as usize];
    (first, columns, symbolic.supernode(s).pattern(), values)
}

/// `x <- L⁻¹ x` within one supernode, and its share taken from the rows below.
#[inline(always)]
fn forward<T: Precision>(factor: &Factor<'_, T>, s: usize, values: &mut [T], below: &mut [T]) {
    let (first, columns, rows_below, block) = supernode(factor, s);
    let height = columns + rows_below.len();
    let x = &mut values[first..first + columns];
    for j in 0..columns {
        let column = &block[j * height..j * height + columns];
        let known = x[j] / column[j];
        x[j] = known;
        for (x, l) in x[j + 1..].iter_mut().zip(&column[j + 1..]) {
            *x -= *l * known;
        }
    }
    if rows_below.is_empty() {
        return;
    }
    let below = &mut below[..rows_below.len()];
    below.fill(T::default());
    let tail = |j: usize| &block[j * height + columns..(j + 1) * height];
    let mut j = 0;
    while j + 4 <= columns {
        let (l0, l1, l2, l3) = (tail(j), tail(j + 1), tail(j + 2), tail(j + 3));
        let (x0, x1, x2, x3) = (x[j], x[j + 1], x[j + 2], x[j + 3]);
        for ((((y, l0), l1), l2), l3) in below.iter_mut().zip(l0).zip(l1).zip(l2).zip(l3) {
            *y += (*l0 * x0 + *l1 * x1) + (*l2 * x2 + *l3 * x3);
        }
        j += 4;
    }
    for j in j..columns {
        let known = x[j];
        below.iter_mut().zip(tail(j)).for_each(|(y, l)| *y += *l * known);
    }
    for (&row, share) in rows_below.iter().zip(below) {
        let value = &mut values[row as usize];
        *value -= *share;
    }
}

/// `x <- L⁻ᵀ x` within one supernode, the rows below being known.
#[inline(always)]
fn backward<T: Precision>(factor: &Factor<'_, T>, s: usize, values: &mut [T], below: &mut [T]) {
    let (first, columns, rows_below, block) = supernode(factor, s);
    let height = columns + rows_below.len();
    let below = &mut below[..rows_below.len()];
    for (value, &row) in below.iter_mut().zip(rows_below) {
        *value = values[row as usize];
    }
    let x = &mut values[first..first + columns];
    let tail = |j: usize| &block[j * height + columns..(j + 1) * height];
    let mut j = 0;
    while j + 4 <= columns && !below.is_empty() {
        let known = dot4([tail(j), tail(j + 1), tail(j + 2), tail(j + 3)], below);
        for k in 0..4 {
            x[j + k] -= known[k];
        }
        j += 4;
    }
    for j in j..columns {
        x[j] -= dot(tail(j), below);
    }
    for j in (0..columns).rev() {
        let column = &block[j * height..j * height + columns];
        x[j] = (x[j] - dot(&column[j + 1..], &x[j + 1..])) / column[j];
    }
}

/// Partial sums that the compiler keeps in vector registers.
const LANES: usize = 8;

/// `a . b`.
#[inline(always)]
fn dot<T: Precision>(a: &[T], b: &[T]) -> T {
    let mut sums = [T::default(); LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let tails = a_chunks.remainder().iter().zip(b_chunks.remainder());
    let mut sum = tails.fold(T::default(), |sum, (a, b)| sum + *a * *b);
    for (a, b) in a_chunks.zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().for_each(|s| sum += *s);
    sum
}

/// Four products at once: `b` is read once for them.
#[inline(always)]
fn dot4<T: Precision>(a: [&[T]; 4], b: &[T]) -> [T; 4] {
    let n = b.len();
    let [a0, a1, a2, a3] = a.map(|a| &a[..n]);
    let mut sums = [[T::default(); LANES]; 4];
    let whole = n - n % LANES;
    let mut i = 0;
    while i < whole {
        let b = &b[i..i + LANES];
        let rows = [&a0[i..i + LANES], &a1[i..i + LANES], &a2[i..i + LANES], &a3[i..i + LANES]];
        for (sums, a) in sums.iter_mut().zip(rows) {
            for lane in 0..LANES {
                sums[lane] += a[lane] * b[lane];
            }
        }
        i += LANES;
    }
    let mut out = [T::default(); 4];
    for (k, a) in [a0, a1, a2, a3].into_iter().enumerate() {
        let head = sums[k].iter().fold(T::default(), |sum, s| sum + *s);
        out[k] = a[whole..].iter().zip(&b[whole..]).fold(head, |sum, (a, b)| sum + *a * *b);
    }
    out
}
