//! Where an energy ends: at the states in which one of its denominators vanishes.
//!
//! `1/d` has a value on both sides of such a pole, but a body only ever is on the side of rest: it would need infinite
//! energy to get to the other, where the energy may fall without end. A logarithm or a root ends by itself.

use super::{Expression, Graph, Id, Node};

impl Expression {
    /// Makes the energy infinite, and its slopes, wherever a denominator does not have the sign that it has at rest.
    pub fn end_at_poles(&mut self) {
        for (base, exponent) in self.poles() {
            let inside = self.is_as_at_rest(base, exponent);
            let wall = self.graph.insert(Node::Wall(inside));
            self.energy = self.graph.add(self.energy, wall);
        }
    }

    /// What denominators are products of, where its sign may change, with its exponent where that is a parameter's.
    fn poles(&self) -> Vec<(Id, Option<Id>)> {
        let graph = &self.graph;
        let mut poles = Vec::new();
        for id in graph.reached(&[self.energy]) {
            let mut bases = Vec::new();
            let exponent = match graph.node(id) {
                Node::Recip(a) => {
                    graph.add_bases(a, &mut bases);
                    None
                }
                Node::Power(a, s) if graph.number_of(s).is_none_or(|s| s < 0.0) => {
                    graph.add_bases(a, &mut bases);
                    Some(s)
                }
                _ => None,
            };
            poles.extend(bases.into_iter().map(|base| (base, exponent)));
        }
        poles.sort_unstable();
        poles.dedup();
        poles
    }

    /// A node that is positive where `base` has the sign that it has at rest, or where its exponent is not negative.
    fn is_as_at_rest(&mut self, base: Id, exponent: Option<Id>) -> Id {
        let rest = self.at_rest(base);
        let graph = &mut self.graph;
        let product = graph.mul(rest, base);
        let Some(exponent) = exponent else { return product };
        let opposite = graph.neg(exponent);
        let (is_pole, one) = (graph.step(opposite), graph.number(1.0));
        let is_none = graph.sub(one, is_pole);
        let counted = graph.mul(is_pole, product);
        graph.add(is_none, counted)
    }
}

impl Graph {
    /// Adds the factors of a denominator whose sign may change.
    fn add_bases(&self, id: Id, bases: &mut Vec<Id>) {
        match self.node(id) {
            _ if !self.varies(id) || self.is_positive(id) => {}
            Node::Mul(a, b) => {
                self.add_bases(a, bases);
                self.add_bases(b, bases);
            }
            Node::Neg(a) | Node::Recip(a) | Node::Sqrt(a) | Node::Power(a, _) => {
                self.add_bases(a, bases);
            }
            _ => bases.push(id),
        }
    }

    /// Whether a node is positive in every deformation: invariants are, and what is made of them by sums, products and
    /// powers.
    fn is_positive(&self, id: Id) -> bool {
        match self.node(id) {
            Node::Number(x) => x > 0.0,
            Node::Variable(_) | Node::Exp(_) => true,
            Node::Add(a, b) | Node::Mul(a, b) => self.is_positive(a) && self.is_positive(b),
            Node::Recip(a) | Node::Sqrt(a) | Node::Power(a, _) => self.is_positive(a),
            _ => false,
        }
    }
}
