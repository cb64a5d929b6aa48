//! The linear system of one Newton iteration or one order of a series: the tangent on the free
//! degrees of freedom, bordered by the prescribed means of patches,
//!   K s - W^T f = b,   W s = c,
//! solved by the Schur complement `W K^-1 W^T` (small: three rows for each patch).

use crate::body::SymmetricBlocks;
use crate::error::Error;
use crate::linear::{Cholesky, FactorError, Factorization, Ldlt, Pattern};
use crate::mesh::Patch;
use faer::linalg::solvers::Solve;

/// Factorised tangent with patch constraints.
pub struct System {
    free: Vec<u32>,
    index: Vec<u32>,
    positions: Vec<u32>,
    diagonal: Vec<usize>,
    values: Vec<f64>,
    factor: Box<dyn Factorization>,
    patches: Vec<Patch>,
    /// `G = K^-1 W^T`, one column for each constraint.
    influence: Vec<f64>,
    /// `(W G)^-1`, dense.
    schur: faer::Mat<f64>,
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
        patches: Vec<Patch>,
    ) -> Result<Self, Error> {
        Self::with(tangent, n_dofs, prescribed, patches, |p| Ok(Box::new(Cholesky::analyze(p)?)))
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
        Self::with(tangent, n_dofs, prescribed, Vec::new(), |p| Ok(Box::new(Ldlt::analyze(p)?)))
    }

    fn with(
        tangent: &SymmetricBlocks,
        n_dofs: usize,
        prescribed: impl Iterator<Item = u32>,
        patches: Vec<Patch>,
        analyze: impl Fn(&Pattern) -> Result<Box<dyn Factorization>, FactorError>,
    ) -> Result<Self, Error> {
        let mut is_free = vec![true; n_dofs];
        prescribed.for_each(|dof| is_free[dof as usize] = false);
        let free: Vec<u32> = (0..n_dofs as u32).filter(|&d| is_free[d as usize]).collect();
        let mut index = vec![u32::MAX; n_dofs];
        free.iter().enumerate().for_each(|(k, &dof)| index[dof as usize] = k as u32);
        let (pattern, positions) = tangent.restrict(&free);
        let diagonal = pattern.column_start[1..].iter().map(|&end| end as usize - 1).collect();
        Ok(System {
            free,
            index,
            positions,
            diagonal,
            values: Vec::new(),
            factor: analyze(&pattern)?,
            patches,
            influence: Vec::new(),
            schur: faer::Mat::zeros(0, 0),
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
        })?;
        self.border()
    }

    /// `G = K^-1 W^T` and the inverse of `W G`.
    fn border(&mut self) -> Result<(), FactorError> {
        let (n, k) = (self.n_free(), 3 * self.patches.len());
        if k == 0 {
            return Ok(());
        }
        let mut influence = vec![0.0; n * k];
        for (p, patch) in self.patches.iter().enumerate() {
            for i in 0..3 {
                let column = &mut influence[(3 * p + i) * n..(3 * p + i + 1) * n];
                for (&node, &w) in patch.nodes.iter().zip(&patch.weights) {
                    if let Some(row) = self.row_of(3 * node as usize + i) {
                        column[row] = w;
                    }
                }
            }
        }
        self.factor.solve(&mut influence, k)?;
        let columns: Vec<Vec<f64>> =
            (0..k).map(|c| self.mean(&influence[c * n..(c + 1) * n])).collect();
        let schur = faer::Mat::from_fn(k, k, |r, c| columns[c][r]);
        self.schur = schur.partial_piv_lu().solve(faer::Mat::<f64>::identity(k, k));
        self.influence = influence;
        Ok(())
    }

    /// The row of a degree of freedom, if it is free.
    pub fn row_of(&self, dof: usize) -> Option<usize> {
        Some(self.index[dof] as usize).filter(|&row| row != u32::MAX as usize)
    }

    /// `W s` of a vector on the free degrees of freedom.
    fn mean(&self, s: &[f64]) -> Vec<f64> {
        let mut mean = vec![0.0; 3 * self.patches.len()];
        for (p, patch) in self.patches.iter().enumerate() {
            for (&node, &w) in patch.nodes.iter().zip(&patch.weights) {
                for i in 0..3 {
                    if let Some(row) = self.row_of(3 * node as usize + i) {
                        mean[3 * p + i] += w * s[row];
                    }
                }
            }
        }
        mean
    }

    /// `W u` of a full displacement: the mean displacement of each patch.
    pub fn patch_means(&self, u: &[f64]) -> Vec<[f64; 3]> {
        self.patches.iter().map(|patch| patch_mean(patch, u)).collect()
    }

    /// Solves for the step and the change of the patch forces; `rhs` on the free degrees of
    /// freedom becomes `s`, `c` is the change of the patch means.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn solve(&self, rhs: &mut [f64], c: &[f64]) -> Result<Vec<f64>, FactorError> {
        self.factor.solve(rhs, 1)?;
        let n = self.n_free();
        let mean = self.mean(rhs);
        let gap: Vec<f64> = c.iter().zip(&mean).map(|(c, m)| c - m).collect();
        let forces: Vec<f64> = (0..gap.len())
            .map(|r| (0..gap.len()).map(|k| self.schur[(r, k)] * gap[k]).sum())
            .collect();
        for (k, &f) in forces.iter().enumerate() {
            for (s, g) in rhs.iter_mut().zip(&self.influence[k * n..(k + 1) * n]) {
                *s += f * g;
            }
        }
        Ok(forces)
    }

    /// Plain solves with the factor, `columns` right-hand sides on the free degrees of freedom.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn solve_free(&self, rhs: &mut [f64], columns: usize) -> Result<(), FactorError> {
        self.factor.solve(rhs, columns)
    }
}

/// `sum_i w_i u_i`.
pub fn patch_mean(patch: &Patch, u: &[f64]) -> [f64; 3] {
    let mut mean = [0.0; 3];
    for (&node, &w) in patch.nodes.iter().zip(&patch.weights) {
        for i in 0..3 {
            mean[i] += w * u[3 * node as usize + i];
        }
    }
    mean
}
