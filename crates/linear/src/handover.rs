//! What a front hands over to its parent in the elimination tree: a square of the rows below its pivots, which are rows of
//! the parent, run by run.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

use super::Precision;
use super::tree::{local, shape};

/// Rows of a front that follow each other in its parent's as well.
pub(super) struct Run {
    own: usize,
    pub parent: usize,
    length: usize,
}

/// The rows below a supernode in its parent's numbers; no run goes from the parent's pivots to its rows below.
pub(super) fn runs(
    symbolic: &SymbolicSupernodalCholesky<u32>,
    s: usize,
    parent: usize,
) -> Vec<Run> {
    let pivots = shape(symbolic, parent).1;
    let mut runs: Vec<Run> = Vec::new();
    for (own, &row) in symbolic.supernode(s).pattern().iter().enumerate() {
        let there = local(symbolic, parent, row);
        match runs.last_mut() {
            Some(run) if run.parent + run.length == there && there != pivots => run.length += 1,
            _ => runs.push(Run { own, parent: there, length: 1 }),
        }
    }
    runs
}

/// Adds to the columns of a front, `height` rows each, what a child of `below` rows has left to it: the columns of the
/// first `n` of these runs, and in each of them the rows of all runs. Row and column `first` of the front come first.
#[inline(always)]
pub(super) fn take_over<T: Precision>(
    left: &[T],
    below: usize,
    (runs, n): (&[Run], usize),
    columns: &mut [T],
    (height, first): (usize, usize),
) {
    for number in 0..n {
        for nth in 0..runs[number].length {
            let source = &left[(runs[number].own + nth) * below..][..below];
            let target = &mut columns[(runs[number].parent + nth - first) * height..][..height];
            let mut skip = nth; // what is above the diagonal
            for run in &runs[number..] {
                let target =
                    &mut target[run.parent + skip - first..run.parent + run.length - first];
                let source = &source[run.own + skip..run.own + run.length];
                target.iter_mut().zip(source).for_each(|(t, s)| *t += *s);
                skip = 0;
            }
        }
    }
}
