//! The rows that patches add to a system: their tools prescribe `W s = c` by forces `F`.
//!
//! Beside the inverse `M⁻¹` of a matrix, exact or not, the border keeps `G = M⁻¹ Wᵀ` and `(W G)⁻¹`. With an exact
//! inverse, closing a step solves the bordered system; with a preconditioner, it is the constraint preconditioner of
//! Gould, Hribar and Nocedal (2001).

use crate::linear::FactorError;
use crate::mesh::Patch;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// A row of `W`: degrees of freedom and their weights.
pub type Row = Vec<(u32, f64)>;

/// The rows of the mean displacements of patches, three of each.
pub fn mean_rows(patches: &[Patch]) -> Vec<Row> {
    let row = |patch: &Patch, i: u32| {
        patch.nodes.iter().map(|node| 3 * node + i).zip(patch.weights.iter().copied()).collect()
    };
    patches.iter().flat_map(|patch| (0..3).map(move |i| row(patch, i))).collect()
}

/// What tools prescribe on the degrees of freedom that are not held.
pub(super) struct Border {
    /// Rows of `W`.
    rows: Vec<Row>,
    /// `(W Wᵀ)⁻¹`.
    gram: Mat<f64>,
    n_dofs: usize,
    /// A row of `W` laid out, zero between uses.
    column: Vec<f64>,
    /// Columns of `G`, one after the other.
    influence: Vec<f64>,
    /// `(W G)⁻¹`.
    schur: Mat<f64>,
}

impl Border {
    pub fn new(rows: Vec<Row>, n_dofs: usize) -> Self {
        let mut dense = vec![0.0; n_dofs];
        let mut gram = Mat::zeros(rows.len(), rows.len());
        for (k, row) in rows.iter().enumerate() {
            row.iter().for_each(|&(dof, w)| dense[dof as usize] = w);
            for (j, other) in rows.iter().enumerate() {
                gram[(k, j)] = other.iter().map(|&(dof, w)| w * dense[dof as usize]).sum();
            }
            row.iter().for_each(|&(dof, _)| dense[dof as usize] = 0.0);
        }
        let gram = inverse(&gram);
        Border { rows, gram, n_dofs, column: dense, influence: Vec::new(), schur: Mat::zeros(0, 0) }
    }

    /// Means that do not change.
    pub fn zeros(&self) -> Vec<f64> {
        vec![0.0; self.rows.len()]
    }

    /// Rows of `W`.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Renews `G` and `(W G)⁻¹` with a new `M⁻¹`, which solves for one right-hand side.
    pub fn influence(
        &mut self,
        mut solve: impl FnMut(&[f64], &mut [f64]) -> Result<(), FactorError>,
    ) -> Result<(), FactorError> {
        let Border { rows, column, n_dofs, influence, .. } = self;
        if rows.is_empty() {
            return Ok(());
        }
        influence.resize(*n_dofs * rows.len(), 0.0);
        for (row, out) in rows.iter().zip(influence.chunks_exact_mut(*n_dofs)) {
            row.iter().for_each(|&(dof, w)| column[dof as usize] = w);
            out.fill(0.0);
            solve(column, out)?;
            row.iter().for_each(|&(dof, _)| column[dof as usize] = 0.0);
        }
        self.renew_schur();
        Ok(())
    }

    /// The same where `M⁻¹` solves in place for several columns of all degrees of freedom, so many each.
    pub fn influence_of_all(
        &mut self,
        solve: impl FnOnce(&mut [f64], usize) -> Result<(), FactorError>,
    ) -> Result<(), FactorError> {
        let Border { rows, n_dofs, influence, .. } = self;
        if rows.is_empty() {
            return Ok(());
        }
        influence.clear();
        influence.resize(*n_dofs * rows.len(), 0.0);
        for (row, column) in rows.iter().zip(influence.chunks_exact_mut(*n_dofs)) {
            row.iter().for_each(|&(dof, w)| column[dof as usize] = w);
        }
        solve(influence, *n_dofs)?;
        self.renew_schur();
        Ok(())
    }

    fn renew_schur(&mut self) {
        let columns = self.influence.chunks_exact(self.n_dofs.max(1));
        let means: Vec<Vec<f64>> = columns.map(|column| self.means(column)).collect();
        let k = self.rows.len();
        self.schur = inverse(&Mat::from_fn(k, k, |r, c| means[c][r]));
    }

    /// Number of negative eigenvalues of `W G`; none if it cannot be determined.
    pub fn n_negative(&self) -> Option<usize> {
        let k = self.rows.len();
        // Those of the inverse have the same signs.
        let symmetric = Mat::from_fn(k, k, |r, c| 0.5 * (self.schur[(r, c)] + self.schur[(c, r)]));
        if !(0..k).all(|c| (0..k).all(|r| symmetric[(r, c)].is_finite())) {
            return None;
        }
        let eigenvalues = symmetric.self_adjoint_eigenvalues(Side::Lower).ok()?;
        Some(eigenvalues.iter().filter(|&&value| value < 0.0).count())
    }

    /// `W s`.
    fn means(&self, s: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|row| row.iter().map(|&(dof, w)| w * s[dof as usize]).sum()).collect()
    }

    /// Corrects `s` so that `W s = c`, and returns the forces of this correction.
    pub fn close(&self, s: &mut [f64], c: &[f64], forces: &mut Vec<f64>) {
        let gap: Vec<f64> = c.iter().zip(self.means(s)).map(|(c, mean)| c - mean).collect();
        forces.clear();
        forces.extend(product(&self.schur, &gap));
        for (force, column) in forces.iter().zip(self.influence.chunks_exact(s.len().max(1))) {
            s.iter_mut().zip(column).for_each(|(s, g)| *s += force * g);
        }
    }

    /// The forces `F` that bring `residual + Wᵀ F` nearest to zero.
    pub fn forces(&self, residual: &[f64]) -> Vec<f64> {
        product(&self.gram, &self.means(residual)).map(|f| -f).collect()
    }

    /// Removes from a residual the part that forces of the tools can balance.
    pub fn project(&self, residual: &mut [f64]) {
        for (row, force) in self.rows.iter().zip(self.forces(residual)) {
            row.iter().for_each(|&(dof, w)| residual[dof as usize] += force * w);
        }
    }
}

fn product<'a>(a: &'a Mat<f64>, x: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    (0..a.nrows()).map(move |r| (0..x.len()).map(|c| a[(r, c)] * x[c]).sum())
}

fn inverse(a: &Mat<f64>) -> Mat<f64> {
    let n = a.nrows();
    if n == 0 { Mat::zeros(0, 0) } else { a.partial_piv_lu().solve(Mat::<f64>::identity(n, n)) }
}
