//! The elimination tree by supernodes: which one's columns the first row below each belongs to, and how its rows are
//! numbered there.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

/// First row, number of columns and number of rows below of a supernode.
pub(super) fn shape(symbolic: &SymbolicSupernodalCholesky<u32>, s: usize) -> (usize, usize, usize) {
    let [first, end] = [symbolic.supernode_begin()[s], symbolic.supernode_end()[s]];
    (first as usize, (end - first) as usize, symbolic.supernode(s).pattern().len())
}

/// The supernode that holds the first row below each.
pub(super) fn parents(symbolic: &SymbolicSupernodalCholesky<u32>) -> Vec<Option<usize>> {
    let mut of_row = vec![0; symbolic.nrows()];
    for s in 0..symbolic.n_supernodes() {
        let (first, pivots, _) = shape(symbolic, s);
        of_row[first..first + pivots].fill(s);
    }
    let first_below = |s| symbolic.supernode(s).pattern().first();
    (0..symbolic.n_supernodes()).map(|s| first_below(s).map(|&row| of_row[row as usize])).collect()
}

/// Number of a row in a supernode: its own columns come first, then the rows below.
pub(super) fn local(symbolic: &SymbolicSupernodalCholesky<u32>, s: usize, row: u32) -> usize {
    let (first, pivots, _) = shape(symbolic, s);
    match (row as usize).checked_sub(first) {
        Some(pivot) if pivot < pivots => pivot,
        _ => pivots + symbolic.supernode(s).pattern().partition_point(|&below| below < row),
    }
}
