//! Which loops threads share: below some tasks, waking another thread takes longer than the work it takes over.

use faer::Par;
use rayon::prelude::*;

/// Tasks of some tens of microseconds from which threads share a loop.
pub const FEWEST: usize = 8;

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

/// Whether more than two threads share a loop of so many tasks, which takes together twice the time that one would take.
pub fn share_among_many(tasks: usize) -> bool {
    share(tasks) && rayon::current_num_threads() > 2
}

/// Does work with many loops of so many tasks on one of the threads that share them: from another thread each loop would wait
/// for them to wake.
pub fn among_threads<T: Send>(tasks: usize, work: impl FnOnce() -> T + Send) -> T {
    if share(tasks) { rayon::scope(|_| work()) } else { work() }
}

/// Runs every part of so many items, with its number. What a part does must not depend on who runs it.
pub fn for_parts<T: Send>(items: &mut [T], length: usize, run: impl Fn(usize, &mut [T]) + Sync) {
    if share(items.len().div_ceil(length)) {
        items.par_chunks_mut(length).enumerate().for_each(|(number, part)| run(number, part));
    } else {
        items.chunks_mut(length).enumerate().for_each(|(number, part)| run(number, part));
    }
}
