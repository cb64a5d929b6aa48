//! Constitutive laws.
//!
//! An isotropic law is a strain energy `psi(I1, I2, J)` written once ([`StrainEnergy`]); stress, tangent and power
//! series follow from it through `invariants.rs`. Laws of another kind (linear, corotated) implement [`Law`], the layer
//! above, directly. Users of a law hold a [`Material`] and call its [`LawKernels`]. A new law is a file here, one row
//! of [`ROWS`] and one line of tests.

/// The blocks `f(a, b)` for `a <= b` of `blocks!(|a, b| f(a, b))`; those below the diagonal, which are never read,
/// repeat them.
macro_rules! blocks {
    (|$a:pat_param, $b:pat_param| $f:expr) => {{
        let aa = $crate::blocks!(@ $a, $b, 0, 0, $f);
        let ab = $crate::blocks!(@ $a, $b, 0, 1, $f);
        let ac = $crate::blocks!(@ $a, $b, 0, 2, $f);
        let bb = $crate::blocks!(@ $a, $b, 1, 1, $f);
        let bc = $crate::blocks!(@ $a, $b, 1, 2, $f);
        let cc = $crate::blocks!(@ $a, $b, 2, 2, $f);
        [[aa, ab.clone(), ac.clone()], [ab, bb, bc.clone()], [ac, bc, cc]]
    }};
    (@ $a:pat, $b:pat, $na:literal, $nb:literal, $f:expr) => {{
        let ($a, $b): (usize, usize) = ($na, $nb);
        $f
    }};
}
pub(crate) use blocks;

mod arruda_boyce;
mod at_rest;
mod corotated;
mod error;
pub mod expression;
mod fibres;
mod formula;
mod fung;
mod holzapfel_gasser_ogden;
mod invariants;
mod kernels;
mod linear;
mod material;
mod mooney_rivlin;
mod named;
mod neo_hookean;
mod ogden;
mod program;
mod rows;
mod saint_venant_kirchhoff;
pub mod samples;
mod series;
mod several;
mod soundness;
mod stable_neo_hookean;
mod taylor_cache;
mod varied;
mod veronda_westmann;
mod yeoh;

pub use arruda_boyce::ArrudaBoyce;
pub use corotated::Corotated;
pub use error::Error;
pub use expression::PRESSURE;
pub use formula::{FORMULA, Formula};
pub use fung::Fung;
pub use holzapfel_gasser_ogden::HolzapfelGasserOgden;
pub use kernels::{Family, LawKernels, Rows, SeriesKernels, Shared, SharedSeries};
pub use linear::{LINEAR, Linear};
pub use material::Material;
pub use mooney_rivlin::{MooneyRivlin, Volumetric};
pub use neo_hookean::NeoHookean;
pub use ogden::Ogden;
pub use program::{Model, Program, Template};
pub use rows::{Bounds, Condition, Kind, Parameter, ROWS, Row};
pub use saint_venant_kirchhoff::SaintVenantKirchhoff;
pub use several::{BETWEEN, SEVERAL};
pub use soundness::resists_collapse;
pub use stable_neo_hookean::StableNeoHookean;
pub use taylor_cache::TaylorCache;
pub use veronda_westmann::VerondaWestmann;
pub use yeoh::Yeoh;

use expression::Expression;
use viscera_number::tensor::{
    Mat3, Vec3, cofactor, cross, determinant, mul_vector, spherical, trace,
};
use viscera_number::unroll::tabulate;
use viscera_number::{Gradient, Hessian, Jet, Monomials, Real, Scalar};

/// An isotropic strain energy per unit reference volume [J/m^3].
///
/// A law must give only `psi`; the other methods have defaults that a law may replace.
#[allow(non_snake_case)]
pub trait StrainEnergy: Copy + Send + Sync {
    /// Whether `psi` depends on `I2`; if not, its derivatives are not computed.
    const USES_I2: bool = true;

    /// Whether a derivative of `psi` depends on `I1`; if not, its power series is not computed.
    const DERIVATIVES_USE_I1: bool = true;

    /// Whether the law resists `1 + tr E = (I1 - 1) / 2` rather than `J`: then this is the volume ratio that
    /// elements average, and [`StrainEnergy::volumetric`] is a function of it.
    const VOLUME_IS_TRACE: bool = false;

    /// Whether a cell turned inside out (`J <= 0`) is outside the law's domain.
    const FORBIDS_INVERSION: bool = true;

    /// `psi(I1, I2, J)` with `I1 = tr C`, `I2 = (I1^2 - tr C^2) / 2 = |cof F|^2`, `J = det F`.
    fn psi<S: Scalar>(&self, I1: S, I2: S, J: S) -> S;

    /// `psi` and its first derivatives.
    #[inline(always)]
    fn gradient<S: Scalar>(&self, invariants: [S; 3]) -> Gradient<S> {
        let [I1, I2, J] = Gradient::variables(invariants);
        self.psi(I1, I2, J)
    }

    /// `psi` and its first and second derivatives.
    #[inline(always)]
    fn hessian<S: Scalar>(&self, invariants: [S; 3]) -> Hessian<S> {
        let [I1, I2, J] = Hessian::variables(invariants);
        self.psi(I1, I2, J)
    }

    /// `U'(J)` and `U''(J)` of [`StrainEnergy::volumetric`].
    #[inline(always)]
    fn volumetric_slopes<S: Scalar>(&self, J: &S) -> [S; 2] {
        let [J, _, _] = Hessian::variables([J.clone(), J.constant(0.0), J.constant(0.0)]);
        let U = self.volumetric(J);
        [U.first[0].clone(), U.second(0, 0)]
    }

    /// `U'(J)` alone.
    #[inline(always)]
    fn volumetric_slope<S: Scalar>(&self, J: &S) -> S {
        let [J, _, _] = Gradient::variables([J.clone(), J.constant(0.0), J.constant(0.0)]);
        let [slope, _, _] = self.volumetric(J).first;
        slope
    }

    /// `U(J)`, the energy of a pure dilatation `F = J^(1/3) I`; laws that write it as a term of its own give that.
    #[inline(always)]
    fn volumetric<S: Scalar>(&self, J: S) -> S {
        let c2 = J.cbrt().square();
        self.psi(c2.clone() * 3.0, c2.square() * 3.0, J)
    }
}

/// A fourth-order tensor seen along three vectors: `blocks[a][b]_ik = g_a,J A_iJkL g_b,L`, for `a <= b`.
pub type TangentBlocks<S> = [[Mat3<S>; 3]; 3];

/// Energy, stress and tangent of a deformation gradient: all that an element needs of a law.
#[allow(non_snake_case)]
pub trait Law: Copy + Send + Sync {
    /// Whether a cell turned inside out (`J <= 0`) is outside the law's domain.
    const FORBIDS_INVERSION: bool;

    /// The energy as an expression in the invariants, its parameters as numbers; none for laws that are no function of
    /// invariants.
    fn expression(&self) -> Option<Expression> {
        None
    }

    /// The law recorded for a [`Program`]. In cells that share their volume ratio, the energy without `part` of that of
    /// the dilatation, `psi - s U(J) + p J` with the cluster's pressure `p`. None if no program has it.
    fn template(&self, _part: Option<f64>) -> Option<Template> {
        None
    }

    /// A part of the energy of dilatation recorded for a [`Program`], `s U(J)`. Where the law resists `(I1 - 1) / 2` rather
    /// than `J`, a function of `I1`. None if no program has it.
    fn dilatation_template(&self, _part: f64) -> Option<Template> {
        None
    }

    /// Strain energy per unit reference volume [J/m^3].
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S;

    /// First Piola-Kirchhoff stress `P = d psi / dF` [Pa], for any scalar, power series included.
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S>;

    /// Energy and stress at once: a strain energy's stress has the energy as a by-product.
    #[inline(always)]
    fn energy_and_stress<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        (self.energy(F), self.stress(F))
    }

    /// Stress and the contraction of `dP/dF` with three vectors, the gradients of three barycentric
    /// coordinates: all that the assembly of a tetrahedron needs of the fourth-order tensor.
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> (Mat3<S>, TangentBlocks<S>);

    /// The volume ratio that the law sees, and its derivative `Z = dJ/dF`: `det F` and `cof F`, or their like
    /// to first order in the strain.
    #[inline(always)]
    fn volume_ratio<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        let Z = cofactor(F);
        (determinant(F, &Z), Z)
    }

    /// Contraction of `d2J/dF2` with three vectors, as in [`Law::tangent`].
    #[inline(always)]
    fn volume_curvature<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> TangentBlocks<S> {
        determinant_curvature(F, g)
    }

    /// `U(J) = psi(J^(1/3) I)`, the energy of a pure dilatation [J/m^3].
    #[inline(always)]
    fn dilatation<S: Scalar>(&self, J: &S) -> S {
        self.energy(&spherical(&J.cbrt()))
    }

    /// `U'(J)` [Pa], by `dF/dJ = c I / (3 J)` for `F = c I`.
    #[inline(always)]
    fn pressure<S: Scalar>(&self, J: &S) -> S {
        let c = J.cbrt();
        trace(&self.stress(&spherical(&c))) * c.square().recip() * (1.0 / 3.0)
    }

    /// `U'(J)` and `U''(J)` [Pa]; the latter is the bulk modulus at `J = 1`.
    #[inline(always)]
    fn pressure_and_modulus<S: Scalar>(&self, J: &S) -> [S; 2] {
        let c = J.cbrt();
        let unit = spherical(&c.constant(1.0));
        let (P, A) = self.tangent(&spherical(&c), &unit);
        let at = |a: usize, b: usize| {
            if a <= b { A[a][b][a][b].clone() } else { A[b][a][b][a].clone() }
        };
        let row = |a: usize| at(a, 0) + at(a, 1) + at(a, 2);
        // With T = tr P: U' = T / (3 c^2), U'' = (dT/dc - 2 T / c) / (9 c^4).
        let (T, r) = (trace(&P), c.recip());
        let slope = row(0) + row(1) + row(2) - T.clone() * r.clone() * 2.0;
        [T * r.square() * (1.0 / 3.0), slope * r.square().square() * (1.0 / 9.0)]
    }

    /// Coefficients of the highest degree of `P + (p - s U'(J)) dJ/dF`, that of `table`, from the series of `F`.
    ///
    /// `deformation` holds nine runs of `table.len()` coefficients, row by row, those of the highest degree zero;
    /// `shared` holds `s` and `p`, see [`Shared`]; `out` nine runs of the coefficients of the highest degree, zero on entry.
    /// Functions of the volume ratio and of the invariants are taken from `cache`, turned to the row of this law and to
    /// `s`. Strain energies replace this by `series.rs`.
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
        write_stress_series(self, (self.stress(&F), || self.volume_ratio(&F)), table, shared, out);
    }

    /// All `table.len()` coefficients of the volume ratio from the same series, zero in `out` on entry.
    #[inline(always)]
    fn volume_series<T: Real>(&self, table: &'static Monomials, deformation: &[T], out: &mut [T]) {
        let (J, _) = self.volume_ratio(&jets(table, deformation));
        for (c, value) in out.iter_mut().enumerate() {
            *value = J.coefficient(c);
        }
    }
}

/// `d2(det F)/dF2` contracted with three vectors: `e_ikq (F (g_a x g_b))_q`.
#[inline(always)]
#[allow(non_snake_case)]
fn determinant_curvature<S: Scalar>(F: &Mat3<S>, g: &[Vec3<S>; 3]) -> TangentBlocks<S> {
    blocks!(|a, b| {
        // e_ikq is 1 for (i, k) = (0, 1), (1, 2), (2, 0).
        let spin = mul_vector(F, &cross(&g[a], &g[b]));
        tabulate!(|i, k| match (3 + k - i) % 3 {
            0 => F[0][0].constant(0.0),
            1 => spin[(6 - i - k) % 3].clone(),
            _ => -spin[(6 - i - k) % 3].clone(),
        })
    })
}

/// Writes [`Law::stress_series`] from the series of `P` and of the volume ratio with its derivative.
#[inline(always)]
#[allow(non_snake_case)]
fn write_stress_series<L: Law, T: Real>(
    law: &L,
    (mut P, volume_ratio): (Mat3<Jet<T>>, impl FnOnce() -> (Jet<T>, Mat3<Jet<T>>)),
    table: &'static Monomials,
    shared: SharedSeries<'_, T>,
    out: &mut [T],
) {
    if !shared.pressure.is_empty() {
        let (J, Z) = volume_ratio();
        let q = Jet::new(table, shared.pressure) - law.pressure(&J) * shared.part;
        P = tabulate!(|i, j| P[i][j].clone() + q.clone() * Z[i][j].clone());
    }
    let top = table.of_degree(table.order());
    for (entry, out) in out.chunks_exact_mut(top.len()).enumerate() {
        for (value, c) in out.iter_mut().zip(top.clone()) {
            *value = P[entry / 3][entry % 3].coefficient(c);
        }
    }
}

/// Nine runs of coefficients as a tensor of series.
#[inline(always)]
fn jets<T: Real>(table: &'static Monomials, runs: &[T]) -> Mat3<Jet<T>> {
    let n = table.len();
    tabulate!(|i, j| Jet::new(table, &runs[(3 * i + j) * n..(3 * i + j + 1) * n]))
}
