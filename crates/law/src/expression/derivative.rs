//! Derivatives of expressions, which are expressions.

use super::{Graph, Id, Node, Variable};
use std::collections::HashMap;

impl Graph {
    /// The derivative of a node in a variable. A switch has none but where it turns over. There must be no trace of a
    /// power.
    pub fn derivative(&mut self, root: Id, variable: Variable) -> Id {
        let zero = self.number(0.0);
        let mut slopes: HashMap<Id, Id> = HashMap::new();
        for id in self.reached(&[root]) {
            let slope = if self.varies(id) { self.slope(id, variable, &slopes) } else { zero };
            slopes.insert(id, slope);
        }
        slopes[&root]
    }

    fn slope(&mut self, id: Id, variable: Variable, slopes: &HashMap<Id, Id>) -> Id {
        let of = |a: Id| slopes[&a];
        match self.node(id) {
            Node::Number(_) | Node::Parameter(_) | Node::Step(_) => self.number(0.0),
            Node::Variable(v) => self.number(f64::from(u8::from(v == variable))),
            Node::Add(a, b) => self.add(of(a), of(b)),
            Node::Sub(a, b) => self.sub(of(a), of(b)),
            Node::Mul(a, b) if a == b => {
                let two = self.number(2.0);
                let twice = self.mul(two, a);
                self.mul(twice, of(a))
            }
            Node::Mul(a, b) => {
                let (first, second) = (self.mul(of(a), b), self.mul(a, of(b)));
                self.add(first, second)
            }
            Node::Neg(a) => self.neg(of(a)),
            Node::Recip(a) => {
                let square = self.mul(id, id);
                let slope = self.neg(square);
                self.mul(slope, of(a))
            }
            Node::Ln(a) => {
                let slope = self.recip(a);
                self.mul(slope, of(a))
            }
            Node::Exp(a) => self.mul(id, of(a)),
            Node::Sqrt(a) => {
                let (half, inverse) = (self.number(0.5), self.recip(id));
                let slope = self.mul(half, inverse);
                self.mul(slope, of(a))
            }
            Node::Power(a, s) => {
                // Of J, which is never zero, no second power is taken; of others (1/0) 0 would be none.
                let power = if self.node(a) == Node::Variable(Variable::J) {
                    let inverse = self.recip(a);
                    self.mul(id, inverse)
                } else {
                    let one = self.number(1.0);
                    let less = self.sub(s, one);
                    self.power(a, less)
                };
                let slope = self.mul(s, power);
                self.mul(slope, of(a))
            }
            Node::Wall(_) => id,
            Node::TraceOfPower(..) => unreachable!("the caller has seen that there are none"),
        }
    }
}
