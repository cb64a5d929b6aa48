use super::StrainEnergy;
use viscera_number::Scalar;

/// Compressible neo-Hookean solid (paper A, eq. 37):
/// `psi = mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean {
    /// Shear modulus [Pa].
    pub mu: f64,
    /// First Lame constant [Pa].
    pub lam: f64,
}

#[allow(non_snake_case)]
impl StrainEnergy for NeoHookean {
    const USES_I2: bool = false;
    const DERIVATIVES_USE_I1: bool = false;

    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, _I2: S, J: S) -> S {
        let ln_J = J.ln();
        (I1 - 3.0) * (0.5 * self.mu) - ln_J.clone() * self.mu + ln_J.square() * (0.5 * self.lam)
    }
}
