//! A strain energy as a list of operations, each on results of earlier ones.

/// The energy of a list of operations.
pub const ENERGY: u32 = 0;
/// Linear elasticity, without operations; parameters mu, lam.
pub const LINEAR: u32 = 1;
/// Corotated linear elasticity, without operations; parameters mu, lam.
pub const COROTATED: u32 = 2;

/// An operation.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Operation {
    /// What it does, one of the constants below.
    pub code: u32,
    /// The first operand, or the number of a parameter or variable.
    pub a: u32,
    /// The second operand.
    pub b: u32,
    /// The value of a number.
    pub value: f64,
}

/// A number.
pub const NUMBER: u32 = 0;
/// A parameter of the cell.
pub const PARAMETER: u32 = 1;
/// A variable: `I1`, `I2`, `J`.
pub const VARIABLE: u32 = 2;
/// The pressure of the cell's cluster.
pub const PRESSURE: u32 = 3;
/// `a + b`.
pub const ADD: u32 = 4;
/// `a - b`.
pub const SUBTRACT: u32 = 5;
/// `a b`.
pub const MULTIPLY: u32 = 6;
/// `a^b` for positive `a`; the exponent depends on no variable.
pub const POWER: u32 = 7;
/// `-a`.
pub const NEGATE: u32 = 8;
/// `1 / a`.
pub const RECIPROCAL: u32 = 9;
/// Natural logarithm.
pub const LOGARITHM: u32 = 10;
/// Exponential.
pub const EXPONENTIAL: u32 = 11;
/// Square root.
pub const SQUARE_ROOT: u32 = 12;
/// 1 where `a > 0`, else 0.
pub const STEP: u32 = 13;

#[cfg(feature = "law")]
mod recorded {
    use super::*;
    use viscera_law::expression::{Node, Variable};
    use viscera_law::{Model, Program};

    /// The number of a model.
    pub fn model(program: &Program) -> u32 {
        match program.model {
            Model::Energy => ENERGY,
            Model::Linear => LINEAR,
            Model::Corotated => COROTATED,
        }
    }

    /// The operations of a program.
    ///
    /// # Errors
    /// One that is not among them: a variable of fibres, a power of the principal stretches.
    pub fn operations(program: &Program) -> Result<Vec<Operation>, String> {
        program.nodes.iter().map(|&node| operation(node)).collect()
    }

    fn operation(node: Node) -> Result<Operation, String> {
        let (code, a, b, value) = match node {
            Node::Number(value) => (NUMBER, 0, 0, value),
            Node::Parameter(viscera_law::PRESSURE) => (PRESSURE, 0, 0, 0.0),
            Node::Parameter(k) => (PARAMETER, u32::from(k), 0, 0.0),
            Node::Variable(Variable::I1) => (VARIABLE, 0, 0, 0.0),
            Node::Variable(Variable::I2) => (VARIABLE, 1, 0, 0.0),
            Node::Variable(Variable::J) => (VARIABLE, 2, 0, 0.0),
            Node::Variable(Variable::I4 | Variable::I6) => {
                return Err("the law has fibres".to_string());
            }
            Node::Add(a, b) => (ADD, a, b, 0.0),
            Node::Sub(a, b) => (SUBTRACT, a, b, 0.0),
            Node::Mul(a, b) => (MULTIPLY, a, b, 0.0),
            Node::Power(a, b) => (POWER, a, b, 0.0),
            Node::Neg(a) => (NEGATE, a, 0, 0.0),
            Node::Recip(a) => (RECIPROCAL, a, 0, 0.0),
            Node::Ln(a) => (LOGARITHM, a, 0, 0.0),
            Node::Exp(a) => (EXPONENTIAL, a, 0, 0.0),
            Node::Sqrt(a) => (SQUARE_ROOT, a, 0, 0.0),
            Node::Step(a) => (STEP, a, 0, 0.0),
            Node::Wall(_) => return Err("the law has a pole".to_string()),
            Node::TraceOfPower(..) => {
                return Err("the law has powers of the principal stretches".to_string());
            }
        };
        Ok(Operation { code, a, b, value })
    }
}

#[cfg(feature = "law")]
pub use recorded::{model, operations};
