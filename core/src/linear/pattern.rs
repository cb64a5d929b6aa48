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
            return invalid(
                0,
                "column_start must hold n + 1 offsets, the first of them 0",
            );
        }
        for column in 0..self.n {
            let (start, end) = (
                self.column_start[column] as usize,
                self.column_start[column + 1] as usize,
            );
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

    /// `y = A x` for the symmetric matrix whose upper triangle holds `values`.
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
