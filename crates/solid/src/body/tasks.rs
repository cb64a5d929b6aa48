//! How loops over batches of cells are cut into parallel tasks.

/// Number of batches that are given to the law together, so that their data stay in the first level
/// of cache.
pub(super) const RUN: usize = 8;

/// Batches of a parallel task, of cells with so many nodes: enough to hide the hand-over, few enough for their sums to
/// stay in the second level of cache, and fixed, so that results do not depend on the number of threads.
pub(super) const fn task(n_nodes: usize) -> usize {
    if n_nodes > 4 { 16 } else { 64 }
}
