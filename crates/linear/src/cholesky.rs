//! `A = L Lᵀ` for positive definite matrices: supernodal, front by front or, where it is large, by faer. A pivot that is
//! not positive is an answer, not an accident: the equilibrium is unstable or a part of the body is not held.

use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::cholesky::supernodal::{
    factorize_supernodal_numeric_llt, factorize_supernodal_numeric_llt_scratch,
};

use super::analysis::Analysis;
use super::column::{Column, FEW};
use super::elimination::Elimination;
use super::substitution::{Factor, zeros};
use super::{FactorError, Factorization, Pattern, Precision};

/// Sparse Cholesky factorisation with a symbolic analysis done once; in single precision, `Cholesky<f32>`, a
/// preconditioner.
pub struct Cholesky<T: Precision = f64> {
    pub(super) analysis: Analysis<T>,
    pub(super) factor: Vec<T>,
    pub(super) elimination: Elimination<T>,
    pub(super) is_factorized: bool,
    /// Fronts of the factor in hand that are done.
    pub(super) done: usize,
}

impl Cholesky {
    /// Orders the pattern and allocates everything that [`Factorization::factorize`] needs.
    ///
    /// # Errors
    /// An invalid pattern, or a factor too large to number or to hold.
    pub fn analyze(pattern: &Pattern) -> Result<Self, FactorError> {
        Self::with_precision(pattern)
    }
}

impl<T: Precision> Cholesky<T> {
    /// [`Cholesky::analyze`] for a factor in any precision.
    ///
    /// # Errors
    /// Those of [`Cholesky::analyze`].
    pub fn with_precision(pattern: &Pattern) -> Result<Self, FactorError> {
        Self::with_analysis(Analysis::new(pattern)?)
    }

    fn with_analysis(analysis: Analysis<T>) -> Result<Self, FactorError> {
        let elimination = Elimination::new(&analysis, |analysis| {
            let Analysis { supernodes, parallelism, .. } = analysis;
            factorize_supernodal_numeric_llt_scratch::<u32, T>(
                supernodes,
                *parallelism,
                Default::default(),
            )
        })?;
        let factor = zeros(analysis.supernodes.len_val())?;
        Ok(Self { analysis, factor, elimination, is_factorized: false, done: 0 })
    }

    /// The caller's row eliminated at each step.
    pub fn order(&self) -> &[u32] {
        self.analysis.order()
    }

    /// Data of each entry of the pattern in the order in which [`Cholesky::factorize_placed`] wants the values.
    pub fn place(&self, of_entries: &[u32]) -> Vec<u32> {
        self.analysis.place(of_entries)
    }

    /// [`Factorization::factorize`] with values that come in the order of [`Cholesky::place`]: no copy between.
    ///
    /// # Errors
    /// Those of [`Factorization::factorize`].
    pub fn factorize_placed(
        &mut self,
        values: impl Iterator<Item = f64>,
    ) -> Result<(), FactorError> {
        self.is_factorized = false;
        self.analysis.load_placed(values)?;
        self.eliminate()
    }

    /// Takes the values of a factor that [`Cholesky::factorize_part`] makes, and forgets the one before.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn begin_placed(&mut self, values: impl Iterator<Item = f64>) -> Result<(), FactorError> {
        (self.is_factorized, self.done) = (false, 0);
        self.analysis.load_placed(values)
    }

    /// Does so many multiplications of the factor that was begun, about; returns whether it is complete. A factor that
    /// faer makes is made at once.
    ///
    /// # Errors
    /// Those of [`Factorization::factorize`].
    pub fn factorize_part(&mut self, work: f64) -> Result<bool, FactorError> {
        let Elimination::Fronts(fronts) = &mut self.elimination else {
            return self.eliminate().map(|()| true);
        };
        let values = &self.analysis.values;
        match fronts.factorize_part(&mut self.done, work, values, &mut self.factor) {
            Ok(false) => Ok(false),
            whole => self.judge(whole.map(|_| ())).map(|()| true),
        }
    }

    /// Multiplications of a factor, about; none if it cannot be made in parts.
    pub fn work(&self) -> Option<f64> {
        match &self.elimination {
            Elimination::Fronts(fronts) => Some(fronts.work()),
            Elimination::Shared(_) => None,
        }
    }

    /// Room for [`Cholesky::solve_column`].
    pub fn column(&self) -> Column<T> {
        Column::new(&self.analysis.supernodes)
    }

    /// Room for [`Cholesky::solve_few`].
    pub fn few(&self) -> Column<T, [T; FEW]> {
        Column::new(&self.analysis.supernodes)
    }

    /// Solves for one right-hand side without allocation: row `rows[k]` of `b` and `x` is eliminated at step `k`;
    /// rows that are not listed stay as they are. A solution that is not finite is the caller's to notice.
    ///
    /// # Errors
    /// A missing factor.
    pub fn solve_column(
        &self,
        rows: &[u32],
        b: &[f64],
        x: &mut [f64],
        column: &mut Column<T>,
    ) -> Result<(), FactorError> {
        column.solve(&self.factor_for(rows)?, rows, b, x);
        Ok(())
    }

    /// The same in place for a few right-hand sides of `n` numbers, one after the other, in hardly more time: at most
    /// [`FEW`].
    ///
    /// # Errors
    /// Those of [`Cholesky::solve_column`].
    pub fn solve_few(
        &self,
        rows: &[u32],
        columns: &mut [f64],
        n: usize,
        few: &mut Column<T, [T; FEW]>,
    ) -> Result<(), FactorError> {
        few.solve(&self.factor_for(rows)?, rows, columns, n);
        Ok(())
    }

    /// The factor, if there is one of so many rows.
    pub(super) fn factor_for(&self, rows: &[u32]) -> Result<Factor<'_, T>, FactorError> {
        if !self.is_factorized {
            return Err(FactorError::NotFactorized);
        }
        FactorError::expect_length("rows", self.analysis.n(), rows.len())?;
        Ok(self.factor())
    }

    fn factor(&self) -> Factor<'_, T> {
        let symbolic = &self.analysis.supernodes;
        Factor { symbolic, values: &self.factor, has_unit_diagonal: false }
    }

    fn eliminate(&mut self) -> Result<(), FactorError> {
        let analysis = &self.analysis;
        let outcome = match &mut self.elimination {
            Elimination::Fronts(fronts) => {
                let outcome = fronts.factorize(&analysis.values, &mut self.factor);
                outcome.map_err(|(done, step)| {
                    self.done = done;
                    step
                })
            }
            Elimination::Shared(memory) => factorize_supernodal_numeric_llt(
                &mut self.factor,
                analysis.matrix(),
                Default::default(),
                &analysis.supernodes,
                analysis.parallelism,
                MemStack::new(memory),
                Default::default(),
            )
            .map(|_| ())
            .map_err(|LltError::NonPositivePivot { index }| index),
        };
        self.judge(outcome)
    }

    /// Whether the factor is one: the step of a pivot that is not positive is given.
    fn judge(&mut self, outcome: Result<(), usize>) -> Result<(), FactorError> {
        let analysis = &self.analysis;
        outcome.map_err(|step| FactorError::NotPositiveDefinite { row: analysis.row(step) })?;
        for (step, position) in analysis.pivots() {
            let pivot = self.factor[position] * self.factor[position];
            // Only an overflow can leave a NaN here.
            if !pivot.is_finite() || pivot <= T::round(T::LOST) * analysis.diagonal(step) {
                return Err(FactorError::Singular { row: analysis.row(step) });
            }
        }
        self.is_factorized = true;
        Ok(())
    }
}

impl<T: Precision> Factorization for Cholesky<T> {
    fn n(&self) -> usize {
        self.analysis.n()
    }

    fn fill(&self) -> usize {
        self.factor.len()
    }

    fn order(&self) -> &[u32] {
        self.analysis.order()
    }

    fn factorize(&mut self, values: &[f64]) -> Result<(), FactorError> {
        self.is_factorized = false;
        self.analysis.load(values)?;
        self.eliminate()
    }

    fn solve(&self, rhs: &mut [f64], columns: usize) -> Result<(), FactorError> {
        if !self.is_factorized {
            return Err(FactorError::NotFactorized);
        }
        let factor = self.factor();
        self.analysis.solve(rhs, columns, |panel| {
            factor.forward(panel);
            factor.backward(panel);
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests;
