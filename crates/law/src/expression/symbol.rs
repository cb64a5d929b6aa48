//! The scalar that records what is done with it.

use super::{Expression, Graph, Id, Variable};
use std::cell::RefCell;
use std::fmt;
use std::ops::{Add, Mul, Neg, Sub};
use std::rc::Rc;
use viscera_number::Scalar;

/// The parameter that stands for the pressure of a cell's cluster.
pub const PRESSURE: u16 = u16::MAX;

/// A node of a graph that grows as the arithmetic goes on.
#[derive(Clone)]
pub struct Symbol {
    record: Rc<RefCell<Record>>,
    id: Id,
}

/// The graph, and its numbers where they are kept apart.
#[derive(Default)]
struct Record {
    graph: Graph,
    numbers: Option<Vec<f64>>,
}

impl Record {
    fn number(&mut self, value: f64) -> Id {
        let Some(numbers) = &mut self.numbers else { return self.graph.number(value) };
        numbers.push(value);
        self.graph.parameter(numbers.len() as u16 - 1)
    }
}

impl Symbol {
    /// Records an energy of the invariants `I1, I2, J, I4, I6`. The law's parameters become numbers.
    pub fn record(energy: impl FnOnce([Symbol; 5]) -> Symbol) -> Expression {
        let (expression, _) = Self::run(Record::default(), |variables, _| energy(variables));
        expression
    }

    /// The same with every number as a parameter, in the order in which they appear, and their values. Beside the
    /// invariants the energy gets a parameter of its own, [`PRESSURE`].
    pub fn record_apart(
        energy: impl FnOnce([Symbol; 5], Symbol) -> Symbol,
    ) -> (Expression, Vec<f64>) {
        Self::run(Record { numbers: Some(Vec::new()), ..Record::default() }, energy)
    }

    fn run(
        record: Record,
        energy: impl FnOnce([Symbol; 5], Symbol) -> Symbol,
    ) -> (Expression, Vec<f64>) {
        let record = Rc::new(RefCell::new(record));
        let symbol = |node: &dyn Fn(&mut Graph) -> Id| {
            let id = node(&mut record.borrow_mut().graph);
            Symbol { record: record.clone(), id }
        };
        let variables = Variable::ALL.map(|v| symbol(&|graph| graph.variable(v)));
        let pressure = symbol(&|graph| graph.parameter(PRESSURE));
        let Symbol { record, id } = energy(variables, pressure);
        let Record { graph, numbers } = &*record.borrow();
        let expression = Expression { graph: graph.clone(), energy: id, parameters: Vec::new() };
        (expression, numbers.clone().unwrap_or_default())
    }

    fn with(&self, node: impl FnOnce(&mut Graph) -> Id) -> Self {
        let id = node(&mut self.record.borrow_mut().graph);
        Symbol { record: self.record.clone(), id }
    }

    fn with_number(&self, value: f64, node: impl FnOnce(&mut Graph, Id) -> Id) -> Self {
        let number = self.record.borrow_mut().number(value);
        self.with(|graph| node(graph, number))
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
    /// Nothing: a record is of the energy where it has a value.
    fn wall(&self) -> Self {
        self.with(|graph| graph.number(0.0))
    }
    fn trace_of_power(i1: &Self, i2: &Self, s: f64) -> Self {
        i1.with_number(s, |graph, s| graph.trace_of_power(i1.id, i2.id, s))
    }
}
