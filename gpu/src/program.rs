//! A strain energy `psi(I1, I2, J)` as a straight-line program: a list of operations, each on results of earlier ones.
//!
//! The program is differentiated operation by operation and rewritten about the rest state: every value is split into
//! its value at rest and a deviation, `a = a0 + da`. The rules for the deviations never subtract nearly equal numbers.
//! The kernels are made from that form, so single precision resolves the stresses of small strains.

mod about_rest;
mod derivatives;

use crate::Error;
use std::collections::HashMap;

/// The invariants of which the energy is a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Invariant {
    /// `I1 = tr C`, 3 at rest.
    I1,
    /// `I2 = |cof F|^2`, 3 at rest.
    I2,
    /// `J = det F`, 1 at rest.
    J,
}

impl Invariant {
    /// All of them, in the order of derivatives.
    pub const ALL: [Invariant; 3] = [Invariant::I1, Invariant::I2, Invariant::J];

    /// Its value at rest.
    pub fn at_rest(self) -> f64 {
        [3.0, 3.0, 1.0][self as usize]
    }
}

/// The place of a result in its program.
pub type Value = usize;

/// An operation on earlier results.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operation {
    /// A number.
    Constant(f64),
    /// The parameter of this number in a cell's row.
    Parameter(usize),
    /// The pressure of the cell's cluster.
    Pressure,
    /// An invariant; in a program written about rest, its deviation.
    Invariant(Invariant),
    /// `a + b`.
    Add(Value, Value),
    /// `a - b`.
    Subtract(Value, Value),
    /// `a b`.
    Multiply(Value, Value),
    /// `-a`.
    Negate(Value),
    /// `1 / a`.
    Reciprocal(Value),
    /// Natural logarithm.
    Logarithm(Value),
    /// Exponential.
    Exponential(Value),
    /// `a^c` for positive `a`; the exponent depends on no invariant.
    Power(Value, Value),
    /// 1 where `a > 0`, else 0.
    Step(Value),
    /// `ln(1 + a)`.
    LogarithmOfOnePlus(Value),
    /// `exp(a) - 1`.
    ExponentialMinusOne(Value),
}

use Operation::*;

/// A list of operations. Repeated operations are added once, and constants are folded.
#[derive(Clone, Debug, Default)]
pub struct Program {
    operations: Vec<Operation>,
    known: HashMap<(u8, u64, u64), Value>,
}

/// A value about rest: `rest + deviation`, the deviation exactly zero there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AboutRest {
    pub rest: Value,
    pub deviation: Value,
}

impl Program {
    /// An empty program.
    pub fn new() -> Self {
        Self::default()
    }

    /// Reads a list of operations from the library's interface; the last result is the energy.
    ///
    /// # Errors
    /// An unknown operation; an operand that is not an earlier result.
    pub fn of(given: &[viscera_device::law::Operation]) -> Result<Self, Error> {
        let (mut program, mut values) = (Program::new(), Vec::with_capacity(given.len()));
        for (place, operation) in given.iter().enumerate() {
            let value = program.add_given(operation, &values).ok_or_else(|| {
                Error::Input(format!(
                    "operation {place} of the law is not a known one: {operation:?}"
                ))
            })?;
            values.push(value);
        }
        // By folding, the energy may be an earlier result. Later ones are then not needed.
        if let Some(&energy) = values.last() {
            program.operations.truncate(energy + 1);
            program.known.retain(|_, value| *value <= energy);
        }
        Ok(program)
    }

    fn add_given(
        &mut self,
        given: &viscera_device::law::Operation,
        values: &[Value],
    ) -> Option<Value> {
        use viscera_device::law as code;
        let place = given.a as usize;
        let a = values.get(place).copied();
        let b = values.get(given.b as usize).copied();
        let operation = match given.code {
            code::NUMBER => Constant(given.value),
            code::PARAMETER => Parameter(place),
            code::VARIABLE => Invariant(*self::Invariant::ALL.get(place)?),
            code::PRESSURE => Pressure,
            code::ADD => Add(a?, b?),
            code::SUBTRACT => Subtract(a?, b?),
            code::MULTIPLY => Multiply(a?, b?),
            code::POWER => return Some(self.power(a?, b?)),
            code::NEGATE => Negate(a?),
            code::RECIPROCAL => Reciprocal(a?),
            code::LOGARITHM => Logarithm(a?),
            code::EXPONENTIAL => Exponential(a?),
            code::SQUARE_ROOT => {
                let half = self.constant(0.5);
                Power(a?, half)
            }
            code::STEP => Step(a?),
            _ => return None,
        };
        Some(self.add(operation))
    }

    /// The operations, in order.
    pub fn operations(&self) -> &[Operation] {
        &self.operations
    }

    /// Number of parameters that the program reads.
    pub fn n_parameters(&self) -> usize {
        let number = |operation: &Operation| match operation {
            Parameter(k) => k + 1,
            _ => 0,
        };
        self.operations.iter().map(number).max().unwrap_or(0)
    }

    /// Adds an operation and returns its value.
    ///
    /// # Panics
    /// If an operand is not a value of this program.
    pub fn add(&mut self, operation: Operation) -> Value {
        assert!(operands(operation).iter().flatten().all(|&v| v < self.operations.len()));
        let operation = self.simplified(operation);
        if let Some(same) = self.same_as(operation) {
            return same;
        }
        let key = key(operation);
        *self.known.entry(key).or_insert_with(|| {
            self.operations.push(operation);
            self.operations.len() - 1
        })
    }

    /// The operand that an operation returns unchanged: `a + 0`, `a - 0`, `1 a`, `-(-a)`.
    fn same_as(&self, operation: Operation) -> Option<Value> {
        let is = |v: Value, c: f64| self.operations[v] == Constant(c);
        match operation {
            Add(a, b) if is(a, 0.0) => Some(b),
            Add(a, b) | Subtract(a, b) if is(b, 0.0) => Some(a),
            Multiply(a, b) if is(a, 1.0) => Some(b),
            Multiply(a, b) if is(b, 1.0) => Some(a),
            Negate(a) => match self.operations[a] {
                Negate(inner) => Some(inner),
                _ => None,
            },
            _ => None,
        }
    }

    /// Folds constants, and products with zero.
    fn simplified(&self, operation: Operation) -> Operation {
        let given = operands(operation).map(|operand| match operand.map(|v| self.operations[v]) {
            Some(Constant(x)) => Some(x),
            _ => None,
        });
        match (operation, given) {
            (Multiply(..), [Some(0.0), _] | [_, Some(0.0)]) => Constant(0.0),
            (Subtract(_, b), [Some(0.0), None]) => Negate(b),
            (Constant(_) | Parameter(_) | Pressure | Invariant(_), _) => operation,
            (Add(..) | Subtract(..) | Multiply(..) | Power(..), [Some(a), Some(b)]) => {
                Constant(apply(operation, [a, b]))
            }
            (Add(..) | Subtract(..) | Multiply(..) | Power(..), _) => operation,
            (_, [Some(a), _]) => Constant(apply(operation, [a, 0.0])),
            _ => operation,
        }
    }

    /// A number.
    pub fn constant(&mut self, value: f64) -> Value {
        self.add(Constant(value))
    }

    /// Evaluates all values at the invariants and a row of parameters, at zero pressure.
    pub fn evaluate(&self, invariants: [f64; 3], parameters: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(self.operations.len());
        for &operation in &self.operations {
            let value = match operation {
                Constant(c) => c,
                Parameter(k) => parameters[k],
                Pressure => 0.0,
                Invariant(i) => invariants[i as usize],
                _ => apply(operation, operands(operation).map(|v| v.map_or(0.0, |v| values[v]))),
            };
            values.push(value);
        }
        values
    }

    /// Marks all values that the wanted ones depend on, and the wanted ones themselves.
    pub(crate) fn needed(&self, wanted: &[Value]) -> Vec<bool> {
        let mut needed = vec![false; self.operations.len()];
        wanted.iter().for_each(|&v| needed[v] = true);
        for value in (0..self.operations.len()).rev() {
            if needed[value] {
                operands(self.operations[value]).iter().flatten().for_each(|&v| needed[v] = true);
            }
        }
        needed
    }
}

/// The operands of an operation.
fn operands(operation: Operation) -> [Option<Value>; 2] {
    match operation {
        Constant(_) | Parameter(_) | Pressure | Invariant(_) => [None, None],
        Add(a, b) | Subtract(a, b) | Multiply(a, b) | Power(a, b) => [Some(a), Some(b)],
        Negate(a)
        | Reciprocal(a)
        | Logarithm(a)
        | Exponential(a)
        | Step(a)
        | LogarithmOfOnePlus(a)
        | ExponentialMinusOne(a) => [Some(a), None],
    }
}

fn apply(operation: Operation, [a, b]: [f64; 2]) -> f64 {
    match operation {
        Constant(_) | Parameter(_) | Pressure | Invariant(_) => f64::NAN, // they have no operands
        Add(..) => a + b,
        Subtract(..) => a - b,
        Multiply(..) => a * b,
        Negate(_) => -a,
        Reciprocal(_) => a.recip(),
        Logarithm(_) => a.ln(),
        Exponential(_) => a.exp(),
        Power(..) => a.powf(b),
        Step(_) => f64::from(u8::from(a > 0.0)),
        LogarithmOfOnePlus(_) => a.ln_1p(),
        ExponentialMinusOne(_) => a.exp_m1(),
    }
}

/// A key that equal operations share, also sums and products with swapped operands.
fn key(operation: Operation) -> (u8, u64, u64) {
    let ordered = |a: Value, b: Value| (a.min(b) as u64, a.max(b) as u64);
    match operation {
        Constant(c) => (0, c.to_bits(), 0),
        Parameter(k) => (1, k as u64, 0),
        Invariant(i) => (2, i as u64, 0),
        Add(a, b) => (3, ordered(a, b).0, ordered(a, b).1),
        Subtract(a, b) => (4, a as u64, b as u64),
        Multiply(a, b) => (5, ordered(a, b).0, ordered(a, b).1),
        Negate(a) => (6, a as u64, 0),
        Reciprocal(a) => (7, a as u64, 0),
        Logarithm(a) => (8, a as u64, 0),
        Exponential(a) => (9, a as u64, 0),
        Power(a, c) => (10, a as u64, c as u64),
        Step(a) => (11, a as u64, 0),
        LogarithmOfOnePlus(a) => (12, a as u64, 0),
        ExponentialMinusOne(a) => (13, a as u64, 0),
        Pressure => (14, 0, 0),
    }
}
