//! Fill-reducing orderings: minimum degree, or one of a few nested dissections of the matrix graph, whichever makes the
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
    let mut best: (f64, Vec<u32>) = along_tree(minimum_degree(pattern)?);
    for order in nested_dissections(&graph) {
        let other = along_tree(order);
        if other.0 < best.0 {
            best = other;
        }
    }
    Ok(best.1)
}

/// Where each of the caller's rows is in `order`.
pub(super) fn inverse(order: &[u32]) -> Vec<u32> {
    let mut position = vec![0; order.len()];
    for (k, &row) in order.iter().enumerate() {
        position[row as usize] = k as u32;
    }
    position
}

/// Nested dissections, less those for which the partitioner fails or returns no permutation.
#[cfg(not(target_family = "wasm"))]
fn nested_dissections(graph: &Graph) -> impl Iterator<Item = Vec<u32>> {
    use feral_scotch::{CscPattern, ScotchOptions, scotch_order_full};
    let pattern = CscPattern::new(graph.n, &graph.start, &graph.neighbour);
    SEEDS.into_iter().filter_map(move |seed| {
        // Further down, and less evenly, than by default: it takes a tenth off the work for organs.
        let options =
            ScotchOptions { amd_switch: 30, max_imbalance: 0.2, seed, ..Default::default() };
        let (order, _, _) = scotch_order_full(pattern.as_ref()?, &options).ok()?;
        let order: Vec<u32> = order.into_iter().map(|row| row as u32).collect();
        is_permutation(&order, graph.n).then_some(order)
    })
}

/// In a page the partitioner cannot run, as it times itself; organs that are stepped there are small.
#[cfg(target_family = "wasm")]
fn nested_dissections(_: &Graph) -> impl Iterator<Item = Vec<u32>> {
    std::iter::empty()
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

/// Neighbours of every row, from both triangles, without the diagonal, ascending.
struct Graph {
    n: usize,
    start: Vec<i32>,
    neighbour: Vec<i32>,
}

impl Graph {
    fn new(pattern: &Pattern) -> Self {
        let n = pattern.n;
        let off_diagonal = |column: usize| {
            let entries = pattern.column(column);
            pattern.row[entries.start..entries.end - 1].iter().map(|&row| row as usize)
        };
        let mut start = vec![0i32; n + 1];
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
        Self { n, start, neighbour }
    }

    fn neighbours(&self, row: u32) -> impl Iterator<Item = usize> + '_ {
        let row = row as usize;
        let entries = self.start[row] as usize..self.start[row + 1] as usize;
        self.neighbour[entries].iter().map(|&other| other as usize)
    }
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

/// Multiplications of a factorisation, about: the sum of the squares of its columns' lengths. Every row of the factor
/// is the part of the tree between the row's neighbours and the row itself.
fn work(graph: &Graph, order: &[u32], parent: &[u32]) -> f64 {
    let position = inverse(order);
    let mut length = vec![1u32; graph.n];
    let mut seen_from = vec![NONE; graph.n];
    for k in 0..graph.n {
        seen_from[k] = k as u32;
        for other in graph.neighbours(order[k]) {
            let mut step = position[other] as usize;
            while step < k && seen_from[step] != k as u32 {
                seen_from[step] = k as u32;
                length[step] += 1;
                step = parent[step] as usize;
            }
        }
    }
    length.into_iter().map(|length| f64::from(length).powi(2)).sum()
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

    /// Entries of the factor in this elimination order, by merging the patterns of the children in the tree.
    fn fill(pattern: &Pattern, order: &[u32]) -> usize {
        let graph = Graph::new(pattern);
        let position = inverse(order);
        let parent = elimination_tree(&graph, order);
        let mut below = vec![std::collections::BTreeSet::new(); graph.n];
        for k in 0..graph.n {
            let later = |&other: &u32| other > k as u32;
            below[k].extend(graph.neighbours(order[k]).map(|row| position[row]).filter(later));
            if parent[k] != NONE {
                assert_eq!(below[k].first(), Some(&parent[k]));
                let passed_on: Vec<u32> = below[k].iter().copied().skip(1).collect();
                below[parent[k] as usize].extend(passed_on);
            }
        }
        graph.n + below.iter().map(|rows| rows.len()).sum::<usize>()
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
    fn subtrees_are_contiguous_and_keep_the_fill() {
        let pattern = elastic_block(7, 6, 5).pattern;
        let order = elimination_order(&pattern).unwrap();
        let graph = Graph::new(&pattern);
        let orders = nested_dissections(&graph).chain(minimum_degree(&pattern));
        let fills: Vec<usize> = orders.map(|order| fill(&pattern, &order)).collect();
        assert!(fills.contains(&fill(&pattern, &order)));
        let parent = elimination_tree(&Graph::new(&pattern), &order);
        let mut first_below: Vec<usize> = (0..pattern.n).collect();
        let mut size = vec![1; pattern.n];
        for k in 0..pattern.n {
            assert_eq!(k + 1 - first_below[k], size[k]);
            if parent[k] != NONE {
                let up = parent[k] as usize;
                first_below[up] = first_below[up].min(first_below[k]);
                size[up] += size[k];
            }
        }
    }

    #[test]
    fn the_order_with_the_least_work_wins() {
        for pattern in [elastic_block(2, 2, 30).pattern, elastic_block(12, 12, 12).pattern] {
            let graph = Graph::new(&pattern);
            let work_of = |order: &[u32]| work(&graph, order, &elimination_tree(&graph, order));
            let best = work_of(&elimination_order(&pattern).unwrap());
            let orders = nested_dissections(&graph).chain(minimum_degree(&pattern));
            let all: Vec<f64> = orders.map(|order| work_of(&order)).collect();
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
    fn minimum_degree_stands_in() {
        let pattern = elastic_block(7, 6, 5).pattern;
        let order = minimum_degree(&pattern).unwrap();
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
