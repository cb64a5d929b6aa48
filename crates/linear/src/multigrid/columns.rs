//! The blocks of a level: where its matrix has some.

use super::super::FactorError;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// Blocks of a symmetric matrix, one for both triangles, in compressed columns; the diagonal comes last in its column.
pub(super) struct Columns {
    start: Vec<u32>,
    row: Vec<u32>,
}

impl Columns {
    /// So many columns; rows of the first, then of the next.
    pub fn new(start: Vec<u32>, row: Vec<u32>) -> Self {
        Columns { start, row }
    }

    /// Number of block rows.
    pub fn n(&self) -> usize {
        self.start.len() - 1
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.row.len()
    }

    /// Places of a column's blocks; the last is the diagonal.
    #[inline(always)]
    pub fn column(&self, column: usize) -> Range<usize> {
        self.start[column] as usize..self.start[column + 1] as usize
    }

    /// Rows of a column's blocks.
    #[inline(always)]
    pub fn rows(&self, column: usize) -> &[u32] {
        &self.row[self.column(column)]
    }

    /// Place of the diagonal block.
    pub fn diagonal(&self, column: usize) -> usize {
        self.start[column + 1] as usize - 1
    }
}

/// The upper triangle: rows ascend within a column.
#[derive(Clone)]
pub(super) struct Upper(pub Arc<Columns>);

impl Deref for Upper {
    type Target = Columns;

    #[inline(always)]
    fn deref(&self) -> &Columns {
        &self.0
    }
}

impl Upper {
    /// From its pairs of row and column, column by column, rows ascending, the diagonal among them.
    pub fn new(n: usize, pairs: impl Iterator<Item = (u32, u32)>) -> Result<Self, FactorError> {
        let invalid =
            |column: usize, reason| Err(FactorError::InvalidPattern { column: 3 * column, reason });
        let (mut start, mut row) = (vec![0u32; n + 1], Vec::new());
        let mut last = (0, 0);
        for (r, c) in pairs {
            if r > c || c as usize >= n || (!row.is_empty() && (c, r) <= last) {
                return invalid(
                    c as usize,
                    "its blocks must come by columns, their rows ascending",
                );
            }
            last = (c, r);
            row.push(r);
            start[c as usize + 1] = row.len() as u32;
        }
        for column in 0..n {
            let (from, end) = (start[column], start[column + 1]);
            if end <= from || row[end as usize - 1] as usize != column {
                return invalid(column, "its last block must be the diagonal");
            }
        }
        Ok(Upper(Arc::new(Columns { start, row })))
    }

    /// The same from pairs that are in this order.
    pub fn sorted(n: usize, pairs: &[(u32, u32)]) -> Self {
        let mut start = vec![0u32; n + 1];
        pairs.iter().for_each(|&(_, column)| start[column as usize + 1] += 1);
        (0..n).for_each(|column| start[column + 1] += start[column]);
        Upper(Arc::new(Columns { start, row: pairs.iter().map(|pair| pair.0).collect() }))
    }

    /// Row and column of every block.
    pub fn pairs(&self) -> impl Iterator<Item = (u32, u32)> + Clone + '_ {
        (0..self.n())
            .flat_map(|column| self.rows(column).iter().map(move |&row| (row, column as u32)))
    }

    /// Place of a block, row <= column, that is there.
    pub fn place(&self, row: u32, column: u32) -> usize {
        let found = self.rows(column as usize).binary_search(&row);
        self.start[column as usize] as usize
            + found.unwrap_or_else(|_| unreachable!("no such block"))
    }
}
