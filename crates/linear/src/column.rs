//! One right-hand side, or a few side by side, through a supernodal Cholesky factor, without allocation: what a frame
//! asks for.
//!
//! The factor is read once forward and once backward, four of its columns at a time, from the diagonal to the last row;
//! it is the traffic of the factor that takes the time, and a dense kernel called for each supernode takes as long again.
//! So a few right-hand sides take hardly longer than one.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

use super::Precision;
use super::entry::Entry;
use super::substitution::{Factor, Supernode};
use viscera_number::simd::{WideKernel, dispatch_wide};

/// Columns of the factor that are read together.
const WIDTH: usize = 4;

/// Right-hand sides that are solved side by side.
pub const FEW: usize = 4;

/// Right-hand sides in elimination order, an entry `V` for each row, with room for the rows of one supernode.
pub struct Column<T, V = T> {
    values: Vec<V>,
    own: Vec<V>,
    of: std::marker::PhantomData<T>,
}

impl<T: Precision, V: Entry<T>> Column<T, V> {
    pub(super) fn new(symbolic: &SymbolicSupernodalCholesky<u32>) -> Self {
        let columns = |s: usize| symbolic.supernode_end()[s] - symbolic.supernode_begin()[s];
        let height = |s: usize| columns(s) as usize + symbolic.supernode(s).pattern().len();
        let tallest = (0..symbolic.n_supernodes()).map(height).max().unwrap_or(0);
        let (values, own) = (vec![V::default(); symbolic.nrows()], vec![V::default(); tallest]);
        Self { values, own, of: std::marker::PhantomData }
    }
}

impl<T: Precision> Column<T> {
    /// `x[rows] = L⁻ᵀ L⁻¹ b[rows]`, scaled to stay within the range of `T`.
    pub(super) fn solve(&mut self, factor: &Factor<'_, T>, rows: &[u32], b: &[f64], x: &mut [f64]) {
        let scale = size_of(rows, b);
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

impl<T: Precision> Column<T, [T; FEW]> {
    /// The same in place for up to [`FEW`] columns of `n` numbers, one after the other.
    pub(super) fn solve(
        &mut self,
        factor: &Factor<'_, T>,
        rows: &[u32],
        columns: &mut [f64],
        n: usize,
    ) {
        let mut scales = [1.0; FEW];
        for (scale, column) in scales.iter_mut().zip(columns.chunks_exact(n)) {
            *scale = size_of(rows, column);
        }
        self.values.fill([T::default(); FEW]);
        for (k, column) in columns.chunks_exact(n).enumerate() {
            let inverse = scales[k].recip();
            for (value, &row) in self.values.iter_mut().zip(rows) {
                value[k] = T::round(column[row as usize] * inverse);
            }
        }
        dispatch_wide(Substitution { factor, column: self });
        for (k, column) in columns.chunks_exact_mut(n).enumerate() {
            for (value, &row) in self.values.iter().zip(rows) {
                column[row as usize] = value[k].double() * scales[k];
            }
        }
    }
}

/// The largest of some rows, by which they are divided; 1 if all are zero.
fn size_of(rows: &[u32], b: &[f64]) -> f64 {
    let largest = rows.iter().fold(0.0, |max: f64, &row| max.max(b[row as usize].abs()));
    if largest > 0.0 { largest } else { 1.0 }
}

struct Substitution<'a, T, V> {
    factor: &'a Factor<'a, T>,
    column: &'a mut Column<T, V>,
}

impl<T: Precision, V: Entry<T>> WideKernel for Substitution<'_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Column { values, own, .. } = self.column;
        let n_supernodes = self.factor.symbolic.n_supernodes();
        for s in 0..n_supernodes {
            self.factor.supernode(s).forward::<BITS, V>(values, own);
        }
        for s in (0..n_supernodes).rev() {
            self.factor.supernode(s).backward::<BITS, V>(values, own);
        }
    }
}

impl<'a, T: Precision> Supernode<'a, T> {
    /// `x <- L⁻¹ x` within this supernode, and its share taken from the rows below.
    #[inline(always)]
    fn forward<const BITS: usize, V: Entry<T>>(&self, values: &mut [V], own: &mut [V]) {
        let (top, below) = own[..self.height].split_at_mut(self.columns);
        top.copy_from_slice(&values[self.first..][..self.columns]);
        below.fill(V::default());
        let own = &mut own[..self.height];
        let whole = self.columns - self.columns % WIDTH;
        for j in (0..whole).step_by(WIDTH) {
            self.eliminate::<BITS, WIDTH, V>(j, own);
        }
        for j in whole..self.columns {
            self.eliminate::<BITS, 1, V>(j, own);
        }
        let (top, below) = own.split_at(self.columns);
        values[self.first..][..self.columns].copy_from_slice(top);
        for (&row, share) in self.rows_below.iter().zip(below) {
            values[row as usize] = values[row as usize].plus(*share);
        }
    }

    /// `x <- L⁻ᵀ x` within this supernode, the rows below being known.
    #[inline(always)]
    fn backward<const BITS: usize, V: Entry<T>>(&self, values: &mut [V], own: &mut [V]) {
        let own = &mut own[..self.height];
        let (top, below) = own.split_at_mut(self.columns);
        top.copy_from_slice(&values[self.first..][..self.columns]);
        for (value, &row) in below.iter_mut().zip(self.rows_below) {
            *value = values[row as usize];
        }
        let whole = self.columns - self.columns % WIDTH;
        for j in (whole..self.columns).rev() {
            self.substitute::<BITS, 1, V>(j, own);
        }
        for j in (0..whole).step_by(WIDTH).rev() {
            self.substitute::<BITS, WIDTH, V>(j, own);
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
    fn eliminate<const BITS: usize, const W: usize, V: Entry<T>>(&self, j: usize, own: &mut [V]) {
        let l = self.columns::<W>(j);
        let (x, rest) = own[j..].split_at_mut(W);
        for k in 0..W {
            x[k] = x[k].over(l[k][k]);
            for row in k + 1..W {
                x[row] = x[row].minus_times(l[k][row], x[k]);
            }
        }
        let shares = std::array::from_fn(|k| V::default().minus(x[k]));
        V::add_columns::<BITS, W>(l.map(|l| &l[W..]), shares, rest);
    }

    /// Solves for the `W` unknowns from `j` on, those after them being known.
    #[inline(always)]
    fn substitute<const BITS: usize, const W: usize, V: Entry<T>>(&self, j: usize, own: &mut [V]) {
        let l = self.columns::<W>(j);
        let (x, known) = own[j..].split_at_mut(W);
        let sums = V::products::<BITS, W>(l.map(|l| &l[W..]), known);
        for k in (0..W).rev() {
            let mut value = x[k].minus(sums[k]);
            for row in k + 1..W {
                value = value.minus_times(l[k][row], x[row]);
            }
            x[k] = value.over(l[k][k]);
        }
    }
}
