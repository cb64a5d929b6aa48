//! Energies of fibres: `psi(I1, I2, J, I4, I6)` with `I4 = |F a|^2`, `I6 = |F b|^2` along two directions at rest.
//!
//! The isotropic part of the geometry is `invariants.rs`; with `dI4/dF = 2 (F a) (x) a` a family adds
//!   P += 2 psi_4 (F a) (x) a,
//! and to the tangent its products with all other directions, and `2 psi_4 a (x) a` along the three axes.

use super::expression::{Expression, Symbol};
use super::invariants::{assemble, contract, invariants};
use super::{Law, StrainEnergy, TangentBlocks};
use viscera_number::tensor::{Mat3, Vec3, cofactor, dot, mul_vector, tensor_cross};
use viscera_number::unroll::{array, tabulate};
use viscera_number::{Hessian, Scalar};

/// Value, five first derivatives, and second derivatives row by row of the upper triangle, in `I1, I2, J, I4, I6`.
pub(super) const FIRST: usize = 6;
/// See [`FIRST`].
pub(super) const SECOND: usize = 21;

/// A strain energy of fibres.
#[allow(non_snake_case)]
pub(super) trait FibreEnergy: Copy + Send + Sync {
    /// Says which of the isotropic invariants count.
    type Isotropic: StrainEnergy;

    /// Unit directions at rest.
    fn fibres(&self) -> [[f64; 3]; 2];
    /// `psi(I1, I2, J, I4, I6)`.
    fn psi<S: Scalar>(&self, invariants: [S; 5]) -> S;
    /// With first derivatives.
    fn first<S: Scalar>(&self, invariants: [S; 5]) -> [S; FIRST];
    /// With first and second derivatives.
    fn second<S: Scalar>(&self, invariants: [S; 5]) -> [S; SECOND];
    /// `U(J)`, `U'(J)` and `U''(J)` of a dilatation that fibres feel least.
    fn volumetric<S: Scalar>(&self, J: &S) -> [S; 3];
}

/// A [`FibreEnergy`] as a law.
#[derive(Clone, Copy)]
pub(super) struct Fibres<E>(pub E);

/// `F a` of both families, and all invariants.
#[inline(always)]
#[allow(non_snake_case, clippy::type_complexity)]
fn all_invariants<E: FibreEnergy, S: Scalar>(
    law: &E,
    F: &Mat3<S>,
    Z: &Mat3<S>,
) -> ([Vec3<S>; 2], [S; 5]) {
    let [I1, I2, J] = invariants::<E::Isotropic, S>(F, Z);
    let [a, b] = law.fibres();
    let (Fa, Fb) = (array!(3, |i| project(&F[i], &a)), array!(3, |i| project(&F[i], &b)));
    let (I4, I6) = (dot(&Fa, &Fa), dot(&Fb, &Fb));
    ([Fa, Fb], [I1, I2, J, I4, I6])
}

/// `v . a` for a fixed direction.
#[inline(always)]
fn project<S: Scalar>(v: &Vec3<S>, a: &[f64; 3]) -> S {
    v[0].clone() * a[0] + v[1].clone() * a[1] + v[2].clone() * a[2]
}

/// The stress of first derivatives `psi_1, psi_2, psi_J, psi_4, psi_6`.
#[inline(always)]
#[allow(non_snake_case)]
fn stress<E: FibreEnergy, S: Scalar>(
    law: &E,
    F: &Mat3<S>,
    Z: &Mat3<S>,
    Fa: &[Vec3<S>; 2],
    psi: [&S; 5],
) -> Mat3<S> {
    let P = assemble::<E::Isotropic, S>(F, Z, psi[0], psi[1], psi[2]);
    let fibres = law.fibres();
    let pull: [Vec3<S>; 2] =
        array!(2, |m| array!(3, |i| Fa[m][i].clone() * psi[3 + m].clone() * 2.0));
    tabulate!(|i, j| P[i][j].clone()
        + pull[0][i].clone() * fibres[0][j]
        + pull[1][i].clone() * fibres[1][j])
}

#[allow(non_snake_case)]
impl<E: FibreEnergy> Law for Fibres<E> {
    const FORBIDS_INVERSION: bool = true;

    fn expression(&self) -> Option<Expression> {
        Some(Symbol::record(|invariants| self.0.psi(invariants)))
    }

    #[inline(always)]
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S {
        let (_, x) = all_invariants(&self.0, F, &cofactor(F));
        self.0.psi(x)
    }

    #[inline(always)]
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S> {
        self.energy_and_stress(F).1
    }

    #[inline(always)]
    fn energy_and_stress<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        let Z = cofactor(F);
        let (Fa, x) = all_invariants(&self.0, F, &Z);
        let [psi, p1, p2, pJ, p4, p6] = self.0.first(x);
        let P = stress(&self.0, F, &Z, &Fa, [&p1, &p2, &pJ, &p4, &p6]);
        (psi, P)
    }

    #[inline(always)]
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> (Mat3<S>, TangentBlocks<S>) {
        let Z = cofactor(F);
        let (Fa, x) = all_invariants(&self.0, F, &Z);
        // Rows of the upper triangle: 11 12 1J 14 16, 22 2J 24 26, JJ J4 J6, 44 46, 66.
        let [
            psi,
            p1,
            p2,
            pJ,
            p4,
            p6,
            p11,
            p12,
            p1J,
            p14,
            p16,
            p22,
            p2J,
            p24,
            p26,
            pJJ,
            pJ4,
            pJ6,
            p44,
            p46,
            p66,
        ] = self.0.second(x);
        let P = stress(&self.0, F, &Z, &Fa, [&p1, &p2, &pJ, &p4, &p6]);
        let hessian =
            Hessian { value: psi, first: [p1, p2, pJ], second: [p11, p12, p1J, p22, p2J, pJJ] };
        let isotropic = contract::<E::Isotropic, S>(F, &Z, &hessian, g);
        let (mixed, own, first) =
            ([[p14, p24, pJ4], [p16, p26, pJ6]], [[p44, p46.clone()], [p46, p66]], [p4, p6]);

        let fibres = self.0.fibres();
        let Y = tensor_cross(&Z, F);
        // a . g, and the directions 2 (F a) (a . g), of each family and vector.
        let s: [[S; 3]; 2] = array!(2, |m| array!(3, |a| project(&g[a], &fibres[m])));
        let pull: [[Vec3<S>; 3]; 2] =
            array!(2, |m| array!(3, |a| array!(3, |i| Fa[m][i].clone() * s[m][a].clone() * 2.0)));
        // What the other directions 2 F g, 2 Y g, Z g give along those, weighted.
        let along: [[Vec3<S>; 3]; 2] = array!(2, |m| {
            array!(3, |a| {
                let (f, y, z) =
                    (mul_vector(F, &g[a]), mul_vector(&Y, &g[a]), mul_vector(&Z, &g[a]));
                array!(3, |i| f[i].clone() * mixed[m][0].clone() * 2.0
                    + y[i].clone() * mixed[m][1].clone() * 2.0
                    + z[i].clone() * mixed[m][2].clone())
            })
        });
        let both: [[Vec3<S>; 3]; 2] = array!(2, |m| {
            array!(3, |a| array!(3, |i| pull[0][a][i].clone() * own[m][0].clone()
                + pull[1][a][i].clone() * own[m][1].clone()))
        });
        let blocks = blocks!(|a, b| {
            let axial = first[0].clone() * s[0][a].clone() * s[0][b].clone() * 2.0
                + first[1].clone() * s[1][a].clone() * s[1][b].clone() * 2.0;
            tabulate!(|i, k| {
                let entry = |m: usize| {
                    along[m][a][i].clone() * pull[m][b][k].clone()
                        + pull[m][a][i].clone() * along[m][b][k].clone()
                        + pull[m][a][i].clone() * both[m][b][k].clone()
                };
                let sum = isotropic[a][b][i][k].clone() + entry(0) + entry(1);
                if i == k { sum + axial.clone() } else { sum }
            })
        });
        (P, blocks)
    }

    #[inline(always)]
    fn dilatation<S: Scalar>(&self, J: &S) -> S {
        let [U, _, _] = self.0.volumetric(J);
        U
    }

    #[inline(always)]
    fn pressure<S: Scalar>(&self, J: &S) -> S {
        let [_, slope, _] = self.0.volumetric(J);
        slope
    }

    #[inline(always)]
    fn pressure_and_modulus<S: Scalar>(&self, J: &S) -> [S; 2] {
        let [_, slope, curvature] = self.0.volumetric(J);
        [slope, curvature]
    }
}
