//! A memory pool of each thread for vectors of numbers.
//!
//! The series of a law at one cell takes about twenty vectors of some kilobytes each and frees them at once. A reduction
//! does so millions of times, for which a general allocator is slow.

use super::{Lane, Wide};
use std::cell::RefCell;
use std::mem;
use std::ops::{Deref, DerefMut};

/// Largest number of free vectors in a thread's pool: more than a law has series at a time.
const MOST: usize = 64;
/// Longest vector that returns to the pool [numbers]: the nine series of a tensor have 1,485 at the highest order.
const LONGEST: usize = 1 << 11;

/// Numbers whose vectors are pooled.
pub trait Pooled: Copy + Default + 'static {
    /// Calls `f` with the free vectors of this thread's pool; none while the thread ends.
    fn with_pool<R>(f: impl FnOnce(&mut Vec<Vec<Self>>) -> R) -> Option<R>;
}

macro_rules! pooled {
    ($($number:ty),*) => {$(
        impl Pooled for $number {
            #[inline]
            fn with_pool<R>(f: impl FnOnce(&mut Vec<Vec<Self>>) -> R) -> Option<R> {
                thread_local! {
                    static POOL: RefCell<Vec<Vec<$number>>> = const { RefCell::new(Vec::new()) };
                }
                POOL.try_with(|pool| f(&mut pool.borrow_mut())).ok()
            }
        }
    )*};
}

pooled!(f64, Lane, Wide);

/// A vector that takes its memory from the pool of the thread, and returns it there. An empty one holds no memory.
#[derive(Default)]
pub struct PooledVec<T: Pooled>(Vec<T>);

impl<T: Pooled> PooledVec<T> {
    /// `n` zeros.
    pub fn zeros(n: usize) -> Self {
        let mut vector = Self::default();
        vector.resize(n);
        vector
    }

    /// A free vector of the pool, or a new one.
    fn taken() -> Vec<T> {
        T::with_pool(Vec::pop).flatten().unwrap_or_default()
    }

    /// Cuts the vector off after `n` numbers, or fills it up with zeros.
    pub fn resize(&mut self, n: usize) {
        if self.0.capacity() == 0 && n > 0 {
            self.0 = Self::taken();
        }
        self.0.resize(n, T::default());
    }
}

impl<T: Pooled> From<&[T]> for PooledVec<T> {
    fn from(numbers: &[T]) -> Self {
        let mut vector = Self::default();
        if !numbers.is_empty() {
            vector.0 = Self::taken();
            vector.0.extend_from_slice(numbers);
        }
        vector
    }
}

impl<T: Pooled> From<Vec<T>> for PooledVec<T> {
    fn from(numbers: Vec<T>) -> Self {
        PooledVec(numbers)
    }
}

impl<T: Pooled> Clone for PooledVec<T> {
    fn clone(&self) -> Self {
        Self::from(&self[..])
    }
}

impl<T: Pooled> Drop for PooledVec<T> {
    fn drop(&mut self) {
        if (1..=LONGEST).contains(&self.0.capacity()) {
            let mut vector = mem::take(&mut self.0);
            vector.clear();
            T::with_pool(|pool| {
                if pool.len() < MOST {
                    pool.push(vector);
                }
            });
        }
    }
}

impl<T: Pooled> Deref for PooledVec<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T: Pooled> DerefMut for PooledVec<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Free vectors in this thread's pool of [`Lane`]s.
    fn n_free() -> usize {
        Lane::with_pool(|pool| pool.len()).unwrap()
    }

    #[test]
    fn memory_is_taken_again_and_starts_at_zero() {
        let mut vector = PooledVec::<f64>::zeros(100);
        vector.fill(3.0);
        let place = vector.as_ptr();
        drop(vector);
        let again = PooledVec::<f64>::zeros(50);
        assert_eq!(again.as_ptr(), place);
        assert_eq!(&again[..], &[0.0; 50]);
        assert_eq!(&PooledVec::from(&[1.0, 2.0][..]).clone()[..], &[1.0, 2.0]);
    }

    #[test]
    fn a_vector_grows_with_zeros_and_is_cut_off() {
        let mut vector = PooledVec::from(vec![1.0, 2.0]);
        vector.resize(4);
        assert_eq!(&vector[..], &[1.0, 2.0, 0.0, 0.0]);
        vector.resize(1);
        assert_eq!(&vector[..], &[1.0]);
        assert!(PooledVec::<f64>::zeros(0).is_empty());
    }

    #[test]
    fn a_thread_keeps_no_more_than_it_needs() {
        std::thread::spawn(|| {
            drop(PooledVec::<Lane>::zeros(LONGEST + 1));
            assert_eq!(n_free(), 0);
            let many: Vec<_> = (0..2 * MOST).map(|_| PooledVec::<Lane>::zeros(3)).collect();
            drop(many);
            assert_eq!(n_free(), MOST);
        })
        .join()
        .unwrap();
    }
}
