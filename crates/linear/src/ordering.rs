//! Fill-reducing orderings: minimum degree, or one of a few nested dissections of the graph of nodes, whichever makes the
//! least work; numbered along the elimination tree so that columns with like patterns become neighbours (supernodes).
//!
//! Minimum degree does best for small and thin bodies, dissection for large and thick ones; dissections that begin
//! with other random numbers differ by a tenth.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use super::{FactorError, Pattern};

const NONE: u32 = u32::MAX;

/// Random numbers that nested dissections begin with.
#[cfg(not(target_family = "wasm"))]
const SEEDS: [u64; 2] = [1, 2];

/// The rows of the matrix in elimination order: entry `k` is the caller's row that is eliminated `k`-th.
pub(super) fn elimination_order(pattern: &Pattern) -> Result<Vec<u32>, FactorError> {
    let graph = Graph::new(pattern);
    let along_tree = |order: Vec<u32>| {
        let tree = elimination_tree(&graph, &order);
        let work = work(&graph, &order, &tree);
        (work, postorder(&tree).into_iter().map(|step| order[step as usize]).collect())
    };
    let mut best: (f64, Vec<u32>) = along_tree(minimum_degree(&graph)?);
    for order in nested_dissections(&graph) {
        let other = along_tree(order);
        if other.0 < best.0 {
            best = other;
        }
    }
    Ok(graph.rows_of(&best.1))
}

/// Where each of the caller's rows is in `order`.
pub(super) fn inverse(order: &[u32]) -> Vec<u32> {
    let mut position = vec![0; order.len()];
    for (k, &row) in order.iter().enumerate() {
        position[row as usize] = k as u32;
    }
    position
}

/// Nested dissections, on as many threads, less those for which the partitioner fails or returns no permutation.
#[cfg(not(target_family = "wasm"))]
fn nested_dissections(graph: &Graph) -> Vec<Vec<u32>> {
    use feral_scotch::{CscPattern, ScotchOptions, scotch_order_full};
    use rayon::prelude::*;
    let dissect = |seed| {
        let pattern = CscPattern::new(graph.n, &graph.start, &graph.neighbour)?;
        // For organs the work hardly depends on these, and the time does: two trials take three fifths of five.
        let (amd_switch, max_imbalance, n_sep_trials) = (60, 0.1, 2);
        let options =
            ScotchOptions { amd_switch, max_imbalance, n_sep_trials, seed, ..Default::default() };
        let (order, _, _) = scotch_order_full(&pattern, &options).ok()?;
        let order: Vec<u32> = order.into_iter().map(|row| row as u32).collect();
        is_permutation(&order, graph.n).then_some(order)
    };
    let found: Vec<Option<Vec<u32>>> = SEEDS.into_par_iter().map(dissect).collect();
    found.into_iter().flatten().collect()
}

/// In a page the partitioner cannot run, as it times itself; organs that are stepped there are small.
#[cfg(target_family = "wasm")]
fn nested_dissections(_: &Graph) -> Vec<Vec<u32>> {
    Vec::new()
}

/// Approximate minimum degree.
fn minimum_degree(graph: &Graph) -> Result<Vec<u32>, FactorError> {
    let n = graph.n;
    let unsigned = |numbers: &[i32]| -> Vec<u32> { numbers.iter().map(|&i| i as u32).collect() };
    let (start, neighbour) = (unsigned(&graph.start), unsigned(&graph.neighbour));
    let pattern = SymbolicSparseColMatRef::new_checked(n, n, &start, None, &neighbour);
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

/// Who neighbours whom among the blocks of a matrix, from both triangles, without the diagonal, ascending. A block is a
/// run of rows with the same entries, such as the three of a node: they fill in alike, so they are ordered as one.
struct Graph {
    /// Number of blocks.
    n: usize,
    start: Vec<i32>,
    neighbour: Vec<i32>,
    /// First row of each block, and the end of the last.
    first_row: Vec<u32>,
}

impl Graph {
    fn new(pattern: &Pattern) -> Self {
        let first_row = blocks(pattern);
        let n = first_row.len() - 1;
        let mut block_of = vec![NONE; pattern.n];
        first_row[..n].iter().enumerate().for_each(|(b, &row)| block_of[row as usize] = b as u32);
        // Between first rows there is an entry if and only if there is one between their blocks.
        let off_diagonal = |block: usize| {
            let entries = pattern.column(first_row[block] as usize);
            let rows = &pattern.row[entries.start..entries.end - 1];
            let blocks = rows.iter().map(|&row| block_of[row as usize]);
            blocks.filter(|&block| block != NONE).map(|block| block as usize)
        };
        let mut start = vec![0i32; n + 1];
        for block in 0..n {
            for other in off_diagonal(block) {
                start[other + 1] += 1;
                start[block + 1] += 1;
            }
        }
        for block in 0..n {
            start[block + 1] += start[block];
        }
        let mut next = start.clone();
        let mut neighbour = vec![0i32; start[n] as usize];
        let mut append = |block: usize, other: usize| {
            neighbour[next[block] as usize] = other as i32;
            next[block] += 1;
        };
        // Block by block, each receives first its smaller neighbours, then the greater ones in order.
        for block in 0..n {
            for other in off_diagonal(block) {
                append(block, other);
                append(other, block);
            }
        }
        Self { n, start, neighbour, first_row }
    }

    fn neighbours(&self, block: u32) -> impl Iterator<Item = usize> + '_ {
        let block = block as usize;
        let entries = self.start[block] as usize..self.start[block + 1] as usize;
        self.neighbour[entries].iter().map(|&other| other as usize)
    }

    /// Number of rows of a block.
    fn size(&self, block: u32) -> u32 {
        self.first_row[block as usize + 1] - self.first_row[block as usize]
    }

    /// The rows of these blocks.
    fn rows_of(&self, blocks: &[u32]) -> Vec<u32> {
        let rows =
            |&block: &u32| self.first_row[block as usize]..self.first_row[block as usize + 1];
        blocks.iter().flat_map(rows).collect()
    }
}

/// First row of each run of rows that have entries in the same columns, and the number of rows.
fn blocks(pattern: &Pattern) -> Vec<u32> {
    // Sums of a number for each neighbour and the row itself: equal where the entries are, and almost surely only there.
    let mut sum = vec![0u64; pattern.n];
    for column in 0..pattern.n {
        for entry in pattern.column(column) {
            let row = pattern.row[entry] as usize;
            sum[column] = sum[column].wrapping_add(scattered(row));
            if row != column {
                sum[row] = sum[row].wrapping_add(scattered(column));
            }
        }
    }
    let starts = (0..pattern.n).filter(|&row| row == 0 || sum[row] != sum[row - 1]);
    starts.chain([pattern.n]).map(|row| row as u32).collect()
}

/// A number that looks random (the finaliser of SplitMix64: Steele, Lea, Flood 2014).
fn scattered(row: usize) -> u64 {
    let mut z = (row as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(any(test, not(target_family = "wasm")))]
fn is_permutation(order: &[u32], n: usize) -> bool {
    let mut seen = vec![false; n];
    order.len() == n
        && order
            .iter()
            .all(|&row| (row as usize) < n && !std::mem::replace(&mut seen[row as usize], true))
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
        let orders = nested_dissections(&graph).into_iter().chain(minimum_degree(&graph));
        orders.map(|order| graph.rows_of(&order)).collect()
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
            assert_eq!(all.len(), 1 + SEEDS.len());
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
