//! Several laws side by side: a row's own law answers for it, and wrong rows are refused.

use super::*;
use viscera_number::{Real, Wide};

/// Name and row of every law there is, and of a formula.
fn single_laws() -> Vec<(String, Vec<f64>)> {
    let formula = format!("{FORMULA}mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2");
    let names = Material::parameter_names(&formula).unwrap();
    let row = names.iter().map(|name| if name == "mu" { MU } else { LAM }).collect();
    let known = ROWS.iter().map(|row| (row.name.to_string(), row.sample.to_vec()));
    known.chain([(formula, row)]).collect()
}

#[test]
fn every_row_is_answered_by_its_own_law() {
    let laws = single_laws();
    let names: Vec<&str> = laws.iter().map(|(name, _)| &name[..]).collect();
    let name = format!("{SEVERAL}{}", names.join(BETWEEN));
    let width = Material::parameter_names(&name).unwrap().len();
    let wide = |k: usize| {
        let mut row = vec![k as f64];
        row.extend(&laws[k].1);
        row.resize(width, 0.0);
        row
    };
    let several = Material::new(&name, (0..laws.len()).map(wide).collect()).unwrap();
    for (k, (name, row)) in laws.iter().enumerate() {
        let alone = Material::new(name, vec![row.clone()]).unwrap();
        let own = several.of_cell(k);
        assert_eq!(several.energy_and_stress(own, &[F0]), alone.energy_and_stress(row, &[F0]));
        assert_eq!(several.tangent(own, &F0), alone.tangent(row, &F0), "{name}");
        assert_eq!(several.moduli(own), alone.moduli(row), "{name}");
        assert_eq!(series(several.law(), several.row(k)), series(alone.law(), alone.row(0)));
    }
}

/// Stress, volume and pressure of the second degree.
fn series(law: &dyn LawKernels, row: &[f64]) -> [Vec<Wide>; 3] {
    let table = Monomials::of(3, 2);
    let (n, top) = (table.len(), table.of_degree(2).len());
    let deformation: Vec<Wide> = (0..9 * n)
        .map(|k| match k % n < n - top {
            true => f64::from(u8::from(k % (4 * n) == 0)) + 0.02 * (k as f64).sin(),
            false => 0.0, // what is sought
        })
        .map(Wide::splat)
        .collect();
    let [mut stress, mut volume, mut pressure] = [9 * top, n, n].map(|n| vec![Wide::default(); n]);
    law.stress_series(
        row,
        &mut TaylorCache::default(),
        table,
        &deformation,
        SharedSeries::default(),
        &mut stress,
    );
    law.volume_series(row, table, &deformation, &mut volume);
    law.pressure_series(row, &mut TaylorCache::default(), table, &deformation[..n], &mut pressure);
    [stress, volume, pressure]
}

#[test]
fn one_law_that_forbids_inversion_is_enough() {
    let forbids = |name: &str, row: Vec<f64>| {
        Material::new(name, vec![row]).unwrap().law().forbids_inversion()
    };
    assert!(!forbids("stable_neo_hookean", vec![MU, LAM]));
    assert!(forbids("laws stable_neo_hookean; neo_hookean", vec![0.0, MU, LAM]));
    assert!(!forbids("laws stable_neo_hookean; linear", vec![0.0, MU, LAM]));
}

#[test]
fn wrong_rows_and_names_are_refused() {
    let name = "laws neo_hookean; yeoh";
    let wrong =
        |name: &str, row: &[f64]| Material::new(name, vec![row.to_vec()]).unwrap_err().to_string();
    assert!(wrong(name, &[2.0, 1.0, 1.0, 1.0, 1.0]).contains("row 0 has law 2 of 2"));
    assert!(wrong(name, &[0.5, 1.0, 1.0, 1.0, 1.0]).contains("row 0 has law 0.5 of 2"));
    assert!(wrong(name, &[0.0, -1.0, 1.0, 0.0, 0.0]).contains("neo_hookean"));
    assert!(wrong(name, &[0.0, 1.0]).contains("2 parameters"));
    assert!(wrong("laws neo_hookean; yeo", &[0.0, 1.0, 1.0]).contains("yeo"));
    assert!(wrong("laws ", &[0.0]).contains("law"));
    assert!(wrong("laws laws neo_hookean", &[0.0, 0.0, 1.0, 1.0]).contains("laws neo_hookean"));
}
