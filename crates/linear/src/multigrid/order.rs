//! The blocks of a level in the order of sweeps over its parts.

use super::columns::{Columns, Upper};
use super::parts::{Parts, Turn};
use std::ops::Range;
use std::sync::Arc;

/// Where the blocks stand: each in the column of that of its nodes to which sweeps forward come later.
pub(super) struct Order {
    pub columns: Arc<Columns>,
    /// The blocks that are transposed, since sweeps come to their row later: places in the upper triangle and here.
    pub transposed: Vec<[u32; 2]>,
}

impl Order {
    pub fn new(upper: &Upper, parts: &Parts) -> Self {
        let beside = beside(upper, parts);
        if beside.is_empty() {
            return Order { columns: upper.0.clone(), transposed: Vec::new() };
        }
        let n = upper.n();
        let mut start = vec![0u32; n + 1];
        (0..n).for_each(|column| start[column + 1] = upper.rows(column).len() as u32);
        for &(row, column, _) in &beside {
            start[column as usize + 1] -= 1;
            start[row as usize + 1] += 1;
        }
        (0..n).for_each(|column| start[column + 1] += start[column]);
        let (mut rows, mut free) = (vec![0; upper.len()], vec![0; n]);
        for column in 0..n {
            let (from, to) =
                (upper.column(column), start[column] as usize..start[column + 1] as usize);
            let stay = staying(from.clone(), to.clone());
            let stayed = &upper.rows(column)[stay.start - from.start..stay.end - from.start];
            rows[to.start..][..stay.len()].copy_from_slice(stayed);
            rows[to.end - 1] = column as u32;
            free[column] = to.start + stay.len();
        }
        let transpose = |(row, column, place): (u32, u32, u32)| {
            let to = free[row as usize];
            rows[to] = column;
            free[row as usize] += 1;
            [place, to as u32]
        };
        let transposed = beside.into_iter().map(transpose).collect();
        Order { columns: Arc::new(Columns::new(start, rows)), transposed }
    }

    /// Places, above and here, of the blocks of a column that stand in it here as well, without the diagonal.
    pub fn staying(&self, upper: &Upper, column: usize) -> (Range<usize>, Range<usize>) {
        let (from, to) = (upper.column(column), self.columns.column(column));
        let stay = staying(from, to.clone());
        let here = to.start..to.start + stay.len();
        (stay, here)
    }
}

/// Row, column and place of the blocks whose row is swept later than their column: those of a part with an even number to
/// the odd part before it.
fn beside(upper: &Upper, parts: &Parts) -> Vec<(u32, u32, u32)> {
    let mut found = Vec::new();
    for part in parts.of(Turn::Even).skip(1) {
        for column in part.nodes.clone() {
            let blocks = upper.rows(column).iter().zip(upper.column(column));
            let beside = blocks.take_while(|&(&row, _)| (row as usize) < part.nodes.start);
            found.extend(beside.map(|(&row, place)| (row, column as u32, place as u32)));
        }
    }
    found
}

/// A column of the upper triangle loses its first blocks, or gets more before its diagonal.
fn staying(from: Range<usize>, to: Range<usize>) -> Range<usize> {
    let staying = from.len().min(to.len()) - 1;
    from.end - 1 - staying..from.end - 1
}
