//! The law of the cells: a strain energy as a program, or one of the two kinematic models (linear, corotated) that are
//! not functions of the invariants; and its WGSL.

use crate::Error;
use crate::program::{Invariant, Operation, Program, Value};
use std::fmt::Write;

/// A stress at rest below this fraction of its terms counts as rounding.
const ROUNDING: f64 = 1e-9;

/// Functions that the source of an energy calls.
pub(crate) const ELEMENTARY: &str = include_str!("kernels/elementary.wgsl");

/// A law.
#[derive(Clone, Debug)]
pub enum Law {
    /// `psi(I1, I2, J)`: the last value of a program that reads the parameters of the cell.
    Energy(Program),
    /// Linear elasticity; parameters mu, lam.
    Linear,
    /// Corotated linear elasticity with its exact tangent; parameters mu, lam.
    Corotated,
}

impl Law {
    /// The law that the caller passed over the library's interface.
    ///
    /// # Errors
    /// An unknown model or operation; an operand that is not an earlier result.
    pub fn of(model: u32, operations: &[viscera_device::law::Operation]) -> Result<Self, Error> {
        use viscera_device::law::{COROTATED, ENERGY, LINEAR};
        match model {
            ENERGY => Program::of(operations).map(Law::Energy),
            LINEAR => Ok(Law::Linear),
            COROTATED => Ok(Law::Corotated),
            other => Err(Error::Input(format!("there is no model of number {other}"))),
        }
    }

    /// Length of a row of parameters.
    pub fn n_parameters(&self) -> usize {
        match self {
            Law::Energy(program) => program.n_parameters(),
            Law::Linear | Law::Corotated => 2,
        }
    }

    /// Whether the law is undefined in an inverted cell.
    pub fn forbids_inversion(&self) -> bool {
        !matches!(self, Law::Linear)
    }

    /// Checks rows of parameters: one for all cells, or one for each.
    pub(crate) fn check(&self, rows: &[Vec<f64>], n_cells: usize) -> Result<(), Error> {
        if rows.len() != 1 && rows.len() != n_cells {
            return Err(Error::Input(format!(
                "{} rows of parameters for {n_cells} cells; give one for all or one for each",
                rows.len()
            )));
        }
        let n = self.n_parameters();
        for (row, values) in rows.iter().enumerate() {
            if values.len() < n || !values.iter().all(|v| v.is_finite()) {
                return Err(Error::Input(format!(
                    "row {row} of parameters is {values:?}; the law reads {n} finite numbers"
                )));
            }
        }
        if matches!(self, Law::Energy(program) if program.operations().is_empty()) {
            return Err(Error::Input("a law without operations has no energy".to_string()));
        }
        Ok(())
    }

    /// The law's part of the kernel that evaluates cells, in WGSL.
    pub(crate) fn source(&self, rows: &[Vec<f64>]) -> String {
        let stride = if rows.len() == 1 { 0 } else { self.n_parameters() };
        let kernel = match self {
            Law::Energy(program) => {
                return format!(
                    "const STRIDE = {stride}u;\n{}\n{ELEMENTARY}\n{}",
                    energy_source(program, rows),
                    include_str!("kernels/energy.wgsl")
                );
            }
            Law::Linear => include_str!("kernels/linear.wgsl"),
            Law::Corotated => include_str!("kernels/corotated.wgsl"),
        };
        format!("const STRIDE = {stride}u;\n{kernel}")
    }

    /// Operations of the law per cell, counted from the part of its program that the kernel evaluates.
    pub fn operations(&self, rows: &[Vec<f64>]) -> usize {
        match self {
            Law::Energy(program) => {
                let Derivatives { program, outputs } = Derivatives::new(program, rows);
                let needed = program.needed(&outputs.map(|(_, value)| value));
                let counts = |o: &Operation| {
                    !matches!(
                        o,
                        Operation::Constant(_)
                            | Operation::Parameter(_)
                            | Operation::Pressure
                            | Operation::Invariant(_)
                    )
                };
                let used = program.operations().iter().zip(needed);
                used.filter(|(operation, needed)| *needed && counts(operation)).count()
            }
            Law::Linear | Law::Corotated => 0,
        }
    }
}

/// First and second derivatives of an energy, written about rest.
pub(crate) struct Derivatives {
    pub program: Program,
    /// Names of the fields that the kernel reads, with their values in the program: the pressure of an undeformed cell
    /// without that of its cluster, and the derivatives.
    pub outputs: [(&'static str, Value); 10],
}

impl Derivatives {
    pub fn new(program: &Program, rows: &[Vec<f64>]) -> Self {
        let mut program = program.clone();
        let psi = program.operations().len() - 1;
        let first = Invariant::ALL.map(|i| program.derivative(psi, i));
        let [one, two, three] = first;
        let mut second = |of: Value, by: Invariant| program.derivative(of, by);
        let pairs = [
            second(one, Invariant::I1),
            second(one, Invariant::I2),
            second(one, Invariant::J),
            second(two, Invariant::I2),
            second(two, Invariant::J),
            second(three, Invariant::J),
        ];
        // 2 psi_1 + 4 psi_2 + psi_J: the pressure of an undeformed cell, zero at rest.
        let two_of = program.constant(2.0);
        let four_of = program.constant(4.0);
        let of_one = program.add(Operation::Multiply(two_of, one));
        let of_two = program.add(Operation::Multiply(four_of, two));
        let sum = program.add(Operation::Add(of_one, of_two));
        let pressure = program.add(Operation::Add(sum, three));

        let values = [&first[..], &pairs[..], &[pressure]].concat();
        let (mut about, split) = program.about_rest(&values);
        let vanishes = rows.iter().all(|row| {
            let at_rest = about.evaluate([0.0; 3], row);
            let size = at_rest[split[0].rest].abs()
                + at_rest[split[1].rest].abs()
                + at_rest[split[2].rest].abs();
            at_rest[split[9].rest].abs() <= ROUNDING * size
        });
        let totals: Vec<Value> = split.iter().map(|&value| about.total(value)).collect();
        let pressure = if vanishes { split[9].deviation } else { totals[9] };
        let outputs = [
            ("pressure", pressure),
            ("d1", totals[0]),
            ("d2", totals[1]),
            ("dJ", totals[2]),
            ("d11", totals[3]),
            ("d12", totals[4]),
            ("d1J", totals[5]),
            ("d22", totals[6]),
            ("d2J", totals[7]),
            ("dJJ", totals[8]),
        ];
        Derivatives { program: about, outputs }
    }
}

/// `s U'`, written about rest, of an energy of dilatation: a function of `J`, or of `I1` if the ratio is `(I1 - 1) / 2`.
pub(crate) fn dilatation_slope(dilatation: &Program) -> (Program, Value) {
    let mut program = dilatation.clone();
    let energy = program.operations().len() - 1;
    let slope = if of_trace(dilatation) {
        let two = program.constant(2.0);
        let slope = program.derivative(energy, Invariant::I1);
        program.add(Operation::Multiply(two, slope))
    } else {
        program.derivative(energy, Invariant::J)
    };
    let (mut about, split) = program.about_rest(&[slope]);
    let total = about.total(split[0]);
    (about, total)
}

/// Whether an energy of dilatation is a function of `I1`.
pub(crate) fn of_trace(dilatation: &Program) -> bool {
    dilatation.operations().contains(&Operation::Invariant(Invariant::I1))
}

/// `fn energy(i1, i2, j, row, pressure)`, `i1 = I1 - 3`, `i2 = I2 - 3`, `j = J - 1`.
fn energy_source(program: &Program, rows: &[Vec<f64>]) -> String {
    let Derivatives { program, outputs } = Derivatives::new(program, rows);
    let needed = program.needed(&outputs.map(|(_, value)| value));
    let mut text =
        String::from("fn energy(i1: f32, i2: f32, j: f32, row: u32, pressure: f32) -> Energy {\n");
    for (value, (&operation, _)) in
        program.operations().iter().zip(&needed).enumerate().filter(|(_, (_, needed))| **needed)
    {
        let _ = writeln!(text, "    let v{value} = {};", expression(operation));
    }
    text += "    var e: Energy;\n";
    for (name, value) in outputs {
        let _ = writeln!(text, "    e.{name} = v{value};");
    }
    text + "    return e;\n}\n"
}

/// An operation on numbers.
pub(crate) fn expression(operation: Operation) -> String {
    use Operation::*;
    match operation {
        Constant(c) => number(c),
        Parameter(k) => format!("parameters[row + {k}u]"),
        Pressure => "pressure".to_string(),
        Invariant(invariant) => ["i1", "i2", "j"][invariant as usize].to_string(),
        Add(a, b) => format!("v{a} + v{b}"),
        Subtract(a, b) => format!("v{a} - v{b}"),
        Multiply(a, b) => format!("v{a} * v{b}"),
        Negate(a) => format!("-v{a}"),
        Reciprocal(a) => format!("1.0 / v{a}"),
        Logarithm(a) => format!("log(v{a})"),
        Exponential(a) => format!("exp(v{a})"),
        Power(a, c) => format!("pow(v{a}, v{c})"),
        Step(a) => format!("select(0.0, 1.0, v{a} > 0.0)"),
        LogarithmOfOnePlus(a) => format!("logarithm_of_one_plus(v{a})"),
        ExponentialMinusOne(a) => format!("exponential_minus_one(v{a})"),
    }
}

/// A number as WGSL writes it: finite in single precision, with a decimal point.
pub(crate) fn number(c: f64) -> String {
    let c = (c as f32).clamp(f32::MIN, f32::MAX);
    if c < 0.0 { format!("({c:e}f)") } else { format!("{c:e}f") }
}
