//! A law as a program for another machine: operations that are the same for all cells, and a row of parameters for
//! each. The operations are those that the law does with the scalar that records, [`Symbol`]; nothing is written twice.
//!
//! A law is made from a row, so its parameters are numbers by the time that it is recorded. Every number is therefore
//! recorded as a parameter. Those that are the same in all rows become numbers again, and what they make foldable is
//! folded.

use super::StrainEnergy;
use super::expression::{Expression, Graph, Id, Node, PRESSURE, Symbol};
use super::material::Material;
use viscera_number::Scalar;

/// A law with one row of parameters, as it is recorded.
#[derive(Clone, Debug)]
pub enum Template {
    /// `psi(I1, I2, J)`, every number in it a parameter, and their values.
    Energy(Expression, Vec<f64>),
    /// Linear elasticity: mu, lam.
    Linear([f64; 2]),
    /// Corotated linear elasticity: mu, lam.
    Corotated([f64; 2]),
}

/// What a program computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// The energy of its nodes.
    Energy,
    /// Linear elasticity, without nodes; parameters mu, lam.
    Linear,
    /// Corotated linear elasticity, without nodes; parameters mu, lam.
    Corotated,
}

/// A law and its parameters.
#[derive(Clone, Debug)]
pub struct Program {
    /// What it computes.
    pub model: Model,
    /// Operations on earlier ones, the last of which is the energy.
    pub nodes: Vec<Node>,
    /// One row of parameters for all cells, or one for each.
    pub rows: Vec<Vec<f64>>,
}

impl Template {
    /// The recorded energy of a law, see [`Law::template`](super::Law::template).
    #[allow(non_snake_case)]
    pub(crate) fn of_energy<E: StrainEnergy>(law: &E, part: Option<f64>) -> Self {
        let (expression, values) = Symbol::record_apart(|[I1, I2, J, _, _], pressure| {
            let psi = law.psi(I1.clone(), I2, J.clone());
            let Some(part) = part else { return psi };
            let ratio = ratio::<E, _>(I1, J);
            psi - law.volumetric(ratio.clone()) * part + ratio * pressure
        });
        Template::Energy(expression, values)
    }

    /// The recorded energy of dilatation, see [`Law::dilatation_template`](super::Law::dilatation_template).
    #[allow(non_snake_case)]
    pub(crate) fn of_dilatation<E: StrainEnergy>(law: &E, part: f64) -> Self {
        let (expression, values) =
            Symbol::record_apart(|[I1, _, J, _, _], _| law.volumetric(ratio::<E, _>(I1, J)) * part);
        Template::Energy(expression, values)
    }
}

/// The volume ratio that a law resists.
#[allow(non_snake_case)]
fn ratio<E: StrainEnergy, S: Scalar>(I1: S, J: S) -> S {
    if E::VOLUME_IS_TRACE { (I1 - 1.0) * 0.5 } else { J }
}

impl Material {
    /// The law as a program. In cells that share their volume ratio, `parts` says by row which part of the energy of
    /// dilatation the cluster has instead, and [`PRESSURE`] is its pressure; it is empty for cells on their own.
    ///
    /// # Errors
    /// Why there is none, after "the law": fibres, for example.
    pub fn program(&self, parts: &[f64]) -> Result<Program, &'static str> {
        let cells = 0..self.parameters().len();
        let templates: Option<Vec<Template>> = cells
            .map(|cell| self.law().template(self.row(cell), parts.get(cell).copied()))
            .collect();
        let templates = templates.ok_or("has fibres")?;
        let of_moduli = |template: &Template| match template {
            Template::Linear(moduli) => Some((Model::Linear, moduli.to_vec())),
            Template::Corotated(moduli) => Some((Model::Corotated, moduli.to_vec())),
            Template::Energy(..) => None,
        };
        let moduli: Option<Vec<_>> = templates.iter().map(of_moduli).collect();
        let Some(moduli) = moduli else { return merged(templates) };
        let model = moduli[0].0;
        if moduli.iter().any(|(other, _)| *other != model) {
            return Err(SEVERAL_PROGRAMS);
        }
        let rows = moduli.into_iter().map(|(_, row)| row).collect();
        Ok(Program { model, nodes: Vec::new(), rows })
    }

    /// The energy of dilatation as a program, `s U(J)`, or a function of `I1` where the law resists `(I1 - 1) / 2`; `parts`
    /// by row as in [`Material::program`].
    ///
    /// # Errors
    /// Why there is none, after "the law".
    pub fn dilatation_program(&self, parts: &[f64]) -> Result<Program, &'static str> {
        let template = |(cell, &part)| self.law().dilatation_template(self.row(cell), part);
        let templates: Option<Vec<Template>> = parts.iter().enumerate().map(template).collect();
        merged(templates.ok_or("is no function of invariants")?)
    }
}

const SEVERAL_PROGRAMS: &str = "differs between cells in more than its parameters";

/// The program of energies that differ in their numbers alone.
fn merged(templates: Vec<Template>) -> Result<Program, &'static str> {
    let energies: Option<Vec<(Expression, Vec<f64>)>> = templates
        .into_iter()
        .map(|template| match template {
            Template::Energy(expression, values) => Some((expression, values)),
            _ => None,
        })
        .collect();
    let energies = energies.ok_or(SEVERAL_PROGRAMS)?;
    let (first, values) = &energies[0];
    if first.has_traces() {
        return Err("has powers of the principal stretches");
    }
    let is_same = |(other, values): &(Expression, Vec<f64>)| {
        other.energy == first.energy
            && values.len() == energies[0].1.len()
            && other.graph.nodes() == first.graph.nodes()
    };
    if !energies.iter().all(is_same) {
        return Err(SEVERAL_PROGRAMS);
    }
    let varying: Vec<usize> = (0..values.len())
        .filter(|&k| energies.iter().any(|(_, other)| other[k].to_bits() != values[k].to_bits()))
        .collect();
    let rows = energies.iter().map(|(_, row)| varying.iter().map(|&k| row[k]).collect()).collect();
    let mut graph = first.graph.clone();
    let energy = graph.substitute(first.energy, &|graph, leaf| match leaf {
        Node::Parameter(PRESSURE) => graph.parameter(PRESSURE),
        Node::Parameter(k) => match varying.binary_search(&(k as usize)) {
            Ok(place) => graph.parameter(place as u16),
            Err(_) => graph.number(values[k as usize]),
        },
        Node::Variable(variable) => graph.variable(variable),
        _ => unreachable!("recorded apart, numbers are parameters"),
    });
    Ok(Program { model: Model::Energy, nodes: listed(&graph, energy), rows })
}

/// The nodes that an energy is made of, numbered anew.
fn listed(graph: &Graph, energy: Id) -> Vec<Node> {
    let reached = graph.reached(&[energy]);
    let place = |id: Id| reached.partition_point(|&other| other < id) as Id;
    reached
        .iter()
        .map(|&id| match graph.node(id) {
            leaf @ (Node::Number(_) | Node::Parameter(_) | Node::Variable(_)) => leaf,
            Node::Add(a, b) => Node::Add(place(a), place(b)),
            Node::Sub(a, b) => Node::Sub(place(a), place(b)),
            Node::Mul(a, b) => Node::Mul(place(a), place(b)),
            Node::Neg(a) => Node::Neg(place(a)),
            Node::Recip(a) => Node::Recip(place(a)),
            Node::Ln(a) => Node::Ln(place(a)),
            Node::Exp(a) => Node::Exp(place(a)),
            Node::Sqrt(a) => Node::Sqrt(place(a)),
            Node::Power(a, s) => Node::Power(place(a), place(s)),
            Node::Step(a) => Node::Step(place(a)),
            Node::Wall(a) => Node::Wall(place(a)),
            Node::TraceOfPower(a, b, s) => Node::TraceOfPower(place(a), place(b), place(s)),
        })
        .collect()
}
