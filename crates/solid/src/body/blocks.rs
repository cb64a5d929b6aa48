//! The tangent as symmetric 3x3 node blocks, its pattern, and its restriction to free degrees of freedom.

use super::block_product::{Columns, Stretch, Upper, stretches};
use crate::linear::{Numbering, Pattern};
use std::sync::Arc;

/// Upper triangle (row node <= column node) of a symmetric block matrix, in compressed columns.
#[derive(Clone)]
pub struct SymmetricBlocks {
    pattern: Arc<BlockPattern>,
    /// Entries `[i][k]` of each block, 9 per block.
    pub(super) values: Vec<f64>,
    /// Memory for the blocks of the tasks of a wave if threads share the evaluation. It is kept, because new memory costs
    /// as much as filling it.
    pub(super) of_tasks: Vec<[f64; 9]>,
}

impl SymmetricBlocks {
    pub(super) fn zeros(pattern: &Arc<BlockPattern>) -> Self {
        let values = vec![0.0; 9 * pattern.len()];
        SymmetricBlocks { pattern: pattern.clone(), values, of_tasks: Vec::new() }
    }

    /// The pattern of its blocks.
    pub fn pattern(&self) -> &BlockPattern {
        &self.pattern
    }

    /// Entries `[i][k]` of each block, 9 per block.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Entries `[i][k]` of each block, mutable.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// `y = A x` over all degrees of freedom.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        if x.iter().filter(|x| **x != 0.0).count() > x.len() / 4 {
            let BlockPattern { column_start, row, stretches } = &*self.pattern;
            let columns = Columns { start: column_start, row };
            let (blocks, _) = self.values.as_chunks();
            return Upper { columns, blocks }.multiply(stretches, x, y);
        }
        for column in 0..self.pattern.n() {
            for block in self.pattern.column(column) {
                let row = self.pattern.row[block] as usize;
                if is_zero(&x[3 * row..3 * row + 3]) && is_zero(&x[3 * column..3 * column + 3]) {
                    continue; // hands move few nodes
                }
                let values = &self.values[9 * block..9 * block + 9];
                add_block_product(values, (row, column), x, y);
            }
        }
    }

    /// Takes the values of another matrix on the same pattern.
    pub fn copy_from(&mut self, other: &SymmetricBlocks) {
        self.values.copy_from_slice(&other.values);
    }

    /// The zero matrix with the nodes in another order, and where each of its blocks comes from.
    pub fn renumbered(pattern: &BlockPattern, numbering: &Numbering) -> (Self, Vec<Source>) {
        let (pattern, sources) = pattern.renumbered(numbering);
        (SymmetricBlocks::zeros(&Arc::new(pattern)), sources)
    }

    /// Takes the values of a matrix in the order of the body.
    pub fn copy_renumbered(&mut self, other: &SymmetricBlocks, sources: &[Source]) {
        let (given, _) = other.values.as_chunks::<9>();
        let (own, _) = self.values.as_chunks_mut::<9>();
        for (own, source) in own.iter_mut().zip(sources) {
            let given = &given[source.block as usize];
            *own = if source.transposed {
                std::array::from_fn(|entry| given[3 * (entry % 3) + entry / 3])
            } else {
                *given
            };
        }
    }

    /// The block of each node with itself, entries `[i][k]`.
    pub fn diagonal(&self) -> impl Iterator<Item = &[f64; 9]> {
        self.pattern.diagonal(&self.values)
    }

    /// Adds to the block at a [`position`](super::Body::position), entries `[i][k]` with `i` of the lower node.
    pub fn add(&mut self, position: usize, entries: &[f64; 9]) {
        let block = &mut self.values[9 * position..9 * position + 9];
        block.iter_mut().zip(entries).for_each(|(b, e)| *b += e);
    }

    /// The values at the positions given by [`BlockPattern::restrict`].
    pub fn gather(&self, positions: &[u32], out: &mut Vec<f64>) {
        out.clear();
        out.extend(positions.iter().map(|&p| self.values[p as usize]));
    }

    /// Mean of the diagonal entries: the scale of a shift.
    pub fn mean_diagonal(&self) -> f64 {
        let sum: f64 = self.diagonal().map(|block| block[0] + block[4] + block[8]).sum();
        sum / (3 * self.pattern.n()) as f64
    }
}

/// Where a block of a renumbered matrix comes from, and whether it comes transposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Source {
    block: u32,
    transposed: bool,
}

/// Which blocks a symmetric matrix has, upper triangle, in compressed columns.
#[derive(Clone)]
pub struct BlockPattern {
    column_start: Vec<u32>,
    row: Vec<u32>,
    /// What threads may take of a product.
    stretches: Vec<Stretch>,
}

impl BlockPattern {
    /// Of `n` nodes, from the pairs of nodes that share a block, in any order and any number of times.
    pub(super) fn new(n: usize, pairs: impl Iterator<Item = [u32; 2]>) -> Self {
        let mut entries: Vec<[u32; 2]> = pairs.map(|[a, b]| [a.max(b), a.min(b)]).collect();
        entries.sort_unstable();
        entries.dedup();
        let mut column_start = vec![0; n + 1];
        entries.iter().for_each(|&[column, _]| column_start[column as usize + 1] += 1);
        (0..n).for_each(|column| column_start[column + 1] += column_start[column]);
        BlockPattern::of_columns(column_start, entries.iter().map(|&[_, row]| row).collect())
    }

    fn of_columns(column_start: Vec<u32>, row: Vec<u32>) -> Self {
        let stretches = stretches(Columns { start: &column_start, row: &row });
        BlockPattern { column_start, row, stretches }
    }

    /// Row and column node of every block, row <= column, in the order of [`SymmetricBlocks::values`].
    pub fn pairs(&self) -> impl Iterator<Item = (u32, u32)> + Clone + '_ {
        let columns =
            (0..self.n()).flat_map(|column| self.column(column).map(move |_| column as u32));
        self.row.iter().copied().zip(columns)
    }

    /// The block of each node with itself among such values, entries `[i][k]`.
    pub fn diagonal<'a>(&'a self, values: &'a [f64]) -> impl Iterator<Item = &'a [f64; 9]> {
        let (blocks, _) = values.as_chunks::<9>();
        // Rows are sorted and at most the column, so its diagonal block comes last.
        (0..self.n()).map(|column| &blocks[self.column(column).end - 1])
    }

    /// The same blocks with the nodes in another order, and where each comes from.
    fn renumbered(&self, numbering: &Numbering) -> (BlockPattern, Vec<Source>) {
        let mut start = vec![0u32; self.n() + 1];
        let place = |node: u32| numbering.place()[node as usize];
        let ends = |row: u32, column: u32| (place(row), place(column));
        for (row, column) in self.pairs() {
            let (a, b) = ends(row, column);
            start[a.max(b) as usize + 1] += 1;
        }
        (0..self.n()).for_each(|column| start[column + 1] += start[column]);
        let mut next = start.clone();
        let mut blocks = vec![(0, Source { block: 0, transposed: false }); self.len()];
        for ((row, column), block) in self.pairs().zip(0..) {
            let (a, b) = ends(row, column);
            let next = &mut next[a.max(b) as usize];
            blocks[*next as usize] = (a.min(b), Source { block, transposed: a > b });
            *next += 1;
        }
        for range in start.windows(2) {
            blocks[range[0] as usize..range[1] as usize].sort_unstable_by_key(|&(row, _)| row);
        }
        let (row, sources) = blocks.into_iter().unzip();
        (BlockPattern::of_columns(start, row), sources)
    }

    /// The pattern of the rows and columns listed in `free` (sorted degrees of freedom), and for
    /// each of its entries the position of its value among those of [`SymmetricBlocks::values`].
    pub fn restrict(&self, free: &[u32]) -> (Pattern, Vec<u32>) {
        let mut index = vec![u32::MAX; 3 * self.n()];
        for (k, &dof) in free.iter().enumerate() {
            index[dof as usize] = k as u32;
        }
        let (mut column_start, mut row, mut position) = (vec![0], Vec::new(), Vec::new());
        for &dof in free {
            let (node, k) = (dof as usize / 3, dof as usize % 3);
            for block in self.column(node) {
                let row_node = self.row[block];
                for i in 0..3 {
                    let r = 3 * row_node + i as u32;
                    if r <= dof && index[r as usize] != u32::MAX {
                        row.push(index[r as usize]);
                        position.push(9 * block as u32 + 3 * i as u32 + k as u32);
                    }
                }
            }
            column_start.push(row.len() as u32);
        }
        (Pattern { n: free.len(), column_start, row }, position)
    }

    /// Stretches of columns that threads may take of a product.
    pub fn n_stretches(&self) -> usize {
        self.stretches.len()
    }

    /// Number of blocks.
    pub(super) fn len(&self) -> usize {
        self.row.len()
    }

    /// The block of two nodes that share one.
    pub(super) fn block(&self, a: u32, b: u32) -> u32 {
        // Asked only for pairs the pattern was made of.
        self.position(a, b).expect("a pair of the pattern") as u32
    }

    /// The block of two nodes, whichever comes first; none for nodes that share none.
    pub fn position(&self, a: u32, b: u32) -> Option<usize> {
        let (row, column) = (a.min(b), a.max(b) as usize);
        let blocks = (column < self.n()).then(|| self.column(column))?;
        Some(blocks.start + self.row[blocks.clone()].binary_search(&row).ok()?)
    }

    fn n(&self) -> usize {
        self.column_start.len() - 1
    }

    fn column(&self, column: usize) -> std::ops::Range<usize> {
        self.column_start[column] as usize..self.column_start[column + 1] as usize
    }
}

/// Adds the products of a block, entries `[i][k]`, and of its transposed below the diagonal, to `y`.
pub fn add_block_product(block: &[f64], (row, column): (usize, usize), x: &[f64], y: &mut [f64]) {
    for i in 0..3 {
        for k in 0..3 {
            y[3 * row + i] += block[3 * i + k] * x[3 * column + k];
            if row != column {
                y[3 * column + k] += block[3 * i + k] * x[3 * row + i];
            }
        }
    }
}

fn is_zero(x: &[f64]) -> bool {
    x.iter().all(|&x| x == 0.0)
}

/// Items sorted into numbered groups.
#[derive(Clone)]
pub(super) struct Grouped<T> {
    start: Vec<u32>,
    items: Vec<T>,
}

impl<T: Copy> Grouped<T> {
    /// `count` groups; within a group items keep the order they come in.
    pub fn new(count: usize, entries: &[(u32, T)]) -> Self {
        let mut start = vec![0u32; count + 1];
        entries.iter().for_each(|&(group, _)| start[group as usize + 1] += 1);
        (0..count).for_each(|group| start[group + 1] += start[group]);
        let mut next = start.clone();
        let mut order = vec![0; entries.len()];
        for (entry, &(group, _)) in entries.iter().enumerate() {
            order[next[group as usize] as usize] = entry;
            next[group as usize] += 1;
        }
        Grouped { start, items: order.into_iter().map(|entry| entries[entry].1).collect() }
    }

    /// The items of a group.
    #[inline(always)]
    pub fn of(&self, group: usize) -> &[T] {
        &self.items[self.range(group)]
    }

    /// Where its items are among all.
    #[inline(always)]
    pub fn range(&self, group: usize) -> std::ops::Range<usize> {
        self.start[group] as usize..self.start[group + 1] as usize
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// Number of items of all groups.
    pub fn total(&self) -> usize {
        self.items.len()
    }
}
