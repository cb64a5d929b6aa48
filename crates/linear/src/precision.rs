//! Double precision for answers, single precision for preconditioners: half the memory, half the time.

use super::strip::InRegisters;
use faer::traits::RealField;

/// A floating-point type a factor may be held in.
pub trait Precision: RealField + InRegisters + Copy + Default + Send + Sync {
    /// A pivot below this fraction of the terms it is the difference of has no digit left to trust: in double
    /// precision, rounding alone leaves 5e-14 of them in the zero pivots of a body of 3e4 rows that nothing holds.
    const LOST: f64;

    /// The nearest value of this type.
    fn round(value: f64) -> Self;

    /// This value in double precision.
    fn double(self) -> f64;

    /// Its square root.
    fn root(self) -> Self;

    /// `self * factor + term`, rounded once where vectors of so many bits come with instructions for it.
    fn times_plus<const BITS: usize>(self, factor: Self, term: Self) -> Self;

    /// Whether it is neither infinite nor NaN.
    fn is_finite(self) -> bool {
        self.double().is_finite()
    }
}

macro_rules! precision {
    ($number:ident, $lost:literal) => {
        impl Precision for $number {
            const LOST: f64 = $lost;

            #[inline(always)]
            fn round(value: f64) -> Self {
                value as $number
            }

            #[inline(always)]
            fn double(self) -> f64 {
                f64::from(self)
            }

            #[inline(always)]
            fn root(self) -> Self {
                self.sqrt()
            }

            #[inline(always)]
            fn times_plus<const BITS: usize>(self, factor: Self, term: Self) -> Self {
                if BITS > 128 { self.mul_add(factor, term) } else { self * factor + term }
            }
        }
    };
}
precision!(f64, 1e-12);
precision!(f32, 1e-4);
