//! Incomplete Cholesky without fill, IC(0): `A ≈ L Lᵀ` with `L` on the pattern of `A`. On elastic blocks it takes a
//! quarter to a sixth of the iterations of block-Jacobi, each two to three times as long.
//!
//! A pivot can vanish although `A` is positive definite; then the diagonal is raised, `A + shift diag(A)`, until
//! none does (Manteuffel 1980).

use super::super::{FactorError, Pattern};
use super::Preconditioner;

/// A pivot below this fraction of its diagonal value counts as vanished: its inverse would drown the others.
const PIVOT_FLOOR: f64 = 1e-3;

/// First shift tried after a breakdown; each further one is twice the last.
const FIRST_SHIFT: f64 = 1e-3;

/// A shift of this size leaves little more than the diagonal, so that the matrix must be at fault.
const LAST_SHIFT: f64 = 10.0;

/// IC(0) preconditioner.
pub struct IncompleteCholesky {
    /// Column `j` of the upper triangle is row `j` of `L`, the diagonal last.
    pattern: Pattern,
    rows: Vec<f64>,
    shift: f64,
}

impl IncompleteCholesky {
    /// Allocates a factor on `pattern`; factorise before use.
    ///
    /// # Errors
    /// An invalid pattern.
    pub fn analyze(pattern: &Pattern) -> Result<Self, FactorError> {
        pattern.validate()?;
        Ok(Self { pattern: pattern.clone(), rows: vec![0.0; pattern.len()], shift: 0.0 })
    }

    /// Part of the diagonal that had to be added to itself; zero where nothing broke down.
    pub fn shift(&self) -> f64 {
        self.shift
    }

    /// Factorises the matrix with these values.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`] where no shift helps.
    pub fn factorize(&mut self, values: &[f64]) -> Result<(), FactorError> {
        FactorError::expect_length("values", self.rows.len(), values.len())?;
        if let Some(position) = values.iter().position(|value| !value.is_finite()) {
            return Err(FactorError::NotFinite { position });
        }
        let mut row_of_l = vec![0.0; self.pattern.n];
        self.shift = 0.0;
        while let Err(row) = self.try_factorize(values, &mut row_of_l) {
            self.shift = (2.0 * self.shift).max(FIRST_SHIFT);
            if self.shift > LAST_SHIFT {
                return Err(FactorError::NotPositiveDefinite { row });
            }
            row_of_l.fill(0.0);
        }
        Ok(())
    }

    /// Row by row: `L_ij = (A_ij - sum_k L_ik L_jk) / L_jj`. Fails with the row of a vanished pivot; `row_of_l` is
    /// zero before and after.
    fn try_factorize(&mut self, values: &[f64], row_of_l: &mut [f64]) -> Result<(), usize> {
        let pattern = &self.pattern;
        for i in 0..pattern.n {
            let entries = pattern.column(i);
            let diagonal = entries.end - 1;
            let mut pivot = values[diagonal] * (1.0 + self.shift);
            for entry in entries.start..diagonal {
                let j = pattern.row[entry] as usize;
                let row_j = pattern.column(j);
                let above = row_j.start..row_j.end - 1;
                let known: f64 =
                    above.map(|k| self.rows[k] * row_of_l[pattern.row[k] as usize]).sum();
                let value = (values[entry] - known) / self.rows[row_j.end - 1];
                row_of_l[j] = value;
                self.rows[entry] = value;
                pivot -= value * value;
            }
            if pivot.is_nan() || pivot <= PIVOT_FLOOR * values[diagonal] || pivot <= 0.0 {
                return Err(i);
            }
            self.rows[diagonal] = pivot.sqrt();
            pattern.row[entries].iter().for_each(|&j| row_of_l[j as usize] = 0.0);
        }
        Ok(())
    }
}

impl Preconditioner for IncompleteCholesky {
    fn n(&self) -> usize {
        self.pattern.n
    }

    fn apply(&self, r: &[f64], z: &mut [f64]) {
        let pattern = &self.pattern;
        for i in 0..pattern.n {
            let entries = pattern.column(i);
            let diagonal = entries.end - 1;
            let known: f64 =
                (entries.start..diagonal).map(|k| self.rows[k] * z[pattern.row[k] as usize]).sum();
            z[i] = (r[i] - known) / self.rows[diagonal];
        }
        for i in (0..pattern.n).rev() {
            let entries = pattern.column(i);
            let diagonal = entries.end - 1;
            z[i] /= self.rows[diagonal];
            for k in entries.start..diagonal {
                z[pattern.row[k] as usize] -= self.rows[k] * z[i];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::test_matrices::{Matrix, elastic_block, load};
    use super::*;

    fn applied(preconditioner: &IncompleteCholesky, r: &[f64]) -> Vec<f64> {
        let mut z = vec![f64::NAN; r.len()];
        preconditioner.apply(r, &mut z);
        z
    }

    #[test]
    fn is_exact_where_elimination_makes_no_fill() {
        let mut entries: Vec<_> = (0..50).map(|i| (i, i, 2.5 + (i as f64).sin())).collect();
        entries.extend((1..50).map(|i| (i - 1, i, -0.7)));
        let matrix = Matrix::from_entries(50, &entries);
        let mut preconditioner = IncompleteCholesky::analyze(&matrix.pattern).unwrap();
        preconditioner.factorize(&matrix.values).unwrap();
        let b = load(50, 0);
        assert_eq!(preconditioner.shift(), 0.0);
        assert!(matrix.relative_residual(&applied(&preconditioner, &b), &b) < 1e-14);
    }

    #[test]
    fn reproduces_the_matrix_on_its_pattern() {
        let matrix = elastic_block(4, 3, 3);
        let mut preconditioner = IncompleteCholesky::analyze(&matrix.pattern).unwrap();
        preconditioner.factorize(&matrix.values).unwrap();
        let mut lower = faer::Mat::<f64>::zeros(matrix.pattern.n, matrix.pattern.n);
        for i in 0..matrix.pattern.n {
            for k in matrix.pattern.column(i) {
                lower[(i, matrix.pattern.row[k] as usize)] = preconditioner.rows[k];
            }
        }
        let product = &lower * lower.transpose();
        for i in 0..matrix.pattern.n {
            for k in matrix.pattern.column(i) {
                assert!(
                    (product[(i, matrix.pattern.row[k] as usize)] - matrix.values[k]).abs() < 1e-13
                );
            }
        }
    }

    #[test]
    fn raises_the_diagonal_where_a_pivot_vanishes() {
        // Kershaw (1978): positive definite, but its incomplete factorisation is not.
        let mut entries = vec![(0, 1, -2.0), (1, 2, -2.0), (2, 3, -2.0), (0, 3, 2.0)];
        entries.extend((0..4).map(|i| (i, i, 3.0)));
        let matrix = Matrix::from_entries(4, &entries);
        let mut preconditioner = IncompleteCholesky::analyze(&matrix.pattern).unwrap();
        preconditioner.factorize(&matrix.values).unwrap();
        assert!(
            preconditioner.shift() > 0.0 && preconditioner.shift() < 0.5,
            "{}",
            preconditioner.shift()
        );
        let b = load(4, 0);
        assert!(applied(&preconditioner, &b).iter().zip(&b).map(|(z, r)| z * r).sum::<f64>() > 0.0);
    }

    #[test]
    fn refuses_a_negative_diagonal_and_a_value_that_is_not_finite() {
        let mut matrix = elastic_block(3, 2, 2);
        let mut preconditioner = IncompleteCholesky::analyze(&matrix.pattern).unwrap();
        let diagonal = matrix.diagonal(20);
        matrix.values[diagonal] = -1.0;
        assert_eq!(
            preconditioner.factorize(&matrix.values),
            Err(FactorError::NotPositiveDefinite { row: 20 })
        );
        matrix.values[diagonal] = f64::INFINITY;
        assert_eq!(
            preconditioner.factorize(&matrix.values),
            Err(FactorError::NotFinite { position: diagonal })
        );
    }
}
