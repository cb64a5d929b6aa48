//! An artery's wall: a ground substance with two families of fibres.
//!
//! Each half of the energy, `half` of the ground substance and one family, is a function of three invariants,
//! `I1, J` and `I4 = |F a|^2`, whose derivatives come from duals; the geometry is `invariants.rs` with
//! `dI4/dF = 2 (F a) (x) a` in the place of `dI2/dF`.

use super::expression::{Expression, Symbol};
use super::{Law, TangentBlocks};
use viscera_number::tensor::{
    Mat3, Vec3, cofactor, cross, determinant, dot, double_dot, mul_vector,
};
use viscera_number::unroll::{array, tabulate};
use viscera_number::{Gradient, Hessian, Scalar};

/// Holzapfel-Gasser-Ogden solid (J. Elasticity 61, 2000, 1; with dispersion J. R. Soc. Interface 3, 2006, 15):
/// `psi = c/2 (I1' - 3) + kappa/2 (J - 1)^2 + sum_i k1/(2 k2) (exp(k2 E_i^2) - 1)`,
/// `E_i = d (I1' - 3) + (1 - 3 d) (I4_i' - 1)`, with the isochoric `I1' = I1 J^-2/3`, `I4_i' = |F a_i|^2 J^-2/3`.
///
/// Fibres bear no compression: a family counts where `E_i >= 0`. The stress is continuous there, the tangent is not.
/// A power series keeps the families of its base state, and at rest that is all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HolzapfelGasserOgden {
    /// Shear modulus of the ground substance [Pa].
    pub c: f64,
    /// Stiffness of the fibres [Pa].
    pub k1: f64,
    /// How fast they stiffen.
    pub k2: f64,
    /// Dispersion `d` of their directions, from 0 (parallel) to 1/3 (isotropic).
    pub dispersion: f64,
    /// Bulk modulus at small strain [Pa].
    pub kappa: f64,
    /// Unit directions of the two families at rest.
    pub fibres: [[f64; 3]; 2],
    /// Whether fibres bear compression too: another law, but an analytic one.
    pub bear_compression: bool,
}

/// Strain up to which a slack fibre counts as at rest: above rounding, below any effect.
const SLACK: f64 = 1e-12;

#[allow(non_snake_case)]
impl HolzapfelGasserOgden {
    /// Half of the ground substance and one family of fibres.
    #[inline(always)]
    fn half<S: Scalar>(&self, I1: S, I4: S, J: S) -> S {
        let J_m23 = J.powf(-2.0 / 3.0);
        let shear = I1 * J_m23.clone() - 3.0;
        let along = I4 * J_m23 - 1.0;
        let mut E = shear.clone() * self.dispersion + along * (1.0 - 3.0 * self.dispersion);
        if !self.bear_compression {
            E = E.clone() * (E + SLACK).heaviside();
        }
        let fibres = ((E.square() * self.k2).exp() - 1.0) * (0.5 * self.k1 / self.k2);
        fibres + shear * (0.25 * self.c) + (J - 1.0).square() * (0.25 * self.kappa)
    }

    /// `F a` of each family, and the invariants of its half.
    #[inline(always)]
    fn families<S: Scalar>(&self, F: &Mat3<S>, Z: &Mat3<S>) -> [(Vec3<S>, [S; 3]); 2] {
        let (I1, J) = (double_dot(F, F), determinant(F, Z));
        self.fibres.map(|a| {
            let Fa = array!(3, |i| project(&F[i], &a));
            let I4 = dot(&Fa, &Fa);
            (Fa, [I1.clone(), I4, J.clone()])
        })
    }
}

#[allow(non_snake_case)]
impl Law for HolzapfelGasserOgden {
    const FORBIDS_INVERSION: bool = true;

    fn expression(&self) -> Option<Expression> {
        Some(Symbol::record(|[I1, _, J, I4, I6]| {
            self.half(I1.clone(), I4, J.clone()) + self.half(I1, I6, J)
        }))
    }

    #[inline(always)]
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S {
        let Z = cofactor(F);
        let [first, second] = self.families(F, &Z).map(|(_, [I1, I4, J])| self.half(I1, I4, J));
        first + second
    }

    /// `P = sum over halves of 2 psi_1 F + 2 psi_4 (F a) (x) a + psi_J Z`.
    #[inline(always)]
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S> {
        let Z = cofactor(F);
        let [first, second] = self.families(F, &Z).map(|(Fa, invariants)| {
            let [I1, I4, J] = Gradient::variables(invariants);
            (Fa, self.half(I1, I4, J).first)
        });
        let psi1 = (first.1[0].clone() + second.1[0].clone()) * 2.0;
        let psiJ = first.1[2].clone() + second.1[2].clone();
        let pull = [first, second].map(|(Fa, psi)| Fa.map(|x| x * psi[1].clone() * 2.0));
        tabulate!(|i, j| {
            let fibres =
                pull[0][i].clone() * self.fibres[0][j] + pull[1][i].clone() * self.fibres[1][j];
            psi1.clone() * F[i][j].clone() + psiJ.clone() * Z[i][j].clone() + fibres
        })
    }

    /// Second derivatives of each half on its directions `2F, 2 (F a) (x) a, Z`, plus first derivatives times the
    /// curvature of the invariants.
    #[inline(always)]
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> (Mat3<S>, TangentBlocks<S>) {
        let Z = cofactor(F);
        let families = self.families(F, &Z);
        let psi = families.clone().map(|(_, invariants)| {
            let [I1, I4, J] = Hessian::variables(invariants);
            self.half(I1, I4, J)
        });
        let both = |n: usize| psi[0].first[n].clone() + psi[1].first[n].clone();
        let (two_psi1, psiJ) = (both(0) * 2.0, both(2));
        let f: [Vec3<S>; 3] = array!(3, |a| mul_vector(F, &g[a]));
        let z: [Vec3<S>; 3] = array!(3, |a| mul_vector(&Z, &g[a]));
        // a . g for each family and vector.
        let s: [[S; 3]; 2] = array!(2, |m| array!(3, |a| project(&g[a], &self.fibres[m])));
        // The directions of each half along each vector, and their product with the second derivatives.
        let along: [[Mat3<S>; 3]; 2] = array!(2, |m| {
            array!(3, |a| {
                array!(3, |i| {
                    let pull = families[m].0[i].clone() * s[m][a].clone();
                    [f[a][i].clone() * 2.0, pull * 2.0, z[a][i].clone()]
                })
            })
        });
        let weighted: [[Mat3<S>; 3]; 2] = array!(2, |m| {
            let second = tabulate!(|p, q| psi[m].second(p, q));
            array!(3, |b| array!(3, |k| mul_vector(&second, &along[m][b][k])))
        });

        let blocks = blocks!(|a, b| {
            let mut diagonal = two_psi1.clone() * dot(&g[a], &g[b]);
            for m in 0..2 {
                let ss = s[m][a].clone() * s[m][b].clone();
                diagonal = diagonal + psi[m].first[1].clone() * ss * 2.0;
            }
            let spin = mul_vector(F, &cross(&g[a], &g[b])).map(|x| x * psiJ.clone());
            tabulate!(|i, k| {
                let entry = dot(&along[0][a][i], &weighted[0][b][k])
                    + dot(&along[1][a][i], &weighted[1][b][k]);
                // e_ikq is +1 for (i, k) = (0, 1), (1, 2), (2, 0).
                match (3 + k - i) % 3 {
                    0 => entry + diagonal.clone(),
                    1 => entry + spin[(6 - i - k) % 3].clone(),
                    _ => entry - spin[(6 - i - k) % 3].clone(),
                }
            })
        });
        (self.stress(F), blocks)
    }

    /// A dilatation leaves the isochoric part at rest.
    #[inline(always)]
    fn dilatation<S: Scalar>(&self, J: &S) -> S {
        (J.clone() - 1.0).square() * (0.5 * self.kappa)
    }

    #[inline(always)]
    fn pressure<S: Scalar>(&self, J: &S) -> S {
        (J.clone() - 1.0) * self.kappa
    }

    #[inline(always)]
    fn pressure_and_modulus<S: Scalar>(&self, J: &S) -> [S; 2] {
        [self.pressure(J), J.constant(self.kappa)]
    }
}

/// `v . a` for a fixed direction.
#[inline(always)]
fn project<S: Scalar>(v: &Vec3<S>, a: &[f64; 3]) -> S {
    v[0].clone() * a[0] + v[1].clone() * a[1] + v[2].clone() * a[2]
}
