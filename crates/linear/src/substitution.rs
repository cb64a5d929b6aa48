//! Forward and backward substitution through a supernodal factor, for a panel of right-hand sides.
//!
//! A panel keeps the right-hand sides of one row side by side, so that the gathers and scatters
//! between supernodes move contiguous runs. faer's own solve walks them column by column and takes
//! half as long again for a panel of 64.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_unit_lower_triangular_in_place,
    solve_unit_upper_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::{Accum, MatMut, MatRef, Par};

use super::{FactorError, Precision};

/// Right-hand sides in elimination order, `n x width`, row-major, with room for one supernode's update.
pub(super) struct Panel<T> {
    pub width: usize,
    pub values: Vec<T>,
    update: Vec<T>,
}

impl<T: Precision> Panel<T> {
    pub fn new(
        symbolic: &SymbolicSupernodalCholesky<u32>,
        width: usize,
    ) -> Result<Self, FactorError> {
        let rows_below = |s| symbolic.supernode(s).pattern().len();
        let tallest = (0..symbolic.n_supernodes()).map(rows_below).max().unwrap_or(0);
        let values = zeros(symbolic.nrows() * width)?;
        Ok(Self { width, values, update: zeros(tallest * width)? })
    }

    /// Takes over as many columns as `rhs` holds, at most those the panel was made for.
    pub fn gather(&mut self, rhs: &[f64], order: &[u32]) {
        let n = order.len();
        self.width = rhs.len() / n;
        self.values.truncate(rhs.len());
        for (x, &row) in self.values.chunks_exact_mut(self.width).zip(order) {
            for (x, b) in x.iter_mut().zip(rhs.chunks_exact(n)) {
                *x = T::round(b[row as usize]);
            }
        }
    }

    /// Gives the columns back in the caller's order of rows.
    pub fn scatter(&self, rhs: &mut [f64], order: &[u32]) {
        for (x, &row) in self.values.chunks_exact(self.width).zip(order) {
            for (x, b) in x.iter().zip(rhs.chunks_exact_mut(order.len())) {
                b[row as usize] = x.double();
            }
        }
    }

    fn rows(&mut self, first: usize, count: usize) -> MatMut<'_, T> {
        let rows = &mut self.values[first * self.width..][..count * self.width];
        MatMut::from_row_major_slice_mut(rows, count, self.width)
    }
}

impl Panel<f64> {
    /// Largest entry of this panel, taken as a residual, over that of `|A| |x| + |b|`, for the worst column.
    pub fn backward_error(&self, solution: &[f64], rhs: &[f64], norm: f64) -> f64 {
        if !self.values.iter().chain(solution).all(|value| value.is_finite()) {
            return f64::INFINITY;
        }
        let largest = |values: &[f64], column: usize| {
            let entries = values.iter().skip(column).step_by(self.width);
            entries.fold(0.0, |largest, value| f64::max(largest, value.abs()))
        };
        let error_of = |column| match largest(&self.values, column) {
            0.0 => 0.0,
            residual => residual / (norm * largest(solution, column) + largest(rhs, column)),
        };
        (0..self.width).map(error_of).fold(0.0, f64::max)
    }

    /// Divides every row by its own divisor.
    pub fn divide_rows(&mut self, divisors: &[f64]) {
        for (x, divisor) in self.values.chunks_exact_mut(self.width).zip(divisors) {
            x.iter_mut().for_each(|x| *x /= divisor);
        }
    }
}

/// Zeros, or the memory's refusal as an error. The system has pages of zeros: none is written before its time.
pub(super) fn zeros<T: Precision>(len: usize) -> Result<Vec<T>, FactorError> {
    // Asked first, since `vec!` ends the process where there is no memory.
    Vec::<T>::new().try_reserve_exact(len).map_err(|_| FactorError::OutOfMemory)?;
    Ok(vec![T::default(); len])
}

/// A lower triangular factor by supernodes: the diagonal block on top of the rows below it, column-major.
#[derive(Clone, Copy)]
pub(super) struct Factor<'a, T> {
    pub symbolic: &'a SymbolicSupernodalCholesky<u32>,
    pub values: &'a [T],
    /// Whether the diagonal counts as one, its place being taken by the `D` of `L D Lᵀ`.
    pub has_unit_diagonal: bool,
}

/// Columns of a factor with the same rows below their triangle.
pub(super) struct Supernode<'a, T> {
    pub first: usize,
    pub columns: usize,
    pub rows_below: &'a [u32],
    /// Column-major, `height` rows; what lies above the diagonal means nothing.
    pub block: &'a [T],
    pub height: usize,
}

impl<'a, T: Precision> Supernode<'a, T> {
    /// The triangle on top, and the rows below.
    fn parts(&self) -> (MatRef<'a, T>, MatRef<'a, T>) {
        let Supernode { columns, block, height, .. } = *self;
        MatRef::from_column_major_slice(block, height, columns).split_at_row(columns)
    }
}

impl<'a, T: Precision> Factor<'a, T> {
    /// `panel <- L⁻¹ panel`.
    pub fn forward(&self, panel: &mut Panel<T>) {
        for s in 0..self.symbolic.n_supernodes() {
            let supernode = self.supernode(s);
            let Supernode { first, rows_below, .. } = supernode;
            let (top, below) = supernode.parts();
            let mut update = std::mem::take(&mut panel.update);
            let width = panel.width;
            let mut x = panel.rows(first, top.ncols());
            if self.has_unit_diagonal {
                solve_unit_lower_triangular_in_place(top, x.as_mut(), Par::Seq);
            } else {
                solve_lower_triangular_in_place(top, x.as_mut(), Par::Seq);
            }
            let known = &mut update[..rows_below.len() * width];
            let product = MatMut::from_row_major_slice_mut(known, rows_below.len(), width);
            matmul(product, Accum::Replace, below, x.as_ref(), T::round(1.0), Par::Seq);
            for (&row, known) in rows_below.iter().zip(known.chunks_exact(width)) {
                let x = &mut panel.values[row as usize * width..][..width];
                x.iter_mut().zip(known).for_each(|(x, known)| *x -= *known);
            }
            panel.update = update;
        }
    }

    /// `panel <- L⁻ᵀ panel`.
    pub fn backward(&self, panel: &mut Panel<T>) {
        for s in (0..self.symbolic.n_supernodes()).rev() {
            let supernode = self.supernode(s);
            let Supernode { first, rows_below, .. } = supernode;
            let (top, below) = supernode.parts();
            let mut update = std::mem::take(&mut panel.update);
            let width = panel.width;
            let known = &mut update[..rows_below.len() * width];
            for (&row, known) in rows_below.iter().zip(known.chunks_exact_mut(width)) {
                known.copy_from_slice(&panel.values[row as usize * width..][..width]);
            }
            let known = MatRef::from_row_major_slice(known, rows_below.len(), width);
            let mut x = panel.rows(first, top.ncols());
            matmul(x.as_mut(), Accum::Add, below.transpose(), known, T::round(-1.0), Par::Seq);
            if self.has_unit_diagonal {
                solve_unit_upper_triangular_in_place(top.transpose(), x, Par::Seq);
            } else {
                solve_upper_triangular_in_place(top.transpose(), x, Par::Seq);
            }
            panel.update = update;
        }
    }

    #[inline(always)]
    pub fn supernode(&self, s: usize) -> Supernode<'a, T> {
        let symbolic = self.symbolic;
        let first = symbolic.supernode_begin()[s] as usize;
        let columns = symbolic.supernode_end()[s] as usize - first;
        let rows_below = symbolic.supernode(s).pattern();
        let offsets = symbolic.col_ptr_for_val();
        let block = &self.values[offsets[s] as usize..offsets[s + 1] as usize];
        Supernode { first, columns, rows_below, block, height: columns + rows_below.len() }
    }
}

impl Factor<'_, f64> {
    /// `sum_k L_ik² |d_k|` over `k < i` for every row `i`: the diagonal of `|L| |D| |Lᵀ|` less the pivot.
    pub fn weighted_row_squares(&self, weights: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; weights.len()];
        for s in 0..self.symbolic.n_supernodes() {
            let supernode = self.supernode(s);
            let Supernode { first, rows_below, .. } = supernode;
            let (top, below) = supernode.parts();
            for column in 0..top.ncols() {
                let weight = weights[first + column].abs();
                for row in column + 1..top.nrows() {
                    sums[first + row] += top[(row, column)].powi(2) * weight;
                }
                for (i, &row) in rows_below.iter().enumerate() {
                    sums[row as usize] += below[(i, column)].powi(2) * weight;
                }
            }
        }
        sums
    }
}
