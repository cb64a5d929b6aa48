//! A program about the rest state: every value split into its value there and a deviation.

use super::Operation::*;
use super::{AboutRest, Operation, Program, Value};

impl Program {
    /// Rewrites values about rest, in a program whose invariants are deviations.
    pub(crate) fn about_rest(&self, values: &[Value]) -> (Program, Vec<AboutRest>) {
        let mut out = Program::new();
        let mut split: Vec<AboutRest> = Vec::with_capacity(self.operations.len());
        for &operation in &self.operations {
            let about = out.split(operation, &split);
            split.push(about);
        }
        let wanted = values.iter().map(|&v| split[v]).collect();
        (out, wanted)
    }

    /// Splits the result of an operation, given the parts of its operands.
    fn split(&mut self, operation: Operation, of: &[AboutRest]) -> AboutRest {
        let zero = self.constant(0.0);
        match operation {
            Constant(_) | Parameter(_) | Pressure => {
                AboutRest { rest: self.add(operation), deviation: zero }
            }
            Invariant(invariant) => AboutRest {
                rest: self.constant(invariant.at_rest()),
                deviation: self.add(operation),
            },
            Add(a, b) => AboutRest {
                rest: self.add(Add(of[a].rest, of[b].rest)),
                deviation: self.add(Add(of[a].deviation, of[b].deviation)),
            },
            Subtract(a, b) => AboutRest {
                rest: self.add(Subtract(of[a].rest, of[b].rest)),
                deviation: self.add(Subtract(of[a].deviation, of[b].deviation)),
            },
            Multiply(a, b) => {
                // a0 db + b0 da + da db
                let left = self.add(Multiply(of[a].rest, of[b].deviation));
                let right = self.add(Multiply(of[b].rest, of[a].deviation));
                let both = self.add(Multiply(of[a].deviation, of[b].deviation));
                let sum = self.add(Add(left, right));
                AboutRest {
                    rest: self.add(Multiply(of[a].rest, of[b].rest)),
                    deviation: self.add(Add(sum, both)),
                }
            }
            Negate(a) => AboutRest {
                rest: self.add(Negate(of[a].rest)),
                deviation: self.add(Negate(of[a].deviation)),
            },
            Reciprocal(a) => {
                // 1/(a0 + da) - 1/a0 = -da / (a0 (a0 + da))
                let whole = self.total(of[a]);
                let inverse = self.add(Reciprocal(whole));
                let rest = self.add(Reciprocal(of[a].rest));
                let factor = self.add(Multiply(inverse, rest));
                let product = self.add(Multiply(of[a].deviation, factor));
                AboutRest { rest, deviation: self.add(Negate(product)) }
            }
            Logarithm(a) => {
                let ratio = self.ratio(of[a]);
                AboutRest {
                    rest: self.add(Logarithm(of[a].rest)),
                    deviation: self.add(LogarithmOfOnePlus(ratio)),
                }
            }
            Exponential(a) => {
                let rest = self.add(Exponential(of[a].rest));
                let growth = self.add(ExponentialMinusOne(of[a].deviation));
                AboutRest { rest, deviation: self.add(Multiply(rest, growth)) }
            }
            Power(a, c) if self.operations[of[a].rest] == Constant(0.0) => {
                AboutRest { rest: zero, deviation: self.power(of[a].deviation, of[c].rest) }
            }
            Power(a, c) => {
                let ratio = self.ratio(of[a]);
                let logarithm = self.add(LogarithmOfOnePlus(ratio));
                let exponent = self.add(Multiply(of[c].rest, logarithm));
                let growth = self.add(ExponentialMinusOne(exponent));
                let rest = self.power(of[a].rest, of[c].rest);
                AboutRest { rest, deviation: self.add(Multiply(rest, growth)) }
            }
            Step(a) => {
                let whole = self.total(of[a]);
                AboutRest { rest: zero, deviation: self.add(Step(whole)) }
            }
            LogarithmOfOnePlus(a) => {
                let one = self.constant(1.0);
                let sum =
                    AboutRest { rest: self.add(Add(one, of[a].rest)), deviation: of[a].deviation };
                let ratio = self.ratio(sum);
                AboutRest {
                    rest: self.add(LogarithmOfOnePlus(of[a].rest)),
                    deviation: self.add(LogarithmOfOnePlus(ratio)),
                }
            }
            ExponentialMinusOne(a) => {
                let factor = self.add(Exponential(of[a].rest));
                let growth = self.add(ExponentialMinusOne(of[a].deviation));
                AboutRest {
                    rest: self.add(ExponentialMinusOne(of[a].rest)),
                    deviation: self.add(Multiply(factor, growth)),
                }
            }
        }
    }

    /// `a0 + da`.
    pub(crate) fn total(&mut self, a: AboutRest) -> Value {
        self.add(Add(a.rest, a.deviation))
    }

    /// `da / a0`.
    fn ratio(&mut self, a: AboutRest) -> Value {
        let inverse = self.add(Reciprocal(a.rest));
        self.add(Multiply(a.deviation, inverse))
    }
}
