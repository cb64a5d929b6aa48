//! A soft tissue for every law, for tests that run over all of them.

use super::{Kind, Material, ROWS, Row};

/// All laws, by name.
pub fn names() -> impl Iterator<Item = &'static str> {
    ROWS.iter().map(|row| row.name)
}

/// Laws whose energy has a power series at rest.
pub fn analytic() -> impl Iterator<Item = &'static str> {
    ROWS.iter().filter(|row| row.is_analytic).map(|row| row.name)
}

fn row(law: &str) -> &'static Row {
    ROWS.iter().find(|row| row.name == law).unwrap_or_else(|| panic!("no law is called {law}"))
}

/// A parameter row of a law, its moduli times a factor.
pub fn parameters(law: &str, factor: f64) -> Vec<f64> {
    let row = row(law);
    let scaled = |kind: Kind, value: f64| if kind == Kind::Stress { factor * value } else { value };
    row.parameters.iter().zip(row.sample).map(|(p, &value)| scaled(p.kind, value)).collect()
}

/// The law with the same parameters in every cell.
pub fn uniform(law: &str) -> Material {
    Material::new(law, vec![parameters(law, 1.0)]).unwrap()
}

/// Cells of three stiffnesses, mixed, two of them nearly the same tissue.
pub fn per_cell(law: &str, cells: usize) -> Material {
    let factor = |cell: usize| [1.0, 1.1, 3.0][cell % 3];
    Material::new(law, (0..cells).map(|cell| parameters(law, factor(cell))).collect()).unwrap()
}
