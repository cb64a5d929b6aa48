//! Which loops threads share, and in which pool: below some tasks, waking another thread takes longer than the work it takes
//! over; and a frame must not wait for a whole solution.

use faer::Par;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::cell::Cell;
use std::sync::OnceLock;

/// Tasks of some tens of microseconds from which threads share a loop.
pub const FEWEST: usize = 8;

/// Dense kernels on all threads; a page has one.
pub fn all_threads() -> Par {
    #[cfg(target_family = "wasm")]
    return Par::Seq;
    #[cfg(not(target_family = "wasm"))]
    if IS_ALONE.get() { Par::Seq } else { Par::rayon(0) }
}

/// Whether threads share a loop of so many tasks.
pub fn share(tasks: usize) -> bool {
    tasks >= FEWEST && n_threads() > 1
}

thread_local! {
    /// Whether this thread of a pool does a whole frame or solution, not one of many tasks.
    static IS_WHOLE: Cell<bool> = const { Cell::new(false) };

    /// Whether this thread shares nothing with others.
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// From here on this thread does all alone that it could share: it works beside frames, whose loops would wait for it.
pub fn work_alone() {
    IS_ALONE.set(true);
}

/// Threads that may share what this one begins, itself included.
pub fn n_threads() -> usize {
    if IS_ALONE.get() { 1 } else { rayon::current_num_threads() }
}

/// Does a whole frame or solution on a thread of a pool.
fn whole<T>(work: impl FnOnce() -> T) -> T {
    struct Before(bool);
    impl Drop for Before {
        fn drop(&mut self) {
            IS_WHOLE.set(self.0);
        }
    }
    let _before = Before(IS_WHOLE.replace(true));
    work()
}

/// Does work with many short loops on a thread of the common pool, so that its loops need not wake threads each time.
pub fn in_common_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::join(|| whole(work), || ()).0
}

/// The same for long work, which has a pool of its own. In the common pool, who waits for a short loop might meanwhile take
/// up all of the long work: a frame would be late. On a thread of any pool it is done where it is.
pub fn in_pool_for_long_work<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    if n_threads() < 2 || rayon::current_thread_index().is_some() {
        return work();
    }
    let of_as_many = || ThreadPoolBuilder::new().num_threads(rayon::current_num_threads());
    match POOL.get_or_init(|| of_as_many().build().ok()) {
        Some(pool) => pool.install(|| whole(work)),
        None => work(),
    }
}

/// The same for long work with many loops of so many tasks, if threads share them.
pub fn among_threads<T: Send>(tasks: usize, work: impl FnOnce() -> T + Send) -> T {
    if share(tasks) { in_pool_for_long_work(work) } else { work() }
}

/// Whether the work that this thread begins may be cut into pieces for several threads, of some hundred microseconds and more.
/// One of many tasks of a pool may not: a thread that waits for a piece might meanwhile take up another task, and hold the
/// memory of both.
pub fn may_cut() -> bool {
    n_threads() > 1 && (rayon::current_thread_index().is_none() || IS_WHOLE.get())
}

/// Runs both, side by side if they are worth waking a thread.
pub fn both(is_worth_it: bool, one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
    if is_worth_it {
        rayon::join(one, other);
    } else {
        one();
        other();
    }
}

/// What each task gives, in their order. There are several only where it is worth waking a thread.
pub fn each<T: Send, R: Send>(tasks: Vec<T>, run: impl Fn(T) -> R + Send + Sync) -> Vec<R> {
    if tasks.len() > 1 && n_threads() > 1 {
        tasks.into_par_iter().map(run).collect()
    } else {
        tasks.into_iter().map(run).collect()
    }
}

/// Runs every part of so many items, with its number. What a part does must not depend on who runs it.
pub fn for_parts<T: Send>(items: &mut [T], length: usize, run: impl Fn(usize, &mut [T]) + Sync) {
    if share(items.len().div_ceil(length)) {
        for_each_part(items, length, run);
    } else {
        items.chunks_mut(length).enumerate().for_each(|(number, part)| run(number, part));
    }
}

/// The same for few parts that take long.
pub fn for_each_part<T: Send>(
    items: &mut [T],
    length: usize,
    run: impl Fn(usize, &mut [T]) + Sync,
) {
    items.par_chunks_mut(length).enumerate().for_each(|(number, part)| run(number, part));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_works_alone_shares_nothing() {
        let alone = std::thread::spawn(|| {
            work_alone();
            (
                n_threads(),
                may_cut(),
                share(2 * FEWEST),
                in_pool_for_long_work(rayon::current_thread_index),
            )
        });
        assert_eq!(alone.join().unwrap(), (1, false, false, None));
    }

    #[test]
    fn one_of_many_tasks_is_not_cut() {
        let has_several = rayon::current_num_threads() > 1;
        for _ in 0..2 {
            assert_eq!(may_cut(), has_several);
            assert_eq!(in_pool_for_long_work(may_cut), has_several);
            assert_eq!(in_pool_for_long_work(|| in_pool_for_long_work(may_cut)), has_several);
            assert_eq!(in_common_pool(may_cut), has_several);
            assert!(!rayon::scope(|_| may_cut()), "whole work is forgotten when it is done");
            assert!(!rayon::scope(|_| in_pool_for_long_work(may_cut)));
        }
    }

    #[test]
    fn work_that_fails_was_whole_all_the_same() {
        let outcome = std::panic::catch_unwind(|| in_common_pool(|| panic!("of no use")));
        assert!(outcome.is_err() && (0..8).all(|_| !rayon::scope(|_| may_cut())));
    }
}
