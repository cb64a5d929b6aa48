use super::linear::{beside_cluster, hooke_dilatation, hooke_pressure};
use super::{Law, TangentBlocks, Template};
use viscera_number::Scalar;
use viscera_number::tensor::{
    Mat3, Vec3, cofactor, cross, determinant, dot, double_dot, mul_vector, spherical, trace,
    transpose_mul, transpose_mul_vector,
};
use viscera_number::unroll::{array, tabulate};

/// Corotated linear elasticity: Hooke's law in the frame of the rotation `R` of `F = R U`,
/// `psi = mu |F - R|^2 + lam/2 (tr(R^T F) - 3)^2`.
///
/// For a linear tetrahedron this is exactly the stiffness-warping method
/// (*Implementation and Evaluation of Hyperelastic Model for Surgical Simulator and Navigation*),
/// with the exact tangent: the variation of `R` is not neglected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corotated {
    /// Shear modulus [Pa].
    pub mu: f64,
    /// First Lame constant [Pa].
    pub lam: f64,
}

#[allow(non_snake_case)]
impl Law for Corotated {
    const FORBIDS_INVERSION: bool = true;

    fn template(&self, part: Option<f64>) -> Option<Template> {
        Some(Template::Corotated(beside_cluster(self.mu, self.lam, part.unwrap_or(0.0))))
    }

    #[inline(always)]
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S {
        let R = rotation(F);
        let stretch = tabulate!(|i, j| F[i][j].clone() - R[i][j].clone());
        let dilation = double_dot(&R, F) - 3.0;
        double_dot(&stretch, &stretch) * self.mu + dilation.square() * (0.5 * self.lam)
    }

    /// `P = 2 mu (F - R) + lam (tr(R^T F) - 3) R`; the variation of `R` drops out.
    #[inline(always)]
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S> {
        let R = rotation(F);
        let pressure = (double_dot(&R, F) - 3.0) * self.lam;
        tabulate!(|i, j| {
            (F[i][j].clone() - R[i][j].clone()) * (2.0 * self.mu)
                + pressure.clone() * R[i][j].clone()
        })
    }

    /// `dP = 2 mu dF + lam (R : dF) R + (lam (tr U - 3) - 2 mu) dR`.
    #[inline(always)]
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> (Mat3<S>, TangentBlocks<S>) {
        let R = rotation(F);
        let factor = (double_dot(&R, F) - 3.0) * self.lam - 2.0 * self.mu;
        let Rg: [Vec3<S>; 3] = array!(3, |a| mul_vector(&R, &g[a]));
        let dR = spin(F, &R, g);
        let blocks = blocks!(|a, b| {
            let gg = dot(&g[a], &g[b]) * (2.0 * self.mu);
            tabulate!(|i, k| {
                let pressure = Rg[a][i].clone() * Rg[b][k].clone() * self.lam;
                let entry = pressure + factor.clone() * dR[a][b][i][k].clone();
                if i == k { entry + gg.clone() } else { entry }
            })
        });
        (self.stress(F), blocks)
    }

    /// `J = 1 + tr(R^T F - I)`, whose gradient is `R`: the variation of `R` drops out.
    #[inline(always)]
    fn volume_ratio<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        let R = rotation(F);
        (double_dot(&R, F) - 2.0, R)
    }

    #[inline(always)]
    fn volume_curvature<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> TangentBlocks<S> {
        spin(F, &rotation(F), g)
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

/// `dR/dF` contracted with three vectors: `dR = R [w]_x` with `(tr U I - U) w = axl(R^T dF - dF^T R)`.
#[inline(always)]
#[allow(non_snake_case)]
fn spin<S: Scalar>(F: &Mat3<S>, R: &Mat3<S>, g: &[Vec3<S>; 3]) -> TangentBlocks<S> {
    let U = transpose_mul(R, F);
    let diagonal = spherical(&trace(&U));
    let A = tabulate!(|i, j| diagonal[i][j].clone() - U[i][j].clone());
    // The cofactor of a symmetric tensor is its inverse times its determinant.
    let cof_A = cofactor(&A);
    let per_det_A = determinant(&A, &cof_A).recip();
    let unit = |k: usize| array!(3, |i| per_det_A.constant((i == k) as u8 as f64));
    blocks!(|a, b| {
        let columns: [Vec3<S>; 3] = array!(3, |k| {
            // dF = e_k (x) g_b: R^T dF = r (x) g_b with r = R^T e_k; its axial vector is g_b x r.
            let r = transpose_mul_vector(R, &unit(k));
            let w = mul_vector(&cof_A, &cross(&g[b], &r));
            mul_vector(R, &cross(&w, &g[a])).map(|entry| entry * per_det_A.clone())
        });
        tabulate!(|i, k| columns[k][i].clone())
    })
}

/// The rotation of the polar decomposition by Higham's Newton iteration `R <- (R + R^-T)/2`.
///
/// The only operations are products and a reciprocal, so it serves power series as well: each
/// step doubles the number of correct orders. Twelve steps bring stretches between 1/30 and 30
/// to round-off, far beyond the law's use.
#[inline(always)]
#[allow(non_snake_case)]
fn rotation<S: Scalar>(F: &Mat3<S>) -> Mat3<S> {
    let mut R = F.clone();
    for _ in 0..12 {
        let Z = cofactor(&R);
        let scale = determinant(&R, &Z).recip() * 0.5;
        R = tabulate!(|i, j| R[i][j].clone() * 0.5 + scale.clone() * Z[i][j].clone());
    }
    R
}
