//! Several independent numbers side by side: cells of a batch, or load positions of a block.
//!
//! Plain arrays, lane by lane without a loop; the compiler turns them into vector instructions inside the functions that
//! are compiled for AVX2 (see `crate::simd`). A law's tangent has thousands of these operations, and as many loops would
//! cost the compiler most of its time: it unrolls each of them in a walk through the whole function.

use super::{Pooled, Real, Scalar, elementary};
use std::ops::{Add, Index, IndexMut, Mul, Neg, Sub};

/// `L` numbers that go through the same arithmetic.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Lanes<const L: usize>(pub [f64; L]);

/// Cells that go through a law side by side.
pub const LANES: usize = 4;

/// One number per cell of a batch.
pub type Lane = Lanes<LANES>;

/// Series that are expanded side by side.
pub const WIDTH: usize = 8;

/// One number per series.
pub type Wide = Lanes<WIDTH>;

/// `Lanes([f(0), ..., f(L - 1)])` of `lanes!(|lane| f(lane))`, for at most eight lanes.
macro_rules! lanes {
    (|$lane:pat_param| $f:expr) => {{
        const { assert!(L <= 8) };
        let mut out = const { [0.0; L] }; // without `const` this would be a loop, too
        lanes!(@ out, $lane, $f; 0 1 2 3 4 5 6 7);
        Lanes(out)
    }};
    (@ $out:ident, $lane:pat, $f:expr; $($n:literal)*) => {$(
        if $n < L {
            let $lane: usize = $n;
            $out[$n] = $f;
        }
    )*};
}

impl<const L: usize> Default for Lanes<L> {
    fn default() -> Self {
        Lanes([0.0; L])
    }
}

impl<const L: usize> Lanes<L> {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        lanes!(|lane| f(self.0[lane]))
    }

    /// Whether all lanes are; none is asked before the others, which takes longer than all at once.
    #[inline(always)]
    fn is_plain(&self) -> bool {
        self.0.iter().fold(true, |all, &x| all & elementary::is_plain(x))
    }

    /// A function of the standard library, lane by lane, as a call that is not inlined.
    ///
    /// The compiler takes a logarithm for a cheap instruction. Inlined beside the plain one, it would compute both for
    /// every cell, and choose afterwards.
    #[cold]
    #[inline(never)]
    fn each(self, f: impl Fn(f64) -> f64) -> Self {
        self.map(f)
    }
}

impl<const L: usize> Index<usize> for Lanes<L> {
    type Output = f64;
    #[inline(always)]
    fn index(&self, lane: usize) -> &f64 {
        &self.0[lane]
    }
}

impl<const L: usize> IndexMut<usize> for Lanes<L> {
    #[inline(always)]
    fn index_mut(&mut self, lane: usize) -> &mut f64 {
        &mut self.0[lane]
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<const L: usize> $trait for Lanes<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                lanes!(|lane| self.0[lane].$method(other.0[lane]))
            }
        }
        impl<const L: usize> $trait<f64> for Lanes<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                lanes!(|lane| self.0[lane].$method(other))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);

impl<const L: usize> Neg for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        lanes!(|lane| -self.0[lane])
    }
}

impl<const L: usize> Scalar for Lanes<L> {
    #[inline(always)]
    fn constant(&self, value: f64) -> Self {
        lanes!(|_| value)
    }
    #[inline(always)]
    fn recip(&self) -> Self {
        self.map(f64::recip)
    }
    #[inline(always)]
    fn ln(&self) -> Self {
        if self.is_plain() { self.map(elementary::ln) } else { self.each(f64::ln) }
    }
    #[inline(always)]
    fn exp(&self) -> Self {
        self.map(f64::exp)
    }
    #[inline(always)]
    fn powf(&self, exponent: f64) -> Self {
        if exponent == -2.0 / 3.0 && self.is_plain() {
            return self.map(elementary::inverse_cbrt).square();
        }
        self.each(|x| x.powf(exponent))
    }
    #[inline(always)]
    fn cbrt(&self) -> Self {
        if self.is_plain() { self.map(elementary::cbrt) } else { self.each(f64::cbrt) }
    }
    #[inline(always)]
    fn sqrt(&self) -> Self {
        self.map(f64::sqrt)
    }
    #[inline(always)]
    fn heaviside(&self) -> Self {
        self.map(|x| x.heaviside())
    }
}

impl<const L: usize> Real for Lanes<L>
where
    Lanes<L>: Pooled,
{
    #[inline(always)]
    fn splat(value: f64) -> Self {
        lanes!(|_| value)
    }
}
