//! The moduli at rest of laws with fibres, which may lie as they like.

use crate::{product, turn};
use viscera_law::samples::parameters;
use viscera_law::{FORMULA, Material};
use viscera_number::tensor::{Mat3, mul_vector};

const SHEAR: f64 = 2.0;
const BULK: f64 = 300.0;

/// Two directions that lie along the axes or nearly so, and turned ever further.
fn directions() -> impl Iterator<Item = [[f64; 3]; 2]> {
    let mut turned: Mat3<f64> = crate::identity();
    (0..12).map(move |_| {
        let both = [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0]].map(|f| mul_vector(&turned, &f));
        turned = product(&turn(), &turned);
        both
    })
}

/// Moduli of a matrix with two families of fibres whose energies are `k (I - 1)^2`.
fn moduli(k: [f64; 2], fibres: [[f64; 3]; 2]) -> [f64; 2] {
    let text = "mu/2*(I1bar - 3) + kappa/2*(J - 1)**2 + first*(I4 - 1)**2 + second*(I6 - 1)**2";
    let row: Vec<f64> =
        [SHEAR, BULK, k[0], k[1]].into_iter().chain(fibres.into_iter().flatten()).collect();
    Material::new(&format!("{FORMULA}{text}"), vec![row.clone()]).unwrap().moduli(&row)
}

/// Fibres stiffen some deviatoric strains; those that stretch no fibre see the matrix alone.
#[test]
fn the_shear_modulus_of_a_fibred_law_is_that_of_its_matrix() {
    for fibres in directions() {
        for k in [[0.0, 0.0], [5.0, 0.0], [1e4, 0.0], [3.0, 700.0]] {
            let [shear, _] = moduli(k, fibres);
            assert!((shear - SHEAR).abs() < 1e-12 * (SHEAR + k[0] + k[1]), "{k:?}: {shear}");
        }
    }
}

/// Nor do fibres count in the bulk modulus, whatever the measure of their stretch: what clusters of cells share is what
/// the matrix resists to a change of volume.
#[test]
fn the_bulk_modulus_of_a_fibred_law_is_that_of_its_matrix() {
    for fibres in directions() {
        for (first, second) in [
            ("I4 - 1", "I6 - 1"),
            ("I4*J**(-2/3) - 1", "I6 - 1"),
            ("log(I4)", "max(I6*J**(-2/3) - 1, 0)"),
            ("0.2*(I1 - 3) + 0.4*(I4 - 1)", "sqrt(I6) - 1"),
            ("I4 + I6 - 2", "0*I6"),
            ("0*I4", "I6 - 1"),
        ] {
            let text =
                format!("mu/2*(I1bar - 3) + kappa/2*(J - 1)**2 + k*({first})**2 + k*({second})**2");
            let row: Vec<f64> =
                [SHEAR, BULK, 1e3].into_iter().chain(fibres.into_iter().flatten()).collect();
            let law = Material::new(&format!("{FORMULA}{text}"), vec![row.clone()]).unwrap();
            let [_, bulk] = law.moduli(&row);
            assert!((bulk - BULK).abs() < 1e-9 * BULK, "{text}: {bulk}");
        }
    }
}

/// A fibre that gives way softens the strain `dev(f (x) f)`, of squared norm 2/3, by `8 |k|`.
#[test]
fn a_fibre_that_softens_lowers_the_shear_modulus() {
    for fibres in directions() {
        let [shear, _] = moduli([-0.3, 0.0], fibres);
        assert!((shear - (SHEAR - 0.3 * 8.0 / 3.0)).abs() < 1e-12 * BULK, "{shear}");
    }
}

/// The energy of a strain that nothing resists to second order does not fall, so the words do not say that it does.
#[test]
fn a_strain_that_meets_no_stress_is_not_said_to_lower_the_energy() {
    for (text, row, word) in [
        ("c*(I1bar - 3)**2 + k/2*(J - 1)**2", vec![1e3, 1e4], "meets no stress"),
        ("c/2*(I1bar - 3) + k*(J - 1)**4", vec![1e3, 1e4], "meets no stress"),
        ("c*(I1bar - 3) + k/2*(J - 1)**2", vec![-1e3, 1e4], "lowers the energy"),
    ] {
        let told = Material::new(&format!("{FORMULA}{text}"), vec![row]).unwrap_err().to_string();
        assert!(told.contains("both must be positive") && told.contains(word), "{text}: {told}");
        assert!(!(told.contains("lowers") && word != "lowers the energy"), "{text}: {told}");
    }
}

/// A built-in law with fibres, turned, keeps both moduli.
#[test]
fn moduli_do_not_depend_on_how_fibres_lie() {
    for name in ["holzapfel_gasser_ogden", "holzapfel_gasser_ogden both ways"] {
        let mut row = parameters(name, 1.0);
        let exact = [row[0], row[4]];
        for [first, second] in directions() {
            row.splice(5..11, first.into_iter().chain(second));
            let found = Material::new(name, vec![row.clone()]).unwrap().moduli(&row);
            for (found, exact) in found.into_iter().zip(exact) {
                assert!((found - exact).abs() < 1e-12 * exact, "{name}: {found} {exact}");
            }
        }
    }
}

/// Of a built-in law it is the largest of its parameters that are stresses: numbers may be as large as they like.
#[test]
fn the_size_of_the_stresses_is_that_of_the_parameters_that_are_stresses() {
    for row in viscera_law::ROWS {
        let stresses = row.stresses();
        let scaled: Vec<f64> = (row.sample.iter().enumerate())
            .map(|(k, value)| if stresses.contains(&k) { 2.0 * value } else { *value })
            .collect();
        let scale =
            |values: &[f64]| Material::new(row.name, vec![values.to_vec()]).unwrap().scale(0);
        let (one, two) = (scale(row.sample), scale(&scaled));
        assert!((two - 2.0 * one).abs() < 1e-12 * one, "{}: {one} {two}", row.name);
        let largest = stresses.iter().fold(0.0f64, |most, &k| most.max(row.sample[k].abs()));
        assert_eq!(one, largest, "{}", row.name);
    }
    let chains = |lock: f64| Material::new("arruda_boyce", vec![vec![1e3, lock, 2e3]]);
    let scale = |lock| chains(lock).unwrap().scale(0);
    assert_eq!(scale(3.0), scale(1e12));
}
