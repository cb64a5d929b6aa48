//! Which loops threads share: below some tasks, waking another thread takes longer than the work it takes over.

use faer::Par;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::OnceLock;

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

/// Does long work with many loops of so many tasks on a thread of a pool of its own, so that its loops need not wake threads
/// each time. In the common pool, who waits for a short loop might meanwhile take up all of the long work: a frame would
/// be late. On a thread of any pool it is done where it is.
pub fn among_threads<T: Send>(tasks: usize, work: impl FnOnce() -> T + Send) -> T {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    if !share(tasks) || rayon::current_thread_index().is_some() {
        return work();
    }
    let of_as_many = || ThreadPoolBuilder::new().num_threads(rayon::current_num_threads());
    match POOL.get_or_init(|| of_as_many().build().ok()) {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// What each task gives, in their order. There are several only where it is worth waking a thread.
pub fn each<T: Send, R: Send>(tasks: Vec<T>, run: impl Fn(T) -> R + Send + Sync) -> Vec<R> {
    if tasks.len() > 1 && rayon::current_num_threads() > 1 {
        tasks.into_par_iter().map(run).collect()
    } else {
        tasks.into_iter().map(run).collect()
    }
}

/// Runs both, side by side where it is worth waking a thread.
pub fn both(is_worth_it: bool, one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
    if is_worth_it && rayon::current_num_threads() > 1 {
        rayon::join(one, other);
    } else {
        one();
        other();
    }
}

/// Runs every part of so many items, with its number. What a part does must not depend on who runs it.
pub fn for_parts<T: Send>(items: &mut [T], length: usize, run: impl Fn(usize, &mut [T]) + Sync) {
    if share(items.len().div_ceil(length)) {
        items.par_chunks_mut(length).enumerate().for_each(|(number, part)| run(number, part));
    } else {
        items.chunks_mut(length).enumerate().for_each(|(number, part)| run(number, part));
    }
}
