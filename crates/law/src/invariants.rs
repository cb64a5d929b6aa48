//! From `psi(I1, I2, J)` to stress and tangent: the geometry every strain energy shares.
//!
//! With `Z = cof F` and the tensor cross product `x` (`viscera_number::tensor`), `I2 = |Z|^2` gives
//!   dI1/dF = 2 F,   dI2/dF = 2 Z x F = 2 Y,   dJ/dF = Z,
//!   P = 2 psi_1 F + 2 psi_2 Y + psi_J Z.
//! The derivatives of `psi` come from duals in the three invariants, so the law is written once.

use super::expression::{Expression, Symbol};
use super::series::{self, Slopes, Uses};
use super::{
    Law, SharedSeries, StrainEnergy, TangentBlocks, TaylorCache, Template, determinant_curvature,
};
use viscera_number::tensor::{
    Mat3, Vec3, cofactor, cross, determinant, dot, double_dot, mul_vector, spherical, tensor_cross,
};
use viscera_number::unroll::{array, tabulate};
use viscera_number::{Hessian, Monomials, Real, Scalar};

#[allow(non_snake_case)]
impl<E: StrainEnergy> Law for E {
    const FORBIDS_INVERSION: bool = <E as StrainEnergy>::FORBIDS_INVERSION;

    fn expression(&self) -> Option<Expression> {
        Some(Symbol::record(|[I1, I2, J, _, _]| self.psi(I1, I2, J)))
    }

    fn template(&self, part: Option<f64>) -> Option<Template> {
        Some(Template::of_energy(self, part))
    }

    fn dilatation_template(&self, part: f64) -> Option<Template> {
        Some(Template::of_dilatation(self, part))
    }

    #[inline(always)]
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S {
        let Z = cofactor(F);
        let [I1, I2, J] = invariants::<Self, S>(F, &Z);
        self.psi(I1, I2, J)
    }

    #[inline(always)]
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S> {
        self.energy_and_stress(F).1
    }

    #[inline(always)]
    fn energy_and_stress<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        let Z = cofactor(F);
        let psi = self.gradient(invariants::<Self, S>(F, &Z));
        let [psi1, psi2, psiJ] = &psi.first;
        let P = assemble::<Self, S>(F, &Z, psi1, psi2, psiJ);
        (psi.value, P)
    }

    #[inline(always)]
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> (Mat3<S>, TangentBlocks<S>) {
        let Z = cofactor(F);
        let psi = self.hessian(invariants::<Self, S>(F, &Z));
        let [psi1, psi2, psiJ] = psi.first.clone();
        let P = assemble::<Self, S>(F, &Z, &psi1, &psi2, &psiJ);
        let blocks = contract::<Self, S>(F, &Z, &psi, g);
        (P, blocks)
    }

    #[inline(always)]
    fn volume_ratio<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        if E::VOLUME_IS_TRACE {
            return ((double_dot(F, F) - 1.0) * 0.5, F.clone());
        }
        let Z = cofactor(F);
        (determinant(F, &Z), Z)
    }

    #[inline(always)]
    fn volume_curvature<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> TangentBlocks<S> {
        if E::VOLUME_IS_TRACE {
            return blocks!(|a, b| spherical(&dot(&g[a], &g[b])));
        }
        determinant_curvature(F, g)
    }

    #[inline(always)]
    fn dilatation<S: Scalar>(&self, J: &S) -> S {
        self.volumetric(J.clone())
    }

    #[inline(always)]
    fn pressure<S: Scalar>(&self, J: &S) -> S {
        self.volumetric_slope(J)
    }

    #[inline(always)]
    fn pressure_and_modulus<S: Scalar>(&self, J: &S) -> [S; 2] {
        self.volumetric_slopes(J)
    }

    #[inline(always)]
    fn stress_series<T: Real>(
        &self,
        cache: &mut TaylorCache<T>,
        table: &'static Monomials,
        deformation: &[T],
        shared: SharedSeries<'_, T>,
        out: &mut [T],
    ) {
        let slopes = |invariants| self.gradient(invariants).first;
        let pressure = |J| self.pressure(&J);
        let uses = Uses::of::<Self>();
        let slopes =
            Slopes { uses, slopes: &slopes, pressure: &pressure, part: shared.part, cache };
        series::stress_series(slopes, table, [deformation, shared.pressure], out);
    }

    #[inline(always)]
    fn volume_series<T: Real>(&self, table: &'static Monomials, deformation: &[T], out: &mut [T]) {
        series::volume_series(Uses::of::<Self>(), table, deformation, out);
    }
}

/// `I1, I2, J`; `I2` is left zero for laws that do not use it.
#[inline(always)]
#[allow(non_snake_case)]
pub(super) fn invariants<E: StrainEnergy, S: Scalar>(F: &Mat3<S>, Z: &Mat3<S>) -> [S; 3] {
    let I2 = if E::USES_I2 { double_dot(Z, Z) } else { Z[0][0].constant(0.0) };
    [double_dot(F, F), I2, determinant(F, Z)]
}

/// `P = 2 psi_1 F + (2 psi_2 Z) x F + psi_J Z`.
#[inline(always)]
#[allow(non_snake_case)]
pub(super) fn assemble<E: StrainEnergy, S: Scalar>(
    F: &Mat3<S>,
    Z: &Mat3<S>,
    psi1: &S,
    psi2: &S,
    psiJ: &S,
) -> Mat3<S> {
    let P = tabulate!(|i, j| psi1.clone() * F[i][j].clone() * 2.0 + psiJ.clone() * Z[i][j].clone());
    if !E::USES_I2 {
        return P;
    }
    let W = tabulate!(|i, j| psi2.clone() * Z[i][j].clone() * 2.0);
    let Y = tensor_cross(&W, F);
    tabulate!(|i, j| P[i][j].clone() + Y[i][j].clone())
}

/// Tangent blocks: second derivatives of `psi` on the three directions `2F, 2Y, Z`, plus first
/// derivatives times the curvature of the invariants.
#[inline(always)]
#[allow(non_snake_case)]
pub(super) fn contract<E: StrainEnergy, S: Scalar>(
    F: &Mat3<S>,
    Z: &Mat3<S>,
    psi: &Hessian<S>,
    g: &[Vec3<S>; 3],
) -> TangentBlocks<S> {
    let Y = tensor_cross(Z, F);
    let f: [Vec3<S>; 3] = array!(3, |a| mul_vector(F, &g[a]));
    let z: [Vec3<S>; 3] = array!(3, |a| mul_vector(Z, &g[a]));
    let y: [Vec3<S>; 3] = array!(3, |a| mul_vector(&Y, &g[a]));
    let two_psi1 = psi.first[0].clone() * 2.0;
    let two_psi2 = psi.first[1].clone() * 2.0;
    let I1 = double_dot(F, F);
    // B = F F^T, the left Cauchy-Green tensor.
    let B = tabulate!(|i, k| dot(&F[i], &F[k]));

    // The directions along each vector times the second derivatives of psi.
    let weighted: [[[S; 3]; 3]; 3] = array!(3, |a| array!(3, |i| {
        let (f2, z, y2) = (f[a][i].clone() * 2.0, z[a][i].clone(), y[a][i].clone() * 2.0);
        array!(3, |n| {
            let sum = f2.clone() * psi.second(0, n) + z.clone() * psi.second(2, n);
            if E::USES_I2 { sum + y2.clone() * psi.second(1, n) } else { sum }
        })
    }));

    blocks!(|a, b| {
        let gg = dot(&g[a], &g[b]);
        // dZ/dF: e_ikq (F (g_a x g_b))_q.
        let spin = mul_vector(F, &cross(&g[a], &g[b]));
        let spin: Vec3<S> = array!(3, |q| spin[q].clone() * psi.first[2].clone());
        tabulate!(|i, k| {
            let [c0, c1, c2] = &weighted[a][i];
            let mut entry = c0.clone() * f[b][k].clone() * 2.0 + c2.clone() * z[b][k].clone();
            if i == k {
                entry = entry + two_psi1.clone() * gg.clone();
            } else {
                // e_ikq is +1 for (i, k) = (0, 1), (1, 2), (2, 0).
                let w = spin[(6 - i - k) % 3].clone();
                entry = if (i + 1) % 3 == k { entry + w } else { entry - w };
            }
            if E::USES_I2 {
                entry = entry + c1.clone() * y[b][k].clone() * 2.0;
                // d(I1 F - F F^T F)/dF, the same tensor as Y.
                let mut curvature = f[a][i].clone() * f[b][k].clone() * 2.0
                    - f[b][i].clone() * f[a][k].clone()
                    - B[i][k].clone() * gg.clone();
                if i == k {
                    curvature = curvature + I1.clone() * gg.clone() - dot(&f[a], &f[b]);
                }
                entry = entry + two_psi2.clone() * curvature;
            }
            entry
        })
    })
}
