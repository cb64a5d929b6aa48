use super::StrainEnergy;
use viscera_number::Scalar;

/// Veronda and Westmann's skin (J. Biomech. 3, 1970, 111):
/// `psi = c1 (exp(c2 (I1' - 3)) - 1) - c1 c2/2 (I2' - 3) + kappa/2 (J - 1)^2`, `I1' = I1 J^-2/3`, `I2' = I2 J^-4/3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerondaWestmann {
    /// Stiffness [Pa]; the shear modulus at small strain is `c1 c2`.
    pub c1: f64,
    /// How fast it stiffens.
    pub c2: f64,
    /// Bulk modulus at small strain [Pa].
    pub kappa: f64,
}

#[allow(non_snake_case)]
impl StrainEnergy for VerondaWestmann {
    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, I2: S, J: S) -> S {
        let J_m23 = J.powf(-2.0 / 3.0);
        let first = ((I1 * J_m23.clone() - 3.0) * self.c2).exp() - 1.0;
        let second = I2 * J_m23.square() - 3.0;
        first * self.c1 - second * (0.5 * self.c1 * self.c2) + self.volumetric(J)
    }

    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        (J - 1.0).square() * (0.5 * self.kappa)
    }
}
