//! How loops over batches of cells are cut into parallel tasks.

use crate::threads::for_parts;

/// Number of batches that are given to the law together, so that their data stay in the first level
/// of cache.
pub(super) const RUN: usize = 8;

/// Batches per parallel task: large enough to hide the hand-over, fixed so that results do not
/// depend on the number of threads.
pub(super) const TASK: usize = 64;

/// Number of tasks that so many batches make.
pub(super) fn tasks(batches: usize) -> usize {
    batches.div_ceil(TASK)
}

/// Runs every task, with its number, on what belongs to its batches.
pub(super) fn for_tasks<T: Send>(of_batches: &mut [T], run: impl Fn(usize, &mut [T]) + Sync) {
    for_parts(of_batches, TASK, run);
}
