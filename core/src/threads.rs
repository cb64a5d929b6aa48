//! Which loops threads share: below some tasks, waking another thread takes longer than the work it takes over.

/// Tasks of some tens of microseconds from which threads share a loop.
const FEWEST: usize = 8;

/// Whether threads share a loop of so many tasks.
pub fn share(tasks: usize) -> bool {
    tasks >= FEWEST && rayon::current_num_threads() > 1
}
