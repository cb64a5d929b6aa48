//! Formulas against the laws of the core, and the checks when they are made.

use std::sync::Arc;
use viscera_law::samples::{names, parameters};
use viscera_law::{
    Formula, LawKernels, Material, Shared, SharedSeries, TaylorCache, resists_collapse,
};
use viscera_number::tensor::{Mat3, Vec3};
use viscera_number::unroll::tabulate;
use viscera_number::{LANES, Lane, Lanes, Monomials, Real, Wide};

use super::{F0, VECTORS};

/// All that a law says at `F0`, at twice its displacement and along a path from there.
fn answers(law: &dyn LawKernels, row: &[f64]) -> Vec<(&'static str, Vec<f64>)> {
    let row = law.prepare(row);
    let lane = |lane: usize, i: usize, j: usize| {
        let rest = f64::from(u8::from(i == j));
        rest + [1.0, 0.3, -0.5, 0.1][lane] * (F0[i][j] - rest)
    };
    let F = [tabulate!(|i, j| Lanes(std::array::from_fn(|l| lane(l, i, j))))];
    let g: [[Vec3<Lane>; 3]; 1] = [VECTORS.map(|v| v.map(|x| Lanes([x; LANES])))];
    let pressure = [Lanes([0.7e3, -0.2e3, 0.4e3, 0.0])];
    let shared = Shared { part: 0.6, pressure: &pressure };
    let mut out = Vec::new();
    let flat = |P: &Mat3<Lane>| P.as_flattened().iter().flat_map(|x| x.0).collect::<Vec<f64>>();
    for (words, shared) in [("alone", Shared::default()), ("in a cluster", shared)] {
        let (mut psi, mut P) = ([Lane::default()], [Mat3::<Lane>::default()]);
        law.stress(&row, &F, shared, &mut psi, &mut P);
        out.push((words, psi[0].0.to_vec()));
        out.push((words, flat(&P[0])));
        let mut A = [[[Mat3::<Lane>::default(); 3]; 3]];
        law.tangent(&row, &F, &g, shared, &mut P, &mut A);
        out.push((words, flat(&P[0])));
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        out.push((words, pairs.iter().flat_map(|&(a, b)| flat(&A[0][a][b])).collect()));
    }
    let ratio = Lanes([0.8, 1.0, 1.2, 1.1]);
    let (mut U, mut slopes) = ([Lane::default()], [[Lane::default(); 2]]);
    law.dilatation(&row, &[ratio], &mut U);
    law.pressure(&row, &[ratio], &mut slopes);
    out.push(("dilatation", [U[0], slopes[0][0], slopes[0][1]].map(|x| x.0).concat()));

    let table = Monomials::of(1, 5);
    let n = table.len();
    let path: Vec<Wide> = (0..9 * n)
        .map(|k| match k % n {
            0 => F0[k / n / 3][k / n % 3],
            5 => 0.0, // what is sought
            _ => 0.1 * (k as f64).sin(),
        })
        .map(Wide::splat)
        .collect();
    let mut series = vec![Wide::default(); 9];
    law.stress_series(
        &row,
        &mut TaylorCache::default(),
        table,
        &path,
        SharedSeries::default(),
        &mut series,
    );
    out.push(("series", series.iter().map(|x| x[0]).collect()));
    let ratio = |c: usize| Wide::splat(if c == 0 { 1.1 } else { 0.1 / c as f64 });
    let ratio: Vec<Wide> = (0..n).map(ratio).collect();
    let mut series = vec![Wide::default(); n];
    law.pressure_series(&row, &mut TaylorCache::default(), table, &ratio, &mut series);
    out.push(("pressure series", series.iter().map(|x| x[0]).collect()));
    out
}

fn compare(name: &str, found: &[(&str, Vec<f64>)], exact: &[(&str, Vec<f64>)]) {
    for ((what, found), (_, exact)) in found.iter().zip(exact) {
        let scale = exact.iter().fold(1.0f64, |max, x| max.max(x.abs()));
        for (f, e) in found.iter().zip(exact) {
            assert!((f - e).abs() < 1e-11 * scale, "{name}, {what}: {f} instead of {e}");
        }
    }
}

#[test]
fn formulas_are_the_laws_they_write_out() {
    for (law, text, order) in [
        ("neo_hookean", "mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", &[0, 1][..]),
        ("saint_venant_kirchhoff", "mu/4*(I1**2 - 2*I1 - 2*I2 + 3) + lam/8*(I1 - 3)**2", &[0, 1]),
        (
            "mooney_rivlin J^2-1",
            "c1*(I1bar - 3) + c2*(I2bar - 3) + kappa/8*(J**2 - 1)**2",
            &[0, 1, 2],
        ),
        (
            "yeoh",
            "c1*(I1bar - 3) + c2*(I1bar - 3)**2 + c3*(I1bar - 3)**3 + kappa/2*(J - 1)**2",
            &[0, 1, 2, 3],
        ),
        (
            "holzapfel_gasser_ogden both ways",
            "c/2*(I1bar - 3) + kappa/2*(J - 1)**2
             + k1/(2*k2)*(exp(k2*(d*(I1bar - 3) + (1 - 3*d)*(I4*J**(-2/3) - 1))**2) - 1)
             + k1/(2*k2)*(exp(k2*(d*(I1bar - 3) + (1 - 3*d)*(I6*J**(-2/3) - 1))**2) - 1)",
            &[0, 4, 1, 2, 3, 5, 6, 7, 8, 9, 10],
        ),
    ] {
        let row = parameters(law, 1.0);
        let built_in = Material::new(law, vec![row.clone()]).unwrap();
        let own: Vec<f64> = order.iter().map(|&k| row[k]).collect();
        let formula = Material::new(&format!("formula {text}"), vec![own.clone()]).unwrap();
        let mut exact = answers(built_in.law(), &row);
        let mut found = answers(formula.law(), &own);
        if law == "saint_venant_kirchhoff" {
            // It averages the trace of the strain in the place of J, as no formula does.
            exact.retain(|(what, _)| ["alone", "series"].contains(what));
            found.retain(|(what, _)| ["alone", "series"].contains(what));
        }
        compare(law, &found, &exact);
        for (found, exact) in formula.moduli(&own).into_iter().zip(built_in.moduli(&row)) {
            assert!((found - exact).abs() < 1e-12 * exact, "{law}: {found} {exact}");
        }
    }
}

/// Every law of invariants, recorded and evaluated, is the law.
#[test]
fn recorded_laws_are_the_laws() {
    let mut count = 0;
    for name in names() {
        let row = parameters(name, 1.0);
        let law = Material::new(name, vec![row.clone()]).unwrap();
        let Some(expression) = law.law().expression(&law.law().prepare(&row)) else {
            assert!(["linear", "corotated"].contains(&name), "{name} has no expression");
            continue;
        };
        count += 1;
        let recorded = Formula::of_expression(&expression).unwrap();
        let fibres = recorded.names().len();
        let kernels: Arc<dyn LawKernels> = recorded.kernels();
        let mut exact = answers(law.law(), &row);
        let mut found = answers(&*kernels, &row[row.len() - fibres..]);
        if name == "saint_venant_kirchhoff" {
            exact.retain(|(what, _)| ["alone", "series"].contains(what));
            found.retain(|(what, _)| ["alone", "series"].contains(what));
        }
        compare(name, &found, &exact);
    }
    assert_eq!(count, names().count() - 2);
}

#[test]
fn formulas_are_checked() {
    for (text, row, word) in [
        ("mu/2*(I1 - 3)", vec![1e3], "at rest"),
        ("mu*(I1bar - 3) + k/2*(J - 1)**2", vec![-1e3, 1e4], "shear modulus -2000.0"),
        ("mu*(I1bar - 3)", vec![1e3], "both must be positive"),
        ("mu/2*(I1 - 3) - mu*log(J) + lam*log(J - 1)", vec![1e3, 1e3], "no moduli at rest"),
        (
            "mu*(I1bar - 3) + k/2*(J - 1)**2 + mu*sqrt(I1bar - 3)",
            vec![1e3, 1e4],
            "no moduli at rest",
        ),
        ("mu*(I1bar - 3) + k/2*(J - 1)**2 + mu*step(J - 1)", vec![1e3, 1e4], "jumps at rest"),
        ("mu*(I1bar - 3) + k/2*(J - 1)**2 + mu*max(0, J - 1)", vec![1e3, 1e4], "jumps at rest"),
        ("mu*(I1bar - 3) + k/2*(J - 1)**2 + mu*max(0, 1 - J)", vec![1e3, 1e4], "jumps at rest"),
        (
            "mu*(I1bar - 3) + k*(J**500 - 1)**2/250000 + mu*max(0, 1 - J)",
            vec![1e3, 1e4],
            "jumps at rest",
        ),
        (
            "mu*(I1bar - 3) + k/2*(J - 1)**2 + exp(mu)",
            vec![1e3, 1e4],
            "no value at rest: what the parameters make there",
        ),
        (
            "mu*(I1bar - 3) + k/2*(J - 1)**2 + log(-k)*(J - 1)**2",
            vec![1e3, 1e4],
            "constants without a value",
        ),
        ("mu*mu", vec![1e3], "depends on no deformation"),
        ("500*(I1bar - 3) + 1000*(J - 1)**2", vec![], "no parameter"),
        ("mu*(I1bar - 3) + a0x*(J - 1)**2", vec![1.0, 1.0], "names a component of the fibres"),
        ("mu*(I1bar - 3) + k*(J - 1)**2", vec![1e3], "has 1 parameters"),
        ("mu*(I1bar - 3) + k*(J - 1)**2", vec![1e3, f64::NAN], "k = NaN"),
    ] {
        let error = Material::new(&format!("formula {text}"), vec![row]).unwrap_err().to_string();
        assert!(error.contains(word), "{text}: {error}");
    }
}

/// Their energies are not like squares at a strain of 1e-3, where a jump would look alike.
#[test]
fn steep_formulas_do_not_jump() {
    for (steep, fibres) in [
        ("k*(J**500 - 1)**2/250000", false),
        ("k*(J**1000000 - 1)**2/1e12", false),
        ("k*(exp(300*(J - 1)) - 1)**2/90000", false),
        ("k*(J**500 - 1)**2/250000 + k*max(I4 - 1, 0)**2", true),
    ] {
        let mut row = vec![1e3, 1e4];
        if fibres {
            row.extend([1.0, 0.0, 0.0]);
        }
        let law = Material::new(&format!("formula mu*(I1bar - 3) + {steep}"), vec![row]);
        assert!(law.is_ok(), "{steep}: {:?}", law.err());
    }
}

#[test]
fn what_gives_way_to_pressure_is_known() {
    for (text, resists) in [
        ("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", true),
        ("mu/2*(I1bar - 3) + lam/2*(J - 1)**2", false),
        ("mu/2*(I1bar - 3) + lam/8*(J**2 + J**(-2) - 2)", true),
    ] {
        let row = vec![1e3, 1e4];
        let law = Material::new(&format!("formula {text}"), vec![row.clone()]).unwrap();
        assert_eq!(resists_collapse(&law, &row), resists, "{text}");
    }
}

/// A denominator that has changed its sign since rest leaves no energy and no stress, whatever it is made of; one that keeps
/// its sign leaves both as they are.
#[test]
fn formulas_end_at_their_poles() {
    let stretch = |l: f64| [[l, 0.0, 0.0], [0.0, l.powf(-0.5), 0.0], [0.0, 0.0, l.powf(-0.5)]];
    let i1 = |l: f64| l * l + 2.0 / l;
    let base = "mu/2*(I1bar - 3) + k/2*(J - 1)**2 + ";
    type Term = fn(f64) -> f64;
    // All poles are where I1 = 3.5, at a stretch of 1.44.
    let terms: [(&str, Vec<f64>, Term); 6] = [
        ("mu*(I1bar - 3)/(1 - (I1bar - 3)/0.5)", vec![], |x| x / (1.0 - x / 0.5)),
        ("mu*(I1 - 3)**2/((I1 - 3 - L)**2*J)", vec![0.5], |x| (x / (x - 0.5)).powi(2)),
        ("mu*(I1bar - 3)*(L - (I1bar - 3))**(-n)", vec![0.5, 3.0], |x| x * (0.5 - x).powi(-3)),
        ("mu*(sqrt(1/(3.5 - I1bar)**2) - 2)**2", vec![], |x| ((0.5 - x).recip() - 2.0).powi(2)),
        ("mu*(I2*0 + I1bar - 3)**2/(I1bar - 3.5)/(-1 - I1bar)", vec![], |x| {
            x * x / (x - 0.5) / (-4.0 - x)
        }),
        ("mu*(I1bar - 3)/max(3.5 - I1bar, -1)", vec![], |x| x / (0.5 - x)),
    ];
    for (text, more, term) in terms {
        let row = [vec![1e3, 1e4], more].concat();
        let law = Material::new(&format!("formula {base}{text}"), vec![row.clone()]).unwrap();
        let at = |l: f64| law.energy_and_stress(&row, &[stretch(l)])[0];
        for l in [0.9, 1.3, 1.4] {
            let (x, (energy, stress)) = (i1(l) - 3.0, at(l));
            let exact = 1e3 * (0.5 * x + term(x));
            assert!((energy - exact).abs() < 1e-9 * exact.abs(), "{text}: {energy} {exact}");
            assert!(stress.iter().flatten().all(|p| p.is_finite()), "{text}: {stress:?}");
        }
        for l in [1.5, 2.0, 9.0] {
            let (energy, stress) = at(l);
            assert!(!energy.is_finite(), "{text}: {energy}");
            assert!(!stress[0][0].is_finite(), "{text}: {stress:?}");
        }
    }
    // No poles: a sum of invariants, and a power with a parameter that is not negative.
    for (text, more) in [
        ("mu/(I1 + J)*(I1bar - 3)", vec![]),
        ("mu*(I1bar - 3)*(L - (I1bar - 3))**n", vec![0.5, 2.0]),
    ] {
        let row = [vec![1e3, 1e4], more].concat();
        let law = Material::new(&format!("formula {base}{text}"), vec![row.clone()]).unwrap();
        assert!(law.energy_and_stress(&row, &[stretch(9.0)])[0].0.is_finite(), "{text}");
    }
}
