//! The fixed sparsity pattern of a symmetric matrix: its upper triangle in compressed columns.

use super::FactorError;

/// Upper triangle (row <= column) of a symmetric matrix in compressed columns, rows sorted, diagonal present.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    /// Number of rows and columns.
    pub n: usize,
    /// Where each column starts in `row`; `n + 1` entries.
    pub column_start: Vec<u32>,
    /// Rows of the entries, ascending within a column, so that the diagonal comes last.
    pub row: Vec<u32>,
}

impl Pattern {
    /// Number of stored entries, which is the number of values of a matrix on this pattern.
    pub fn len(&self) -> usize {
        self.row.len()
    }

    /// Whether the matrix has no entry, that is no row.
    pub fn is_empty(&self) -> bool {
        self.row.is_empty()
    }

    /// Positions of column `column` in `row`; the last one is the diagonal.
    pub fn column(&self, column: usize) -> std::ops::Range<usize> {
        self.column_start[column] as usize..self.column_start[column + 1] as usize
    }

    /// Checks every promise of this type.
    ///
    /// # Errors
    /// [`FactorError::InvalidPattern`] names the first column that breaks one.
    pub fn validate(&self) -> Result<(), FactorError> {
        let invalid = |column, reason| Err(FactorError::InvalidPattern { column, reason });
        if self.n >= i32::MAX as usize || self.row.len() >= i32::MAX as usize / 2 {
            return Err(FactorError::TooLarge { n: self.n });
        }
        if self.column_start.len() != self.n + 1 || self.column_start[0] != 0 {
            return invalid(0, "column_start must hold n + 1 offsets, the first of them 0");
        }
        for column in 0..self.n {
            let (start, end) =
                (self.column_start[column] as usize, self.column_start[column + 1] as usize);
            if start >= end || end > self.row.len() {
                return invalid(
                    column,
                    "its offsets must ascend, stay inside row and leave room for the diagonal",
                );
            }
            let rows = &self.row[start..end];
            if rows[rows.len() - 1] as usize != column {
                return invalid(column, "its last row must be the diagonal");
            }
            if rows.windows(2).any(|pair| pair[0] >= pair[1]) {
                return invalid(column, "its rows must ascend without repetition");
            }
        }
        if self.column_start[self.n] as usize != self.row.len() {
            return invalid(self.n, "column_start must end at the number of rows stored");
        }
        Ok(())
    }

    /// `y = A x` for the symmetric matrix whose upper triangle holds `values`; `x` and `y` have `n` entries.
    pub fn multiply(&self, values: &[f64], x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for column in 0..self.n {
            let entries = self.column(column);
            let diagonal = entries.end - 1;
            let mut sum = values[diagonal] * x[column];
            for entry in entries.start..diagonal {
                let row = self.row[entry] as usize;
                sum += values[entry] * x[row];
                y[row] += values[entry] * x[column];
            }
            y[column] += sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_matrices::{elastic_block, load, relative_difference};
    use super::*;

    #[test]
    fn multiplies_like_the_dense_matrix() {
        let matrix = elastic_block(3, 4, 2);
        let x = load(matrix.pattern.n, 0);
        let dense = &matrix.dense() * faer::Mat::from_fn(x.len(), 1, |i, _| x[i]);
        assert!(relative_difference(&matrix.multiply(&x), dense.col_as_slice(0)) < 1e-14);
    }

    #[test]
    fn names_the_column_that_breaks_a_promise() {
        let broken = |column_start: &[u32], row: &[u32]| {
            let pattern = Pattern { n: 3, column_start: column_start.to_vec(), row: row.to_vec() };
            match pattern.validate() {
                Err(FactorError::InvalidPattern { column, .. }) => Some(column),
                _ => None,
            }
        };
        assert_eq!(broken(&[0, 1, 3, 5], &[0, 0, 1, 0, 2]), None);
        assert_eq!(broken(&[0, 1, 3], &[0, 0, 1]), Some(0)); // an offset is missing
        assert_eq!(broken(&[0, 1, 2, 4], &[0, 0, 1, 2]), Some(1)); // no diagonal
        assert_eq!(broken(&[0, 1, 3, 6], &[0, 0, 1, 1, 0, 2]), Some(2)); // unsorted
        assert_eq!(broken(&[0, 1, 3, 6], &[0, 0, 1, 0, 0, 2]), Some(2)); // repeated
        assert_eq!(broken(&[0, 1, 3, 6], &[0, 0, 1, 0, 2]), Some(2)); // past the end
        assert_eq!(broken(&[0, 2, 1, 5], &[0, 0, 1, 0, 2]), Some(0)); // offsets descend
        assert_eq!(broken(&[0, 1, 3, 4], &[0, 0, 1, 2, 2]), Some(3)); // entries left over
    }
}
