use super::linear::{beside_cluster, hooke_dilatation, hooke_pressure};
use super::{Law, SharedSeries, TangentBlocks, TaylorCache, Template, jets, write_stress_series};
use viscera_number::tensor::{
    Mat3, Vec3, cofactor, cross, determinant, dot, double_dot, mul_vector, spherical, trace,
    transpose_mul, transpose_mul_vector,
};
use viscera_number::unroll::{array, tabulate};
use viscera_number::{Jet, Monomials, Real, Scalar};

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
        self.stress_beside(F, &rotation(F))
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

    #[inline(always)]
    fn stress_series<T: Real>(
        &self,
        _: &mut TaylorCache<T>,
        table: &'static Monomials,
        deformation: &[T],
        shared: SharedSeries<'_, T>,
        out: &mut [T],
    ) {
        let F = jets(table, deformation);
        let R = rotation_series(&F);
        let P = self.stress_beside(&F, &R);
        let volume_ratio = || (double_dot(&R, &F) - 2.0, R.clone());
        write_stress_series(self, (P, volume_ratio), table, shared, out);
    }

    #[inline(always)]
    fn volume_series<T: Real>(&self, table: &'static Monomials, deformation: &[T], out: &mut [T]) {
        let F = jets(table, deformation);
        let J = double_dot(&rotation_series(&F), &F) - 2.0;
        for (c, value) in out.iter_mut().enumerate() {
            *value = J.coefficient(c);
        }
    }
}

#[allow(non_snake_case)]
impl Corotated {
    /// `P` from `F` and its rotation.
    #[inline(always)]
    fn stress_beside<S: Scalar>(&self, F: &Mat3<S>, R: &Mat3<S>) -> Mat3<S> {
        let pressure = (double_dot(R, F) - 3.0) * self.lam;
        tabulate!(|i, j| {
            (F[i][j].clone() - R[i][j].clone()) * (2.0 * self.mu)
                + pressure.clone() * R[i][j].clone()
        })
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

/// Steps that bring stretches between 1/30 and 30 to round-off, far beyond the law's use.
const STEPS: usize = 12;

/// The rotation of the polar decomposition by Higham's Newton iteration `R <- (R + R^-T)/2`.
///
/// The only operations are products and a reciprocal, so it serves power series as well.
#[inline(always)]
#[allow(non_snake_case)]
fn rotation<S: Scalar>(F: &Mat3<S>) -> Mat3<S> {
    let mut R = F.clone();
    for _ in 0..STEPS {
        R = nearer_rotation(&R);
    }
    R
}

/// A step of Higham's iteration.
#[inline(always)]
#[allow(non_snake_case)]
fn nearer_rotation<S: Scalar>(R: &Mat3<S>) -> Mat3<S> {
    let Z = cofactor(R);
    let scale = determinant(R, &Z).recip() * 0.5;
    tabulate!(|i, j| R[i][j].clone() * 0.5 + scale.clone() * Z[i][j].clone())
}

/// The rotation of a series: once its constants are a rotation, every step doubles the number of correct orders, from
/// none. At rest they are one from the start.
#[inline(always)]
#[allow(non_snake_case)]
fn rotation_series<T: Real>(F: &Mat3<Jet<T>>) -> Mat3<Jet<T>> {
    let order = F[0][0].table().order();
    let mut R = F.clone();
    for _ in 0..steps_to_rotation(F) + (order + 1).next_power_of_two().ilog2() as usize {
        R = nearer_rotation(&R);
    }
    R
}

/// Steps after which the constants of a series are a rotation to rounding: the error that a step leaves is the square of
/// what it changes.
#[inline(always)]
#[allow(non_snake_case)]
fn steps_to_rotation<T: Real>(F: &Mat3<Jet<T>>) -> usize {
    let mut R: Mat3<T> = tabulate!(|i, j| F[i][j].coefficient(0));
    for steps in 0..STEPS {
        let next = nearer_rotation(&R);
        if next == R {
            return steps;
        }
        let change = tabulate!(|i, j| next[i][j] - R[i][j]);
        if double_dot(&change, &change) + 1.0 == T::splat(1.0) {
            return steps + 1;
        }
        R = next;
    }
    STEPS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// About a deformation with stretches of about 0.5 to 2, or about rest.
    #[allow(non_snake_case)]
    fn series(order: usize, is_at_rest: bool) -> Mat3<Jet<f64>> {
        let table = Monomials::of(3, order);
        let at = [[1.7, 0.4, -0.2], [-0.6, 0.9, 0.5], [0.1, -0.3, 0.8]];
        tabulate!(|i, j| {
            let unit = f64::from(u8::from(i == j));
            let c = (0..table.len()).map(|c| match c {
                0 if is_at_rest => unit,
                0 => at[i][j],
                _ => 0.2 * ((c + 7 * i + 3 * j) as f64).sin(),
            });
            Jet::new(table, c.collect::<Vec<_>>())
        })
    }

    #[test]
    #[allow(non_snake_case)]
    fn few_steps_give_the_rotation_of_a_series() {
        assert_eq!(steps_to_rotation(&series(5, true)), 0);
        for (order, is_at_rest) in (1..=8).flat_map(|order| [(order, true), (order, false)]) {
            let F = series(order, is_at_rest);
            let (few, many) = (rotation_series(&F), rotation(&F));
            let RtR = transpose_mul(&few, &few);
            let U = transpose_mul(&few, &F);
            for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
                for c in 0..F[0][0].table().len() {
                    let unit = if i == j && c == 0 { 1.0 } else { 0.0 };
                    let scale = 1.0 + U[i][j].coefficient(c).abs();
                    let near =
                        |a: f64, b: f64| assert!((a - b).abs() < 1e-10 * scale, "{order} {c}");
                    near(RtR[i][j].coefficient(c), unit);
                    near(U[i][j].coefficient(c), U[j][i].coefficient(c));
                    near(few[i][j].coefficient(c), many[i][j].coefficient(c));
                }
            }
        }
    }
}
