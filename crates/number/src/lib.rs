//! Scalars: the arithmetic in which a strain energy is written, and the number types that derive different results from
//! the same text.
//!
//! | type | reads out of `psi` |
//! | --- | --- |
//! | `f64`, [`Lanes`] | the energy of one cell, or of several at once |
//! | [`Gradient`] | its first derivatives in the invariants: stress |
//! | [`Hessian`] | its second derivatives: the consistent tangent |
//! | [`Jet`] | its truncated power series: right-hand sides of the asymptotic numerical method |

mod compose;
mod dual;
mod elementary;
mod jet;
mod lanes;
mod monomials;
pub mod pade;
mod pool;
mod power;
pub mod simd;
mod sphere;
pub mod tensor;
pub mod unroll;
mod vector;

pub use compose::Expansion;
pub use dual::{Gradient, Hessian};
pub use jet::Jet;
pub use lanes::{LANES, Lane, Lanes, WIDTH, Wide};
pub use monomials::{Monomials, degree_of, evaluate_monomials};
pub use pade::Pade;
pub use pool::{Pooled, PooledVec};
pub use sphere::on_sphere;
pub use vector::{dot, norm};

use std::fmt::Debug;
use std::ops::{Add, Mul, Neg, Sub};

/// A commutative algebra with the elementary functions that strain energies use.
///
/// Operators take values, so a law reads as its formula; `f64` operands stand for constants.
pub trait Scalar:
    Clone
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// Whether the scalar is a power series. Operations of duals over one are functions that are compiled once: inlined
    /// into every law they would be most of the compiler's work.
    const IS_SERIES: bool = false;
    /// The constant `value`, of the same shape (order, variables) as `self`.
    fn constant(&self, value: f64) -> Self;
    /// `1 / self`.
    fn recip(&self) -> Self;
    /// Natural logarithm; defined for positive values.
    fn ln(&self) -> Self;
    /// Exponential.
    fn exp(&self) -> Self;
    /// `self^exponent` for positive values and a real exponent.
    fn powf(&self, exponent: f64) -> Self;
    /// The cube root of a positive value.
    #[inline(always)]
    fn cbrt(&self) -> Self {
        self.powf(1.0 / 3.0)
    }
    /// The square root of a positive value.
    #[inline(always)]
    fn sqrt(&self) -> Self {
        self.powf(0.5)
    }
    /// `x_1^s + x_2^s + x_3^s` of the numbers with the elementary symmetric functions `i1`, `i2` and 1: the trace of a
    /// power of an isochoric tensor.
    #[inline(always)]
    fn trace_of_power(i1: &Self, i2: &Self, s: f64) -> Self {
        power::trace_of_power(i1, i2, s)
    }
    /// The constant 1 where the value is positive, 0 elsewhere: the switch of a one-sided law. A series goes by its
    /// constant term.
    fn heaviside(&self) -> Self;
    /// The constant 0 where the value is positive, infinity elsewhere: the end of a law's domain. A series goes by its
    /// constant term.
    #[inline(always)]
    fn wall(&self) -> Self {
        self.heaviside().recip() + -1.0
    }
    /// `self * self`.
    #[inline(always)]
    fn square(&self) -> Self {
        self.clone() * self.clone()
    }
}

/// A scalar that is plain data: what jets and duals are built over, and what kernels loop on.
pub trait Real: Scalar + Pooled + PartialEq + Send + Sync {
    /// All lanes equal to `value`.
    fn splat(value: f64) -> Self;
    /// `self += a * b`.
    ///
    /// Multiplied and added separately: a fused operation would be a library call on machines
    /// without it and would make results differ between machines.
    #[inline(always)]
    fn add_product(&mut self, a: Self, b: Self) {
        *self = *self + a * b;
    }
}

impl Scalar for f64 {
    #[inline(always)]
    fn constant(&self, value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn recip(&self) -> Self {
        f64::recip(*self)
    }
    #[inline(always)]
    fn ln(&self) -> Self {
        f64::ln(*self)
    }
    #[inline(always)]
    fn exp(&self) -> Self {
        f64::exp(*self)
    }
    #[inline(always)]
    fn powf(&self, exponent: f64) -> Self {
        f64::powf(*self, exponent)
    }
    #[inline(always)]
    fn cbrt(&self) -> Self {
        f64::cbrt(*self)
    }
    #[inline(always)]
    fn sqrt(&self) -> Self {
        f64::sqrt(*self)
    }
    #[inline(always)]
    fn heaviside(&self) -> Self {
        f64::from(u8::from(*self > 0.0))
    }
}

impl Real for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
}
