//! A soft tissue for every law, for tests that run over all of them.

use super::Material;

/// Values of a parameter row: shear modulus about 3 kPa, as incompressible as differences of energies stand. Fibres cross
/// about the first axis.
fn row(law: &str) -> &'static [f64] {
    const FIBRES: [f64; 11] = [3.0e3, 0.5e3, 0.8, 0.1, 13.0e3, 0.8, 0.6, 0.0, 0.8, -0.6, 0.0];
    match law.split(' ').next().unwrap() {
        "linear" | "corotated" | "saint_venant_kirchhoff" | "neo_hookean" => &[3.0e3, 11.0e3],
        "mooney_rivlin" => &[1.2e3, 0.3e3, 11.0e3],
        "yeoh" => &[1.5e3, 0.3e3, 0.1e3, 13.0e3],
        "ogden" => &[1.0e3, -0.1e3, 2.0e3, 1.3, -5.0, 2.1, 13.0e3],
        "holzapfel_gasser_ogden" => const { &FIBRES },
        other => panic!("no parameters for {other}"),
    }
}

/// Laws whose energy has a power series at every state; that of fibres which bear no compression has none where they
/// begin to.
pub(crate) fn analytic() -> impl Iterator<Item = &'static str> {
    Material::NAMES.iter().copied().filter(|law| *law != "holzapfel_gasser_ogden")
}

/// A parameter row of a law, its moduli times a factor.
pub(crate) fn parameters(law: &str, factor: f64) -> Vec<f64> {
    let is_modulus = |name: &str| {
        ["mu", "lam", "kappa", "k1"].contains(&name)
            || name.trim_end_matches(char::is_numeric) == "c"
            || ["mu1", "mu2", "mu3"].contains(&name)
    };
    let names = Material::parameter_names(law).unwrap();
    let scaled = |(name, &value): (&&str, &f64)| {
        if is_modulus(name) { factor * value } else { value }
    };
    names.iter().zip(row(law)).map(scaled).collect()
}

/// The law with the same parameters in every cell.
pub(crate) fn uniform(law: &str) -> Material {
    Material::new(law, vec![parameters(law, 1.0)]).unwrap()
}

/// Cells of three stiffnesses, mixed, two of them nearly the same tissue.
pub(crate) fn per_cell(law: &str, cells: usize) -> Material {
    let factor = |cell: usize| [1.0, 1.1, 3.0][cell % 3];
    Material::new(law, (0..cells).map(|cell| parameters(law, factor(cell))).collect()).unwrap()
}
