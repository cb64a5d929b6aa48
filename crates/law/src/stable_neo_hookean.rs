use super::StrainEnergy;
use viscera_number::Scalar;

/// Stable neo-Hookean solid (Smith, de Goes and Kim, ACM Trans. Graph. 37, 2018, 12, eq. 14):
/// `psi = m/2 (I1 - 3) + l/2 (J - a)^2 - m/2 ln(I1 + 1) - psi(rest)`, `a = 1 + 3/4 m/l`.
///
/// With `m = 4/3 mu` and `l = lam + 5/6 mu` it is Hooke's law at small strain (their section 3.4). The energy is finite
/// and smooth for every deformation, one turned inside out included (`J <= 0`): cells recover from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableNeoHookean {
    /// Shear modulus at small strain [Pa].
    pub mu: f64,
    /// First Lame constant at small strain [Pa].
    pub lam: f64,
}

#[allow(non_snake_case)]
impl StrainEnergy for StableNeoHookean {
    const USES_I2: bool = false;
    const FORBIDS_INVERSION: bool = false;

    #[inline(always)]
    fn psi<S: Scalar>(&self, I1: S, _I2: S, J: S) -> S {
        let (m, l) = (4.0 / 3.0 * self.mu, self.lam + 5.0 / 6.0 * self.mu);
        let a = 1.0 + 0.75 * m / l;
        let at_rest = 0.5 * l * (1.0 - a) * (1.0 - a);
        // ln(I1 + 1) - ln 4.
        let logarithm = ((I1.clone() + 1.0) * 0.25).ln();
        (I1 - 3.0 - logarithm) * (0.5 * m) + (J - a).square() * (0.5 * l) - at_rest
    }
}
