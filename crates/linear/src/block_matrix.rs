//! A symmetric matrix of 3x3 blocks in single precision, row by row: what incomplete factors are made from. Rows may be
//! held: their unknowns are zero and stay so.

use viscera_number::simd::{Kernel, dispatch};

/// Columns of a 3x3 block, padded to a vector register.
pub(super) type Block = [[f32; 4]; 3];

/// A symmetric block matrix on a fixed pattern.
pub struct BlockMatrix {
    row_start: Vec<u32>,
    /// Column of every block, ascending within a row.
    column: Vec<u32>,
    blocks: Vec<Block>,
    /// Where the blocks left of the diagonal end, row by row: there is the diagonal block.
    diagonal: Vec<u32>,
    /// Block of the caller's upper triangle that each one is a copy of; transposed left of the diagonal.
    source: Vec<u32>,
    /// Rows `3 node + component` whose unknowns are held at zero.
    is_held: Vec<bool>,
}

impl BlockMatrix {
    /// Zero, on the pattern whose upper triangle has blocks at `pairs` of row and column, row <= column, the
    /// diagonal among them; in the order in which their values will come.
    pub fn new(n_nodes: usize, pairs: impl Iterator<Item = (u32, u32)>) -> Self {
        let mut entries: Vec<(u32, u32, u32)> = Vec::new();
        for (source, (row, column)) in (0u32..).zip(pairs) {
            entries.push((row, column, source));
            if row != column {
                entries.push((column, row, source));
            }
        }
        entries.sort_unstable();
        let mut row_start = vec![0u32; n_nodes + 1];
        let mut diagonal = vec![0u32; n_nodes];
        for (place, &(row, column, _)) in (0u32..).zip(&entries) {
            row_start[row as usize + 1] = place + 1;
            if row == column {
                diagonal[row as usize] = place;
            }
        }
        Self {
            row_start,
            column: entries.iter().map(|e| e.1).collect(),
            blocks: vec![Block::default(); entries.len()],
            diagonal,
            source: entries.iter().map(|e| e.2).collect(),
            is_held: vec![false; 3 * n_nodes],
        }
    }

    /// Number of nodes, a third of the number of rows.
    pub fn n_nodes(&self) -> usize {
        self.diagonal.len()
    }

    /// Chooses the rows that are held.
    pub fn hold(&mut self, is_held: &[bool]) {
        self.is_held.copy_from_slice(is_held);
    }

    /// Whether a row is held.
    pub fn is_held(&self, row: usize) -> bool {
        self.is_held[row]
    }

    /// Takes over nine values for each block of the upper triangle, row-major, and adds `shift` to the diagonal.
    pub fn fill(&mut self, values: &[f64], shift: f64) {
        dispatch(Fill { matrix: self, values });
        for &diagonal in &self.diagonal {
            let block = &mut self.blocks[diagonal as usize];
            (0..3).for_each(|i| block[i][i] += shift as f32);
        }
    }

    /// Blocks left of the diagonal in a row: their columns and values.
    #[inline(always)]
    pub(super) fn left(&self, row: usize) -> (&[u32], &[Block]) {
        let range = self.row_start[row] as usize..self.diagonal[row] as usize;
        (&self.column[range.clone()], &self.blocks[range])
    }

    /// The diagonal block of a node; where a row is held, that of the identity.
    pub(super) fn diagonal_block(&self, node: usize) -> [[f64; 3]; 3] {
        let block = &self.blocks[self.diagonal[node] as usize];
        self.without_held(block, node, node)
    }

    /// Entries `[i][j]` of a block; held rows and columns are those of the identity.
    pub(super) fn without_held(&self, block: &Block, row: usize, column: usize) -> [[f64; 3]; 3] {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                if self.is_held[3 * row + i] || self.is_held[3 * column + j] {
                    f64::from(row == column && i == j)
                } else {
                    f64::from(block[j][i])
                }
            })
        })
    }
}

struct Fill<'a> {
    matrix: &'a mut BlockMatrix,
    values: &'a [f64],
}

impl Kernel for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let BlockMatrix { row_start, diagonal, blocks, source, .. } = self.matrix;
        for (row, &diagonal) in diagonal.iter().enumerate() {
            let range = row_start[row] as usize..row_start[row + 1] as usize;
            for place in range {
                let at = 9 * source[place] as usize;
                let v: &[f64; 9] = self.values[at..at + 9].try_into().unwrap_or(&[0.0; 9]);
                let f = |k: usize| v[k] as f32;
                blocks[place] = if place < diagonal as usize {
                    [[f(0), f(1), f(2), 0.0], [f(3), f(4), f(5), 0.0], [f(6), f(7), f(8), 0.0]]
                } else {
                    [[f(0), f(3), f(6), 0.0], [f(1), f(4), f(7), 0.0], [f(2), f(5), f(8), 0.0]]
                };
            }
        }
    }
}

/// `sum += A x`.
#[inline(always)]
pub(super) fn add_product(sum: &mut [f64; 4], block: &Block, x: &[f64]) {
    let (x0, x1, x2) = (x[0], x[1], x[2]);
    for i in 0..4 {
        let products = f64::from(block[0][i]) * x0 + f64::from(block[1][i]) * x1;
        sum[i] += products + f64::from(block[2][i]) * x2;
    }
}

/// `sum += Aᵀ x`.
#[inline(always)]
pub(super) fn add_transposed_product(sum: &mut [f64], block: &Block, x: &[f64; 3]) {
    for j in 0..3 {
        let b = &block[j];
        sum[j] += f64::from(b[0]) * x[0] + f64::from(b[1]) * x[1] + f64::from(b[2]) * x[2];
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_matrices::Matrix;
    use super::*;

    /// The block matrix of a scalar one.
    pub fn blocked(matrix: &Matrix) -> BlockMatrix {
        let (n, dense) = (matrix.pattern.n / 3, matrix.dense());
        let block = |r: usize, c: usize| (0..9).map(move |k| (3 * r + k / 3, 3 * c + k % 3));
        let is_filled = |&(r, c): &(usize, usize)| block(r, c).any(|at| dense[at] != 0.0) || r == c;
        let pairs: Vec<(usize, usize)> =
            (0..n).flat_map(|c| (0..=c).map(move |r| (r, c))).filter(is_filled).collect();
        let values: Vec<f64> =
            pairs.iter().flat_map(|&(r, c)| block(r, c)).map(|at| dense[at]).collect();
        let mut blocked = BlockMatrix::new(n, pairs.iter().map(|&(r, c)| (r as u32, c as u32)));
        blocked.fill(&values, 0.0);
        blocked
    }
}
