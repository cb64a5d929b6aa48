//! The tangent as symmetric 3x3 node blocks, its assembly map, and its restriction to free
//! degrees of freedom.

use super::Slot;
use crate::linear::Pattern;

/// Upper triangle (row node <= column node) of a symmetric block matrix, in compressed columns.
#[derive(Clone)]
pub struct SymmetricBlocks {
    column_start: Vec<u32>,
    row: Vec<u32>,
    /// Entries `[i][k]` of each block, 9 per block.
    pub(super) values: Vec<f64>,
}

impl SymmetricBlocks {
    /// `y = A x` over all degrees of freedom.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for column in 0..self.column_start.len() - 1 {
            for block in self.column_start[column]..self.column_start[column + 1] {
                let row = self.row[block as usize] as usize;
                let values = &self.values[9 * block as usize..9 * block as usize + 9];
                for i in 0..3 {
                    for k in 0..3 {
                        y[3 * row + i] += values[3 * i + k] * x[3 * column + k];
                        if row != column {
                            y[3 * column + k] += values[3 * i + k] * x[3 * row + i];
                        }
                    }
                }
            }
        }
    }

    /// Where the block of two nodes is stored, whichever comes first; none for nodes that share no cell.
    pub fn position(&self, a: u32, b: u32) -> Option<usize> {
        let (row, column) = (a.min(b), a.max(b) as usize);
        let start = *self.column_start.get(column)? as usize;
        let end = *self.column_start.get(column + 1)? as usize;
        self.row[start..end].binary_search(&row).ok().map(|k| start + k)
    }

    /// Adds to the block at a [`position`](Self::position), entries `[i][k]` with `i` of the lower node.
    pub fn add(&mut self, position: usize, entries: &[f64; 9]) {
        let block = &mut self.values[9 * position..9 * position + 9];
        block.iter_mut().zip(entries).for_each(|(b, e)| *b += e);
    }

    /// The pattern of the rows and columns listed in `free` (sorted degrees of freedom), and for
    /// each of its entries the position of its value in this matrix.
    pub fn restrict(&self, free: &[u32]) -> (Pattern, Vec<u32>) {
        let mut index = vec![u32::MAX; 3 * (self.column_start.len() - 1)];
        for (k, &dof) in free.iter().enumerate() {
            index[dof as usize] = k as u32;
        }
        let (mut column_start, mut row, mut position) = (vec![0], Vec::new(), Vec::new());
        for &dof in free {
            let (node, k) = (dof as usize / 3, dof as usize % 3);
            for block in self.column_start[node]..self.column_start[node + 1] {
                let row_node = self.row[block as usize];
                for i in 0..3 {
                    let r = 3 * row_node + i as u32;
                    if r <= dof && index[r as usize] != u32::MAX {
                        row.push(index[r as usize]);
                        position.push(9 * block + 3 * i as u32 + k as u32);
                    }
                }
            }
            column_start.push(row.len() as u32);
        }
        (Pattern { n: free.len(), column_start, row }, position)
    }

    /// The values at the positions given by [`SymmetricBlocks::restrict`].
    pub fn gather(&self, positions: &[u32], out: &mut Vec<f64>) {
        out.clear();
        out.extend(positions.iter().map(|&p| self.values[p as usize]));
    }

    /// Mean of the diagonal entries: the scale of a shift.
    pub fn mean_diagonal(&self) -> f64 {
        let columns = self.column_start.len() - 1;
        let sum: f64 = (0..columns)
            .map(|c| {
                // Rows are sorted and at most the column, so its diagonal block comes last.
                let block = 9 * (self.column_start[c + 1] as usize - 1);
                self.values[block] + self.values[block + 4] + self.values[block + 8]
            })
            .sum();
        sum / (3 * columns) as f64
    }
}

/// A contribution of a cell to a block: local block index, and whether it comes transposed.
#[derive(Clone, Copy)]
pub(super) struct Contribution {
    pub slot: Slot,
    pub block: u8,
    pub transposed: bool,
}

/// Which cell blocks add up to each matrix block.
pub(super) struct BlockMap {
    column_start: Vec<u32>,
    row: Vec<u32>,
    contribution_start: Vec<u32>,
    contributions: Vec<Contribution>,
}

/// Local node pairs `a <= b` of a cell, in the order its blocks are stored.
pub(super) const LOCAL_PAIRS: [(usize, usize); 10] =
    [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];

impl BlockMap {
    pub fn new(n: usize, cells: &[[u32; 4]], slots: &[Slot]) -> Self {
        let mut entries = Vec::with_capacity(10 * cells.len());
        for (cell, nodes) in cells.iter().enumerate() {
            for (block, &(a, b)) in LOCAL_PAIRS.iter().enumerate() {
                let transposed = nodes[a] > nodes[b];
                let (row, column) = (nodes[a].min(nodes[b]), nodes[a].max(nodes[b]));
                let slot = slots[cell];
                entries.push((column, row, Contribution { slot, block: block as u8, transposed }));
            }
        }
        // A node without cells would leave a column without its diagonal; it is no body's node.
        entries.sort_by_key(|&(column, row, _)| (column, row));
        let mut map = BlockMap {
            column_start: vec![0; n + 1],
            row: Vec::new(),
            contribution_start: vec![0],
            contributions: Vec::with_capacity(entries.len()),
        };
        for group in entries.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            map.row.push(group[0].1);
            map.column_start[group[0].0 as usize + 1] += 1;
            map.contributions.extend(group.iter().map(|e| e.2));
            map.contribution_start.push(map.contributions.len() as u32);
        }
        for column in 0..n {
            map.column_start[column + 1] += map.column_start[column];
        }
        map
    }

    pub fn zeros(&self) -> SymmetricBlocks {
        SymmetricBlocks {
            column_start: self.column_start.clone(),
            row: self.row.clone(),
            values: vec![0.0; 9 * self.row.len()],
        }
    }

    pub fn contributions(&self, block: usize) -> &[Contribution] {
        let range = self.contribution_start[block]..self.contribution_start[block + 1];
        &self.contributions[range.start as usize..range.end as usize]
    }
}
