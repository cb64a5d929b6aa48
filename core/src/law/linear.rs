use super::{Law, TangentBlocks};
use crate::number::Scalar;
use crate::tensor::{Mat3, Vec3, dot, spherical, tabulate, trace};

/// Linear elasticity: `P = lam tr(e) I + 2 mu e`, `e = (F + F^T)/2 - I`.
///
/// Exact for infinitesimal displacements only; it inflates whatever rotates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// Shear modulus [Pa].
    pub mu: f64,
    /// First Lame constant [Pa].
    pub lam: f64,
}

#[allow(non_snake_case)]
impl Law for Linear {
    const FORBIDS_INVERSION: bool = false;

    #[inline(always)]
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S {
        let e = strain(F);
        let squares = dot(&e[0], &e[0]) + dot(&e[1], &e[1]) + dot(&e[2], &e[2]);
        squares * self.mu + trace(&e).square() * (0.5 * self.lam)
    }

    #[inline(always)]
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S> {
        let e = strain(F);
        let pressure = spherical(&(trace(&e) * self.lam));
        tabulate(|i, j| e[i][j].clone() * (2.0 * self.mu) + pressure[i][j].clone())
    }

    #[inline(always)]
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 4]) -> (Mat3<S>, TangentBlocks<S>) {
        (self.stress(F), hooke(self.mu, self.lam, g))
    }
}

/// Hooke's tensor contracted with shape gradients:
/// `lam g_a (x) g_b + mu g_b (x) g_a + mu (g_a . g_b) I`.
#[inline(always)]
pub(super) fn hooke<S: Scalar>(mu: f64, lam: f64, g: &[Vec3<S>; 4]) -> TangentBlocks<S> {
    std::array::from_fn(|a| {
        std::array::from_fn(|b| {
            let diagonal = spherical(&(dot(&g[a], &g[b]) * mu));
            tabulate(|i, k| {
                g[a][i].clone() * g[b][k].clone() * lam
                    + g[b][i].clone() * g[a][k].clone() * mu
                    + diagonal[i][k].clone()
            })
        })
    })
}

#[inline(always)]
#[allow(non_snake_case)]
fn strain<S: Scalar>(F: &Mat3<S>) -> Mat3<S> {
    tabulate(|i, j| {
        let symmetric = (F[i][j].clone() + F[j][i].clone()) * 0.5;
        if i == j { symmetric - 1.0 } else { symmetric }
    })
}
