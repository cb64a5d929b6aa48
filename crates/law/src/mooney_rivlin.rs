use super::StrainEnergy;
use viscera_number::Scalar;

/// Nearly incompressible Mooney-Rivlin solid
/// (*Implementation and Evaluation of Hyperelastic Model for Surgical Simulator and Navigation*):
/// `psi = c1 (I1 J^-2/3 - 3) + c2 (I2 J^-4/3 - 3) + W_vol(J)`.
///
/// That paper's linear tetrahedron with constant pressure is condensed exactly: `J` is constant in
/// the cell, so the pressure `l = alpha W^V` is eliminated cell by cell and leaves
/// `W_vol = alpha/2 (W^V)^2`, which with `W^V = J^2 - 1` means `kappa = 4 alpha`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MooneyRivlin {
    /// First coefficient [Pa].
    pub c1: f64,
    /// Second coefficient [Pa]; the shear modulus is `2 (c1 + c2)`.
    pub c2: f64,
    /// Bulk modulus at small strain [Pa].
    pub kappa: f64,
    /// The volumetric energy.
    pub volumetric: Volumetric,
}

/// The volumetric energy `W_vol(J)`; all agree to second order at `J = 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Volumetric {
    /// `kappa/2 (J - 1)^2`.
    Jacobian,
    /// `alpha/2 (J^2 - 1)^2` with `kappa = 4 alpha`: the constants of that paper.
    JacobianSquared,
    /// `kappa/2 (ln J)^2`.
    Logarithm,
}

#[allow(non_snake_case)]
impl StrainEnergy for MooneyRivlin {
    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, I2: S, J: S) -> S {
        let J_m23 = J.powf(-2.0 / 3.0);
        let isochoric =
            (I1 * J_m23.clone() - 3.0) * self.c1 + (I2 * J_m23.square() - 3.0) * self.c2;
        isochoric + self.volumetric(J)
    }

    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        let (half_kappa, eighth_kappa) = (0.5 * self.kappa, 0.125 * self.kappa);
        match self.volumetric {
            Volumetric::Jacobian => (J - 1.0).square() * half_kappa,
            Volumetric::JacobianSquared => (J.square() - 1.0).square() * eighth_kappa,
            Volumetric::Logarithm => J.ln().square() * half_kappa,
        }
    }
}
