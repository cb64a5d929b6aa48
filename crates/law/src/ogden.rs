use super::StrainEnergy;
use viscera_number::Scalar;

/// Ogden's solid (Proc. R. Soc. Lond. A 326, 1972, 565) in the isochoric principal stretches `l_i = J^-1/3 lambda_i`:
/// `psi = sum_p mu_p/alpha_p (l_1^alpha_p + l_2^alpha_p + l_3^alpha_p - 3) + kappa/2 (J - 1)^2`.
///
/// The sum of powers is `tr(C^(alpha/2))` of the isochoric `C`, a smooth function of the invariants: no stretch is
/// ever computed, so coincident ones are nothing special. A term with `mu_p = 0` is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ogden {
    /// Moduli [Pa]; the shear modulus at small strain is half the sum of `mu_p alpha_p`.
    pub mu: [f64; 3],
    /// Exponents.
    pub alpha: [f64; 3],
    /// Bulk modulus at small strain [Pa].
    pub kappa: f64,
}

#[allow(non_snake_case)]
impl StrainEnergy for Ogden {
    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, I2: S, J: S) -> S {
        let J_m23 = J.powf(-2.0 / 3.0);
        let (I1, I2) = (I1 * J_m23.clone(), I2 * J_m23.square());
        let mut psi = self.volumetric(J);
        for (mu, alpha) in self.mu.into_iter().zip(self.alpha) {
            if mu != 0.0 {
                let powers = S::trace_of_power(&I1, &I2, 0.5 * alpha);
                psi = psi + (powers - 3.0) * (mu / alpha);
            }
        }
        psi
    }

    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        (J - 1.0).square() * (0.5 * self.kappa)
    }
}
