//! The scalar that records what is done with it.

use super::{Expression, Graph, Id, Variable};
use std::cell::RefCell;
use std::fmt;
use std::ops::{Add, Mul, Neg, Sub};
use std::rc::Rc;
use viscera_number::Scalar;

/// A node of a graph that grows as the arithmetic goes on.
#[derive(Clone)]
pub struct Symbol {
    graph: Rc<RefCell<Graph>>,
    id: Id,
}

impl Symbol {
    /// Records an energy of the invariants `I1, I2, J, I4, I6`. The law's parameters become numbers.
    pub fn record(energy: impl FnOnce([Symbol; 5]) -> Symbol) -> Expression {
        let graph = Rc::new(RefCell::new(Graph::default()));
        let variables = Variable::ALL.map(|v| {
            let id = graph.borrow_mut().variable(v);
            Symbol { graph: graph.clone(), id }
        });
        let Symbol { graph, id } = energy(variables);
        Expression { graph: graph.borrow().clone(), energy: id, parameters: Vec::new() }
    }

    fn with(&self, node: impl FnOnce(&mut Graph) -> Id) -> Self {
        let id = node(&mut self.graph.borrow_mut());
        Symbol { graph: self.graph.clone(), id }
    }

    fn with_number(&self, value: f64, node: impl FnOnce(&mut Graph, Id) -> Id) -> Self {
        self.with(|graph| {
            let number = graph.number(value);
            node(graph, number)
        })
    }
}

impl fmt::Debug for Symbol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "node {}", self.id)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl $trait for Symbol {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                self.with(|graph| graph.$method(self.id, other.id))
            }
        }
        impl $trait<f64> for Symbol {
            type Output = Self;
            fn $method(self, other: f64) -> Self {
                self.with_number(other, |graph, number| graph.$method(self.id, number))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);

impl Neg for Symbol {
    type Output = Self;
    fn neg(self) -> Self {
        self.with(|graph| graph.neg(self.id))
    }
}

impl Scalar for Symbol {
    fn constant(&self, value: f64) -> Self {
        self.with_number(value, |_, number| number)
    }
    fn recip(&self) -> Self {
        self.with(|graph| graph.recip(self.id))
    }
    fn ln(&self) -> Self {
        self.with(|graph| graph.ln(self.id))
    }
    fn exp(&self) -> Self {
        self.with(|graph| graph.exp(self.id))
    }
    fn sqrt(&self) -> Self {
        self.with(|graph| graph.sqrt(self.id))
    }
    fn powf(&self, exponent: f64) -> Self {
        self.with_number(exponent, |graph, s| graph.power(self.id, s))
    }
    fn heaviside(&self) -> Self {
        self.with(|graph| graph.step(self.id))
    }
    fn trace_of_power(i1: &Self, i2: &Self, s: f64) -> Self {
        i1.with_number(s, |graph, s| graph.trace_of_power(i1.id, i2.id, s))
    }
}
