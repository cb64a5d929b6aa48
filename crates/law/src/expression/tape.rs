//! Expressions as a list of operations on registers.
//!
//! What depends on parameters alone is worked out once for a row; the rest is a loop over operations, each on whatever
//! the scalar is: cells side by side, power series.

use super::{Graph, Id, Node, Variable};
use crate::error::Error;
use std::collections::HashMap;
use viscera_number::Scalar;

/// Most constants that the tapes of an expression may have.
const MAX_CONSTANTS: usize = 250;
/// Registers of most expressions; others are evaluated somewhat slower.
const FEW: usize = 12;
const MOST: usize = 250;
const VARIABLES: usize = Variable::ALL.len();

#[derive(Clone, Copy, Debug)]
enum Code {
    Add,
    Sub,
    Mul,
    /// Register plus constant, and so on.
    AddConstant,
    SubConstant,
    ConstantSub,
    MulConstant,
    Neg,
    Recip,
    Ln,
    Exp,
    Sqrt,
    Power,
    Step,
    Wall,
    TraceOfPower,
}

/// `out = code(a, b)`; `b` or `c` is a constant where the code says so.
#[derive(Clone, Copy, Debug)]
struct Op {
    code: Code,
    out: u8,
    a: u8,
    b: u8,
    c: u8,
}

#[derive(Clone, Copy, Debug)]
enum Output {
    Zero,
    Constant(u8),
    Register(u8),
}

/// What tapes need of a row of parameters: the values of nodes that depend on no variable.
#[derive(Clone, Debug, Default)]
pub struct Constants {
    nodes: Vec<Id>,
}

impl Constants {
    fn place(&mut self, id: Id) -> Result<u8, Error> {
        if let Some(place) = self.nodes.iter().position(|&c| c == id) {
            return Ok(place as u8);
        }
        if self.nodes.len() == MAX_CONSTANTS {
            return Err(Error::input(format!(
                "the formula and its derivatives have more than {MAX_CONSTANTS} different constants; make it shorter"
            )));
        }
        self.nodes.push(id);
        Ok(self.nodes.len() as u8 - 1)
    }

    /// Their values.
    pub fn values(&self, graph: &Graph, row: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; graph.len()];
        for id in graph.reached(&self.nodes) {
            let at = |a: Id| values[a as usize];
            values[id as usize] = match graph.node(id) {
                Node::Number(x) => x,
                Node::Parameter(k) => row[k as usize],
                Node::Add(a, b) => at(a) + at(b),
                Node::Sub(a, b) => at(a) - at(b),
                Node::Mul(a, b) => at(a) * at(b),
                Node::Neg(a) => -at(a),
                Node::Recip(a) => at(a).recip(),
                Node::Ln(a) => at(a).ln(),
                Node::Exp(a) => at(a).exp(),
                Node::Sqrt(a) => at(a).sqrt(),
                Node::Power(a, s) => at(a).powf(at(s)),
                Node::Step(a) => Scalar::heaviside(&at(a)),
                Node::Wall(a) => Scalar::wall(&at(a)),
                Node::TraceOfPower(a, b, s) => Scalar::trace_of_power(&at(a), &at(b), at(s)),
                Node::Variable(_) => unreachable!("constants depend on no variable"),
            };
        }
        self.nodes.iter().map(|&id| values[id as usize]).collect()
    }
}

/// Some nodes of a graph, ready to be evaluated together.
#[derive(Clone, Debug)]
pub struct Tape {
    ops: Vec<Op>,
    outputs: Vec<Output>,
    registers: usize,
}

impl Tape {
    /// A tape of some nodes, which adds its constants to those of others.
    ///
    /// # Errors
    /// More constants or intermediate values than there is room for.
    pub fn new(graph: &Graph, roots: &[Id], constants: &mut Constants) -> Result<Self, Error> {
        let nodes = graph.reached(roots);
        let mut layout = Layout::new(graph, &nodes, roots, constants);
        for &id in nodes.iter().filter(|&&id| graph.varies(id)) {
            layout.place(id)?;
        }
        let outputs = roots.iter().map(|&root| layout.output(root)).collect::<Result<_, _>>()?;
        let Layout { ops, registers, .. } = layout;
        Ok(Tape { ops, outputs, registers })
    }

    /// Number of operations for each evaluation.
    pub fn len(&self) -> usize {
        self.ops.len()
    }

    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.ops.is_empty()
    }

    /// The values at `I1, I2, J, I4, I6`.
    #[inline(always)]
    pub fn evaluate<S: Scalar, const N: usize>(
        &self,
        constants: &[f64],
        variables: [S; VARIABLES],
    ) -> [S; N] {
        let zero = variables[0].constant(0.0);
        if self.registers <= FEW {
            let mut registers: [S; FEW] = std::array::from_fn(|_| zero.clone());
            registers[..VARIABLES].clone_from_slice(&variables);
            self.run(constants, &mut registers)
        } else {
            let mut registers = vec![zero; self.registers];
            registers[..VARIABLES].clone_from_slice(&variables);
            self.run(constants, &mut registers)
        }
    }

    #[inline(always)]
    fn run<S: Scalar, const N: usize>(&self, constants: &[f64], r: &mut [S]) -> [S; N] {
        for &Op { code, out, a, b, c } in &self.ops {
            let (a, b, c) = (a as usize, b as usize, c as usize);
            r[out as usize] = match code {
                Code::Add => r[a].clone() + r[b].clone(),
                Code::Sub => r[a].clone() - r[b].clone(),
                Code::Mul => r[a].clone() * r[b].clone(),
                Code::AddConstant => r[a].clone() + constants[c],
                Code::SubConstant => r[a].clone() - constants[c],
                Code::ConstantSub => -(r[a].clone() - constants[c]),
                Code::MulConstant => r[a].clone() * constants[c],
                Code::Neg => -r[a].clone(),
                Code::Recip => r[a].recip(),
                Code::Ln => r[a].ln(),
                Code::Exp => r[a].exp(),
                Code::Sqrt => r[a].sqrt(),
                Code::Power => r[a].powf(constants[c]),
                Code::Step => r[a].heaviside(),
                Code::Wall => r[a].wall(),
                Code::TraceOfPower => trace(&r[a], &r[b], constants[c]),
            };
        }
        std::array::from_fn(|k| match self.outputs[k] {
            Output::Zero => r[0].constant(0.0),
            Output::Constant(c) => r[0].constant(constants[c as usize]),
            Output::Register(k) => r[k as usize].clone(),
        })
    }
}

/// Not inlined: it is long, and rare.
#[inline(never)]
fn trace<S: Scalar>(i1: &S, i2: &S, s: f64) -> S {
    S::trace_of_power(i1, i2, s)
}

/// Where nodes are while a tape is laid out.
struct Layout<'a> {
    graph: &'a Graph,
    /// How often a node is still asked for.
    uses: HashMap<Id, usize>,
    place: HashMap<Id, u8>,
    free: Vec<u8>,
    constants: &'a mut Constants,
    ops: Vec<Op>,
    registers: usize,
}

impl<'a> Layout<'a> {
    fn new(graph: &'a Graph, nodes: &[Id], roots: &[Id], constants: &'a mut Constants) -> Self {
        let mut uses: HashMap<Id, usize> = HashMap::new();
        let operands = nodes.iter().flat_map(|&id| Graph::operands(graph.node(id)));
        operands.chain(roots.iter().copied()).for_each(|id| *uses.entry(id).or_default() += 1);
        Layout {
            graph,
            uses,
            place: HashMap::new(),
            free: Vec::new(),
            constants,
            ops: Vec::new(),
            registers: VARIABLES,
        }
    }

    /// The register of a node, which is free again after its last use.
    fn take(&mut self, id: Id) -> u8 {
        let register = self.place[&id];
        if let Some(uses) = self.uses.get_mut(&id) {
            *uses -= 1;
            if *uses == 0 && register as usize >= VARIABLES {
                self.free.push(register);
            }
        }
        register
    }

    fn place(&mut self, id: Id) -> Result<(), Error> {
        let node = self.graph.node(id);
        if let Node::Variable(variable) = node {
            self.place.insert(id, variable as u8);
            return Ok(());
        }
        let mut op = Op { code: Code::Neg, out: 0, a: 0, b: 0, c: 0 };
        let is_constant = |a: Id| !self.graph.varies(a);
        match node {
            Node::Add(a, b) if is_constant(a) || is_constant(b) => {
                let (a, c) = if is_constant(b) { (a, b) } else { (b, a) };
                op = Op {
                    code: Code::AddConstant,
                    c: self.constants.place(c)?,
                    a: self.take(a),
                    ..op
                };
            }
            Node::Sub(a, c) if is_constant(c) => {
                op = Op {
                    code: Code::SubConstant,
                    c: self.constants.place(c)?,
                    a: self.take(a),
                    ..op
                };
            }
            Node::Sub(c, a) if is_constant(c) => {
                op = Op {
                    code: Code::ConstantSub,
                    c: self.constants.place(c)?,
                    a: self.take(a),
                    ..op
                };
            }
            Node::Mul(a, b) if is_constant(a) || is_constant(b) => {
                let (a, c) = if is_constant(b) { (a, b) } else { (b, a) };
                op = Op {
                    code: Code::MulConstant,
                    c: self.constants.place(c)?,
                    a: self.take(a),
                    ..op
                };
            }
            Node::Add(a, b) | Node::Sub(a, b) | Node::Mul(a, b) => {
                let code = match node {
                    Node::Add(..) => Code::Add,
                    Node::Sub(..) => Code::Sub,
                    _ => Code::Mul,
                };
                op = Op { code, a: self.take(a), b: self.take(b), ..op };
            }
            Node::Power(a, s) => {
                op = Op { code: Code::Power, c: self.constants.place(s)?, a: self.take(a), ..op };
            }
            Node::TraceOfPower(a, b, s) => {
                let (code, c) = (Code::TraceOfPower, self.constants.place(s)?);
                op = Op { code, c, a: self.in_register(a)?, b: self.in_register(b)?, ..op };
            }
            Node::Neg(a)
            | Node::Recip(a)
            | Node::Ln(a)
            | Node::Exp(a)
            | Node::Sqrt(a)
            | Node::Step(a)
            | Node::Wall(a) => {
                let code = match node {
                    Node::Neg(_) => Code::Neg,
                    Node::Recip(_) => Code::Recip,
                    Node::Ln(_) => Code::Ln,
                    Node::Exp(_) => Code::Exp,
                    Node::Sqrt(_) => Code::Sqrt,
                    Node::Step(_) => Code::Step,
                    _ => Code::Wall,
                };
                op = Op { code, a: self.take(a), ..op };
            }
            Node::Number(_) | Node::Parameter(_) | Node::Variable(_) => {
                unreachable!("only what varies is placed, and variables have their place")
            }
        }
        op.out = self.register()?;
        self.ops.push(op);
        self.place.insert(id, op.out);
        Ok(())
    }

    /// A node that may be a constant, in a register: a variable times zero, plus the constant.
    fn in_register(&mut self, id: Id) -> Result<u8, Error> {
        if self.graph.varies(id) {
            return Ok(self.take(id));
        }
        Err(Error::input("the trace of a power of a constant is a constant: write it as one"))
    }

    fn register(&mut self) -> Result<u8, Error> {
        if let Some(register) = self.free.pop() {
            return Ok(register);
        }
        if self.registers == MOST {
            return Err(Error::input(format!(
                "the formula and its derivatives keep more than {MOST} intermediate values; make it shorter"
            )));
        }
        self.registers += 1;
        Ok(self.registers as u8 - 1)
    }

    fn output(&mut self, root: Id) -> Result<Output, Error> {
        Ok(match self.graph.node(root) {
            Node::Number(0.0) => Output::Zero,
            _ if self.graph.varies(root) => Output::Register(self.place[&root]),
            _ => Output::Constant(self.constants.place(root)?),
        })
    }
}
