//! Derivatives of a program, operation by operation.

use super::Operation::*;
use super::{Invariant, Program, Value};

/// Integer exponents up to this are written as products.
const LARGEST_PRODUCT: f64 = 4.0;

impl Program {
    /// Adds the derivative of a value with respect to an invariant.
    pub fn derivative(&mut self, of: Value, by: Invariant) -> Value {
        let mut slopes: Vec<Value> = Vec::with_capacity(of + 1);
        for value in 0..=of {
            let slope = self.slope(value, by, &slopes);
            slopes.push(slope);
        }
        slopes[of]
    }

    /// The derivative of a value, from those of its operands.
    fn slope(&mut self, value: Value, by: Invariant, slopes: &[Value]) -> Value {
        match self.operations[value] {
            Constant(_) | Parameter(_) | Pressure | Step(_) => self.constant(0.0),
            Invariant(invariant) => self.constant(f64::from(u8::from(invariant == by))),
            Add(a, b) => self.add(Add(slopes[a], slopes[b])),
            Subtract(a, b) => self.add(Subtract(slopes[a], slopes[b])),
            Multiply(a, b) => {
                let left = self.add(Multiply(slopes[a], b));
                let right = self.add(Multiply(a, slopes[b]));
                self.add(Add(left, right))
            }
            Negate(a) => self.add(Negate(slopes[a])),
            Reciprocal(a) => {
                let square = self.add(Multiply(value, value));
                let factor = self.add(Negate(square));
                self.add(Multiply(factor, slopes[a]))
            }
            Logarithm(a) => {
                let factor = self.add(Reciprocal(a));
                self.add(Multiply(factor, slopes[a]))
            }
            Exponential(a) => self.add(Multiply(value, slopes[a])),
            Power(a, c) => {
                let one = self.constant(1.0);
                let less = self.add(Subtract(c, one));
                let power = self.power(a, less);
                let factor = self.add(Multiply(c, power));
                self.add(Multiply(factor, slopes[a]))
            }
            LogarithmOfOnePlus(a) => {
                let one = self.constant(1.0);
                let sum = self.add(Add(one, a));
                let factor = self.add(Reciprocal(sum));
                self.add(Multiply(factor, slopes[a]))
            }
            ExponentialMinusOne(a) => {
                let factor = self.add(Exponential(a));
                self.add(Multiply(factor, slopes[a]))
            }
        }
    }

    /// `a^c`. Small integer powers are products, which are defined for any sign.
    pub fn power(&mut self, a: Value, c: Value) -> Value {
        match self.operations[c] {
            Constant(c) if c.fract() == 0.0 && c.abs() <= LARGEST_PRODUCT => {
                let one = self.constant(1.0);
                let power =
                    (0..c.abs() as usize).fold(one, |power, _| self.add(Multiply(power, a)));
                if c < 0.0 { self.add(Reciprocal(power)) } else { power }
            }
            _ => self.add(Power(a, c)),
        }
    }
}
