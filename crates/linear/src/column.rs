//! One right-hand side, or a few side by side, through a supernodal Cholesky factor, without allocation: what a frame
//! asks for.
//!
//! The factor is read once forward and once backward, four of its columns at a time, from the diagonal to the last row;
//! it is the traffic of the factor that takes the time, and a dense kernel called for each supernode takes as long again.
//! So a few right-hand sides take hardly longer than one.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

use super::Precision;
use super::entry::Entry;
use super::substitution::{Factor, Supernode};
use super::subtrees::{Subtree, Subtrees};
use super::tree::shape;
use crate::threads::may_cut;
use viscera_number::simd::{WideKernel, dispatch_wide};

/// Columns of the factor that are read together.
const WIDTH: usize = 4;

/// Entries of the factor that one thread reads in a piece: in some hundred microseconds, while to wake another takes some
/// ten. There are as many pieces for one thread, so that sums are the same.
const GRAIN: usize = 500_000;

/// Right-hand sides that are solved side by side.
pub const FEW: usize = 4;

/// Right-hand sides in elimination order, an entry `V` for each row, with room for the rows of one supernode at a time.
pub struct Column<T, V = T> {
    subtrees: Subtrees,
    /// One for each subtree.
    rooms: Vec<Room<V>>,
    of: std::marker::PhantomData<T>,
}

/// Where one thread works on a subtree.
struct Room<V> {
    /// Its rows, in its own numbers.
    values: Vec<V>,
    /// Those of one supernode.
    own: Vec<V>,
}

impl<T: Precision, V: Entry<T>> Column<T, V> {
    pub(super) fn new(symbolic: &SymbolicSupernodalCholesky<u32>) -> Self {
        Self::cut(symbolic, Subtrees::new(symbolic, GRAIN))
    }

    fn cut(symbolic: &SymbolicSupernodalCholesky<u32>, subtrees: Subtrees) -> Self {
        let height = |s: usize| {
            let (_, columns, below) = shape(symbolic, s);
            columns + below
        };
        let room = |subtree: &Subtree| Room {
            values: vec![V::default(); subtree.columns.len() + subtree.below],
            own: vec![V::default(); subtree.supernodes.clone().map(height).max().unwrap_or(0)],
        };
        let rooms = subtrees.all.iter().map(room).collect();
        Self { subtrees, rooms, of: std::marker::PhantomData }
    }

    /// Each entry with the row of the caller that it is for.
    fn entries<'a>(&'a mut self, rows: &'a [u32]) -> impl Iterator<Item = (&'a mut V, usize)> {
        self.subtrees.all.iter().zip(&mut self.rooms).flat_map(|(subtree, room)| {
            let rows = &rows[subtree.columns.clone()];
            room.values.iter_mut().zip(rows).map(|(value, &row)| (value, row as usize))
        })
    }

    /// `L⁻ᵀ L⁻¹` times what there is; threads share the work if they may.
    fn substitute(&mut self, factor: &Factor<'_, T>) {
        let is_shared = self.rooms.len() > 1 && may_cut();
        self.substitute_in_pieces(factor, is_shared);
    }

    fn substitute_in_pieces(&mut self, factor: &Factor<'_, T>, is_shared: bool) {
        let Self { subtrees, rooms, .. } = self;
        let solution = Substitution { factor, subtrees, is_shared };
        subtrees.each(&subtrees.roots, rooms, is_shared, &|subtree, rooms| {
            solution.forward(subtree, rooms);
            solution.backward(subtree, rooms);
        });
    }
}

impl<T: Precision> Column<T> {
    /// `x[rows] = L⁻ᵀ L⁻¹ b[rows]`, scaled to stay within the range of `T`.
    pub(super) fn solve(&mut self, factor: &Factor<'_, T>, rows: &[u32], b: &[f64], x: &mut [f64]) {
        let scale = size_of(rows, b);
        let inverse = scale.recip();
        self.entries(rows).for_each(|(value, row)| *value = T::round(b[row] * inverse));
        self.substitute(factor);
        self.entries(rows).for_each(|(value, row)| x[row] = value.double() * scale);
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
        self.entries(rows).for_each(|(value, _)| *value = Default::default());
        for (k, column) in columns.chunks_exact(n).enumerate() {
            let inverse = scales[k].recip();
            self.entries(rows).for_each(|(value, row)| value[k] = T::round(column[row] * inverse));
        }
        self.substitute(factor);
        for (k, column) in columns.chunks_exact_mut(n).enumerate() {
            self.entries(rows).for_each(|(value, row)| column[row] = value[k].double() * scales[k]);
        }
    }
}

/// The largest of some rows, by which they are divided; 1 if all are zero.
fn size_of(rows: &[u32], b: &[f64]) -> f64 {
    let largest = rows.iter().fold(0.0, |max: f64, &row| max.max(b[row as usize].abs()));
    if largest > 0.0 { largest } else { 1.0 }
}

/// A factor and its subtrees.
struct Substitution<'a, T> {
    factor: &'a Factor<'a, T>,
    subtrees: &'a Subtrees,
    is_shared: bool,
}

impl<T: Precision> Substitution<'_, T> {
    /// `x <- L⁻¹ x` in a subtree: those below it first, side by side, and then its own supernodes with what they leave to
    /// it. The last room is its own.
    fn forward<V: Entry<T>>(&self, subtree: &Subtree, rooms: &mut [Room<V>]) {
        let Some((room, below)) = rooms.split_last_mut() else { return };
        let forward = |child: &Subtree, rooms: &mut [Room<V>]| self.forward(child, rooms);
        self.subtrees.each(&subtree.children, below, self.is_shared, &forward);
        room.values[subtree.columns.len()..].fill(V::default());
        for (child, values) in self.left(subtree, below) {
            for (&row, share) in child.above.iter().zip(values) {
                let value = &mut room.values[row as usize];
                *value = value.plus(*share);
            }
        }
        dispatch_wide(Forward { factor: self.factor, subtree, room });
    }

    /// `x <- L⁻ᵀ x` in a subtree whose rows below are known.
    fn backward<V: Entry<T>>(&self, subtree: &Subtree, rooms: &mut [Room<V>]) {
        let Some((room, below)) = rooms.split_last_mut() else { return };
        dispatch_wide(Backward { factor: self.factor, subtree, room });
        for (child, values) in self.left(subtree, below) {
            for (value, &row) in values.iter_mut().zip(&child.above) {
                *value = room.values[row as usize];
            }
        }
        let backward = |child: &Subtree, rooms: &mut [Room<V>]| self.backward(child, rooms);
        self.subtrees.each(&subtree.children, below, self.is_shared, &backward);
    }

    /// The subtrees right below one, with the values of their rows below.
    fn left<'b, V>(
        &'b self,
        subtree: &'b Subtree,
        rooms: &'b mut [Room<V>],
    ) -> impl Iterator<Item = (&'b Subtree, &'b mut [V])> {
        let mut rest = rooms;
        subtree.children.iter().map(move |&child| {
            let child = &self.subtrees.all[child];
            let (its, others) = std::mem::take(&mut rest).split_at_mut(child.size);
            rest = others;
            (child, &mut its[child.size - 1].values[child.columns.len()..])
        })
    }
}

/// The supernodes of one subtree, in elimination order.
struct Forward<'a, T, V> {
    factor: &'a Factor<'a, T>,
    subtree: &'a Subtree,
    room: &'a mut Room<V>,
}

impl<T: Precision, V: Entry<T>> WideKernel for Forward<'_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Room { values, own } = self.room;
        let mut rows = &self.subtree.rows[..];
        for s in self.subtree.supernodes.clone() {
            let (below, rest) = rows.split_at(self.factor.supernode(s).rows_below.len());
            let supernode = self.factor.supernode(s).within(&self.subtree.columns, below);
            supernode.forward::<BITS, V>(values, own);
            rows = rest;
        }
    }
}

/// The same, backwards.
struct Backward<'a, T, V> {
    factor: &'a Factor<'a, T>,
    subtree: &'a Subtree,
    room: &'a mut Room<V>,
}

impl<T: Precision, V: Entry<T>> WideKernel for Backward<'_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Room { values, own } = self.room;
        let mut rows = &self.subtree.rows[..];
        for s in self.subtree.supernodes.clone().rev() {
            let n = self.factor.supernode(s).rows_below.len();
            let (rest, below) = rows.split_at(rows.len() - n);
            let supernode = self.factor.supernode(s).within(&self.subtree.columns, below);
            supernode.backward::<BITS, V>(values, own);
            rows = rest;
        }
    }
}

impl<'a, T: Precision> Supernode<'a, T> {
    /// In the numbers of a subtree that has these columns: its rows below are given.
    #[inline(always)]
    fn within(self, columns: &Range<usize>, rows_below: &'a [u32]) -> Self {
        Self { first: self.first - columns.start, rows_below, ..self }
    }

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

#[cfg(test)]
mod tests {
    use super::super::test_matrices::{elastic_block, load, relative_difference};
    use super::super::{Cholesky, Factorization};
    use super::*;

    /// A factor of some hundred rows in pieces of a few entries, and the solution of a panel beside it.
    fn in_pieces() -> (Cholesky<f64>, Column<f64>, Vec<f64>, Vec<f64>) {
        let matrix = elastic_block(9, 8, 7);
        let mut cholesky = Cholesky::analyze(&matrix.pattern).unwrap();
        cholesky.factorize(&matrix.values).unwrap();
        let supernodes = &cholesky.analysis.supernodes;
        let column = Column::cut(supernodes, Subtrees::new(supernodes, 2_000));
        assert!(column.rooms.len() > 8);
        let b = load(matrix.pattern.n, 0);
        let mut x = b.clone();
        cholesky.solve(&mut x, 1).unwrap();
        (cholesky, column, b, x)
    }

    fn solved(cholesky: &Cholesky<f64>, column: &mut Column<f64>, b: &[f64]) -> Vec<f64> {
        let mut x = vec![f64::NAN; b.len()];
        cholesky.solve_column(cholesky.order(), b, &mut x, column).unwrap();
        x
    }

    #[test]
    fn pieces_solve_as_the_whole_does() {
        let (cholesky, mut column, b, expected) = in_pieces();
        for _ in 0..2 {
            assert!(relative_difference(&solved(&cholesky, &mut column, &b), &expected) < 1e-12);
        }
        let whole = solved(&cholesky, &mut cholesky.column(), &b);
        assert!(relative_difference(&whole, &expected) < 1e-12);
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let (cholesky, mut column, b, _) = in_pieces();
        let alone = solved(&cholesky, &mut column, &b);
        let rows = cholesky.order();
        for threads in 1..5 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let scale = size_of(rows, &b);
            column.entries(rows).for_each(|(value, row)| *value = b[row] * scale.recip());
            pool.install(|| column.substitute_in_pieces(&cholesky.factor_for(rows).unwrap(), true));
            assert!(column.entries(rows).all(|(value, row)| *value * scale == alone[row]));
        }
    }
}
