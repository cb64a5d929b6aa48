//! Fill-reducing orderings: nested dissection of the matrix graph, numbered along the elimination tree
//! so that columns with like patterns become neighbours (supernodes).

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;
use feral_scotch::{CscPattern, scotch_order};

use super::{FactorError, Pattern};

const NONE: u32 = u32::MAX;

/// The rows of the matrix in elimination order: entry `k` is the caller's row that is eliminated `k`-th.
pub(super) fn elimination_order(pattern: &Pattern) -> Result<Vec<u32>, FactorError> {
    let order = match nested_dissection(pattern) {
        Some(order) => order,
        None => minimum_degree(pattern)?,
    };
    let parent = elimination_tree(pattern, &order);
    Ok(postorder(&parent)
        .into_iter()
        .map(|k| order[k as usize])
        .collect())
}

/// Where each of the caller's rows is in `order`.
pub(super) fn inverse(order: &[u32]) -> Vec<u32> {
    let mut position = vec![0; order.len()];
    for (k, &row) in order.iter().enumerate() {
        position[row as usize] = k as u32;
    }
    position
}

/// Nested dissection, or nothing where the partitioner fails or returns no permutation.
fn nested_dissection(pattern: &Pattern) -> Option<Vec<u32>> {
    let (start, neighbour) = adjacency(pattern);
    let graph = CscPattern::new(pattern.n, &start, &neighbour)?;
    let order: Vec<u32> = scotch_order(&graph)
        .ok()?
        .into_iter()
        .map(|row| row as u32)
        .collect();
    is_permutation(&order, pattern.n).then_some(order)
}

/// Approximate minimum degree.
fn minimum_degree(pattern: &Pattern) -> Result<Vec<u32>, FactorError> {
    let n = pattern.n;
    let graph =
        SymbolicSparseColMatRef::new_checked(n, n, &pattern.column_start, None, &pattern.row);
    let (mut order, mut position) = (vec![0u32; n], vec![0u32; n]);
    let mut memory = MemBuffer::try_new(amd::order_scratch::<u32>(n, pattern.len()))
        .map_err(|_| FactorError::OutOfMemory)?;
    amd::order(
        &mut order,
        &mut position,
        graph,
        amd::Control::default(),
        MemStack::new(&mut memory),
    )
    .map_err(|_| FactorError::TooLarge { n })?;
    Ok(order)
}

/// Neighbours of every row, both triangles, without the diagonal, ascending.
fn adjacency(pattern: &Pattern) -> (Vec<i32>, Vec<i32>) {
    let n = pattern.n;
    let mut start = vec![0i32; n + 1];
    let off_diagonal = |column: usize| {
        let entries = pattern.column(column);
        pattern.row[entries.start..entries.end - 1]
            .iter()
            .map(|&row| row as usize)
    };
    for column in 0..n {
        for row in off_diagonal(column) {
            start[row + 1] += 1;
            start[column + 1] += 1;
        }
    }
    for row in 0..n {
        start[row + 1] += start[row];
    }
    let mut next = start.clone();
    let mut neighbour = vec![0i32; start[n] as usize];
    let mut append = |row: usize, other: usize| {
        neighbour[next[row] as usize] = other as i32;
        next[row] += 1;
    };
    // Column by column, a row receives first its smaller neighbours, then the greater ones in order.
    for column in 0..n {
        for row in off_diagonal(column) {
            append(column, row);
            append(row, column);
        }
    }
    (start, neighbour)
}

fn is_permutation(order: &[u32], n: usize) -> bool {
    let mut seen = vec![false; n];
    order.len() == n
        && order
            .iter()
            .all(|&row| (row as usize) < n && !std::mem::replace(&mut seen[row as usize], true))
}

/// Parent of every elimination step in the elimination tree (Liu's algorithm with path compression).
fn elimination_tree(pattern: &Pattern, order: &[u32]) -> Vec<u32> {
    let n = pattern.n;
    let (start, neighbour) = adjacency(pattern);
    let position = inverse(order);
    let mut parent = vec![NONE; n];
    let mut ancestor = vec![NONE; n];
    for k in 0..n {
        let row = order[k] as usize;
        for &other in &neighbour[start[row] as usize..start[row + 1] as usize] {
            let mut step = position[other as usize] as usize;
            while step < k {
                let next = std::mem::replace(&mut ancestor[step], k as u32);
                if next == NONE {
                    parent[step] = k as u32;
                    break;
                }
                step = next as usize;
            }
        }
    }
    parent
}

/// Steps of a forest such that every subtree is contiguous and ends at its root.
fn postorder(parent: &[u32]) -> Vec<u32> {
    let n = parent.len();
    let (mut first_child, mut sibling) = (vec![NONE; n], vec![NONE; n]);
    let mut stack = Vec::new();
    for step in (0..n).rev() {
        match parent[step] {
            NONE => stack.push(step as u32),
            up => {
                sibling[step] = first_child[up as usize];
                first_child[up as usize] = step as u32;
            }
        }
    }
    let mut order = Vec::with_capacity(n);
    while let Some(&step) = stack.last() {
        match std::mem::replace(&mut first_child[step as usize], NONE) {
            NONE => {
                order.push(step);
                stack.pop();
                if sibling[step as usize] != NONE {
                    stack.push(sibling[step as usize]);
                }
            }
            child => stack.push(child),
        }
    }
    order
}
