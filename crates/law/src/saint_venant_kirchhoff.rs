use super::StrainEnergy;
use viscera_number::Scalar;

/// Saint Venant-Kirchhoff solid: `psi = lam/2 (tr E)^2 + mu tr E^2`, `E = (C - I) / 2`.
///
/// Geometrically nonlinear, materially linear. It softens without bound in compression and has
/// equilibria with cells turned inside out: a flaw of the law, not of a solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaintVenantKirchhoff {
    /// Shear modulus [Pa].
    pub mu: f64,
    /// First Lame constant [Pa].
    pub lam: f64,
}

#[allow(non_snake_case)]
impl StrainEnergy for SaintVenantKirchhoff {
    const VOLUME_IS_TRACE: bool = true;

    /// `tr E = (I1 - 3) / 2` and `tr E^2 = (tr C^2 - 2 I1 + 3) / 4` with `tr C^2 = I1^2 - 2 I2`.
    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, I2: S, _J: S) -> S {
        let trace_E = (I1.clone() - 3.0) * 0.5;
        let trace_E2 = (I1.square() - I2 * 2.0 - I1 * 2.0 + 3.0) * 0.25;
        trace_E.square() * (0.5 * self.lam) + trace_E2 * self.mu
    }

    /// `K/2 (tr E)^2`, as `tr E^2 = (tr E)^2 / 3` in a dilatation.
    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        (J - 1.0).square() * (0.5 * self.lam + self.mu / 3.0)
    }
}
