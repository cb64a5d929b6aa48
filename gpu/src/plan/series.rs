//! The same estimate for the right-hand sides of the off-line stage. Operations are counted in the source of the kernels
//! that a law gets.

use super::{Sheet, Work};
use crate::series::{SERIES_LANES, source_of_stresses};
use crate::{Error, Solid};
use std::collections::HashMap;

/// What the processor sends in one call [bytes]: as in `crates/series/src/touch/on_device.rs`.
const MOST_SENT: usize = 32 << 20;

/// The work of a degree of the series of [`SERIES_LANES`] load positions, for cells that do not share their volume ratio.
#[derive(Clone, Debug)]
pub struct SeriesPlan {
    /// Degree p of the coefficients of the force.
    pub degree: usize,
    /// Directions along which the series are expanded: as many as there are monomials of degree p in three variables.
    pub directions: usize,
    /// The force of every cell, and the sums at the nodes, along one direction.
    pub passes: [Work; 2],
    /// Bytes between processor and device, along one direction.
    pub transferred: f64,
    /// Dispatches, along all directions.
    pub dispatches: usize,
}

impl SeriesPlan {
    /// The estimate for a degree.
    ///
    /// # Errors
    /// [`Error::Input`] for a law without an energy.
    pub fn new(solid: &Solid<'_>, degree: usize) -> Result<Self, Error> {
        let (n, m) = (solid.points.len() as f64, solid.cells.len() as f64);
        let directions = (degree + 1) * (degree + 2) / 2;
        let lanes = SERIES_LANES as f64;
        let source = source_of_stresses(solid.law, solid.parameters, degree + 1)?;
        let parameters =
            if solid.parameters.len() == 1 { 0 } else { 4 * solid.law.n_parameters() } as f64;
        let given = 12.0 * lanes * (degree - 1) as f64 * n;
        let (force, response) = (12.0 * lanes * n, 48.0 * lanes * m);
        let at_once = (MOST_SENT / given as usize).clamp(1, directions);
        let work =
            |kernel, bytes, operations: f64| Work { kernel, bytes, operations, dispatches: 1 };
        Ok(SeriesPlan {
            degree,
            directions,
            passes: [
                work(
                    "expand_stresses",
                    given + 12.0 * n + (16.0 + 40.0 + parameters) * m + response,
                    lanes * m * of_stresses(&source, degree + 1) as f64,
                ),
                work("gather_series", response + 16.0 * m + 4.0 * n + force, 12.0 * lanes * m),
            ],
            transferred: given + force,
            dispatches: 2 * directions.div_ceil(at_once),
        })
    }

    /// Lower bound of the time that all directions take on the device [s]: roofline plus dispatches.
    pub fn time(&self, sheet: &Sheet) -> f64 {
        let of_direction: f64 = self.passes.iter().map(|work| sheet.roofline(work)).sum();
        self.directions as f64 * of_direction + self.dispatches as f64 * sheet.per_dispatch
    }
}

/// Operations of `expand_stresses` for a cell, with `n` coefficients.
fn of_stresses(source: &str, n: usize) -> usize {
    let counted = Counted::new(source);
    let of = |names: &[&str]| names.iter().map(|name| counted.of(name)).sum::<usize>();
    // Nine entries of the gradient from three differences; the stress from the highest products; forces on corners.
    let own = 54 * (n - 1) + 95;
    let always = of(&["motion_of", "cofactor_about_rest", "i1_of", "j_of", "slopes"]);
    let second = if source.contains("const USES_I2 = true;") {
        of(&["squares", "y_about_rest", "highest_products"]) + 3 * n + 18
    } else {
        0
    };
    own + always + 2 * counted.of("highest_products") + second
}

/// The operations in the functions of a WGSL source.
struct Counted<'a> {
    bodies: HashMap<&'a str, String>,
}

impl<'a> Counted<'a> {
    fn new(source: &'a str) -> Self {
        let functions = source.split("\nfn ").skip(1);
        let body = |text: &'a str| {
            let (name, rest) = text.split_once('(').unwrap_or((text, ""));
            let end = rest.find("\n}").map_or(rest.len(), |end| end.min(one_line(rest)));
            let lines = rest[..end].lines().filter(|line| !line.trim_start().starts_with("//"));
            (name, lines.skip_while(|line| !line.contains('{')).collect::<Vec<_>>().join("\n"))
        };
        Counted { bodies: functions.map(body).collect() }
    }

    /// Operators of a function and of all that it calls; an elementary function of WGSL counts as one. The gradient of a
    /// cell, which works on vectors, is left out.
    fn of(&self, name: &str) -> usize {
        match (name, self.bodies.get(name)) {
            ("log" | "exp" | "pow" | "select", None) => 1,
            ("gradients", _) | (_, None) => 0,
            (_, Some(body)) => {
                let operators = [" + ", " - ", " * ", " / "];
                let own: usize = operators.iter().map(|o| body.matches(o).count()).sum();
                own + calls(body).map(|called| self.of(called)).sum::<usize>()
            }
        }
    }
}

/// Where a function ends that stands in one line.
fn one_line(rest: &str) -> usize {
    let line = rest.find('\n').unwrap_or(rest.len());
    if rest[..line].ends_with('}') { line } else { rest.len() }
}

/// Names that a text calls.
fn calls(body: &str) -> impl Iterator<Item = &str> {
    body.match_indices('(').map(|(at, _)| {
        let is_name = |c: char| c.is_alphanumeric() || c == '_';
        let start = body[..at].rfind(|c: char| !is_name(c)).map_or(0, |space| space + 1);
        &body[start..at]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Invariant, Law, Operation, Program};

    fn law(operations: &[Operation]) -> Law {
        let mut program = Program::new();
        operations.iter().for_each(|&operation| {
            program.add(operation);
        });
        Law::Energy(program)
    }

    /// `psi = I1 I2 + J^2`.
    fn of_both() -> Law {
        use Operation::{Add, Multiply};
        let [i1, i2, j] = Invariant::ALL.map(Operation::Invariant);
        law(&[i1, i2, j, Multiply(0, 1), Multiply(2, 2), Add(3, 4)])
    }

    /// By hand: a product of series with n coefficients has n^2 operations, a sum n.
    #[test]
    fn operations_are_those_of_the_source() {
        for n in 3..6 {
            let source = source_of_stresses(&of_both(), &[vec![]], n).unwrap();
            let counted = Counted::new(&source);
            let (product, sum) = (n * n, n);
            assert_eq!(counted.of("multiply"), product);
            assert_eq!(counted.of("minor"), 2 * product + sum);
            assert_eq!(counted.of("highest"), 2 * n - 1);
            assert_eq!(counted.of("motion_of"), 9 * (2 * product + sum) + 2 * sum);
            assert_eq!(counted.of("i1_of"), 9 * product + 10 * sum);
            assert_eq!(counted.of("j_of"), 3 * product + 6 * sum);
            assert_eq!(counted.of("cofactor_about_rest"), 12 * sum);
            assert_eq!(counted.of("y_about_rest"), 54 * product + 81 * sum);
        }
    }

    #[test]
    fn a_law_of_the_second_invariant_takes_more() {
        let of = |law: &Law| of_stresses(&source_of_stresses(law, &[vec![]], 5).unwrap(), 5);
        let of_first = law(&[Operation::Invariant(Invariant::I1)]);
        assert!(of(&of_both()) > of(&of_first) + 54 * 25);
        assert!(source_of_stresses(&Law::Corotated, &[vec![]], 5).is_err());
    }
}
