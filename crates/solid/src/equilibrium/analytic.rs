//! Formulas without a power series about rest.
//!
//! `x^s` has one where `x` vanishes for whole exponents `s` alone: `(I1bar - 3)**2.5` has second derivatives at rest, so it is
//! a law to solve with, but no series of its stress goes beyond them.

use crate::body::Body;
use crate::error::Error;
use crate::law::FORMULA;
use crate::law::expression::{Constants, Expression, Graph, Id, Node, Tape, Variable};
use std::collections::HashSet;

/// A base is zero at rest up to rounding: invariants are of the size of one there.
const ZERO: f64 = 1e-13;

/// Refuses a body of which a law has no power series about rest.
///
/// # Errors
/// A formula with a power whose base vanishes at rest and whose exponent is not whole.
pub fn require_series_about_rest(body: &Body) -> Result<(), Error> {
    let material = body.material();
    let mut known = HashSet::new();
    for cell in 0..material.parameters().len() {
        let (name, row) = (material.name_of_cell(cell), material.row(cell));
        let Some(formula) = name.strip_prefix(FORMULA) else { continue };
        if !known.insert(row.iter().map(|x| x.to_bits()).collect::<Vec<_>>()) {
            continue;
        }
        let Some(energy) = material.law().expression(row) else { continue };
        if let Some(exponent) = broken_power_of_zero(&energy)? {
            return Err(Error::input(format!(
                "the formula {formula} has no power series about rest: what it raises to the power {exponent} is zero \
                 there, and only whole powers of zero have one; give a whole exponent, such as {}, or use solve",
                exponent.ceil().max(2.0)
            )));
        }
    }
    Ok(())
}

/// The exponent of a power that is not whole, of a base that is zero at rest.
fn broken_power_of_zero(energy: &Expression) -> Result<Option<f64>, Error> {
    let graph = &energy.graph;
    for id in graph.reached(&[energy.energy]) {
        let (base, exponent) = match graph.node(id) {
            Node::Sqrt(base) => (base, 0.5),
            Node::Power(base, s) => (base, value_at_rest(graph, s)?),
            _ => continue,
        };
        if exponent.fract() != 0.0 && value_at_rest(graph, base)?.abs() <= ZERO {
            return Ok(Some(exponent));
        }
    }
    Ok(None)
}

/// The value of a node at rest, of a graph whose parameters have become numbers.
fn value_at_rest(graph: &Graph, node: Id) -> Result<f64, Error> {
    let mut constants = Constants::default();
    let tape = Tape::new(graph, &[node], &mut constants)?;
    let [value] =
        tape.evaluate(&constants.values(graph, &[]), Variable::ALL.map(Variable::at_rest));
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Material;
    use crate::mesh::samples::block;

    const MATRIX: &str = "mu/2*(I1bar - 3) + kappa/2*log(J)**2";

    fn checked(term: &str, exponents: &[f64]) -> Result<(), Error> {
        let (points, cells) = block([1, 1, 1], [1.0; 3]);
        let row = |n: f64| vec![1e3, 1e4, 2e3, n];
        let rows = (0..cells.len()).map(|cell| row(exponents[cell % exponents.len()]));
        let law = Material::new(&format!("formula {MATRIX} + c*{term}"), rows.collect()).unwrap();
        require_series_about_rest(&Body::new(points, cells, law).unwrap())
    }

    #[test]
    fn a_power_of_zero_that_is_not_whole_is_refused_with_its_formula_and_exponent() {
        for (term, n, exponent) in [
            ("max(I1bar - 3, 0)**n", 2.5, "2.5"),
            ("((J - 1)**2)**n", 2.25, "2.25"),
            ("max(-log(J), 0)**(n + 1)", 2.5, "3.5"),
        ] {
            let told = checked(term, &[3.0, n]).unwrap_err().to_string();
            let words = format!("the formula {MATRIX} + c*{term} has no power series about rest");
            assert!(told.starts_with(&words), "{told}");
            assert!(
                told.contains(&format!("raises to the power {exponent} is zero there")),
                "{told}"
            );
        }
    }

    #[test]
    fn other_powers_are_not() {
        for (term, n) in [
            ("(I1bar - 3)**n", 2.0),
            ("(I1bar - 3)**n", 18.0),
            ("(I1bar/3)**n*log(J)**2", 2.5),
            ("sqrt((I1bar - 3)**n + 0.01)", 2.0),
        ] {
            checked(term, &[n]).unwrap();
        }
    }
}
