//! Arrays by formula, written out entry by entry.
//!
//! What `std::array::from_fn` does with a closure, but certain to be inlined: the compiler is free to leave a closure
//! outside of the kernel that calls it, and then compiles it for the baseline instruction set.

/// `[f(0), f(1), f(2)]` of `array!(3, |i| f(i))`, two or six entries.
#[macro_export]
macro_rules! array {
    (2, |$i:pat_param| $f:expr) => {
        $crate::array!(@ [0usize, 1], $i, $f)
    };
    (3, |$i:pat_param| $f:expr) => {
        $crate::array!(@ [0usize, 1, 2], $i, $f)
    };
    (6, |$i:pat_param| $f:expr) => {
        $crate::array!(@ [0usize, 1, 2, 3, 4, 5], $i, $f)
    };
    (@ [$($n:expr),*], $i:pat, $f:expr) => {
        [$({
            let $i = $n;
            $f
        }),*]
    };
}

/// The tensor with entries `f(i, j)` of `tabulate!(|i, j| f(i, j))`.
#[macro_export]
macro_rules! tabulate {
    (|$i:pat_param, $j:pat_param| $f:expr) => {
        $crate::array!(3, |$i| $crate::array!(3, |$j| $f))
    };
}

/// `f(0); f(1); ...` of `each!(N, |a| f(a))`, for a constant N of ten at most.
///
/// A loop whose body asks for constants by its index: the compiler unrolls it in one kernel and not in the next.
#[macro_export]
macro_rules! each {
    ($count:expr, |$a:pat_param| $f:expr) => {
        const { assert!($count <= 10) };
        $crate::each!(@ $count, $a, $f; 0 1 2 3 4 5 6 7 8 9);
    };
    (@ $count:expr, $a:pat, $f:expr; $($n:literal)*) => {$(
        if $n < $count {
            let $a: usize = $n;
            $f
        }
    )*};
}

pub use crate::{array, each, tabulate};
