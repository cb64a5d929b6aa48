//! Energies as expressions: a small graph over the invariants and a law's parameters.
//!
//! An expression is parsed from a user's formula ([`Expression::parse`]) or recorded from a law by evaluating it with
//! [`Symbol`]. It is differentiated term by term and laid out on a [`Tape`], which runs with any scalar.

mod derivative;
mod domain;
mod parse;
mod symbol;
mod tape;

pub use symbol::{PRESSURE, Symbol};
pub use tape::{Constants, Tape};

use std::collections::HashMap;

/// What an energy is a function of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Variable {
    /// `tr C`.
    I1,
    /// `(I1^2 - tr C^2) / 2`.
    I2,
    /// `det F`.
    J,
    /// `|F a|^2` along the first direction of fibres.
    I4,
    /// `|F a|^2` along the second.
    I6,
}

impl Variable {
    /// Its value at rest.
    pub fn at_rest(self) -> f64 {
        match self {
            Variable::I1 | Variable::I2 => 3.0,
            Variable::J | Variable::I4 | Variable::I6 => 1.0,
        }
    }

    /// All of them, in the order in which they are given to a tape.
    pub const ALL: [Variable; 5] =
        [Variable::I1, Variable::I2, Variable::J, Variable::I4, Variable::I6];
}

/// A node of a graph, by its number.
pub type Id = u32;

/// An operation on nodes before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Node {
    /// A number.
    Number(f64),
    /// A parameter, by its place in the row.
    Parameter(u16),
    /// A variable.
    Variable(Variable),
    /// Sum.
    Add(Id, Id),
    /// Difference.
    Sub(Id, Id),
    /// Product.
    Mul(Id, Id),
    /// `-x`.
    Neg(Id),
    /// `1 / x`.
    Recip(Id),
    /// Natural logarithm.
    Ln(Id),
    /// Exponential.
    Exp(Id),
    /// Square root.
    Sqrt(Id),
    /// A power; the exponent depends on no variable.
    Power(Id, Id),
    /// 1 where positive, else 0.
    Step(Id),
    /// 0 where positive, else infinity, and so its slopes.
    Wall(Id),
    /// `x_1^s + x_2^s + x_3^s` of the numbers with the elementary symmetric functions of the first two nodes and 1: the
    /// trace of a power of the isochoric `C`. The third, `s`, depends on no variable.
    TraceOfPower(Id, Id, Id),
}

/// Nodes, each of them once, in an order in which they can be evaluated.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    nodes: Vec<Node>,
    /// Whether a node depends on a variable.
    varies: Vec<bool>,
    known: HashMap<Key, Id>,
}

/// A node as what it is looked up by.
type Key = (u8, u64, u32, u32);

fn key(node: Node) -> Key {
    match node {
        Node::Number(x) => (0, x.to_bits(), 0, 0),
        Node::Parameter(k) => (1, u64::from(k), 0, 0),
        Node::Variable(v) => (2, v as u64, 0, 0),
        Node::Add(a, b) => (3, 0, a.min(b), a.max(b)),
        Node::Sub(a, b) => (4, 0, a, b),
        Node::Mul(a, b) => (5, 0, a.min(b), a.max(b)),
        Node::Neg(a) => (6, 0, a, 0),
        Node::Recip(a) => (7, 0, a, 0),
        Node::Ln(a) => (8, 0, a, 0),
        Node::Exp(a) => (9, 0, a, 0),
        Node::Sqrt(a) => (10, 0, a, 0),
        Node::Power(a, s) => (11, 0, a, s),
        Node::Step(a) => (12, 0, a, 0),
        Node::TraceOfPower(a, b, s) => (13, u64::from(s), a, b),
        Node::Wall(a) => (14, 0, a, 0),
    }
}

/// Whole exponents up to here are products.
const MAX_WHOLE: f64 = 16.0;

impl Graph {
    /// The node.
    pub fn node(&self, id: Id) -> Node {
        self.nodes[id as usize]
    }

    /// Whether it depends on a variable.
    pub fn varies(&self, id: Id) -> bool {
        self.varies[id as usize]
    }

    /// All of them.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    fn number_of(&self, id: Id) -> Option<f64> {
        if let Node::Number(x) = self.node(id) { Some(x) } else { None }
    }

    /// The nodes that a node is made of.
    pub fn operands(node: Node) -> impl Iterator<Item = Id> {
        let [a, b, c] = match node {
            Node::Number(_) | Node::Parameter(_) | Node::Variable(_) => [None; 3],
            Node::Add(a, b) | Node::Sub(a, b) | Node::Mul(a, b) | Node::Power(a, b) => {
                [Some(a), Some(b), None]
            }
            Node::Neg(a)
            | Node::Recip(a)
            | Node::Ln(a)
            | Node::Exp(a)
            | Node::Sqrt(a)
            | Node::Step(a)
            | Node::Wall(a) => [Some(a), None, None],
            Node::TraceOfPower(a, b, s) => [Some(a), Some(b), Some(s)],
        };
        [a, b, c].into_iter().flatten()
    }

    fn insert(&mut self, node: Node) -> Id {
        if let Some(&id) = self.known.get(&key(node)) {
            return id;
        }
        let id = self.nodes.len() as Id;
        let varies =
            matches!(node, Node::Variable(_)) || Self::operands(node).any(|a| self.varies(a));
        self.nodes.push(node);
        self.varies.push(varies);
        self.known.insert(key(node), id);
        id
    }

    /// A number.
    pub fn number(&mut self, value: f64) -> Id {
        // Minus zero is zero.
        self.insert(Node::Number(value + 0.0))
    }

    /// A parameter, by its place in the row.
    pub fn parameter(&mut self, place: u16) -> Id {
        self.insert(Node::Parameter(place))
    }

    /// A variable.
    pub fn variable(&mut self, variable: Variable) -> Id {
        self.insert(Node::Variable(variable))
    }

    /// `a + b`.
    pub fn add(&mut self, a: Id, b: Id) -> Id {
        match (self.number_of(a), self.number_of(b)) {
            (Some(x), Some(y)) => self.number(x + y),
            (Some(0.0), _) => b,
            (_, Some(0.0)) => a,
            _ => self.insert(Node::Add(a, b)),
        }
    }

    /// `a - b`.
    pub fn sub(&mut self, a: Id, b: Id) -> Id {
        match (self.number_of(a), self.number_of(b)) {
            (Some(x), Some(y)) => self.number(x - y),
            (Some(0.0), _) => self.neg(b),
            (_, Some(0.0)) => a,
            _ if a == b => self.number(0.0),
            _ => self.insert(Node::Sub(a, b)),
        }
    }

    /// `a b`; factors that do not vary come together.
    pub fn mul(&mut self, a: Id, b: Id) -> Id {
        match (self.number_of(a), self.number_of(b)) {
            (Some(x), Some(y)) => return self.number(x * y),
            (Some(0.0), _) => return a,
            (_, Some(0.0)) => return b,
            (Some(1.0), _) => return b,
            (_, Some(1.0)) => return a,
            _ => {}
        }
        let (a, b) = if self.varies(a) && !self.varies(b) { (b, a) } else { (a, b) };
        if let (false, Node::Mul(c, d)) = (self.varies(a), self.node(b))
            && !self.varies(c)
            && self.varies(d)
        {
            let factor = self.mul(a, c);
            return self.mul(factor, d);
        }
        self.insert(Node::Mul(a, b))
    }

    /// `-a`.
    pub fn neg(&mut self, a: Id) -> Id {
        match self.node(a) {
            Node::Number(x) => self.number(-x),
            Node::Neg(b) => b,
            _ => self.insert(Node::Neg(a)),
        }
    }

    /// `1 / a`.
    pub fn recip(&mut self, a: Id) -> Id {
        match self.node(a) {
            Node::Number(x) => self.number(x.recip()),
            Node::Recip(b) => b,
            _ => self.insert(Node::Recip(a)),
        }
    }

    /// `ln a`.
    pub fn ln(&mut self, a: Id) -> Id {
        if let Some(x) = self.number_of(a) {
            return self.number(x.ln());
        }
        self.insert(Node::Ln(a))
    }

    /// `exp a`.
    pub fn exp(&mut self, a: Id) -> Id {
        if let Some(x) = self.number_of(a) {
            return self.number(x.exp());
        }
        self.insert(Node::Exp(a))
    }

    /// The square root of `a`.
    pub fn sqrt(&mut self, a: Id) -> Id {
        if let Some(x) = self.number_of(a) {
            return self.number(x.sqrt());
        }
        self.insert(Node::Sqrt(a))
    }

    /// 1 where `a` is positive, else 0.
    pub fn step(&mut self, a: Id) -> Id {
        if let Some(x) = self.number_of(a) {
            return self.number(f64::from(u8::from(x > 0.0)));
        }
        self.insert(Node::Step(a))
    }

    /// `a^s`: products for whole exponents, which have a value at zero and below too.
    pub fn power(&mut self, a: Id, s: Id) -> Id {
        if let (Some(x), Some(s)) = (self.number_of(a), self.number_of(s)) {
            return self.number(x.powf(s));
        }
        if let Some(s) = self.number_of(s) {
            if s == 0.5 {
                return self.sqrt(a);
            }
            if s.fract() == 0.0 && s.abs() <= MAX_WHOLE {
                let power = self.whole_power(a, s.abs() as u32);
                return if s < 0.0 { self.recip(power) } else { power };
            }
        }
        if self.varies(s) {
            let ln = self.ln(a);
            let product = self.mul(s, ln);
            return self.exp(product);
        }
        self.insert(Node::Power(a, s))
    }

    fn whole_power(&mut self, a: Id, s: u32) -> Id {
        match s {
            0 => self.number(1.0),
            1 => a,
            _ => {
                let half = self.whole_power(a, s / 2);
                let square = self.mul(half, half);
                if s % 2 == 1 { self.mul(square, a) } else { square }
            }
        }
    }

    /// The trace of a power of the isochoric `C`.
    pub fn trace_of_power(&mut self, i1: Id, i2: Id, s: Id) -> Id {
        self.insert(Node::TraceOfPower(i1, i2, s))
    }

    /// The same expression with a node in the place of each number, parameter and variable.
    pub fn substitute(&mut self, root: Id, with: &dyn Fn(&mut Graph, Node) -> Id) -> Id {
        let mut image: HashMap<Id, Id> = HashMap::new();
        for id in 0..=root {
            let at = |a: Id, image: &HashMap<Id, Id>| image[&a];
            let new = match self.node(id) {
                leaf @ (Node::Number(_) | Node::Parameter(_) | Node::Variable(_)) => {
                    with(self, leaf)
                }
                Node::Add(a, b) => self.add(at(a, &image), at(b, &image)),
                Node::Sub(a, b) => self.sub(at(a, &image), at(b, &image)),
                Node::Mul(a, b) => self.mul(at(a, &image), at(b, &image)),
                Node::Neg(a) => self.neg(at(a, &image)),
                Node::Recip(a) => self.recip(at(a, &image)),
                Node::Ln(a) => self.ln(at(a, &image)),
                Node::Exp(a) => self.exp(at(a, &image)),
                Node::Sqrt(a) => self.sqrt(at(a, &image)),
                Node::Power(a, s) => self.power(at(a, &image), at(s, &image)),
                Node::Step(a) => self.step(at(a, &image)),
                Node::Wall(a) => self.insert(Node::Wall(at(a, &image))),
                Node::TraceOfPower(a, b, s) => {
                    self.trace_of_power(at(a, &image), at(b, &image), at(s, &image))
                }
            };
            image.insert(id, new);
        }
        image[&root]
    }

    /// The nodes that some nodes are made of, these included, in their order.
    pub fn reached(&self, roots: &[Id]) -> Vec<Id> {
        let mut is_reached = vec![false; self.nodes.len()];
        roots.iter().for_each(|&root| is_reached[root as usize] = true);
        for id in (0..self.nodes.len()).rev() {
            if is_reached[id] {
                Self::operands(self.nodes[id]).for_each(|a| is_reached[a as usize] = true);
            }
        }
        (0..self.nodes.len() as Id).filter(|&id| is_reached[id as usize]).collect()
    }
}

/// An energy: a graph, the node that is its value, and the names of its parameters.
#[derive(Clone, Debug)]
pub struct Expression {
    /// Its nodes.
    pub graph: Graph,
    /// The energy.
    pub energy: Id,
    /// Names of its parameters, in the order of a row.
    pub parameters: Vec<String>,
}

impl Expression {
    /// Whether the energy depends on a variable.
    pub fn uses(&self, variable: Variable) -> bool {
        let nodes = self.graph.reached(&[self.energy]);
        nodes.iter().any(|&id| self.graph.node(id) == Node::Variable(variable))
    }

    /// Whether it has the trace of a power, which has no derivative among the operations.
    pub fn has_traces(&self) -> bool {
        let nodes = self.graph.reached(&[self.energy]);
        nodes.iter().any(|&id| matches!(self.graph.node(id), Node::TraceOfPower(..)))
    }

    /// Whether it has a switch, where it has no power series.
    pub fn has_switch(&self) -> bool {
        let nodes = self.graph.reached(&[self.energy]);
        nodes.iter().any(|&id| matches!(self.graph.node(id), Node::Step(..)))
    }

    /// Whether it has an exponential, which reaches any number at a moderate strain.
    pub fn has_exponential(&self) -> bool {
        let nodes = self.graph.reached(&[self.energy]);
        nodes.iter().any(|&id| matches!(self.graph.node(id), Node::Exp(..)))
    }

    /// Takes the energy at rest off.
    pub fn count_from_rest(&mut self) {
        let rest = self.at_rest(self.energy);
        self.energy = self.graph.sub(self.energy, rest);
    }

    /// The value of a node at rest.
    fn at_rest(&mut self, id: Id) -> Id {
        let image = |graph: &mut Graph, leaf: Node| match leaf {
            Node::Variable(variable) => graph.number(variable.at_rest()),
            _ => graph.insert(leaf),
        };
        self.graph.substitute(id, &image)
    }

    /// The energy of a dilatation, a function of `J` alone: `I1 = 3 J^(2/3)`, `I2 = 3 J^(4/3)`, and along fibres `I4 = J^e`,
    /// `I6 = J^f` with exponents `e`, `f` that are two parameters after all others.
    pub fn dilatation(&mut self) -> Id {
        let after = self.parameters.len() as u16;
        let image = |graph: &mut Graph, leaf: Node| {
            let Node::Variable(variable) = leaf else { return graph.insert(leaf) };
            let j = graph.variable(Variable::J);
            let (factor, exponent) = match variable {
                Variable::J => return j,
                Variable::I1 => (3.0, graph.number(2.0 / 3.0)),
                Variable::I2 => (3.0, graph.number(4.0 / 3.0)),
                Variable::I4 => (1.0, graph.parameter(after)),
                Variable::I6 => (1.0, graph.parameter(after + 1)),
            };
            let power = graph.power(j, exponent);
            let factor = graph.number(factor);
            graph.mul(factor, power)
        };
        self.graph.substitute(self.energy, &image)
    }
}
