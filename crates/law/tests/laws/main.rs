//! Every law gets every test by one line of [`law_tests!`].
#![allow(non_snake_case)]

mod at_rest;
mod formulas;
mod programs;
mod several;
mod wrapped;

use viscera_law::*;
use viscera_number::tensor::{Mat3, add, mul_vector, sub};
use viscera_number::unroll::tabulate;
use viscera_number::{Jet, Lanes, Monomials};
use wrapped::{Once, Plain};

const VECTORS: [[f64; 3]; 3] = [[1.0, 0.2, -0.3], [0.1, 1.2, 0.5], [-0.4, -0.3, -0.6]];

/// A moderate stretch, shear and rotation with `J > 0`.
const F0: Mat3<f64> = [[1.15, 0.22, -0.13], [-0.18, 0.92, 0.24], [0.09, -0.2, 1.05]];
const DIRECTION: Mat3<f64> = [[0.3, -0.5, 0.2], [0.4, 0.1, -0.6], [-0.2, 0.7, 0.25]];
const MU: f64 = 3.0;
const LAM: f64 = 11.0;

fn identity() -> Mat3<f64> {
    tabulate!(|i, j| (i == j) as u8 as f64)
}

fn axpy(t: f64, d: &Mat3<f64>, f: &Mat3<f64>) -> Mat3<f64> {
    tabulate!(|i, j| f[i][j] + t * d[i][j])
}

fn largest(m: &Mat3<f64>) -> f64 {
    m.iter().flatten().fold(0.0, |max, x| max.max(x.abs()))
}

/// Rotation about (1, 2, 2)/3 by 0.7.
fn turn() -> Mat3<f64> {
    let (n, c, s) = ([1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], 0.7f64.cos(), 0.7f64.sin());
    let spin = [[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]];
    tabulate!(|i, j| c * ((i == j) as u8 as f64) + s * spin[i][j] + (1.0 - c) * n[i] * n[j])
}

fn product(a: &Mat3<f64>, b: &Mat3<f64>) -> Mat3<f64> {
    tabulate!(|i, j| (0..3).map(|k| a[i][k] * b[k][j]).sum())
}

/// Central differences in `h`, exact to `h^2`.
fn stress_is_the_derivative_of_the_energy(law: impl Law) {
    let h = 1e-5;
    let (energy, stress): (f64, _) = law.energy_and_stress(&F0);
    assert!((energy - law.energy(&F0)).abs() < 1e-13 * energy.abs());
    assert!(largest(&sub(&stress, &law.stress(&F0))) < 1e-13 * largest(&stress));
    let scale = largest(&stress);
    for i in 0..3 {
        for j in 0..3 {
            let unit = tabulate!(|p, q| (p == i && q == j) as u8 as f64);
            let plus: f64 = law.energy(&axpy(h, &unit, &F0));
            let minus: f64 = law.energy(&axpy(-h, &unit, &F0));
            let difference = (plus - minus) / (2.0 * h);
            assert!((difference - stress[i][j]).abs() < 1e-8 * scale, "P[{i}][{j}]");
        }
    }
}

fn tangent_is_the_derivative_of_the_stress(law: impl Law) {
    let h = 1e-5;
    let (stress, blocks) = law.tangent(&F0, &VECTORS);
    assert!(largest(&sub(&stress, &law.stress(&F0))) < 1e-13 * largest(&stress));
    for b in 0..3 {
        for k in 0..3 {
            let step = tabulate!(|i, j| if i == k { VECTORS[b][j] } else { 0.0 });
            let (plus, minus) =
                (law.stress(&axpy(h, &step, &F0)), law.stress(&axpy(-h, &step, &F0)));
            let difference = tabulate!(|i, j| (plus[i][j] - minus[i][j]) / (2.0 * h));
            for a in 0..=b {
                let column = mul_vector(&difference, &VECTORS[a]);
                for i in 0..3 {
                    let error = (column[i] - blocks[a][b][i][k]).abs();
                    assert!(error < 1e-7 * (MU + LAM), "K[{a}][{b}][{i}][{k}] off by {error}");
                }
            }
        }
    }
}

fn objective(law: impl Law) {
    let (q, stress) = (turn(), law.stress(&F0));
    let turned = law.stress(&product(&q, &F0));
    assert!(largest(&sub(&turned, &product(&q, &stress))) < 1e-12 * largest(&stress));
    let (a, b): (f64, f64) = (law.energy(&F0), law.energy(&product(&q, &F0)));
    assert!((a - b).abs() < 1e-12 * a.abs());
}

fn is_at_rest_undeformed(law: impl Law) {
    assert!(largest(&law.stress(&identity())) < 1e-13 * (MU + LAM));
    let energy: f64 = law.energy(&identity());
    assert!(energy.abs() < 1e-13 * (MU + LAM));
}

fn hooke(law: impl Law) {
    let h = 1e-6;
    let linear = Linear { mu: MU, lam: LAM };
    let small = axpy(h, &DIRECTION, &identity());
    let difference = sub(&law.stress(&small), &linear.stress(&small));
    assert!(largest(&difference) < 1e-5 * largest(&linear.stress(&small)));
    let (_, blocks) = law.tangent(&identity(), &VECTORS);
    let (_, expected) = linear.tangent(&identity(), &VECTORS);
    for a in 0..3 {
        for b in a..3 {
            assert!(largest(&sub(&blocks[a][b], &expected[a][b])) < 1e-11 * (MU + LAM));
        }
    }
}

/// Hooke's law plus the fibres, `k1 (1 - 3 d)^2 A (x) A` with `A = 2 a (x) a - 2/3 I` for each family.
fn fibres(law: HolzapfelGasserOgden) {
    let dispersed = 1.0 - 3.0 * law.dispersion;
    let weight = law.k1 * dispersed * dispersed;
    let (_, mut expected) = Linear { mu: MU, lam: LAM }.tangent(&identity(), &VECTORS);
    for a in law.fibres {
        let A = tabulate!(|i, j| 2.0 * a[i] * a[j] - if i == j { 2.0 / 3.0 } else { 0.0 });
        let pull = VECTORS.map(|g| mul_vector(&A, &g));
        for (p, row) in expected.iter_mut().enumerate() {
            for (q, block) in row.iter_mut().enumerate() {
                *block = add(block, &tabulate!(|i, k| weight * pull[p][i] * pull[q][k]));
            }
        }
    }
    let (_, blocks) = law.tangent(&identity(), &VECTORS);
    for a in 0..3 {
        for b in a..3 {
            assert!(largest(&sub(&blocks[a][b], &expected[a][b])) < 1e-11 * (MU + LAM));
        }
    }
}

/// Coefficients of `P(F0 + t D + t^2 D^T)` against the series summed and differenced in `t`.
fn taylor_series_is_the_stress_along_a_path(law: impl Law) {
    const ORDER: usize = 10;
    let table = Monomials::of(1, ORDER);
    let path = tabulate!(|i, j| Jet::new(table, vec![F0[i][j], DIRECTION[i][j], DIRECTION[j][i]]));
    let series = law.stress(&path);
    let at = |t: f64| {
        law.stress(&tabulate!(|i, j| F0[i][j] + t * DIRECTION[i][j] + t * t * DIRECTION[j][i]))
    };
    let scale = largest(&at(0.0));
    // The value of the truncated series differs from the stress by order ORDER + 1 in t.
    for t in [0.02, -0.03] {
        let exact = at(t);
        let sum = tabulate!(|i, j| {
            (0..=ORDER).rev().fold(0.0, |sum, p| sum * t + series[i][j].coefficient(p))
        });
        assert!(largest(&sub(&sum, &exact)) < 1e-9 * scale);
    }
    let h = 1e-4;
    let (plus, minus, centre) = (at(h), at(-h), at(0.0));
    for i in 0..3 {
        for j in 0..3 {
            let first = (plus[i][j] - minus[i][j]) / (2.0 * h);
            let second = (plus[i][j] - 2.0 * centre[i][j] + minus[i][j]) / (2.0 * h * h);
            assert!((first - series[i][j].coefficient(1)).abs() < 1e-5 * scale);
            assert!((second - series[i][j].coefficient(2)).abs() < 1e-4 * scale);
        }
    }
}

/// A jet in three variables along a line is the jet in one variable.
fn three_variables_restrict_to_one(law: impl Law) {
    let (line, space) = (Monomials::of(1, 4), Monomials::of(3, 4));
    let direction = [0.6, -0.3, 0.5];
    let steps = [DIRECTION, tabulate!(|i, j| DIRECTION[j][i]), F0];
    let in_space = law.stress(&tabulate!(|i, j| {
        Jet::new(space, vec![F0[i][j], steps[0][i][j], steps[1][i][j], steps[2][i][j]])
    }));
    let on_line = law.stress(&tabulate!(|i, j| {
        let slope = (0..3).map(|v| direction[v] * steps[v][i][j]).sum();
        Jet::new(line, vec![F0[i][j], slope])
    }));
    let mut monomials = vec![0.0; space.len()];
    space.evaluate(direction, &mut monomials);
    for p in 0..=4 {
        let sum = tabulate!(|i, j| {
            space.of_degree(p).map(|c| in_space[i][j].coefficient(c) * monomials[c]).sum::<f64>()
        });
        let expected = tabulate!(|i, j| on_line[i][j].coefficient(p));
        let error = largest(&sub(&sum, &expected));
        assert!(error < 1e-11 * (1.0 + largest(&expected)), "order {p}: {error}");
    }
}

fn lanes_agree(law: impl Law) {
    let exact = law.stress(&F0);
    let lanes = law.stress(&tabulate!(|i, j| Lanes([F0[i][j], identity()[i][j]])));
    let first = tabulate!(|i, j| lanes[i][j].0[0]);
    assert!(largest(&sub(&first, &exact)) < 1e-14 * largest(&exact));
}

#[allow(non_snake_case)]
/// The hand-written geometry on series against the generic stress of jets.
fn series_agree_with_generic_jets(law: impl Law) {
    for (variables, order) in [(1, 7), (3, 3), (3, 4)] {
        let table = Monomials::of(variables, order);
        let n = table.len();
        let path: Vec<f64> = (0..9 * n)
            .map(|k| match k % n {
                0 => F0[k / n / 3][k / n % 3],
                c if c < table.of_degree(order).start => 0.2 * (k as f64).sin(),
                _ => 0.0, // what is sought
            })
            .collect();
        let deformation =
            tabulate!(|i, j| Jet::new(table, path[(3 * i + j) * n..(3 * i + j + 1) * n].to_vec()));
        let generic = law.stress(&deformation);
        let top = table.of_degree(order);
        let mut series = vec![0.0; 9 * top.len()];
        law.stress_series(
            &mut TaylorCache::default(),
            table,
            &path,
            SharedSeries::default(),
            &mut series,
        );
        let close = |a: f64, b: f64, what: &str| {
            assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{what}: {a} {b}");
        };
        let compare = |series: &[f64], expected: &Mat3<Jet<f64>>| {
            for (k, value) in series.iter().enumerate() {
                let (entry, c) = (k / top.len(), top.start + k % top.len());
                close(*value, expected[entry / 3][entry % 3].coefficient(c), "P");
            }
        };
        compare(&series, &generic);
        // With a pressure in place of a part of the law's own, twice: what is kept serves again.
        let (J, Z) = law.volume_ratio(&deformation);
        let q = Jet::new(table, (0..n).map(|k| 0.3 * (1.0 + k as f64).cos()).collect::<Vec<_>>());
        let part = 0.4;
        let net = q.clone() - law.pressure(&J) * part;
        let loaded = tabulate!(|i, j| generic[i][j].clone() + net.clone() * Z[i][j].clone());
        let (shared, mut cache) =
            (SharedSeries { part, pressure: q.coefficients() }, TaylorCache::default());
        for _ in 0..2 {
            series.fill(0.0);
            law.stress_series(&mut cache, table, &path, shared, &mut series);
            compare(&series, &loaded);
        }
        let mut volume = vec![0.0; n];
        law.volume_series(table, &path, &mut volume);
        volume.iter().enumerate().for_each(|(c, &v)| close(v, J.coefficient(c), "J"));
    }
}

#[allow(non_snake_case)]
/// Volume ratio, its curvature and the energy of a dilatation, all by central differences.
fn volume_and_pressure_are_derivatives(law: impl Law) {
    let h = 1e-5;
    let (_, gradient) = law.volume_ratio(&F0);
    let curvature = law.volume_curvature(&F0, &VECTORS);
    for b in 0..3 {
        for k in 0..3 {
            let step = tabulate!(|i, j| if i == k { VECTORS[b][j] } else { 0.0 });
            let ((plus, Z_plus), (minus, Z_minus)) =
                (law.volume_ratio(&axpy(h, &step, &F0)), law.volume_ratio(&axpy(-h, &step, &F0)));
            let slope = mul_vector(&gradient, &VECTORS[b])[k];
            assert!(((plus - minus) / (2.0 * h) - slope).abs() < 1e-9);
            let difference = tabulate!(|i, j| (Z_plus[i][j] - Z_minus[i][j]) / (2.0 * h));
            for a in 0..=b {
                let column = mul_vector(&difference, &VECTORS[a]);
                (0..3).for_each(|i| assert!((column[i] - curvature[a][b][i][k]).abs() < 1e-8));
            }
        }
    }
    for J in [0.8, 1.0, 1.3] {
        let [pressure, modulus] = law.pressure_and_modulus(&J);
        let slope = (law.dilatation(&(J + h)) - law.dilatation(&(J - h))) / (2.0 * h);
        let curvature = (law.pressure(&(J + h)) - law.pressure(&(J - h))) / (2.0 * h);
        assert!((pressure - slope).abs() < 1e-8 * (MU + LAM), "U'({J})");
        assert!((pressure - law.pressure(&J)).abs() < 1e-13 * (MU + LAM));
        assert!((modulus - curvature).abs() < 1e-7 * (MU + LAM), "U''({J})");
    }
    let [at_rest, bulk_modulus] = law.pressure_and_modulus(&1.0);
    assert!(at_rest.abs() < 1e-13 * (MU + LAM));
    assert!((bulk_modulus - (LAM + 2.0 / 3.0 * MU)).abs() < 1e-12 * (MU + LAM));
}

#[allow(non_snake_case)]
fn inherited_pressures_agree(law: impl Law) {
    let plain = Plain(law);
    for J in [0.8, 1.0, 1.3] {
        let (ours, theirs) = (law.pressure_and_modulus(&J), plain.pressure_and_modulus(&J));
        assert!((law.dilatation(&J) - plain.dilatation(&J)).abs() < 1e-13 * (MU + LAM));
        assert!((law.pressure(&J) - plain.pressure(&J)).abs() < 1e-13 * (MU + LAM));
        (0..2).for_each(|k| assert!((ours[k] - theirs[k]).abs() < 1e-12 * (MU + LAM)));
    }
}

macro_rules! law_tests {
    ($($name:ident: $law:expr $(, $property:ident)*;)*) => {$(
        mod $name {
            use super::*;
            #[test]
            fn stress() { stress_is_the_derivative_of_the_energy(Once($law)) }
            #[test]
            fn tangent() { tangent_is_the_derivative_of_the_stress(Once($law)) }
            $(#[test]
            fn $property() { super::$property($law) })*
            #[test]
            fn rest() { is_at_rest_undeformed(Once($law)) }
            #[test]
            fn taylor() { taylor_series_is_the_stress_along_a_path(Once($law)) }
            #[test]
            fn jet() { three_variables_restrict_to_one(Once($law)) }
            #[test]
            fn series() { series_agree_with_generic_jets(Once($law)) }
            #[test]
            fn volume() { volume_and_pressure_are_derivatives(Once($law)) }
            #[test]
            fn lanes() { lanes_agree(Once($law)) }
        }
    )*};
}

fn mooney(volumetric: Volumetric) -> MooneyRivlin {
    MooneyRivlin { c1: 0.4 * MU, c2: 0.1 * MU, kappa: LAM + 2.0 / 3.0 * MU, volumetric }
}

fn ogden(mu: [f64; 3], alpha: [f64; 3]) -> Ogden {
    Ogden { mu, alpha, kappa: LAM + 2.0 / 3.0 * MU }
}

/// Two families, of which `F0` stretches one and shortens the other.
fn artery(bear_compression: bool) -> HolzapfelGasserOgden {
    HolzapfelGasserOgden {
        c: MU,
        k1: 2.0,
        k2: 0.8,
        dispersion: 0.1,
        kappa: LAM + 2.0 / 3.0 * MU,
        fibres: [[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]],
        bear_compression,
    }
}

// Linear elasticity is the one law that is not objective; fibres have moduli of their own at small strain.
law_tests! {
    linear: Linear { mu: MU, lam: LAM }, hooke;
    corotated: Corotated { mu: MU, lam: LAM }, objective, hooke;
    saint_venant_kirchhoff: SaintVenantKirchhoff { mu: MU, lam: LAM }, objective, hooke;
    neo_hookean: NeoHookean { mu: MU, lam: LAM }, objective, hooke;
    mooney_rivlin_jacobian: mooney(Volumetric::Jacobian), objective, hooke;
    mooney_rivlin_jacobian_squared: mooney(Volumetric::JacobianSquared), objective, hooke;
    mooney_rivlin_logarithm: mooney(Volumetric::Logarithm), objective, hooke;
    yeoh: Yeoh { c: [0.5 * MU, 0.1, 0.02], kappa: LAM + 2.0 / 3.0 * MU }, objective, hooke;
    ogden_one_term: ogden([2.0 * MU / 3.7, 0.0, 0.0], [3.7, 1.0, 1.0]), objective, hooke;
    ogden_three_terms: ogden([1.0, -0.1, 2.0], [1.3, -5.0, 2.1]), objective, hooke;
    stable_neo_hookean: StableNeoHookean { mu: MU, lam: LAM }, objective, hooke;
    arruda_boyce: ArrudaBoyce { mu: MU, lambda_m: 1.4, kappa: LAM + 2.0 / 3.0 * MU }, objective, hooke;
    veronda_westmann: VerondaWestmann { c1: MU / 0.8, c2: 0.8, kappa: LAM + 2.0 / 3.0 * MU }, objective, hooke;
    fung: Fung { mu: MU, b: 0.7, kappa: LAM + 2.0 / 3.0 * MU }, objective, hooke;
    artery_in_tension: artery(false), objective, fibres;
    artery_both_ways: artery(true), objective, fibres;
}

#[test]
fn what_a_law_inherits_is_what_strain_energies_do_faster() {
    inherited_pressures_agree(NeoHookean { mu: MU, lam: LAM });
    inherited_pressures_agree(mooney(Volumetric::Logarithm));
    inherited_pressures_agree(mooney(Volumetric::JacobianSquared));
}

#[test]
fn linear_elasticity_is_not_objective_and_shows_it() {
    let law = Linear { mu: MU, lam: LAM };
    assert!(largest(&law.stress(&turn())) > 0.1 * MU);
    assert!(largest(&add(&law.stress(&identity()), &identity())) > 0.0);
}

/// Small-strain oracle of the corotated law: stiffness warping `f = R K0 (R^T x - X)`.
#[test]
fn corotated_is_stiffness_warping() {
    let stretch = [[1.1, 0.05, 0.0], [0.05, 0.95, 0.02], [0.0, 0.02, 1.0]];
    let (law, hooke) = (Corotated { mu: MU, lam: LAM }, Linear { mu: MU, lam: LAM });
    let warped = product(&turn(), &hooke.stress(&stretch));
    let error = sub(&law.stress(&product(&turn(), &stretch)), &warped);
    assert!(largest(&error) < 1e-13);
}

/// Turned inside out it has an energy that is finite and a stress that is its derivative.
#[test]
fn stable_neo_hookean_recovers_from_inversion() {
    let law = StableNeoHookean { mu: MU, lam: LAM };
    let inside_out = tabulate!(|i, j| if i == 0 { -F0[i][j] } else { F0[i][j] });
    let (energy, stress): (f64, Mat3<f64>) = law.energy_and_stress(&inside_out);
    assert!(energy > 0.0 && !<StableNeoHookean as Law>::FORBIDS_INVERSION);
    let slope = |t: f64| -> f64 { law.energy(&axpy(t, &DIRECTION, &inside_out)) };
    let difference = (slope(1e-5) - slope(-1e-5)) / 2e-5;
    let along: f64 = viscera_number::tensor::double_dot(&stress, &DIRECTION);
    assert!((difference - along).abs() < 1e-7 * largest(&stress), "{difference} {along}");
}

/// Even exponents are Mooney-Rivlin's invariants, to round-off.
#[test]
fn ogden_with_even_exponents_is_mooney_rivlin() {
    let law = ogden([0.8 * MU, -0.2 * MU, 0.0], [2.0, -2.0, 1.0]);
    let difference = sub(&law.stress(&F0), &mooney(Volumetric::Jacobian).stress(&F0));
    assert!(largest(&difference) < 1e-14 * (MU + LAM));
}

/// Without fibres, and with a stretched family against a shortened one, which bears nothing.
#[test]
fn fibres_bear_no_compression() {
    let stretch = |a: f64| [[a, 0.0, 0.0], [0.0, a.powf(-0.5), 0.0], [0.0, 0.0, a.powf(-0.5)]];
    let along =
        HolzapfelGasserOgden { dispersion: 0.0, fibres: [[1.0, 0.0, 0.0]; 2], ..artery(false) };
    let bare = HolzapfelGasserOgden { k1: 0.0, ..along };
    assert_eq!(along.stress(&stretch(0.8)), bare.stress(&stretch(0.8)));
    let E = 1.2f64.powi(2) - 1.0;
    // psi' = k1 E exp(k2 E^2), dE/dl = 2 l, two families; isochoric, so the stress of the axial stretch is the sum of
    // the constraint's and this one.
    let pull = 2.0 * along.k1 * E * (along.k2 * E * E).exp() * 2.0 * 1.2;
    let P = sub(&along.stress(&stretch(1.2)), &bare.stress(&stretch(1.2)));
    let lateral = 1.2f64.powf(-0.5);
    let work = P[0][0] - P[1][1] * lateral / 1.2;
    assert!((work - pull).abs() < 1e-12 * pull, "{work} {pull}");
}

#[test]
fn materials_are_checked() {
    assert!(Material::new("neo_hookean", vec![vec![1.0, 2.0]]).is_ok());
    // Two silicones of the measured ones need a negative c1.
    assert!(Material::new("mooney_rivlin J-1", vec![vec![-0.1, 0.4, 1.0]]).is_ok());
    for (name, row, word) in [
        ("neohookean", vec![1.0, 2.0], "no law is called"),
        ("neo_hookean", vec![1.0], "takes"),
        ("neo_hookean", vec![-1.0, 2.0], "mu = -1"),
        ("neo_hookean", vec![3.0, -2.0], "the bulk modulus, is 0"),
        ("mooney_rivlin J-1", vec![-0.5, 0.4, 1.0], "c1 + c2"),
        ("yeoh", vec![1.0, 0.0, 0.0, -1.0], "kappa = -1"),
        ("neo_hookean", vec![1.0, f64::NAN], "lam = NaN"),
    ] {
        let message = Material::new(name, vec![row]).unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
    }
}
