//! Which loops threads share: below some tasks, waking another thread takes longer than the work it takes over.

use faer::Par;

/// Tasks of some tens of microseconds from which threads share a loop.
const FEWEST: usize = 8;

/// Dense kernels on all threads; a page has one.
pub fn all_threads() -> Par {
    #[cfg(target_family = "wasm")]
    return Par::Seq;
    #[cfg(not(target_family = "wasm"))]
    Par::rayon(0)
}

/// Whether threads share a loop of so many tasks.
pub fn share(tasks: usize) -> bool {
    tasks >= FEWEST && rayon::current_num_threads() > 1
}
