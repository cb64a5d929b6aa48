use super::StrainEnergy;
use viscera_number::Scalar;

/// Fung's exponential for an isotropic tissue (Demiray, J. Biomech. 5, 1972, 309; Humphrey, Cardiovascular Solid
/// Mechanics, 2002): `psi = mu/(2 b) (exp(b (I1' - 3)) - 1) + kappa/2 (J - 1)^2`, `I1' = I1 J^-2/3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fung {
    /// Shear modulus at small strain [Pa].
    pub mu: f64,
    /// How fast it stiffens.
    pub b: f64,
    /// Bulk modulus at small strain [Pa].
    pub kappa: f64,
}

#[allow(non_snake_case)]
impl StrainEnergy for Fung {
    const USES_I2: bool = false;

    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, _I2: S, J: S) -> S {
        let exponential = ((I1 * J.powf(-2.0 / 3.0) - 3.0) * self.b).exp();
        (exponential - 1.0) * (0.5 * self.mu / self.b) + self.volumetric(J)
    }

    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        (J - 1.0).square() * (0.5 * self.kappa)
    }
}
