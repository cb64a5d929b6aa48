//! Single precision as a [`Scalar`].

use super::{Real, Scalar};
use std::ops::{Add, Mul, Neg, Sub};

/// `f32` with constants given in `f64`, so that laws keep their parameters in one type.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
#[repr(transparent)]
pub struct Single(pub f32);

macro_rules! single_operator {
    ($trait:ident, $method:ident) => {
        impl $trait for Single {
            type Output = Single;
            #[inline(always)]
            fn $method(self, other: Single) -> Single {
                Single(self.0.$method(other.0))
            }
        }
        impl $trait<f64> for Single {
            type Output = Single;
            #[inline(always)]
            fn $method(self, other: f64) -> Single {
                Single(self.0.$method(other as f32))
            }
        }
    };
}
single_operator!(Add, add);
single_operator!(Sub, sub);
single_operator!(Mul, mul);

impl Neg for Single {
    type Output = Single;
    #[inline(always)]
    fn neg(self) -> Single {
        Single(-self.0)
    }
}

impl Scalar for Single {
    #[inline(always)]
    fn constant(&self, value: f64) -> Self {
        Single(value as f32)
    }
    #[inline(always)]
    fn recip(&self) -> Self {
        Single(self.0.recip())
    }
    #[inline(always)]
    fn ln(&self) -> Self {
        Single(self.0.ln())
    }
    #[inline(always)]
    fn exp(&self) -> Self {
        Single(self.0.exp())
    }
    #[inline(always)]
    fn powf(&self, exponent: f64) -> Self {
        Single(self.0.powf(exponent as f32))
    }
    #[inline(always)]
    fn heaviside(&self) -> Self {
        Single(f32::from(u8::from(self.0 > 0.0)))
    }
}

impl Real for Single {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Single(value as f32)
    }
}
