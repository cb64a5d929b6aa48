//! Fill-reducing orderings: minimum degree or nested dissection of the graph of nodes, whichever makes less work; numbered
//! along the elimination tree so that columns with like patterns become neighbours (supernodes).
//!
//! Minimum degree does best for small and thin bodies, dissection for large and thick ones.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use super::dissection::dissection;
use super::graph::{Graph, NONE};
use super::{FactorError, Pattern};

/// The rows of the matrix in elimination order: entry `k` is the caller's row that is eliminated `k`-th.
pub(super) fn elimination_order(pattern: &Pattern) -> Result<Vec<u32>, FactorError> {
    let graph = Graph::new(pattern);
    let along_tree = |order: Vec<u32>| -> (f64, Vec<u32>) {
        let tree = elimination_tree(&graph, &order);
        let work = work(&graph, &order, &tree);
        (work, postorder(&tree).into_iter().map(|step| order[step as usize]).collect())
    };
    let [by_degree, by_dissection] = [minimum_degree(&graph)?, dissection(&graph)].map(along_tree);
    let (_, least) = if by_dissection.0 < by_degree.0 { by_dissection } else { by_degree };
    Ok(graph.rows_of(&least))
}

/// Where each of the caller's rows is in `order`.
pub(super) fn inverse(order: &[u32]) -> Vec<u32> {
    let mut position = vec![0; order.len()];
    for (k, &row) in order.iter().enumerate() {
        position[row as usize] = k as u32;
    }
    position
}

/// Approximate minimum degree.
fn minimum_degree(graph: &Graph) -> Result<Vec<u32>, FactorError> {
    let n = graph.n;
    let (start, neighbour) = (&graph.start, &graph.neighbour);
    let pattern = SymbolicSparseColMatRef::new_checked(n, n, start, None, neighbour);
    let (mut order, mut position) = (vec![0u32; n], vec![0u32; n]);
    let mut memory = MemBuffer::try_new(amd::order_scratch::<u32>(n, neighbour.len()))
        .map_err(|_| FactorError::OutOfMemory)?;
    amd::order(
        &mut order,
        &mut position,
        pattern,
        amd::Control::default(),
        MemStack::new(&mut memory),
    )
    .map_err(|_| FactorError::TooLarge { n })?;
    Ok(order)
}

/// Parent of every elimination step in the elimination tree (Liu's algorithm with path compression).
fn elimination_tree(graph: &Graph, order: &[u32]) -> Vec<u32> {
    let position = inverse(order);
    let mut parent = vec![NONE; graph.n];
    let mut ancestor = vec![NONE; graph.n];
    for k in 0..graph.n {
        for other in graph.neighbours(order[k]) {
            let mut step = position[other] as usize;
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

/// Multiplications of a factorisation, about: the sum of the squares of its columns' lengths. Every block row of the
/// factor is the part of the tree between the block's neighbours and the block itself.
fn work(graph: &Graph, order: &[u32], parent: &[u32]) -> f64 {
    let position = inverse(order);
    let size: Vec<u32> = order.iter().map(|&block| graph.size(block)).collect();
    let mut length = size.clone();
    let mut seen_from = vec![NONE; graph.n];
    for k in 0..graph.n {
        seen_from[k] = k as u32;
        for other in graph.neighbours(order[k]) {
            let mut step = position[other] as usize;
            while step < k && seen_from[step] != k as u32 {
                seen_from[step] = k as u32;
                length[step] += size[k];
                step = parent[step] as usize;
            }
        }
    }
    // The columns of a block are each shorter by one than the last.
    let squares = |(&length, &size): (&u32, &u32)| -> f64 {
        (0..size).map(|column| f64::from(length - column).powi(2)).sum()
    };
    length.iter().zip(&size).map(squares).sum()
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

#[cfg(test)]
mod tests {
    use super::super::test_matrices::{Matrix, elastic_block};
    use super::*;
    use std::collections::BTreeSet;

    fn is_permutation(order: &[u32], n: usize) -> bool {
        let mut seen = vec![false; n];
        order.len() == n
            && order
                .iter()
                .all(|&row| (row as usize) < n && !std::mem::replace(&mut seen[row as usize], true))
    }

    /// Columns of the factor in this order of rows, each with the steps of the rows below its diagonal, by the definition.
    fn columns(pattern: &Pattern, order: &[u32]) -> Vec<BTreeSet<u32>> {
        let position = inverse(order);
        let mut below = vec![BTreeSet::new(); pattern.n];
        for column in 0..pattern.n {
            for entry in pattern.column(column) {
                let [a, b] = [pattern.row[entry] as usize, column].map(|row| position[row]);
                below[a.min(b) as usize].insert(a.max(b));
            }
        }
        for k in 0..pattern.n {
            below[k].remove(&(k as u32));
            let mut passed_on = below[k].clone();
            if let Some(parent) = passed_on.pop_first() {
                below[parent as usize].extend(passed_on);
            }
        }
        below
    }

    /// Entries of the factor.
    fn fill(pattern: &Pattern, order: &[u32]) -> usize {
        columns(pattern, order).iter().map(|rows| 1 + rows.len()).sum()
    }

    /// The orders that are compared, of rows.
    fn orders(pattern: &Pattern) -> Vec<Vec<u32>> {
        let graph = Graph::new(pattern);
        let orders = [minimum_degree(&graph).unwrap(), dissection(&graph)];
        orders.iter().map(|order| graph.rows_of(order)).collect()
    }

    #[test]
    fn nested_dissection_fills_less_than_the_natural_order() {
        let pattern = elastic_block(12, 12, 12).pattern;
        let natural: Vec<u32> = (0..pattern.n as u32).collect();
        let dissected = elimination_order(&pattern).unwrap();
        assert!(is_permutation(&dissected, pattern.n));
        assert!(3 * fill(&pattern, &dissected) < 2 * fill(&pattern, &natural));
    }

    #[test]
    fn the_rows_of_a_node_are_a_block() {
        let pattern = elastic_block(4, 3, 2).pattern;
        let graph = Graph::new(&pattern);
        assert_eq!(pattern.n, 3 * graph.n);
        assert!((0..graph.n as u32).all(|block| graph.size(block) == 3));
        assert_eq!(graph.rows_of(&[2, 0]), [6, 7, 8, 0, 1, 2]);
        for block in 0..graph.n as u32 {
            let neighbours: Vec<usize> = graph.neighbours(block).collect();
            let expected: BTreeSet<usize> = (0..graph.n)
                .filter(|&other| other != block as usize)
                .filter(|&other| {
                    let (low, high) =
                        (3 * other.min(block as usize), 3 * other.max(block as usize));
                    pattern.row[pattern.column(high)].contains(&(low as u32))
                })
                .collect();
            assert!(neighbours.is_sorted() && neighbours.into_iter().eq(expected));
        }
    }

    #[test]
    fn rows_with_other_entries_are_blocks_of_their_own() {
        // Rows 1 and 2 have the same entries; 3 has them all but for the one with 0.
        let entries = [(0, 1, 1.0), (0, 2, 1.0), (1, 2, 1.0), (1, 3, 1.0), (2, 3, 1.0)];
        let graph = Graph::new(&Matrix::from_entries(4, &entries).pattern);
        assert_eq!(graph.first_row, [0, 1, 3, 4]);
        assert_eq!((graph.start, graph.neighbour), (vec![0, 1, 3, 4], vec![1, 0, 2, 1]));
    }

    #[test]
    fn subtrees_are_contiguous_and_keep_the_fill() {
        let pattern = elastic_block(7, 6, 5).pattern;
        let order = elimination_order(&pattern).unwrap();
        let fills: Vec<usize> =
            orders(&pattern).iter().map(|order| fill(&pattern, order)).collect();
        assert!(fills.contains(&fill(&pattern, &order)));
        let columns = columns(&pattern, &order);
        let mut first_below: Vec<usize> = (0..pattern.n).collect();
        let mut size = vec![1; pattern.n];
        for k in 0..pattern.n {
            assert_eq!(k + 1 - first_below[k], size[k]);
            if let Some(&parent) = columns[k].first() {
                let up = parent as usize;
                first_below[up] = first_below[up].min(first_below[k]);
                size[up] += size[k];
            }
        }
    }

    #[test]
    fn the_order_with_the_least_work_wins() {
        for pattern in [elastic_block(2, 2, 30).pattern, elastic_block(12, 12, 12).pattern] {
            let work_of = |order: &Vec<u32>| -> f64 {
                let lengths = columns(&pattern, order).into_iter().map(|rows| 1 + rows.len());
                lengths.map(|length| (length as f64).powi(2)).sum()
            };
            let best = work_of(&elimination_order(&pattern).unwrap());
            let all: Vec<f64> = orders(&pattern).iter().map(work_of).collect();
            assert_eq!(best, all.into_iter().fold(f64::INFINITY, f64::min));
        }
    }

    #[test]
    fn work_is_the_sum_of_squares_of_the_columns() {
        // A path eliminated from its middle: 1 - 0 - 2, whose neighbours then meet.
        let pattern = Matrix::from_entries(3, &[(0, 1, 1.0), (0, 2, 1.0)]).pattern;
        let graph = Graph::new(&pattern);
        for (order, expected) in [([0, 1, 2], 9.0 + 4.0 + 1.0), ([1, 2, 0], 4.0 + 4.0 + 1.0)] {
            assert_eq!(work(&graph, &order, &elimination_tree(&graph, &order)), expected);
        }
    }

    #[test]
    fn work_counts_the_rows_of_blocks() {
        let pattern = elastic_block(4, 3, 2).pattern;
        let graph = Graph::new(&pattern);
        let order = minimum_degree(&graph).unwrap();
        let lengths =
            columns(&pattern, &graph.rows_of(&order)).into_iter().map(|rows| 1 + rows.len());
        let expected: f64 = lengths.map(|length| (length as f64).powi(2)).sum();
        assert_eq!(work(&graph, &order, &elimination_tree(&graph, &order)), expected);
    }

    #[test]
    fn minimum_degree_stands_in() {
        let pattern = elastic_block(7, 6, 5).pattern;
        let graph = Graph::new(&pattern);
        let order = graph.rows_of(&minimum_degree(&graph).unwrap());
        let natural: Vec<u32> = (0..pattern.n as u32).collect();
        assert!(is_permutation(&order, pattern.n));
        assert!(fill(&pattern, &order) < fill(&pattern, &natural));
    }

    #[test]
    fn orders_any_graph() {
        let star: Vec<_> = (1..3000).map(|i| (0, i, 1.0)).collect();
        let path: Vec<_> = (1..3000).map(|i| (i - 1, i, 1.0)).collect();
        let clique: Vec<_> = (0..300).flat_map(|i| (0..i).map(move |j| (i, j, 1.0))).collect();
        for entries in [vec![], star, path, clique] {
            let pattern = Matrix::from_entries(3000, &entries).pattern;
            assert!(is_permutation(&elimination_order(&pattern).unwrap(), 3000));
        }
    }

    #[test]
    fn tells_a_permutation() {
        assert!(is_permutation(&[2, 0, 1], 3));
        assert!(!is_permutation(&[2, 0, 2], 3));
        assert!(!is_permutation(&[0, 1], 3));
        assert!(!is_permutation(&[0, 1, 3], 3));
    }
}
