//! A law of one's own: a strain energy given as a formula.

use super::StrainEnergy;
use super::expression::{Constants, Expression, Graph, Id, Tape, Variable};
use super::fibres::{FIRST, FibreEnergy, Fibres, SECOND};
use super::kernels::{Family, LawKernels};
use crate::error::Error;
use std::sync::Arc;
use viscera_number::{Gradient, Hessian, Scalar};

/// Prefix of the formula in the name of a material.
pub const FORMULA: &str = "formula ";

/// The tapes of an energy.
struct Tapes {
    graph: Graph,
    constants: Constants,
    energy: Tape,
    /// With derivatives; none if they are not among the operations.
    first: Option<Tape>,
    second: Option<Tape>,
    /// `U(J), U'(J), U''(J)` of a dilatation.
    volumetric: Option<Tape>,
}

impl Tapes {
    fn new(expression: &Expression, variables: &[Variable]) -> Result<Self, Error> {
        let Expression { mut graph, energy: psi, parameters } = expression.clone();
        let mut constants = Constants::default();
        let energy = Tape::new(&graph, &[psi], &mut constants)?;
        if expression.has_traces() {
            return Ok(Tapes {
                graph,
                constants,
                energy,
                first: None,
                second: None,
                volumetric: None,
            });
        }
        let slopes: Vec<Id> = variables.iter().map(|&v| graph.derivative(psi, v)).collect();
        let mut all: Vec<Id> = std::iter::once(psi).chain(slopes.iter().copied()).collect();
        let first = Tape::new(&graph, &all, &mut constants)?;
        for (k, &slope) in slopes.iter().enumerate() {
            for &v in &variables[k..] {
                all.push(graph.derivative(slope, v));
            }
        }
        let second = Tape::new(&graph, &all, &mut constants)?;
        let mut dilatation = Expression { graph, energy: psi, parameters };
        let u = dilatation.dilatation();
        let mut graph = dilatation.graph;
        let slope = graph.derivative(u, Variable::J);
        let curvature = graph.derivative(slope, Variable::J);
        let volumetric = Tape::new(&graph, &[u, slope, curvature], &mut constants)?;
        let (first, second, volumetric) = (Some(first), Some(second), Some(volumetric));
        Ok(Tapes { graph, constants, energy, first, second, volumetric })
    }
}

/// The exponent of `J` in the squared stretch of every direction of a dilatation.
const LIKE_ALL: f64 = 2.0 / 3.0;

/// Largest exponent of `J` along a family of fibres.
const LARGEST_EXPONENT: f64 = 2.0;

/// The determinant of `psi_44, psi_46, psi_66` over `psi_44 psi_66`, up to which the energy feels both families as one.
const ONE_FAMILY: f64 = 1e-12;

/// A strain energy as an expression in the invariants, parsed from a text or recorded from a law.
pub struct Formula {
    names: Vec<String>,
    tapes: Tapes,
    /// Families of fibres.
    families: usize,
}

/// Components of the directions of fibres, the last columns of a row.
pub(super) const COMPONENTS: [&str; 6] = ["a0x", "a0y", "a0z", "a1x", "a1y", "a1z"];

impl Formula {
    /// The law of a text, see [`Expression::parse`]. Its energy counts from rest, whatever the text gives there, and ends
    /// where a denominator vanishes.
    ///
    /// # Errors
    /// A text that is no formula, has no parameter or no invariant.
    pub fn new(text: &str) -> Result<Self, Error> {
        let mut expression = Expression::parse(text)?;
        if expression.parameters.is_empty() {
            return Err(Error::input(
                "the formula has no parameter: name a modulus at least, as in mu/2*(I1bar - 3) + kappa/2*(J - 1)**2",
            ));
        }
        if let Some(name) = expression.parameters.iter().find(|p| COMPONENTS.contains(&p.as_str()))
        {
            return Err(Error::input(format!(
                "the formula has a parameter {name}, which names a component of the fibres: call it otherwise"
            )));
        }
        if !expression.graph.varies(expression.energy) {
            return Err(Error::input(
                "the formula depends on no deformation: use I1, I2, J, I1bar, I2bar, I4 or I6",
            ));
        }
        expression.count_from_rest();
        expression.end_at_poles();
        Self::of_expression(&expression)
    }

    /// The law of an expression.
    ///
    /// # Errors
    /// An expression too long for its tapes.
    pub fn of_expression(expression: &Expression) -> Result<Self, Error> {
        let families = if expression.uses(Variable::I6) {
            2
        } else {
            usize::from(expression.uses(Variable::I4))
        };
        let variables = if families > 0 { &Variable::ALL[..] } else { &Variable::ALL[..3] };
        let mut names = expression.parameters.clone();
        names.extend(COMPONENTS[..3 * families].iter().map(|name| name.to_string()));
        Ok(Formula { names, tapes: Tapes::new(expression, variables)?, families })
    }

    /// Names of its parameters: those of the text as they appear, then the components of the directions of fibres.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Its kernels.
    pub fn kernels(self) -> Arc<dyn LawKernels> {
        if self.families > 0 { Arc::new(OfFibres(self)) } else { Arc::new(Isotropic(self)) }
    }

    /// The values of the tapes' constants, and six components of directions.
    fn prepare(&self, row: &[f64]) -> Vec<f64> {
        let (parameters, fibres) = row.split_at(row.len() - 3 * self.families);
        let Tapes { constants, graph, .. } = &self.tapes;
        let with =
            |exponents: [f64; 2]| constants.values(graph, &[parameters, &exponents].concat());
        let mut values = with([LIKE_ALL; 2]);
        if self.families > 0 {
            values = with(self.exponents(&values));
        }
        values.extend(fibres.iter().copied().chain(std::iter::repeat(0.0)).take(6));
        values
    }

    /// Exponents `e` of `I4 = J^e` and `I6 = J^f` with which fibres add least to the energy of a dilatation: zero where the
    /// energy has `I4`, 2/3 where it has `I4 J^(-2/3)`. So `U(J)` is that of the matrix, and what a cluster shares leaves
    /// each cell its fibres whole.
    #[allow(non_snake_case)]
    fn exponents(&self, constants: &[f64]) -> [f64; 2] {
        let Some(tape) = &self.tapes.second else { return [LIKE_ALL; 2] };
        let at_rest = Variable::ALL.map(Variable::at_rest);
        let all: [f64; SECOND] = tape.evaluate(constants, at_rest);
        // Rows of the upper triangle: 11 12 1J 14 16, 22 2J 24 26, JJ J4 J6, 44 46, 66.
        let [p14, p16, p24, p26, pJ4, pJ6, p44, p46, p66] =
            [9, 10, 13, 14, 16, 17, 18, 19, 20].map(|k| all[k]);
        // Slopes of psi_4 and psi_6 in ln J, with dI1 = 2 d(ln J), dI2 = 4 d(ln J).
        let slopes = [2.0 * p14 + 4.0 * p24 + pJ4, 2.0 * p16 + 4.0 * p26 + pJ6];
        let determinant = p44 * p66 - p46 * p46;
        let both = p44 + 2.0 * p46 + p66;
        let found = if !(p44 >= 0.0 && p66 >= 0.0 && determinant >= -ONE_FAMILY * p44 * p66) {
            [LIKE_ALL; 2] // where fibres soften there is no least energy
        } else if determinant > ONE_FAMILY * p44 * p66 {
            [p46 * slopes[1] - p66 * slopes[0], p46 * slopes[0] - p44 * slopes[1]]
                .map(|numerator| numerator / determinant)
        } else if p46 == 0.0 {
            // One family, or none, is felt at rest.
            [(slopes[0], p44), (slopes[1], p66)]
                .map(|(slope, own)| if own > 0.0 { -slope / own } else { LIKE_ALL })
        } else {
            [-(slopes[0] + slopes[1]) / both; 2]
        };
        found.map(|exponent| {
            let known = [0.0, LIKE_ALL].into_iter().find(|e| (exponent - e).abs() < 1e-9);
            known.unwrap_or(exponent.clamp(-LARGEST_EXPONENT, LARGEST_EXPONENT))
        })
    }

    fn bind<'a>(&'a self, row: &'a [f64]) -> Bound<'a> {
        Bound { tapes: &self.tapes, constants: row }
    }
}

/// Formulas of isotropic laws.
struct Isotropic(Formula);

impl Family for Isotropic {
    type Law<'a> = Bound<'a>;

    fn prepare(&self, row: &[f64]) -> Vec<f64> {
        self.0.prepare(row)
    }

    #[inline(always)]
    fn law<'a>(&'a self, row: &'a [f64]) -> Bound<'a> {
        self.0.bind(row)
    }
}

/// Formulas with fibres.
struct OfFibres(Formula);

impl Family for OfFibres {
    type Law<'a> = Fibres<Bound<'a>>;

    fn prepare(&self, row: &[f64]) -> Vec<f64> {
        self.0.prepare(row)
    }

    #[inline(always)]
    fn law<'a>(&'a self, row: &'a [f64]) -> Fibres<Bound<'a>> {
        Fibres(self.0.bind(row))
    }
}

/// A formula with its constants.
#[derive(Clone, Copy)]
struct Bound<'a> {
    tapes: &'a Tapes,
    constants: &'a [f64],
}

#[inline(always)]
#[allow(non_snake_case)]
fn isotropic<S: Scalar>([I1, I2, J]: [S; 3]) -> [S; 5] {
    let zero = J.constant(0.0);
    [I1, I2, J, zero.clone(), zero]
}

impl Bound<'_> {
    #[inline(always)]
    fn run<S: Scalar, const N: usize>(&self, tape: &Tape, x: [S; 5]) -> [S; N] {
        tape.evaluate(self.constants, x)
    }

    /// The tape of `U(J), U'(J), U''(J)` there, which expressions with the trace of a power do not have.
    #[inline(always)]
    fn dilatation<S: Scalar>(&self, j: &S) -> Option<[S; 3]> {
        let zero = || j.constant(0.0);
        let x = || [zero(), zero(), j.clone(), zero(), zero()];
        self.tapes.volumetric.as_ref().map(|tape| self.run(tape, x()))
    }
}

/// Not inlined, like those below: only expressions with the trace of a power need it, and its code is long.
#[inline(never)]
fn dual_dilatation<S: Scalar>(law: &Bound<'_>, j: &S) -> [S; 3] {
    let [j, _, _] = Hessian::variables([j.clone(), j.constant(0.0), j.constant(0.0)]);
    let (c2, zero) = (j.cbrt().square(), j.constant(0.0));
    let x = [c2.clone() * 3.0, c2.square() * 3.0, j, zero.clone(), zero];
    let [u] = law.run(&law.tapes.energy, x);
    [u.value.clone(), u.first[0].clone(), u.second(0, 0)]
}

/// `U'(J)` alone, also as a series: without second derivatives a quarter of the code.
#[inline(never)]
fn dual_slope<S: Scalar>(law: &Bound<'_>, j: &S) -> S {
    let [j, _, _] = Gradient::variables([j.clone(), j.constant(0.0), j.constant(0.0)]);
    let c2 = j.cbrt().square();
    let [slope, _, _] = StrainEnergy::psi(law, c2.clone() * 3.0, c2.square() * 3.0, j).first;
    slope
}

#[inline(never)]
fn dual_gradient<S: Scalar>(law: &Bound<'_>, x: [S; 3]) -> Gradient<S> {
    let [psi] = law.run(&law.tapes.energy, isotropic(Gradient::variables(x)));
    psi
}

#[inline(never)]
fn dual_hessian<S: Scalar>(law: &Bound<'_>, x: [S; 3]) -> Hessian<S> {
    let [psi] = law.run(&law.tapes.energy, isotropic(Hessian::variables(x)));
    psi
}

#[allow(non_snake_case)]
impl StrainEnergy for Bound<'_> {
    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, I2: S, J: S) -> S {
        let [psi] = self.run(&self.tapes.energy, isotropic([I1, I2, J]));
        psi
    }

    #[inline(always)]
    fn gradient<S: Scalar>(&self, x: [S; 3]) -> Gradient<S> {
        match &self.tapes.first {
            Some(tape) => {
                let [value, p1, p2, pJ] = self.run(tape, isotropic(x));
                Gradient { value, first: [p1, p2, pJ] }
            }
            None => dual_gradient(self, x),
        }
    }

    #[inline(always)]
    fn hessian<S: Scalar>(&self, x: [S; 3]) -> Hessian<S> {
        match &self.tapes.second {
            Some(tape) => {
                let [value, p1, p2, pJ, a, b, c, d, e, f] = self.run(tape, isotropic(x));
                Hessian { value, first: [p1, p2, pJ], second: [a, b, c, d, e, f] }
            }
            None => dual_hessian(self, x),
        }
    }

    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        let [U, _, _] = self.dilatation(&J).unwrap_or_else(|| dual_dilatation(self, &J));
        U
    }

    #[inline(always)]
    fn volumetric_slopes<S: Scalar>(&self, J: &S) -> [S; 2] {
        let [_, slope, curvature] = self.dilatation(J).unwrap_or_else(|| dual_dilatation(self, J));
        [slope, curvature]
    }

    #[inline(always)]
    fn volumetric_slope<S: Scalar>(&self, J: &S) -> S {
        match self.dilatation(J) {
            Some([_, slope, _]) => slope,
            None => dual_slope(self, J),
        }
    }
}

#[allow(non_snake_case)]
impl<'a> FibreEnergy for Bound<'a> {
    type Isotropic = Bound<'a>;

    #[inline(always)]
    fn fibres(&self) -> [[f64; 3]; 2] {
        let at = |k: usize| self.constants[self.constants.len() - 6 + k];
        [[at(0), at(1), at(2)], [at(3), at(4), at(5)]]
    }

    #[inline(always)]
    fn psi<S: Scalar>(&self, x: [S; 5]) -> S {
        let [psi] = self.run(&self.tapes.energy, x);
        psi
    }

    #[inline(always)]
    fn first<S: Scalar>(&self, x: [S; 5]) -> [S; FIRST] {
        self.run(self.tapes.first.as_ref().expect("no formula has traces"), x)
    }

    #[inline(always)]
    fn second<S: Scalar>(&self, x: [S; 5]) -> [S; SECOND] {
        self.run(self.tapes.second.as_ref().expect("no formula has traces"), x)
    }

    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: &S) -> [S; 3] {
        self.dilatation(J).expect("no formula has traces")
    }
}
