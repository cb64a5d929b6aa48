//! A Cholesky factor of the tangent on the degrees of freedom that are not fixed. What hands hold keeps its rows,
//! as those of the identity: a grasp or a release changes values, not the pattern, and needs no new analysis.

use crate::body::BlockPattern;
use crate::linear::{Cholesky, Column, FEW, FactorError, Factorization, Pattern, Precision};

/// A factor with the way from the values of the tangent to its own order.
pub(super) struct TangentFactor<T: Precision> {
    pub(super) cholesky: Cholesky<T>,
    column: Column<T>,
    /// Made when first needed.
    few: Option<Column<T, [T; FEW]>>,
    /// Degree of freedom eliminated at each step.
    dofs: Vec<u32>,
    /// For every entry in elimination order its place in the values of the tangent, and its row and column.
    positions: Vec<u32>,
    ends: Vec<[u32; 2]>,
    /// Diagonal entries in elimination order.
    diagonal: Vec<u32>,
    /// Entries that vanish because their row or column is held, and held diagonal entries.
    silenced: Vec<u32>,
    held: Vec<u32>,
    values: Vec<f64>,
}

impl<T: Precision> TangentFactor<T> {
    /// Analyses the pattern of a body's tangents on the `free` degrees of freedom, ascending.
    pub fn new(blocks: &BlockPattern, free: &[u32]) -> Result<Self, FactorError> {
        let (pattern, positions) = blocks.restrict(free);
        let cholesky = Cholesky::with_precision(&pattern)?;
        let entries: Vec<u32> = (0..pattern.len() as u32).collect();
        let placed = cholesky.place(&entries);
        let of_entries = ends(&pattern, free);
        let ends: Vec<[u32; 2]> = placed.iter().map(|&entry| of_entries[entry as usize]).collect();
        let is_diagonal = |&k: &u32| ends[k as usize][0] == ends[k as usize][1];
        Ok(TangentFactor {
            column: cholesky.column(),
            few: None,
            dofs: cholesky.order().iter().map(|&row| free[row as usize]).collect(),
            positions: placed.iter().map(|&entry| positions[entry as usize]).collect(),
            diagonal: (0..ends.len() as u32).filter(is_diagonal).collect(),
            values: vec![0.0; ends.len()],
            ends,
            silenced: Vec::new(),
            held: Vec::new(),
            cholesky,
        })
    }

    /// Chooses the degrees of freedom that are held from the next factor on.
    pub fn hold(&mut self, is_held: &[bool]) {
        let touches = |&k: &u32| self.ends[k as usize].iter().any(|&dof| is_held[dof as usize]);
        let touched: Vec<u32> = (0..self.ends.len() as u32).filter(touches).collect();
        let is_diagonal = |&k: &u32| self.ends[k as usize][0] == self.ends[k as usize][1];
        (self.held, self.silenced) = touched.into_iter().partition(is_diagonal);
    }

    /// Factorises the tangent with these values and `shift` added to its diagonal.
    pub fn factorize(&mut self, values: &[f64], shift: f64) -> Result<(), FactorError> {
        if shift == 0.0 && self.held.is_empty() {
            let placed = self.positions.iter().map(|&p| values[p as usize]);
            return self.cholesky.factorize_placed(placed).map_err(|e| self.in_dofs(e));
        }
        self.load(values, shift);
        self.cholesky.factorize_placed(self.values.iter().copied()).map_err(|e| self.in_dofs(e))
    }

    /// Takes the tangent of a factor that [`TangentFactor::factorize_part`] makes.
    pub fn begin(&mut self, values: &[f64], shift: f64) -> Result<(), FactorError> {
        self.load(values, shift);
        self.cholesky.begin_placed(self.values.iter().copied())
    }

    /// Does so many multiplications of the factor; returns whether it is complete.
    pub fn factorize_part(&mut self, work: f64) -> Result<bool, FactorError> {
        self.cholesky.factorize_part(work).map_err(|e| self.in_dofs(e))
    }

    /// Multiplications of a factor; none if it cannot be made in parts.
    pub fn work(&self) -> Option<f64> {
        self.cholesky.work()
    }

    /// The matrix that is factorised for these values and `shift`, in elimination order.
    fn load(&mut self, values: &[f64], shift: f64) {
        for (value, &position) in self.values.iter_mut().zip(&self.positions) {
            *value = values[position as usize];
        }
        self.diagonal.iter().for_each(|&k| self.values[k as usize] += shift);
        self.silenced.iter().for_each(|&k| self.values[k as usize] = 0.0);
        self.held.iter().for_each(|&k| {
            self.values[k as usize] = held_diagonal(self.values[k as usize]);
        });
    }

    fn in_dofs(&self, error: FactorError) -> FactorError {
        let dof = |row: usize| {
            let step = self.cholesky.order().iter().position(|&r| r as usize == row);
            step.map_or(row, |step| self.dofs[step] as usize)
        };
        match error {
            FactorError::NotPositiveDefinite { row } => {
                FactorError::NotPositiveDefinite { row: dof(row) }
            }
            FactorError::Singular { row } => FactorError::Singular { row: dof(row) },
            other => other,
        }
    }

    /// `x = K⁻¹ b` on the free degrees of freedom; where `b` is zero on what is held, so is `x`.
    pub fn solve(&mut self, b: &[f64], x: &mut [f64]) -> Result<(), FactorError> {
        self.cholesky.solve_column(&self.dofs, b, x, &mut self.column)
    }

    /// The same in place for columns of all degrees of freedom, `n` each, which are zero on what is held.
    pub fn solve_each(&mut self, columns: &mut [f64], n: usize) -> Result<(), FactorError> {
        let TangentFactor { cholesky, few, dofs, .. } = self;
        let few = few.get_or_insert_with(|| cholesky.few());
        columns.chunks_mut(FEW * n).try_for_each(|some| cholesky.solve_few(dofs, some, n, few))
    }

    /// `K⁻¹` in place for columns of free degrees of freedom, ascending; for as many threads at once as there are.
    pub fn solve_columns(&self, columns: &mut [f64]) -> Result<(), FactorError> {
        self.cholesky.solve(columns, columns.len() / self.dofs.len().max(1))
    }
}

/// Row and column of every entry of a pattern on the `free` degrees of freedom.
pub(super) fn ends(pattern: &Pattern, free: &[u32]) -> Vec<[u32; 2]> {
    let of_column = |column: usize| {
        let rows = pattern.row[pattern.column(column)].iter();
        rows.map(move |&row| [free[row as usize], free[column]])
    };
    (0..pattern.n).flat_map(of_column).collect()
}

/// A diagonal entry of what is held: not zero, so that nothing comes of its row.
pub(super) fn held_diagonal(value: f64) -> f64 {
    value.abs().max(f64::MIN_POSITIVE)
}
