//! The inverse of the diagonal blocks that belong to one node each: the cheapest preconditioner of an elastic body.

use super::super::{FactorError, Pattern};
use super::Preconditioner;

const NONE: u32 = u32::MAX;

/// Block-Jacobi preconditioner with blocks of up to three rows.
pub struct BlockJacobi {
    n: usize,
    n_values: usize,
    blocks: Vec<Block>,
}

/// The rows of one node, and the inverse of their block of the matrix.
struct Block {
    rows: [u32; 3],
    /// Positions of the block's upper triangle in the values of the matrix, row by row.
    entries: [[u32; 3]; 3],
    inverse: [[f64; 3]; 3],
}

impl BlockJacobi {
    /// Groups the rows that have the same number in `node`, at most three to a group; factorise before use.
    ///
    /// # Errors
    /// An invalid pattern, a `node` of the wrong length, a node with more than three rows.
    pub fn analyze(pattern: &Pattern, node: &[u32]) -> Result<Self, FactorError> {
        pattern.validate()?;
        FactorError::expect_length("node", pattern.n, node.len())?;
        let mut rows: Vec<u32> = (0..pattern.n as u32).collect();
        rows.sort_by_key(|&row| node[row as usize]);
        let mut blocks = Vec::new();
        for group in rows.chunk_by(|&a, &b| node[a as usize] == node[b as usize]) {
            if group.len() > 3 {
                let reason = "more than three rows belong to its node";
                return Err(FactorError::InvalidPattern { column: group[3] as usize, reason });
            }
            let mut padded = [NONE; 3];
            padded[..group.len()].copy_from_slice(group);
            blocks.push(Block {
                rows: padded,
                entries: entries_of(pattern, padded),
                inverse: [[0.0; 3]; 3],
            });
        }
        Ok(Self { n: pattern.n, n_values: pattern.len(), blocks })
    }

    /// Inverts the blocks of the matrix with these values.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`] names a row of the block that is not, which may be any of its rows.
    pub fn factorize(&mut self, values: &[f64]) -> Result<(), FactorError> {
        FactorError::expect_length("values", self.n_values, values.len())?;
        for block in &mut self.blocks {
            block.inverse = inverse_of_positive(block.gather(values))
                .ok_or(FactorError::NotPositiveDefinite { row: block.rows[0] as usize })?;
        }
        Ok(())
    }
}

impl Block {
    /// The block of the matrix; the rows that a smaller block lacks are those of the identity.
    fn gather(&self, values: &[f64]) -> [[f64; 3]; 3] {
        let value = |i: usize, j: usize| match self.entries[i.min(j)][i.max(j)] {
            NONE => f64::from(i == j),
            entry => values[entry as usize],
        };
        std::array::from_fn(|i| std::array::from_fn(|j| value(i, j)))
    }
}

impl Preconditioner for BlockJacobi {
    fn n(&self) -> usize {
        self.n
    }

    fn apply(&self, r: &[f64], z: &mut [f64]) {
        for Block { rows, inverse, .. } in &self.blocks {
            let load = rows.map(|row| if row == NONE { 0.0 } else { r[row as usize] });
            for (&row, inverse) in rows.iter().zip(inverse).filter(|(row, _)| **row != NONE) {
                z[row as usize] =
                    inverse[0] * load[0] + inverse[1] * load[1] + inverse[2] * load[2];
            }
        }
    }
}

/// Where the upper triangle of a block is in the values; rows ascend, so that the greater one is the column.
fn entries_of(pattern: &Pattern, rows: [u32; 3]) -> [[u32; 3]; 3] {
    let position = |i: usize, j: usize| {
        if rows[j] == NONE {
            return NONE;
        }
        let column = pattern.column(rows[j] as usize);
        let found = pattern.row[column.clone()].binary_search(&rows[i]);
        found.map_or(NONE, |offset| (column.start + offset) as u32)
    };
    std::array::from_fn(|i| std::array::from_fn(|j| if i <= j { position(i, j) } else { NONE }))
}

/// Inverse by cofactors, or nothing unless all leading minors are positive (Sylvester's criterion).
fn inverse_of_positive(a: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let minor = |i: usize, j: usize| {
        let (p, q, r, s) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        a[p][r] * a[q][s] - a[p][s] * a[q][r]
    };
    let determinant = (0..3).map(|j| a[0][j] * minor(0, j)).sum::<f64>();
    let is_positive =
        a[0][0] > 0.0 && minor(2, 2) > 0.0 && determinant > 0.0 && determinant.is_finite();
    is_positive.then(|| std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i) / determinant)))
}

#[cfg(test)]
mod tests {
    use super::super::super::test_matrices::Matrix;
    use super::*;

    /// Blocks of one, two and three rows, interleaved.
    const NODE: [u32; 6] = [7, 3, 9, 3, 9, 9];

    fn block_diagonal() -> Matrix {
        let entries = [(1, 3, 1.0), (2, 4, -1.0), (2, 5, 0.5), (4, 5, 1.5)];
        Matrix::from_entries(6, &entries).shifted(4.0)
    }

    #[test]
    fn inverts_a_block_diagonal_matrix() {
        let matrix = block_diagonal();
        let mut preconditioner = BlockJacobi::analyze(&matrix.pattern, &NODE).unwrap();
        preconditioner.factorize(&matrix.values).unwrap();
        let x = [1.0, -2.0, 3.0, 0.5, 0.0, 4.0];
        let mut z = [f64::NAN; 6];
        preconditioner.apply(&matrix.multiply(&x), &mut z);
        z.iter().zip(x).for_each(|(z, x)| assert!((z - x).abs() < 1e-14));
    }

    #[test]
    fn refuses_an_indefinite_block_and_a_crowded_node() {
        let matrix = block_diagonal().shifted(-3.5);
        let mut preconditioner = BlockJacobi::analyze(&matrix.pattern, &NODE).unwrap();
        assert_eq!(
            preconditioner.factorize(&matrix.values),
            Err(FactorError::NotPositiveDefinite { row: 1 })
        );
        let crowded = BlockJacobi::analyze(&matrix.pattern, &[0, 0, 1, 0, 0, 2]);
        assert!(matches!(crowded, Err(FactorError::InvalidPattern { column: 4, .. })));
    }
}
