//! The tangent on the free degrees of freedom, factorised once for many right-hand sides: the orders of a series.

use crate::body::SymmetricBlocks;
use crate::error::Error;
use crate::linear::{Cholesky, FactorError, Factorization, Ldlt, Pattern};

/// Factorised tangent.
pub struct System {
    free: Vec<u32>,
    index: Vec<u32>,
    positions: Vec<u32>,
    diagonal: Vec<usize>,
    values: Vec<f64>,
    factor: Box<dyn Factorization>,
}

impl System {
    /// Analyses the tangent's pattern on the degrees of freedom that are not `prescribed`.
    ///
    /// # Errors
    /// A pattern the solver refuses.
    pub fn new(
        tangent: &SymmetricBlocks,
        n_dofs: usize,
        prescribed: impl Iterator<Item = u32>,
    ) -> Result<Self, Error> {
        Self::with(tangent, n_dofs, prescribed, |p| Ok(Box::new(Cholesky::analyze(p)?)))
    }

    /// The same for tangents that may be indefinite: paths that pass a limit point.
    ///
    /// # Errors
    /// A pattern the solver refuses.
    pub fn indefinite(
        tangent: &SymmetricBlocks,
        n_dofs: usize,
        prescribed: impl Iterator<Item = u32>,
    ) -> Result<Self, Error> {
        Self::with(tangent, n_dofs, prescribed, |p| Ok(Box::new(Ldlt::analyze(p)?)))
    }

    fn with(
        tangent: &SymmetricBlocks,
        n_dofs: usize,
        prescribed: impl Iterator<Item = u32>,
        analyze: impl Fn(&Pattern) -> Result<Box<dyn Factorization>, FactorError>,
    ) -> Result<Self, Error> {
        let mut is_free = vec![true; n_dofs];
        prescribed.for_each(|dof| is_free[dof as usize] = false);
        let free: Vec<u32> = (0..n_dofs as u32).filter(|&d| is_free[d as usize]).collect();
        let mut index = vec![u32::MAX; n_dofs];
        free.iter().enumerate().for_each(|(k, &dof)| index[dof as usize] = k as u32);
        let (pattern, positions) = tangent.pattern().restrict(&free);
        let diagonal = pattern.column_start[1..].iter().map(|&end| end as usize - 1).collect();
        Ok(System {
            free,
            index,
            positions,
            diagonal,
            values: Vec::new(),
            factor: analyze(&pattern)?,
        })
    }

    /// Number of free degrees of freedom.
    pub fn n_free(&self) -> usize {
        self.free.len()
    }

    /// The free degrees of freedom, ascending.
    pub fn free(&self) -> &[u32] {
        &self.free
    }

    /// Factorises `K + shift * mean(diag K) * I`.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`] with the degree of freedom as its row: the state is
    /// not stable; other factorisation errors.
    pub fn factorize(&mut self, tangent: &SymmetricBlocks, shift: f64) -> Result<(), FactorError> {
        tangent.gather(&self.positions, &mut self.values);
        let shift = shift * tangent.mean_diagonal();
        for &entry in &self.diagonal {
            self.values[entry] += shift;
        }
        self.factor.factorize(&self.values).map_err(|error| match error {
            FactorError::NotPositiveDefinite { row } => {
                FactorError::NotPositiveDefinite { row: self.free[row] as usize }
            }
            other => other,
        })
    }

    /// The row of a degree of freedom, if it is free.
    pub fn row_of(&self, dof: usize) -> Option<usize> {
        Some(self.index[dof] as usize).filter(|&row| row != u32::MAX as usize)
    }

    /// Plain solves with the factor, `columns` right-hand sides on the free degrees of freedom.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn solve_free(&self, rhs: &mut [f64], columns: usize) -> Result<(), FactorError> {
        self.factor.solve(rhs, columns)
    }
}
