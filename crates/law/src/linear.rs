use super::{Law, TangentBlocks, Template};
use viscera_number::Scalar;
use viscera_number::tensor::{Mat3, Vec3, dot, spherical, trace};
use viscera_number::unroll::tabulate;

/// Its name. It is the one law that is not objective, and the one whose tangent is the same everywhere.
pub const LINEAR: &str = "linear";

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

    fn template(&self, part: Option<f64>) -> Option<Template> {
        Some(Template::Linear(beside_cluster(self.mu, self.lam, part.unwrap_or(0.0))))
    }

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
        tabulate!(|i, j| e[i][j].clone() * (2.0 * self.mu) + pressure[i][j].clone())
    }

    #[inline(always)]
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> (Mat3<S>, TangentBlocks<S>) {
        (self.stress(F), hooke(self.mu, self.lam, g))
    }

    /// `J = 1 + tr e`.
    #[inline(always)]
    fn volume_ratio<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        (trace(F) - 2.0, spherical(&F[0][0].constant(1.0)))
    }

    #[inline(always)]
    fn volume_curvature<S: Scalar>(&self, F: &Mat3<S>, _g: &[Vec3<S>; 3]) -> TangentBlocks<S> {
        blocks!(|_, _| spherical(&F[0][0].constant(0.0)))
    }

    #[inline(always)]
    fn dilatation<S: Scalar>(&self, J: &S) -> S {
        hooke_dilatation(self.mu, self.lam, J)
    }

    #[inline(always)]
    fn pressure<S: Scalar>(&self, J: &S) -> S {
        let [pressure, _] = hooke_pressure(self.mu, self.lam, J);
        pressure
    }

    #[inline(always)]
    fn pressure_and_modulus<S: Scalar>(&self, J: &S) -> [S; 2] {
        hooke_pressure(self.mu, self.lam, J)
    }
}

/// Hooke's tensor contracted with shape gradients:
/// `lam g_a (x) g_b + mu g_b (x) g_a + mu (g_a . g_b) I`.
#[inline(always)]
fn hooke<S: Scalar>(mu: f64, lam: f64, g: &[Vec3<S>; 3]) -> TangentBlocks<S> {
    blocks!(|a, b| {
        let diagonal = spherical(&(dot(&g[a], &g[b]) * mu));
        tabulate!(|i, k| {
            g[a][i].clone() * g[b][k].clone() * lam
                + g[b][i].clone() * g[a][k].clone() * mu
                + diagonal[i][k].clone()
        })
    })
}

/// Lame's constants without a part of the bulk modulus, which is constant.
pub(super) fn beside_cluster(mu: f64, lam: f64, part: f64) -> [f64; 2] {
    [mu, lam - part * (lam + 2.0 / 3.0 * mu)]
}

/// `U = K/2 (J - 1)^2`, `K = lam + 2 mu / 3`.
#[inline(always)]
#[allow(non_snake_case)]
pub(super) fn hooke_dilatation<S: Scalar>(mu: f64, lam: f64, J: &S) -> S {
    (J.clone() - 1.0).square() * (0.5 * lam + mu / 3.0)
}

/// Its first two derivatives.
#[inline(always)]
#[allow(non_snake_case)]
pub(super) fn hooke_pressure<S: Scalar>(mu: f64, lam: f64, J: &S) -> [S; 2] {
    let K = lam + 2.0 / 3.0 * mu;
    [(J.clone() - 1.0) * K, J.constant(K)]
}

#[inline(always)]
#[allow(non_snake_case)]
fn strain<S: Scalar>(F: &Mat3<S>) -> Mat3<S> {
    tabulate!(|i, j| {
        let symmetric = (F[i][j].clone() + F[j][i].clone()) * 0.5;
        if i == j { symmetric - 1.0 } else { symmetric }
    })
}
