//! Runs of numbers whose memory a thread keeps for its next ones.
//!
//! A series of a law at one cell takes a score of them, of some kilobytes each, and gives them back at once: millions in
//! a reduction, which allocators that serve every purpose are slow at.

use super::{Lane, Wide};
use std::cell::RefCell;
use std::mem;
use std::ops::{Deref, DerefMut};

/// Runs that a thread keeps: as many as a law has series at a time, and more.
const MOST: usize = 64;
/// The longest run that it keeps [numbers].
const LONGEST: usize = 1 << 13;

/// Numbers whose runs are kept.
pub trait Pooled: Copy + Default + 'static {
    /// What `f` makes of the runs that this thread keeps; nothing while the thread ends.
    fn of_thread<R>(f: impl FnOnce(&mut Vec<Vec<Self>>) -> R) -> Option<R>;
}

macro_rules! pooled {
    ($($number:ty),*) => {$(
        impl Pooled for $number {
            #[inline]
            fn of_thread<R>(f: impl FnOnce(&mut Vec<Vec<Self>>) -> R) -> Option<R> {
                thread_local! {
                    static KEPT: RefCell<Vec<Vec<$number>>> = const { RefCell::new(Vec::new()) };
                }
                KEPT.try_with(|kept| f(&mut kept.borrow_mut())).ok()
            }
        }
    )*};
}

pooled!(f64, Lane, Wide);

/// A run of numbers. One that is empty holds no memory.
#[derive(Default)]
pub struct Run<T: Pooled>(Vec<T>);

impl<T: Pooled> Run<T> {
    /// `n` zeros.
    pub fn zeros(n: usize) -> Self {
        let mut run = Self::default();
        run.resize(n);
        run
    }

    /// Cuts the run off after `n` numbers, or fills it up with zeros.
    pub fn resize(&mut self, n: usize) {
        if self.0.capacity() == 0 && n > 0 {
            self.0 = T::of_thread(Vec::pop).flatten().unwrap_or_default();
        }
        self.0.resize(n, T::default());
    }
}

impl<T: Pooled> From<&[T]> for Run<T> {
    fn from(numbers: &[T]) -> Self {
        let mut run = Self::default();
        if !numbers.is_empty() {
            run.0 = T::of_thread(Vec::pop).flatten().unwrap_or_default();
            run.0.extend_from_slice(numbers);
        }
        run
    }
}

impl<T: Pooled> From<Vec<T>> for Run<T> {
    fn from(numbers: Vec<T>) -> Self {
        Run(numbers)
    }
}

impl<T: Pooled> Clone for Run<T> {
    fn clone(&self) -> Self {
        Self::from(&self[..])
    }
}

impl<T: Pooled> Drop for Run<T> {
    fn drop(&mut self) {
        if (1..=LONGEST).contains(&self.0.capacity()) {
            let mut run = mem::take(&mut self.0);
            run.clear();
            T::of_thread(|kept| {
                if kept.len() < MOST {
                    kept.push(run);
                }
            });
        }
    }
}

impl<T: Pooled> Deref for Run<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T: Pooled> DerefMut for Run<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The runs that this thread keeps for the numbers of a [`Lane`].
    fn kept() -> usize {
        Lane::of_thread(|kept| kept.len()).unwrap()
    }

    #[test]
    fn memory_is_taken_again_and_starts_at_zero() {
        let mut run = Run::<f64>::zeros(100);
        run.fill(3.0);
        let place = run.as_ptr();
        drop(run);
        let again = Run::<f64>::zeros(50);
        assert_eq!(again.as_ptr(), place);
        assert_eq!(&again[..], &[0.0; 50]);
        assert_eq!(&Run::from(&[1.0, 2.0][..]).clone()[..], &[1.0, 2.0]);
    }

    #[test]
    fn a_run_grows_with_zeros_and_is_cut_off() {
        let mut run = Run::from(vec![1.0, 2.0]);
        run.resize(4);
        assert_eq!(&run[..], &[1.0, 2.0, 0.0, 0.0]);
        run.resize(1);
        assert_eq!(&run[..], &[1.0]);
        assert!(Run::<f64>::zeros(0).is_empty());
    }

    #[test]
    fn a_thread_keeps_no_more_than_it_needs() {
        std::thread::spawn(|| {
            drop(Run::<Lane>::zeros(LONGEST + 1));
            assert_eq!(kept(), 0);
            let many: Vec<_> = (0..2 * MOST).map(|_| Run::<Lane>::zeros(3)).collect();
            drop(many);
            assert_eq!(kept(), MOST);
        })
        .join()
        .unwrap();
    }
}
