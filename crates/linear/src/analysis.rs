//! Everything a direct solver knows before it sees a value: the elimination order, the supernodes of the
//! factor, and where each of the caller's values goes. Computed once per pattern.

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::SymbolicSupernodalParams;
use faer::sparse::linalg::cholesky::simplicial::{
    prefactorize_symbolic_cholesky, prefactorize_symbolic_cholesky_scratch,
};
use faer::sparse::linalg::cholesky::supernodal::{
    SymbolicSupernodalCholesky, factorize_supernodal_symbolic_cholesky,
    factorize_supernodal_symbolic_cholesky_scratch,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};

use super::substitution::{Panel, zeros};
use super::{FactorError, Pattern, Precision, ordering};
use crate::threads::all_threads;

/// Right-hand sides solved together; the time for each falls steeply up to 32 and hardly beyond 64.
const PANEL: usize = 64;

/// Bytes of a large factor, which faer makes: fronts take two thirds of the time, and as much memory again for what they leave
/// to each other as for the factor.
const LARGE_FROM: usize = 120_000_000;

/// Symbolic factorisation of a pattern, with buffers for the permuted values.
pub(super) struct Analysis<T> {
    /// The caller's row eliminated at each step.
    order: Vec<u32>,
    pub(super) supernodes: SymbolicSupernodalCholesky<u32>,
    pub(super) is_large: bool,
    /// How the numeric factorisation runs.
    pub(super) parallelism: Par,
    /// Lower triangle of the permuted matrix, and its values.
    pub(super) lower: SymbolicSparseColMat<u32>,
    pub(super) values: Vec<T>,
    /// Where the caller's values go in `values`.
    target: Vec<u32>,
}

impl<T: Precision> Analysis<T> {
    /// Orders the pattern and predicts its factor.
    pub(super) fn new(pattern: &Pattern) -> Result<Self, FactorError> {
        pattern.validate()?;
        let order = ordering::elimination_order(pattern)?;
        let (lower, target) = permuted_lower(pattern, &ordering::inverse(&order));
        let supernodes = supernodes_of(&lower)?;
        let is_large = supernodes.len_val() * size_of::<T>() >= LARGE_FROM;
        let parallelism = if is_large { all_threads() } else { Par::Seq };
        let values = zeros(pattern.len())?;
        Ok(Self { order, supernodes, is_large, parallelism, lower, values, target })
    }

    pub(super) fn n(&self) -> usize {
        self.order.len()
    }

    /// The caller's row of an elimination step.
    pub(super) fn row(&self, step: usize) -> usize {
        self.order[step] as usize
    }

    /// Takes new values over into elimination order.
    pub(super) fn load(&mut self, values: &[f64]) -> Result<(), FactorError> {
        FactorError::expect_length("values", self.target.len(), values.len())?;
        for (position, (&value, &target)) in values.iter().zip(&self.target).enumerate() {
            if !value.is_finite() {
                return Err(FactorError::NotFinite { position });
            }
            self.values[target as usize] = T::round(value);
        }
        Ok(())
    }

    /// The caller's row eliminated at each step.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Data of each of the caller's entries, in the order in which [`Analysis::load_placed`] wants the values.
    pub(super) fn place(&self, of_entries: &[u32]) -> Vec<u32> {
        let mut placed = vec![0; of_entries.len()];
        of_entries.iter().zip(&self.target).for_each(|(&data, &t)| placed[t as usize] = data);
        placed
    }

    /// Takes new values over that are in elimination order already.
    pub(super) fn load_placed(
        &mut self,
        values: impl Iterator<Item = f64>,
    ) -> Result<(), FactorError> {
        // A sum is finite if and only if all its terms are, or else it overflows with them.
        let mut sum = 0.0;
        for (place, value) in self.values.iter_mut().zip(values) {
            sum += value;
            *place = T::round(value);
        }
        if f64::is_finite(sum) { Ok(()) } else { Err(self.not_finite()) }
    }

    fn not_finite(&self) -> FactorError {
        let place = self.values.iter().position(|v| !v.is_finite()).unwrap_or_default() as u32;
        let position = self.target.iter().position(|&t| t == place).unwrap_or_default();
        FactorError::NotFinite { position }
    }

    /// The loaded matrix in elimination order, lower triangle.
    pub(super) fn matrix(&self) -> SparseColMatRef<'_, u32, T> {
        SparseColMatRef::new(self.lower.as_ref(), &self.values)
    }

    /// The loaded diagonal value of an elimination step.
    pub(super) fn diagonal(&self, step: usize) -> T {
        self.values[self.lower.col_ptr()[step] as usize]
    }

    /// Every step with its pivot position in the values of a factor.
    pub(super) fn pivots(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let symbolic = &self.supernodes;
        (0..symbolic.n_supernodes()).flat_map(move |s| {
            let (begin, end) =
                (symbolic.supernode_begin()[s] as usize, symbolic.supernode_end()[s] as usize);
            let first = symbolic.col_ptr_for_val()[s] as usize;
            let rows = end - begin + symbolic.supernode(s).pattern().len();
            (begin..end).map(move |step| (step, first + (step - begin) * (rows + 1)))
        })
    }

    /// Runs `substitute` on the right-hand sides in elimination order, a panel at a time.
    pub(super) fn solve(
        &self,
        rhs: &mut [f64],
        columns: usize,
        substitute: impl Fn(&mut Panel<T>) -> Result<(), FactorError>,
    ) -> Result<(), FactorError> {
        let n = self.n();
        FactorError::expect_length("rhs", n * columns, rhs.len())?;
        if let Some(at) = rhs.iter().position(|value| !value.is_finite()) {
            let (row, column) = (at % n, at / n);
            return Err(FactorError::RightHandSideNotFinite { row, column });
        }
        if rhs.is_empty() {
            return Ok(());
        }
        let width = columns.min(PANEL);
        let mut panel = Panel::new(&self.supernodes, width)?;
        for block in rhs.chunks_mut(n * width) {
            panel.gather(block, &self.order);
            substitute(&mut panel)?;
            panel.scatter(block, &self.order);
        }
        match rhs.iter().position(|value| !value.is_finite()) {
            Some(at) => Err(FactorError::SolutionNotFinite { row: at % n, column: at / n }),
            None => Ok(()),
        }
    }
}

impl Analysis<f64> {
    /// Largest row sum of the absolute values of the loaded matrix.
    pub(super) fn norm(&self) -> f64 {
        let mut sums = vec![0.0; self.n()];
        self.for_each_loaded(|row, column, value| {
            sums[column] += value.abs();
            if row != column {
                sums[row] += value.abs();
            }
        });
        sums.into_iter().fold(0.0, f64::max)
    }

    /// `panel -= A x` with the loaded matrix, `x` laid out like the panel.
    pub(super) fn subtract_product(&self, x: &[f64], panel: &mut Panel<f64>) {
        let width = panel.width;
        let mut subtract = |row: usize, column: usize, value: f64| {
            let y = &mut panel.values[row * width..][..width];
            let x = &x[column * width..][..width];
            y.iter_mut().zip(x).for_each(|(y, x)| *y -= value * x);
        };
        self.for_each_loaded(|row, column, value| {
            subtract(row, column, value);
            if row != column {
                subtract(column, row, value);
            }
        });
    }

    fn for_each_loaded(&self, mut visit: impl FnMut(usize, usize, f64)) {
        for column in 0..self.n() {
            for entry in self.lower.col_range(column) {
                visit(self.lower.row_idx()[entry] as usize, column, self.values[entry]);
            }
        }
    }
}

/// Lower triangle of the permuted pattern, and the place there of every entry of the caller's pattern.
fn permuted_lower(pattern: &Pattern, position: &[u32]) -> (SymbolicSparseColMat<u32>, Vec<u32>) {
    let n = pattern.n;
    let permuted = |column: usize, entry: usize| {
        let (a, b) = (position[pattern.row[entry] as usize], position[column]);
        (a.min(b) as usize, a.max(b) as usize)
    };
    // Two bucket sorts, by row and then stably by column, leave every column ascending.
    let mut by_row = vec![(0u32, 0u32); pattern.len()];
    let mut next = vec![0usize; n + 1];
    for_each_entry(pattern, |column, entry| next[permuted(column, entry).1 + 1] += 1);
    accumulate(&mut next);
    for_each_entry(pattern, |column, entry| {
        let (left, row) = permuted(column, entry);
        by_row[next[row]] = (left as u32, entry as u32);
        next[row] += 1;
    });
    let mut start = vec![0usize; n + 1];
    by_row.iter().for_each(|&(column, _)| start[column as usize + 1] += 1);
    accumulate(&mut start);
    let column_start: Vec<u32> = start.iter().map(|&offset| offset as u32).collect();
    let (mut rows, mut target) = (vec![0u32; pattern.len()], vec![0u32; pattern.len()]);
    let mut row = 0;
    for (index, &(column, entry)) in by_row.iter().enumerate() {
        while index >= next[row] {
            row += 1;
        }
        let place = &mut start[column as usize];
        rows[*place] = row as u32;
        target[entry as usize] = *place as u32;
        *place += 1;
    }
    (SymbolicSparseColMat::new_checked(n, n, column_start, None, rows), target)
}

fn for_each_entry(pattern: &Pattern, mut visit: impl FnMut(usize, usize)) {
    for column in 0..pattern.n {
        for entry in pattern.column(column) {
            visit(column, entry);
        }
    }
}

fn accumulate(counts: &mut [usize]) {
    for i in 1..counts.len() {
        counts[i] += counts[i - 1];
    }
}

/// Supernodes of the factor of a matrix given by its lower triangle.
fn supernodes_of(
    lower: &SymbolicSparseColMat<u32>,
) -> Result<SymbolicSupernodalCholesky<u32>, FactorError> {
    let n = lower.ncols();
    let too_large = |_| FactorError::TooLarge { n };
    // faer predicts from the upper triangle and factorises from the lower one.
    let upper = lower.as_ref().transpose().to_col_major().map_err(|_| FactorError::OutOfMemory)?;
    let request = prefactorize_symbolic_cholesky_scratch::<u32>(n, upper.row_idx().len())
        .or(factorize_supernodal_symbolic_cholesky_scratch::<u32>(n));
    let mut memory = MemBuffer::try_new(request).map_err(|_| FactorError::OutOfMemory)?;
    let stack = MemStack::new(&mut memory);
    let (mut tree, mut counts) = (vec![0i32; n], vec![0u32; n]);
    let tree = prefactorize_symbolic_cholesky(&mut tree, &mut counts, upper.as_ref(), stack);
    let parameters = SymbolicSupernodalParams::default();
    factorize_supernodal_symbolic_cholesky(upper.as_ref(), tree, &counts, stack, parameters)
        .map_err(too_large)
}
