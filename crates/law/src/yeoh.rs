use super::StrainEnergy;
use viscera_number::Scalar;

/// Yeoh's solid (Rubber Chem. Technol. 66, 1993, 754):
/// `psi = sum_i c_i0 (I1 J^-2/3 - 3)^i + kappa/2 (J - 1)^2`, `i = 1..3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yeoh {
    /// Coefficients [Pa]; the shear modulus is `2 c[0]`.
    pub c: [f64; 3],
    /// Bulk modulus at small strain [Pa].
    pub kappa: f64,
}

#[allow(non_snake_case)]
impl StrainEnergy for Yeoh {
    const USES_I2: bool = false;

    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, _I2: S, J: S) -> S {
        let x = I1 * J.powf(-2.0 / 3.0) - 3.0;
        let [c10, c20, c30] = self.c;
        let isochoric = ((x.clone() * c30 + c20) * x.clone() + c10) * x;
        isochoric + self.volumetric(J)
    }

    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        (J - 1.0).square() * (0.5 * self.kappa)
    }
}
