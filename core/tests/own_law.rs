//! A law that another crate brings: its energy, a row of parameters, and no line of the core.

use std::sync::Arc;
use viscera_core::body::Body;
use viscera_core::element::Element;
use viscera_core::law::{LawKernels, Material, Rows, StrainEnergy};
use viscera_core::number::Scalar;

/// Gent's solid (Rubber Chem. Technol. 69, 1996, 59) with `kappa/2 (J - 1)^2`.
#[derive(Clone, Copy)]
struct Gent {
    mu: f64,
    limit: f64,
    kappa: f64,
}

#[allow(non_snake_case)]
impl StrainEnergy for Gent {
    const USES_I2: bool = false;

    fn psi<S: Scalar>(&self, I1: S, _I2: S, J: S) -> S {
        let x = (I1 * J.powf(-2.0 / 3.0) - 3.0) * (-1.0 / self.limit) + 1.0;
        x.ln() * (-0.5 * self.mu * self.limit) + (J - 1.0).square() * (0.5 * self.kappa)
    }
}

/// Two cells, in which the law's force and tangent are those of differences, for every element.
#[test]
fn a_law_of_another_crate_deforms_a_body() {
    let names = ["mu", "limit", "kappa"].map(String::from).to_vec();
    let law = Arc::new(Rows(|p| Gent { mu: p[0], limit: p[1], kappa: p[2] }));
    let material = Material::of_kernels("gent", names, law, vec![vec![3e3, 0.8, 2e4]]).unwrap();
    let points = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1], [0.1, 0.1, 0.1]];
    let cells = vec![[0, 1, 2, 3], [1, 2, 3, 4]];
    for element in Element::ALL {
        let body =
            Body::with_element(element, points.clone(), cells.clone(), material.clone()).unwrap();
        let n = body.n_dofs();
        let u: Vec<f64> = (0..n).map(|k| 4e-3 * (k as f64).sin()).collect();
        let direction: Vec<f64> = (0..n).map(|k| (2.0 * k as f64).cos()).collect();
        let at =
            |h: f64| -> Vec<f64> { u.iter().zip(&direction).map(|(u, w)| u + h * w).collect() };
        let force = |u: &[f64]| {
            let mut f = vec![0.0; n];
            (body.internal_force(u, &mut f), f)
        };
        let (h, (mut f, mut tangent)) = (1e-6, (vec![0.0; n], body.zero_tangent()));
        body.internal_force_and_tangent(&u, &mut f, &mut tangent);
        let slope = (body.energy(&at(h)) - body.energy(&at(-h))) / (2.0 * h);
        let along: f64 = f.iter().zip(&direction).map(|(f, w)| f * w).sum();
        assert!((slope - along).abs() < 1e-7 * along.abs(), "{}: {slope} {along}", element.name());
        assert!((force(&u).0 - body.energy(&u)).abs() < 1e-12 * body.energy(&u));
        let mut product = vec![0.0; n];
        tangent.multiply(&direction, &mut product);
        let size = product.iter().fold(0.0f64, |max, x| max.max(x.abs()));
        let (plus, minus) = (force(&at(h)).1, force(&at(-h)).1);
        for k in 0..n {
            let difference = (plus[k] - minus[k]) / (2.0 * h);
            assert!((difference - product[k]).abs() < 1e-6 * size, "{}", element.name());
        }
    }
}

/// Rounding is that of the law's stresses, whatever its parameters are given in: in pascals, in megapascals, or as numbers
/// that say nothing of a stress.
#[test]
fn the_size_of_its_stresses_does_not_depend_on_the_units_of_its_parameters() {
    let scale = |law: Arc<dyn LawKernels>, row: [f64; 3]| {
        let names = ["mu", "limit", "kappa"].map(String::from).to_vec();
        Material::of_kernels("gent", names, law, vec![row.to_vec()]).unwrap().scale(0)
    };
    let pascals = Arc::new(Rows(|p| Gent { mu: p[0], limit: p[1], kappa: p[2] }));
    let mega = Rows(|p| Gent { mu: 1e6 * p[0], limit: p[1], kappa: 1e6 * p[2] });
    let expected = scale(pascals.clone(), [3e3, 0.8, 2e4]);
    assert!((expected - 2.3e4).abs() < 1e-6 * expected, "{expected}");
    assert!((scale(Arc::new(mega), [3e-3, 0.8, 2e-2]) - expected).abs() < 1e-9 * expected);
    // A limit so far away that there is none.
    assert!((scale(pascals, [3e3, 1e15, 2e4]) - expected).abs() < 1e-2 * expected);
}
