//! The elimination tree in subtrees that threads share: what is below one reaches the rest of the factor only through the
//! rows below its topmost supernode.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

use super::tree::{parents, shape};
use crate::threads::both;

/// Supernodes that one thread works on in a piece, and the subtrees below them. Its rows have numbers of their own: those of
/// its columns come first, then the rows below.
pub(super) struct Subtree {
    pub supernodes: Range<usize>,
    /// Its columns in elimination order.
    pub columns: Range<usize>,
    /// Rows below its last supernode.
    pub below: usize,
    /// The rows below each of its supernodes in its own numbers, one after the other.
    pub rows: Vec<u32>,
    /// The subtrees right below it.
    pub children: Vec<usize>,
    /// Its rows below in the numbers of the subtree above it.
    pub above: Vec<u32>,
    /// Its place among all.
    pub number: usize,
    /// How many subtrees are in it, itself included: those before it.
    pub size: usize,
    /// The subtree at the bottom whose memory serves this one, too: where one comes to by the largest child each time.
    pub room: usize,
    /// Entries of the factor in all of them.
    entries: usize,
}

/// All subtrees, each after those below it.
pub(super) struct Subtrees {
    pub all: Vec<Subtree>,
    /// Those that nothing is above.
    pub roots: Vec<usize>,
    /// Most entries of a piece.
    grain: usize,
}

impl Subtrees {
    /// Cuts the tree of a factor, every subtree of which is contiguous, into pieces of at most `grain` entries, and the
    /// supernodes above them.
    pub fn new(symbolic: &SymbolicSupernodalCholesky<u32>, grain: usize) -> Self {
        let parents = parents(symbolic);
        let entries = |s: usize| {
            let offsets = symbolic.col_ptr_for_val();
            (offsets[s + 1] - offsets[s]) as usize
        };
        let n = symbolic.n_supernodes();
        let (mut sums, mut first): (Vec<_>, Vec<_>) =
            ((0..n).map(entries).collect(), (0..n).collect());
        for (s, parent) in parents.iter().enumerate() {
            if let Some(parent) = *parent {
                sums[parent] += sums[s];
                first[parent] = first[parent].min(first[s]);
            }
        }
        // A supernode is the top of a piece if what is above it is too large for one.
        let is_top = |s: usize| parents[s].is_none_or(|parent| sums[parent] > grain);
        let mut cut = Self { all: Vec::new(), roots: Vec::new(), grain };
        let mut below: Vec<Vec<usize>> = vec![Vec::new(); n]; // the subtrees right below a supernode
        for s in (0..n).filter(|&s| is_top(s)) {
            let children = std::mem::take(&mut below[s]);
            let supernodes = if sums[s] > grain { s..s + 1 } else { first[s]..s + 1 };
            parents[s].map_or(&mut cut.roots, |parent| &mut below[parent]).push(cut.all.len());
            cut.push(symbolic, supernodes, children, sums[s]);
        }
        cut
    }

    fn push(
        &mut self,
        symbolic: &SymbolicSupernodalCholesky<u32>,
        supernodes: Range<usize>,
        children: Vec<usize>,
        entries: usize,
    ) {
        let top = supernodes.end - 1;
        let columns = shape(symbolic, supernodes.start).0..symbolic.supernode_end()[top] as usize;
        let below = symbolic.supernode(top).pattern();
        let own = |row: u32| match (row as usize).checked_sub(columns.end) {
            None => row - columns.start as u32,
            Some(_) => (columns.len() + below.partition_point(|&b| b < row)) as u32,
        };
        let rows =
            supernodes.clone().flat_map(|s| symbolic.supernode(s).pattern()).map(|&row| own(row));
        let rows = rows.collect();
        for &child in &children {
            let top = self.all[child].supernodes.end - 1;
            self.all[child].above =
                symbolic.supernode(top).pattern().iter().map(|&row| own(row)).collect();
        }
        let size = 1 + children.iter().map(|&child| self.all[child].size).sum::<usize>();
        let number = self.all.len();
        let largest = children.iter().map(|&child| &self.all[child]).max_by_key(|s| s.entries);
        self.all.push(Subtree {
            room: largest.map_or(number, |child| child.room),
            below: below.len(),
            above: Vec::new(),
            supernodes,
            columns,
            rows,
            children,
            number,
            size,
            entries,
        });
    }

    /// Runs these subtrees, which follow each other, each with its part of what belongs to it and to those below it: as many
    /// items as there are subtrees. Threads share them if they may.
    pub fn each<T: Send>(
        &self,
        subtrees: &[usize],
        items: &mut [T],
        is_shared: bool,
        run: &(impl Fn(&Subtree, &mut [T]) + Sync),
    ) {
        match *subtrees {
            [] => {}
            [only] => run(&self.all[only], items),
            _ => {
                let (left, right) = subtrees.split_at(subtrees.len() / 2);
                let sum = |of: &[usize], what: fn(&Subtree) -> usize| {
                    of.iter().map(|&k| what(&self.all[k])).sum::<usize>()
                };
                let (its, others) = items.split_at_mut(sum(left, |subtree| subtree.size));
                let least = sum(left, |s| s.entries).min(sum(right, |s| s.entries));
                let one = || self.each(left, its, is_shared, run);
                let other = || self.each(right, others, is_shared, run);
                both(is_shared && 2 * least >= self.grain, one, other);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::analysis::Analysis;
    use super::super::test_matrices::elastic_block;
    use super::*;

    fn cut(grain: usize) -> (Subtrees, Analysis<f64>) {
        let analysis = Analysis::new(&elastic_block(9, 8, 7).pattern).unwrap();
        (Subtrees::new(&analysis.supernodes, grain), analysis)
    }

    #[test]
    fn a_small_factor_is_one_piece() {
        let (subtrees, analysis) = cut(1_000_000);
        assert_eq!((subtrees.all.len(), &subtrees.roots[..]), (1, &[0][..]));
        assert_eq!(subtrees.all[0].supernodes, 0..analysis.supernodes.n_supernodes());
    }

    #[test]
    fn pieces_are_the_whole_and_none_is_too_large() {
        let (subtrees, analysis) = cut(5_000);
        let supernodes = subtrees.all.iter().flat_map(|subtree| subtree.supernodes.clone());
        assert!(supernodes.eq(0..analysis.supernodes.n_supernodes()));
        let columns = subtrees.all.iter().flat_map(|subtree| subtree.columns.clone());
        assert!(columns.eq(0..analysis.n()));
        assert!(subtrees.all.iter().any(|subtree| subtree.supernodes.len() > 1));
        for subtree in &subtrees.all {
            assert!(subtree.entries <= 5_000 || subtree.supernodes.len() == 1);
        }
        assert_eq!(subtrees.roots, [subtrees.all.len() - 1]);
        assert_eq!(subtrees.all.last().unwrap().size, subtrees.all.len());
    }

    #[test]
    fn every_piece_runs_once_with_its_own() {
        let (subtrees, _) = cut(2_000);
        fn visit(subtrees: &Subtrees, subtree: &Subtree, items: &mut [Vec<usize>]) {
            let (own, below) = items.split_last_mut().unwrap();
            own.push(subtree.columns.start);
            subtrees.each(&subtree.children, below, true, &|child, items| {
                visit(subtrees, child, items)
            });
        }
        let mut items = vec![Vec::new(); subtrees.all.len()];
        subtrees
            .each(&subtrees.roots, &mut items, true, &|root, items| visit(&subtrees, root, items));
        assert!(
            subtrees.all.iter().zip(items).all(|(subtree, item)| item == [subtree.columns.start])
        );
    }

    #[test]
    fn rows_below_are_those_of_the_subtree_above() {
        let (subtrees, analysis) = cut(2_000);
        let symbolic = &analysis.supernodes;
        let below = |subtree: &Subtree| symbolic.supernode(subtree.supernodes.end - 1).pattern();
        for subtree in &subtrees.all {
            for child in subtree.children.iter().map(|&child| &subtrees.all[child]) {
                for (&row, &above) in below(child).iter().zip(&child.above) {
                    let own = subtree.columns.len();
                    let there = match (above as usize).checked_sub(own) {
                        None => subtree.columns.start as u32 + above,
                        Some(k) => below(subtree)[k],
                    };
                    assert_eq!(row, there);
                }
            }
        }
    }
}
