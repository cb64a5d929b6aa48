//! Programs of laws, evaluated operation by operation, against the laws.

use super::F0;
use viscera_law::expression::{Node, Variable};
use viscera_law::samples::{names, parameters};
use viscera_law::{Material, Model, PRESSURE, Program};
use viscera_number::tensor::{Mat3, cofactor, determinant, double_dot};
use viscera_number::{LANES, Lane, Lanes};

const PARTS: [f64; 3] = [0.3, 0.6, 0.8];
const OF_CLUSTER: f64 = 450.0;

/// The energy of a program at a deformation gradient.
fn energy(program: &Program, row: &[f64], F: &Mat3<f64>) -> f64 {
    let Z = cofactor(F);
    energy_of(program, row, [double_dot(F, F), double_dot(&Z, &Z), determinant(F, &Z)])
}

/// The energy of a program at `I1`, `I2`, `J`.
fn energy_of(program: &Program, row: &[f64], invariants: [f64; 3]) -> f64 {
    let mut values: Vec<f64> = Vec::new();
    for &node in &program.nodes {
        let at = |id: u32| values[id as usize];
        let value = match node {
            Node::Number(x) => x,
            Node::Parameter(PRESSURE) => OF_CLUSTER,
            Node::Parameter(k) => row[k as usize],
            Node::Variable(Variable::I1) => invariants[0],
            Node::Variable(Variable::I2) => invariants[1],
            Node::Variable(Variable::J) => invariants[2],
            Node::Add(a, b) => at(a) + at(b),
            Node::Sub(a, b) => at(a) - at(b),
            Node::Mul(a, b) => at(a) * at(b),
            Node::Neg(a) => -at(a),
            Node::Recip(a) => at(a).recip(),
            Node::Ln(a) => at(a).ln(),
            Node::Exp(a) => at(a).exp(),
            Node::Sqrt(a) => at(a).sqrt(),
            Node::Power(a, s) => at(a).powf(at(s)),
            Node::Step(a) => f64::from(u8::from(at(a) > 0.0)),
            Node::Variable(_) | Node::Wall(_) | Node::TraceOfPower(..) => panic!("{node:?}"),
        };
        values.push(value);
    }
    values[values.len() - 1]
}

/// The energy of the law, less that of a part of the dilatation, and the work of the cluster's pressure.
fn exact(law: &Material, cell: usize, F: &Mat3<f64>, part: Option<f64>) -> f64 {
    let row = law.row(cell);
    let F = [F.map(|row| row.map(|x| Lanes([x; LANES])))];
    let (mut psi, mut J, mut Z) = ([Lane::default()], [Lane::default()], [Mat3::<Lane>::default()]);
    law.law().energy(row, &F, part.unwrap_or(0.0), &mut psi);
    law.law().volume_ratio(row, &F, &mut J, &mut Z);
    psi[0][0] + part.map_or(0.0, |_| OF_CLUSTER * J[0][0])
}

#[test]
fn programs_are_the_laws() {
    let mut count = 0;
    for name in names() {
        let rows: Vec<Vec<f64>> = [1.0, 1.3, 0.7].map(|factor| parameters(name, factor)).to_vec();
        let law = Material::new(name, rows).unwrap();
        for parts in [&[][..], &PARTS] {
            let program = match law.program(parts) {
                Ok(program) if program.model == Model::Energy => program,
                Ok(program) => {
                    assert_eq!(program.rows.len(), 3);
                    continue;
                }
                Err(why) => {
                    let known = if name == "ogden" { "has powers of" } else { "has fibres" };
                    assert!(why.starts_with(known), "{name}: {why}");
                    continue;
                }
            };
            count += 1;
            // Moduli differ between the rows, and what is made from them; nothing else is a parameter.
            let n = program.rows[0].len();
            assert!(n > 0 && n <= 12, "{name}: {n} parameters");
            for cell in 0..3 {
                let exact = exact(&law, cell, &F0, parts.get(cell).copied());
                let found = energy(&program, &program.rows[cell], &F0);
                assert!(
                    (found - exact).abs() < 1e-11 * exact.abs().max(1e3),
                    "{name}: {found} {exact}"
                );
            }
            if !parts.is_empty() {
                holds_the_dilatation(&law, parts);
            }
            let same = Material::new(name, vec![parameters(name, 1.0); 3]).unwrap();
            assert!(same.program(&[]).unwrap().rows.iter().all(Vec::is_empty));
        }
    }
    assert_eq!(count, 20);
}

/// `s U` of the volume ratio that the law resists, as the law itself computes it.
fn holds_the_dilatation(law: &Material, parts: &[f64]) {
    let program = law.dilatation_program(parts).unwrap();
    let is_trace = program.nodes.contains(&Node::Variable(Variable::I1));
    for (cell, part) in parts.iter().enumerate() {
        for ratio in [0.8, 1.0, 1.3] {
            let mut exact = [Lane::default()];
            law.law().dilatation(law.row(cell), &[Lanes([ratio; LANES])], &mut exact);
            // What the program does not read must not matter.
            let invariants =
                if is_trace { [2.0 * ratio + 1.0, f64::NAN] } else { [f64::NAN, ratio] };
            let [i1, j] = invariants;
            let found = energy_of(&program, &program.rows[cell], [i1, f64::NAN, j]);
            let exact = part * exact[0][0];
            assert!((found - exact).abs() < 1e-12 * exact.abs().max(1e3), "{found} {exact}");
        }
    }
}

#[test]
fn laws_of_several_kinds_are_no_program() {
    let law = Material::new(
        "laws linear; yeoh",
        vec![vec![0.0, 1e3, 1e4, 0.0, 0.0], vec![1.0, 1e3, 0.0, 0.0, 1e4]],
    );
    assert!(law.unwrap().program(&[]).unwrap_err().contains("differs between cells"));
    let two = vec![vec![0.0, 1e3, 1e4], vec![1.0, 1e3, 1e4]];
    let law = Material::new("laws neo_hookean; stable_neo_hookean", two).unwrap();
    assert!(law.program(&[]).unwrap_err().contains("differs between cells"));
}

/// A formula's operations are its own, its parameters those of its rows.
#[test]
fn formulas_are_programs() {
    let text = "formula mu/2*(I1bar - 3) + kappa/2*log(J)**2 + mu*max(J - 1, 0)**3";
    let law = Material::new(text, vec![vec![1e3, 2e4], vec![1.5e3, 2e4], vec![1e3, 3e4]]).unwrap();
    let program = law.program(&[]).unwrap();
    for cell in 0..3 {
        let (found, exact) =
            (energy(&program, &program.rows[cell], &F0), exact(&law, cell, &F0, None));
        assert!((found - exact).abs() < 1e-11 * exact, "{found} {exact}");
    }
    let fibres = Material::new(
        "formula mu/2*(I1bar - 3) + kappa/2*(J - 1)**2 + k*(I4 - 1)**2",
        vec![vec![1e3, 1e4, 1e2, 1.0, 0.0, 0.0]],
    );
    assert_eq!(fibres.unwrap().program(&[]).unwrap_err(), "has fibres");
}
