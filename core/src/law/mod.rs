//! Constitutive laws.
//!
//! An isotropic law is a strain energy `psi(I1, I2, J)` written once ([`StrainEnergy`]); stress,
//! tangent and power series follow from it through `invariants.rs`. Laws of another kind
//! (linear, corotated) implement [`Law`], the layer above, directly. A new law is a file here,
//! one line in [`laws!`] and one line of tests.

mod corotated;
mod holzapfel_gasser_ogden;
mod invariants;
mod linear;
mod mooney_rivlin;
mod neo_hookean;
mod ogden;
mod power;
mod saint_venant_kirchhoff;
mod series;
#[cfg(test)]
mod tests;
mod yeoh;

pub use corotated::Corotated;
pub use holzapfel_gasser_ogden::HolzapfelGasserOgden;
pub use linear::Linear;
pub use mooney_rivlin::{MooneyRivlin, Volumetric};
pub use neo_hookean::NeoHookean;
pub use ogden::Ogden;
pub use saint_venant_kirchhoff::SaintVenantKirchhoff;
pub use yeoh::Yeoh;

use crate::error::Error;
use crate::number::{Jet, Monomials, Real, Scalar};
use crate::tensor::{Mat3, Vec3, tabulate};

/// An isotropic strain energy per unit reference volume [J/m^3].
pub trait StrainEnergy: Copy + Send + Sync {
    /// Whether `psi` depends on `I2`; if not, its derivatives are not computed.
    const USES_I2: bool = true;

    /// Whether a derivative of `psi` depends on `I1`; if not, its power series is not computed.
    const DERIVATIVES_USE_I1: bool = true;

    /// `psi(I1, I2, J)` with `I1 = tr C`, `I2 = (I1^2 - tr C^2) / 2 = |cof F|^2`, `J = det F`.
    #[allow(non_snake_case)]
    fn psi<S: Scalar>(&self, I1: S, I2: S, J: S) -> S;
}

/// The tangent of a linear tetrahedron: `blocks[a][b] = dP/dF : (g_a, g_b)`, for nodes `a <= b`.
pub type TangentBlocks<S> = [[Mat3<S>; 4]; 4];

/// Energy, stress and tangent of a deformation gradient: what an element asks of a law.
#[allow(non_snake_case)]
pub trait Law: Copy + Send + Sync + PartialEq + 'static {
    /// Whether a cell turned inside out (`J <= 0`) is outside the law's domain.
    const FORBIDS_INVERSION: bool;

    /// Strain energy per unit reference volume [J/m^3].
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S;

    /// First Piola-Kirchhoff stress `P = d psi / dF` [Pa], for any scalar, power series included.
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S>;

    /// Stress and the contraction of `dP/dF` with four shape gradients:
    /// `blocks[a][b]_ik = g_a,J (dP_iJ / dF_kL) g_b,L` for `a <= b`, which is all that assembly
    /// needs of the fourth-order tensor.
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 4]) -> (Mat3<S>, TangentBlocks<S>);

    /// Degree-p coefficients of `P`, p being the order of `table`, from the series of `F`.
    ///
    /// `deformation` holds nine runs of `table.len()` coefficients, row by row; `out` nine runs of
    /// the degree-p coefficients, zero on entry. Strain energies replace this by `series.rs`.
    #[inline(always)]
    fn stress_series<T: Real>(&self, table: &'static Monomials, deformation: &[T], out: &mut [T]) {
        let (n, top) = (table.len(), table.of_degree(table.order()));
        let run = |entry: usize| deformation[entry * n..(entry + 1) * n].to_vec();
        let P = self.stress(&tabulate(|i, j| Jet::new(table, run(3 * i + j))));
        for (entry, out) in out.chunks_exact_mut(top.len()).enumerate() {
            for (value, c) in out.iter_mut().zip(top.clone()) {
                *value = P[entry / 3][entry % 3].coefficient(c);
            }
        }
    }
}

/// A law given to the cells of a body: one set of parameters for all, or one per cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    name: String,
    parameters: Vec<Vec<f64>>,
}

impl Material {
    /// `name` as in [`Material::NAMES`], one row of parameters or one row per cell.
    ///
    /// # Errors
    /// An unknown name; a row of the wrong length; a value that is not finite or not admissible.
    pub fn new(name: &str, parameters: Vec<Vec<f64>>) -> Result<Self, Error> {
        let expected = Self::parameter_names(name).ok_or_else(|| Error::UnknownLaw {
            name: name.to_string(),
            known: Self::NAMES.join(", "),
        })?;
        if parameters.is_empty() {
            return Err(Error::input(format!("law {name}: no parameters; give {expected:?}")));
        }
        for (row, values) in parameters.iter().enumerate() {
            check_parameters(name, row, expected, values)?;
        }
        Ok(Material { name: name.to_string(), parameters })
    }

    /// The law's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of its parameters.
    pub fn names(&self) -> &'static [&'static str] {
        Self::parameter_names(&self.name).unwrap_or_default()
    }

    /// Parameters, one row for all cells or one per cell.
    pub fn parameters(&self) -> &[Vec<f64>] {
        &self.parameters
    }

    /// The parameters of a cell.
    pub fn of_cell(&self, cell: usize) -> &[f64] {
        if self.parameters.len() == 1 { &self.parameters[0] } else { &self.parameters[cell] }
    }
}

/// Parameters that no law can do with at zero or below.
const POSITIVE: &[&str] = &["mu", "c1", "kappa", "c10", "c", "k1", "k2"];

fn check_parameters(law: &str, row: usize, names: &[&str], values: &[f64]) -> Result<(), Error> {
    if values.len() != names.len() {
        return Err(Error::input(format!(
            "law {law}: row {row} has {} parameters; it takes {names:?}",
            values.len()
        )));
    }
    for (name, &value) in names.iter().zip(values) {
        let must_be_positive = POSITIVE.contains(name);
        if !value.is_finite() || (value <= 0.0 && must_be_positive) {
            return Err(Error::input(format!(
                "law {law}: {name} = {value} in row {row}; it must be finite{}",
                if must_be_positive { " and positive" } else { "" }
            )));
        }
    }
    Ok(())
}

/// Declares the laws by name and lets generic code run on a [`Material`]'s concrete type.
macro_rules! laws {
    ($($name:literal, [$($parameter:literal),*], $type:ty, $make:expr;)*) => {
        impl Material {
            /// Names of the laws.
            pub const NAMES: &'static [&'static str] = &[$($name),*];

            /// Names of a law's parameters, in the order of a row.
            pub fn parameter_names(name: &str) -> Option<&'static [&'static str]> {
                match name {
                    $($name => Some(&[$($parameter),*]),)*
                    _ => None,
                }
            }

            /// Calls `visitor` with the function that makes the concrete law of a parameter row.
            pub fn visit<V: LawVisitor>(&self, visitor: V) -> V::Output {
                match self.name.as_str() {
                    $($name => {
                        let make: fn(&[f64]) -> $type = $make;
                        visitor.visit(make)
                    })*
                    other => unreachable!("law {other} was validated on construction"),
                }
            }
        }
    };
}
/// Generic code over laws, called once outside all loops.
pub trait LawVisitor {
    /// What the code returns.
    type Output;
    /// Runs with the law's constructor from a parameter row.
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) -> Self::Output;
}

laws! {
    "linear", ["mu", "lam"], Linear, |p| Linear { mu: p[0], lam: p[1] };
    "corotated", ["mu", "lam"], Corotated, |p| Corotated { mu: p[0], lam: p[1] };
    "saint_venant_kirchhoff", ["mu", "lam"], SaintVenantKirchhoff,
        |p| SaintVenantKirchhoff { mu: p[0], lam: p[1] };
    "neo_hookean", ["mu", "lam"], NeoHookean, |p| NeoHookean { mu: p[0], lam: p[1] };
    "mooney_rivlin J-1", ["c1", "c2", "kappa"], MooneyRivlin,
        |p| MooneyRivlin { c1: p[0], c2: p[1], kappa: p[2], volumetric: Volumetric::Jacobian };
    "mooney_rivlin J^2-1", ["c1", "c2", "kappa"], MooneyRivlin,
        |p| MooneyRivlin { c1: p[0], c2: p[1], kappa: p[2], volumetric: Volumetric::JacobianSquared };
    "mooney_rivlin ln J", ["c1", "c2", "kappa"], MooneyRivlin,
        |p| MooneyRivlin { c1: p[0], c2: p[1], kappa: p[2], volumetric: Volumetric::Logarithm };
    "yeoh", ["c10", "c20", "c30", "kappa"], Yeoh, |p| Yeoh { c: [p[0], p[1], p[2]], kappa: p[3] };
    "ogden", ["mu1", "mu2", "mu3", "alpha1", "alpha2", "alpha3", "kappa"], Ogden,
        |p| Ogden { mu: [p[0], p[1], p[2]], alpha: [p[3], p[4], p[5]], kappa: p[6] };
    "holzapfel_gasser_ogden",
        ["c", "k1", "k2", "dispersion", "kappa", "a0x", "a0y", "a0z", "a1x", "a1y", "a1z"],
        HolzapfelGasserOgden, |p| holzapfel_gasser_ogden(p, false);
    "holzapfel_gasser_ogden both ways",
        ["c", "k1", "k2", "dispersion", "kappa", "a0x", "a0y", "a0z", "a1x", "a1y", "a1z"],
        HolzapfelGasserOgden, |p| holzapfel_gasser_ogden(p, true);
}

fn holzapfel_gasser_ogden(p: &[f64], bear_compression: bool) -> HolzapfelGasserOgden {
    let fibres = [[p[5], p[6], p[7]], [p[8], p[9], p[10]]];
    let [c, k1, k2, dispersion, kappa] = [p[0], p[1], p[2], p[3], p[4]];
    HolzapfelGasserOgden { c, k1, k2, dispersion, kappa, fibres, bear_compression }
}
