use super::StrainEnergy;
use viscera_number::Scalar;

/// Arruda and Boyce's eight-chain solid (J. Mech. Phys. Solids 41, 1993, 389), the five terms of their series:
/// `psi = m sum_i C_i N^(1-i) (I1'^i - 3^i) + kappa/2 (J - 1)^2`, `N = lambda_m^2`, `I1' = I1 J^-2/3`,
/// `C = 1/2, 1/20, 11/1050, 19/7000, 519/673750`.
///
/// `m` is such that `mu` is the shear modulus at small strain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArrudaBoyce {
    /// Shear modulus at small strain [Pa].
    pub mu: f64,
    /// Stretch at which the chains lock.
    pub lambda_m: f64,
    /// Bulk modulus at small strain [Pa].
    pub kappa: f64,
}

/// `C_i`.
const C: [f64; 5] = [1.0 / 2.0, 1.0 / 20.0, 11.0 / 1050.0, 19.0 / 7000.0, 519.0 / 673_750.0];

#[allow(non_snake_case)]
impl StrainEnergy for ArrudaBoyce {
    const USES_I2: bool = false;

    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, _I2: S, J: S) -> S {
        let N = self.lambda_m * self.lambda_m;
        // C_i N^(1-i), and twice the slope of the sum at I1' = 3: the shear modulus of m = 1.
        let [c1, c2, c3, c4, c5] =
            [C[0], C[1] / N, C[2] / (N * N), C[3] / N.powi(3), C[4] / N.powi(4)];
        let shear = 2.0 * (c1 + 6.0 * c2 + 27.0 * c3 + 108.0 * c4 + 405.0 * c5);
        let x = I1 * J.powf(-2.0 / 3.0);
        let sum =
            ((((x.clone() * c5 + c4) * x.clone() + c3) * x.clone() + c2) * x.clone() + c1) * x;
        let at_rest = ((((3.0 * c5 + c4) * 3.0 + c3) * 3.0 + c2) * 3.0 + c1) * 3.0;
        (sum - at_rest) * (self.mu / shear) + self.volumetric(J)
    }

    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        (J - 1.0).square() * (0.5 * self.kappa)
    }
}
