//! One right-hand side through a supernodal Cholesky factor, without allocation: what a frame asks for.
//!
//! The factor is read once forward and once backward, four of its columns at a time, from the diagonal to the last row;
//! it is the traffic of the factor that takes the time, and a dense kernel called for each supernode takes as long again.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

use super::Precision;
use super::substitution::{Factor, Supernode};
use viscera_number::simd::{WideKernel, dispatch_wide};

/// Columns of the factor that are read together.
const WIDTH: usize = 4;

/// A right-hand side in elimination order, with room for the rows of one supernode.
pub struct Column<T> {
    values: Vec<T>,
    own: Vec<T>,
}

impl<T: Precision> Column<T> {
    pub(super) fn new(symbolic: &SymbolicSupernodalCholesky<u32>) -> Self {
        let columns = |s: usize| symbolic.supernode_end()[s] - symbolic.supernode_begin()[s];
        let height = |s: usize| columns(s) as usize + symbolic.supernode(s).pattern().len();
        let tallest = (0..symbolic.n_supernodes()).map(height).max().unwrap_or(0);
        Self { values: vec![T::default(); symbolic.nrows()], own: vec![T::default(); tallest] }
    }

    /// `x[rows] = L⁻ᵀ L⁻¹ b[rows]`, scaled to stay within the range of `T`.
    pub(super) fn solve(&mut self, factor: &Factor<'_, T>, rows: &[u32], b: &[f64], x: &mut [f64]) {
        let largest = rows.iter().fold(0.0, |max: f64, &row| max.max(b[row as usize].abs()));
        let scale = if largest > 0.0 { largest } else { 1.0 };
        let inverse = scale.recip();
        for (value, &row) in self.values.iter_mut().zip(rows) {
            *value = T::round(b[row as usize] * inverse);
        }
        dispatch_wide(Substitution { factor, column: self });
        for (value, &row) in self.values.iter().zip(rows) {
            x[row as usize] = value.double() * scale;
        }
    }
}

struct Substitution<'a, T> {
    factor: &'a Factor<'a, T>,
    column: &'a mut Column<T>,
}

impl<T: Precision> WideKernel for Substitution<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Column { values, own } = self.column;
        let n_supernodes = self.factor.symbolic.n_supernodes();
        for s in 0..n_supernodes {
            self.factor.supernode(s).forward::<BITS>(values, own);
        }
        for s in (0..n_supernodes).rev() {
            self.factor.supernode(s).backward::<BITS>(values, own);
        }
    }
}

impl<'a, T: Precision> Supernode<'a, T> {
    /// `x <- L⁻¹ x` within this supernode, and its share taken from the rows below.
    #[inline(always)]
    fn forward<const BITS: usize>(&self, values: &mut [T], own: &mut [T]) {
        let (top, below) = own[..self.height].split_at_mut(self.columns);
        top.copy_from_slice(&values[self.first..][..self.columns]);
        below.fill(T::default());
        let own = &mut own[..self.height];
        let whole = self.columns - self.columns % WIDTH;
        for j in (0..whole).step_by(WIDTH) {
            self.eliminate::<BITS, WIDTH>(j, own);
        }
        for j in whole..self.columns {
            self.eliminate::<BITS, 1>(j, own);
        }
        let (top, below) = own.split_at(self.columns);
        values[self.first..][..self.columns].copy_from_slice(top);
        for (&row, share) in self.rows_below.iter().zip(below) {
            values[row as usize] += *share;
        }
    }

    /// `x <- L⁻ᵀ x` within this supernode, the rows below being known.
    #[inline(always)]
    fn backward<const BITS: usize>(&self, values: &mut [T], own: &mut [T]) {
        let own = &mut own[..self.height];
        let (top, below) = own.split_at_mut(self.columns);
        top.copy_from_slice(&values[self.first..][..self.columns]);
        for (value, &row) in below.iter_mut().zip(self.rows_below) {
            *value = values[row as usize];
        }
        let whole = self.columns - self.columns % WIDTH;
        for j in (whole..self.columns).rev() {
            self.substitute::<BITS, 1>(j, own);
        }
        for j in (0..whole).step_by(WIDTH).rev() {
            self.substitute::<BITS, WIDTH>(j, own);
        }
        values[self.first..][..self.columns].copy_from_slice(&own[..self.columns]);
    }

    /// The `W` columns from `j` on, each from the diagonal of the first of them.
    #[inline(always)]
    fn columns<const W: usize>(&self, j: usize) -> [&'a [T]; W] {
        std::array::from_fn(|k| &self.block[(j + k) * self.height..][j..self.height])
    }

    /// Solves for the `W` unknowns from `j` on, and takes their share from the rows after them.
    #[inline(always)]
    fn eliminate<const BITS: usize, const W: usize>(&self, j: usize, own: &mut [T]) {
        let l = self.columns::<W>(j);
        let (x, rest) = own[j..].split_at_mut(W);
        let mut shares = [T::default(); W];
        for k in 0..W {
            let known = x[k] / l[k][k];
            for row in k + 1..W {
                x[row] -= l[k][row] * known;
            }
            (x[k], shares[k]) = (known, -known);
        }
        add_columns::<BITS, W, T>(l.map(|l| &l[W..]), shares, rest);
    }

    /// Solves for the `W` unknowns from `j` on, those after them being known.
    #[inline(always)]
    fn substitute<const BITS: usize, const W: usize>(&self, j: usize, own: &mut [T]) {
        let l = self.columns::<W>(j);
        let (x, known) = own[j..].split_at_mut(W);
        let sums = products::<BITS, W, T>(l.map(|l| &l[W..]), known);
        for k in (0..W).rev() {
            let mut value = x[k] - sums[k];
            for row in k + 1..W {
                value -= l[k][row] * x[row];
            }
            x[k] = value / l[k][k];
        }
    }
}

/// Rows that are worked on together, in vector registers.
const LANES: usize = 8;

/// `y += sum_k a_k x_k`: `y` is read once for all of them.
#[inline(always)]
fn add_columns<const BITS: usize, const W: usize, T: Precision>(
    a: [&[T]; W],
    x: [T; W],
    y: &mut [T],
) {
    let a = a.map(|a| a[..y.len()].as_chunks::<LANES>());
    let (whole, rest) = y.as_chunks_mut::<LANES>();
    for (i, y) in whole.iter_mut().enumerate() {
        let mut sums = *y;
        for k in 0..W {
            let a = &a[k].0[i];
            for lane in 0..LANES {
                sums[lane] = a[lane].times_plus::<BITS>(x[k], sums[lane]);
            }
        }
        *y = sums;
    }
    for (i, y) in rest.iter_mut().enumerate() {
        for k in 0..W {
            *y = a[k].1[i].times_plus::<BITS>(x[k], *y);
        }
    }
}

/// `a_k . b` for all columns: `b` is read once for them.
#[inline(always)]
fn products<const BITS: usize, const W: usize, T: Precision>(a: [&[T]; W], b: &[T]) -> [T; W] {
    let a = a.map(|a| a[..b.len()].as_chunks::<LANES>());
    let (whole, rest) = b.as_chunks::<LANES>();
    let mut sums = [[T::default(); LANES]; W];
    for (i, b) in whole.iter().enumerate() {
        for (sums, (a, _)) in sums.iter_mut().zip(a) {
            let a = &a[i];
            for lane in 0..LANES {
                sums[lane] = a[lane].times_plus::<BITS>(b[lane], sums[lane]);
            }
        }
    }
    std::array::from_fn(|k| {
        let head = sums[k].iter().fold(T::default(), |sum, s| sum + *s);
        a[k].1.iter().zip(rest).fold(head, |sum, (a, b)| sum + *a * *b)
    })
}
