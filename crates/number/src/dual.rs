//! Duals in the three invariants: a value with its gradient, or with gradient and Hessian.
//!
//! Three variables only, because a law is a function of `I1, I2, J`; the
//! geometry that turns these derivatives into stress and tangent is written by hand in
//! `crate::law`.

use super::Scalar;
use crate::unroll::array;
use std::ops::{Add, Mul, Neg, Sub};

/// `f` and `df/dx_i`, i = 0..3.
#[derive(Clone, Debug)]
pub struct Gradient<T> {
    /// The value.
    pub value: T,
    /// First derivatives.
    pub first: [T; 3],
}

/// `f`, `df/dx_i` and `d2f/dx_i dx_j`, the Hessian packed as 00, 01, 02, 11, 12, 22.
#[derive(Clone, Debug)]
pub struct Hessian<T> {
    /// The value.
    pub value: T,
    /// First derivatives.
    pub first: [T; 3],
    /// Second derivatives, packed upper triangle.
    pub second: [T; 6],
}

/// Rows and columns of the packed Hessian.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// An expression of the variables that are named with their types: inlined for numbers, for series a call of a function
/// that is compiled once, since their loops take far longer than a call.
macro_rules! once_for_series {
    ($($name:ident: $kind:ty),* => $out:ty, $value:expr) => {{
        #[inline(always)]
        fn here<T: Scalar>($($name: $kind),*) -> $out {
            $value
        }
        #[inline(never)]
        fn apart<T: Scalar>($($name: $kind),*) -> $out {
            here::<T>($($name),*)
        }
        if T::IS_SERIES { apart::<T>($($name),*) } else { here::<T>($($name),*) }
    }};
}

impl<T: Scalar> Gradient<T> {
    /// The independent variables `x_0, x_1, x_2` at the given values.
    #[inline(always)]
    pub fn variables(x: [T; 3]) -> [Self; 3] {
        let (zero, one) = (x[0].constant(0.0), x[0].constant(1.0));
        array!(3, |k| {
            let first = array!(3, |i| if i == k { one.clone() } else { zero.clone() });
            Gradient { value: x[k].clone(), first }
        })
    }

    /// Chain rule for a function of one variable with value `f` and derivative `df`.
    #[inline(always)]
    fn chain(&self, f: T, df: T) -> Self {
        let x = self;
        once_for_series!(x: &Gradient<T>, f: T, df: T => Gradient<T>, {
            Gradient { value: f, first: array!(3, |i| x.first[i].clone() * df.clone()) }
        })
    }
}

impl<T: Scalar> Hessian<T> {
    /// The independent variables `x_0, x_1, x_2` at the given values.
    #[inline(always)]
    pub fn variables(x: [T; 3]) -> [Self; 3] {
        let (zero, one) = (x[0].constant(0.0), x[0].constant(1.0));
        array!(3, |k| {
            let first = array!(3, |i| if i == k { one.clone() } else { zero.clone() });
            Hessian { value: x[k].clone(), first, second: array!(6, |_| zero.clone()) }
        })
    }

    /// `d2f/dx_i dx_j`.
    #[inline(always)]
    pub fn second(&self, i: usize, j: usize) -> T {
        let (i, j) = if i <= j { (i, j) } else { (j, i) };
        self.second[i * (5 - i) / 2 + j].clone()
    }

    /// Chain rule: value `f`, derivative `df`, second derivative `ddf`.
    #[inline(always)]
    fn chain(&self, f: T, df: T, ddf: T) -> Self {
        let x = self;
        once_for_series!(x: &Hessian<T>, f: T, df: T, ddf: T => Hessian<T>, Hessian {
            value: f,
            first: array!(3, |i| x.first[i].clone() * df.clone()),
            second: array!(6, |k| {
                let (i, j) = PAIRS[k];
                x.second[k].clone() * df.clone()
                    + x.first[i].clone() * x.first[j].clone() * ddf.clone()
            }),
        })
    }
}

macro_rules! linear_operators {
    ($dual:ident, $($part:ident $n:tt),*) => {
        impl<T: Scalar> Add for $dual<T> {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                let (a, b) = (self, other);
                once_for_series!(a: $dual<T>, b: $dual<T> => $dual<T>, $dual {
                    value: a.value + b.value,
                    $($part: array!($n, |i| a.$part[i].clone() + b.$part[i].clone()),)*
                })
            }
        }
        impl<T: Scalar> Sub for $dual<T> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                let (a, b) = (self, other);
                once_for_series!(a: $dual<T>, b: $dual<T> => $dual<T>, $dual {
                    value: a.value - b.value,
                    $($part: array!($n, |i| a.$part[i].clone() - b.$part[i].clone()),)*
                })
            }
        }
        impl<T: Scalar> Neg for $dual<T> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                let a = self;
                once_for_series!(a: $dual<T> => $dual<T>, {
                    $dual { value: -a.value, $($part: array!($n, |i| -a.$part[i].clone()),)* }
                })
            }
        }
        impl<T: Scalar> Add<f64> for $dual<T> {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: f64) -> Self {
                $dual { value: self.value + other, ..self }
            }
        }
        impl<T: Scalar> Sub<f64> for $dual<T> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: f64) -> Self {
                $dual { value: self.value - other, ..self }
            }
        }
        impl<T: Scalar> Mul<f64> for $dual<T> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: f64) -> Self {
                let (a, s) = (self, other);
                once_for_series!(a: $dual<T>, s: f64 => $dual<T>, {
                    $dual { value: a.value * s, $($part: array!($n, |i| a.$part[i].clone() * s),)* }
                })
            }
        }
    };
}
linear_operators!(Gradient, first 3);
linear_operators!(Hessian, first 3, second 6);

impl<T: Scalar> Mul for Gradient<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self, other);
        once_for_series!(a: Gradient<T>, b: Gradient<T> => Gradient<T>, Gradient {
            first: array!(3, |i| {
                a.first[i].clone() * b.value.clone() + b.first[i].clone() * a.value.clone()
            }),
            value: a.value * b.value,
        })
    }
}

impl<T: Scalar> Mul for Hessian<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self, other);
        once_for_series!(a: Hessian<T>, b: Hessian<T> => Hessian<T>, Hessian {
            second: array!(6, |k| {
                let (i, j) = PAIRS[k];
                a.second[k].clone() * b.value.clone()
                    + b.second[k].clone() * a.value.clone()
                    + a.first[i].clone() * b.first[j].clone()
                    + a.first[j].clone() * b.first[i].clone()
            }),
            first: array!(3, |i| {
                a.first[i].clone() * b.value.clone() + b.first[i].clone() * a.value.clone()
            }),
            value: a.value * b.value,
        })
    }
}

impl<T: Scalar> Scalar for Gradient<T> {
    #[inline(always)]
    fn constant(&self, value: f64) -> Self {
        let zero = self.value.constant(0.0);
        Gradient { value: self.value.constant(value), first: array!(3, |_| zero.clone()) }
    }
    #[inline(always)]
    fn recip(&self) -> Self {
        let r = self.value.recip();
        self.chain(r.clone(), -r.square())
    }
    #[inline(always)]
    fn ln(&self) -> Self {
        self.chain(self.value.ln(), self.value.recip())
    }
    #[inline(always)]
    fn exp(&self) -> Self {
        let e = self.value.exp();
        self.chain(e.clone(), e)
    }
    #[inline(always)]
    fn cbrt(&self) -> Self {
        let root = self.value.cbrt();
        let slope = root.clone() * self.value.recip() * (1.0 / 3.0);
        self.chain(root, slope)
    }
    #[inline(always)]
    fn powf(&self, exponent: f64) -> Self {
        let power = self.value.powf(exponent);
        let slope = power.clone() * self.value.recip() * exponent;
        self.chain(power, slope)
    }
    #[inline(always)]
    fn heaviside(&self) -> Self {
        Gradient { value: self.value.heaviside(), ..self.constant(0.0) }
    }
    #[inline(always)]
    fn wall(&self) -> Self {
        Gradient { value: self.value.wall(), ..self.constant(0.0) }
    }
}

impl<T: Scalar> Scalar for Hessian<T> {
    #[inline(always)]
    fn constant(&self, value: f64) -> Self {
        let zero = self.value.constant(0.0);
        Hessian {
            value: self.value.constant(value),
            first: array!(3, |_| zero.clone()),
            second: array!(6, |_| zero.clone()),
        }
    }
    #[inline(always)]
    fn recip(&self) -> Self {
        let r = self.value.recip();
        let slope = -r.square();
        let curvature = r.clone() * r.square() * 2.0;
        self.chain(r, slope, curvature)
    }
    #[inline(always)]
    fn ln(&self) -> Self {
        let r = self.value.recip();
        self.chain(self.value.ln(), r.clone(), -r.square())
    }
    #[inline(always)]
    fn exp(&self) -> Self {
        let e = self.value.exp();
        self.chain(e.clone(), e.clone(), e)
    }
    #[inline(always)]
    fn cbrt(&self) -> Self {
        let (root, r) = (self.value.cbrt(), self.value.recip());
        let slope = root.clone() * r.clone() * (1.0 / 3.0);
        let curvature = slope.clone() * r * (-2.0 / 3.0);
        self.chain(root, slope, curvature)
    }
    #[inline(always)]
    fn powf(&self, exponent: f64) -> Self {
        let r = self.value.recip();
        let power = self.value.powf(exponent);
        let slope = power.clone() * r.clone() * exponent;
        let curvature = slope.clone() * r * (exponent - 1.0);
        self.chain(power, slope, curvature)
    }
    #[inline(always)]
    fn heaviside(&self) -> Self {
        Hessian { value: self.value.heaviside(), ..self.constant(0.0) }
    }
    #[inline(always)]
    fn wall(&self) -> Self {
        Hessian { value: self.value.wall(), ..self.constant(0.0) }
    }
}
