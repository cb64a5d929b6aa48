//! A law for the rest of the core: one object that evaluates many cells at once.
//!
//! A law is written over any [`Scalar`](viscera_number::Scalar). Its users hold a `dyn` [`LawKernels`] and give it
//! slices of [`Lane`]s that share one row of parameters. The kernels of a law are therefore compiled once,
//! independently of elements and solvers, and these independently of laws. A call serves a run of cells, so its cost is
//! too small to be measured (`benches/assembly.rs`).

#![allow(non_snake_case)]

use super::expression::Expression;
use super::{Law, TangentBlocks, TaylorCache, Template};
use viscera_number::simd::Kernel;
use viscera_number::tensor::{Mat3, Vec3, mul_vector};
use viscera_number::unroll::{array, tabulate};
use viscera_number::{Jet, Lane, Monomials, Real, Wide};

/// Makes laws of one kind from rows of parameters.
pub trait Family: Send + Sync {
    /// The law, which may borrow from the family and the row.
    type Law<'a>: Law
    where
        Self: 'a;

    /// The prepared row of parameters that [`Family::law`] takes, computed once.
    fn prepare(&self, row: &[f64]) -> Vec<f64> {
        row.to_vec()
    }

    /// The law with these parameters, prepared.
    fn law<'a>(&'a self, row: &'a [f64]) -> Self::Law<'a>;
}

/// A [`Family`] of laws that hold all they need: a function of the row.
pub struct Rows<L>(pub fn(&[f64]) -> L);

impl<L: Law + 'static> Family for Rows<L> {
    type Law<'a> = L;

    #[inline(always)]
    fn law<'a>(&'a self, row: &'a [f64]) -> L {
        self.0(row)
    }
}

/// The pressure that replaces a part of the law's own volumetric response in cells that share their volume ratio. With
/// the energy `U(J)` of a pure dilatation, the law gives `psi - s U(J)` and `P + (p - s U'(J)) dJ/dF`. Nothing by
/// default.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shared<'a> {
    /// The part `s`.
    pub part: f64,
    /// The pressures `p` of the cells [Pa]; none for cells on their own.
    pub pressure: &'a [Lane],
}

/// The same of series: all `table.len()` coefficients of the pressure, or none for a cell on its own.
#[derive(Clone, Copy, Debug)]
pub struct SharedSeries<'a, T> {
    /// The part `s`.
    pub part: f64,
    /// The series of `p` [Pa].
    pub pressure: &'a [T],
}

impl<T> Default for SharedSeries<'_, T> {
    fn default() -> Self {
        SharedSeries { part: 0.0, pressure: &[] }
    }
}

/// A law over slices: entry k of the results is of the cells whose deformation gradients are `F[k]`. All slices of a call
/// have one length, and `row` holds the parameters of all its cells, as [`LawKernels::prepare`] gives them.
pub trait LawKernels: SeriesKernels<f64> + SeriesKernels<Wide> + Send + Sync {
    /// Whether an inverted cell (`J <= 0`) is outside the law's domain.
    fn forbids_inversion(&self) -> bool;

    /// Prepares the `row` that all other functions take: a row of parameters, or values that the law computes from it.
    fn prepare(&self, row: &[f64]) -> Vec<f64>;

    /// The energy of a row as an expression, see [`Law::expression`].
    fn expression(&self, row: &[f64]) -> Option<Expression>;

    /// The law of a row, recorded, see [`Law::template`].
    fn template(&self, row: &[f64], part: Option<f64>) -> Option<Template>;

    /// Strain energy per unit reference volume [J/m^3], that of the dilatation counting but for a part.
    fn energy(&self, row: &[f64], F: &[Mat3<Lane>], part: f64, psi: &mut [Lane]);

    /// Energy and first Piola-Kirchhoff stress [Pa].
    fn stress(
        &self,
        row: &[f64],
        F: &[Mat3<Lane>],
        shared: Shared<'_>,
        psi: &mut [Lane],
        P: &mut [Mat3<Lane>],
    );

    /// Stress, and the tangent along three vectors, see [`Law::tangent`]. A shared pressure counts as constant.
    fn tangent(
        &self,
        row: &[f64],
        F: &[Mat3<Lane>],
        g: &[[Vec3<Lane>; 3]],
        shared: Shared<'_>,
        P: &mut [Mat3<Lane>],
        A: &mut [TangentBlocks<Lane>],
    );

    /// The volume ratio that the law sees, and `dJ/dF`.
    fn volume_ratio(&self, row: &[f64], F: &[Mat3<Lane>], J: &mut [Lane], Z: &mut [Mat3<Lane>]);

    /// `U(J)`, the energy of a pure dilatation [J/m^3].
    fn dilatation(&self, row: &[f64], J: &[Lane], U: &mut [Lane]);

    /// `U'(J)` and `U''(J)` [Pa].
    fn pressure(&self, row: &[f64], J: &[Lane], out: &mut [[Lane; 2]]);
}

/// The power series of a law, as [`Law`] defines them, for one kind of coefficients. All of `out` is zero on entry.
/// Functions of the volume ratio are taken from `cache`, which the caller has turned to the row and the shared part.
pub trait SeriesKernels<T: Real> {
    /// [`Law::stress_series`].
    fn stress_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<T>,
        table: &'static Monomials,
        deformation: &[T],
        shared: SharedSeries<'_, T>,
        out: &mut [T],
    );

    /// [`Law::volume_series`].
    fn volume_series(
        &self,
        row: &[f64],
        table: &'static Monomials,
        deformation: &[T],
        out: &mut [T],
    );

    /// All `table.len()` coefficients of `U'(J)`.
    fn pressure_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<T>,
        table: &'static Monomials,
        ratio: &[T],
        out: &mut [T],
    );
}

/// Makes the kernels of a law compile with the law's own file, since the compiler puts a method into the unit of its
/// type. In one unit for all laws, one processor would compile them for minutes.
trait Compiled: Law {
    /// # Safety
    /// The processor must have AVX2 where there is such a thing.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2"))]
    unsafe fn run<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}

impl<L: Law> Compiled for L {}

/// Runs a kernel of a law. [`viscera_number::simd::check`] has been asked by whoever made a body.
#[inline(always)]
fn compiled<L: Law, K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    assert!(is_x86_feature_detected!("avx2"), "laws are asked only where it is");
    // SAFETY: the processor has the feature the function is compiled for.
    unsafe { <L as Compiled>::run(kernel) }
}

impl<M: Family> LawKernels for M {
    fn forbids_inversion(&self) -> bool {
        M::Law::FORBIDS_INVERSION
    }

    fn prepare(&self, row: &[f64]) -> Vec<f64> {
        Family::prepare(self, row)
    }

    fn expression(&self, row: &[f64]) -> Option<Expression> {
        self.law(row).expression()
    }

    fn template(&self, row: &[f64], part: Option<f64>) -> Option<Template> {
        self.law(row).template(part)
    }

    fn energy(&self, row: &[f64], F: &[Mat3<Lane>], part: f64, psi: &mut [Lane]) {
        compiled::<M::Law<'_>, _>(Energy { law: self.law(row), F, part, psi });
    }

    fn stress(
        &self,
        row: &[f64],
        F: &[Mat3<Lane>],
        shared: Shared<'_>,
        psi: &mut [Lane],
        P: &mut [Mat3<Lane>],
    ) {
        compiled::<M::Law<'_>, _>(Stress { law: self.law(row), F, shared, psi, P });
    }

    fn tangent(
        &self,
        row: &[f64],
        F: &[Mat3<Lane>],
        g: &[[Vec3<Lane>; 3]],
        shared: Shared<'_>,
        P: &mut [Mat3<Lane>],
        A: &mut [TangentBlocks<Lane>],
    ) {
        let law = self.law(row);
        compiled::<M::Law<'_>, _>(Tangent { law: &law, F, g, P, A });
        if !shared.pressure.is_empty() {
            compiled::<M::Law<'_>, _>(TangentShared { law: &law, F, g, shared, P, A });
        }
    }

    fn volume_ratio(&self, row: &[f64], F: &[Mat3<Lane>], J: &mut [Lane], Z: &mut [Mat3<Lane>]) {
        compiled::<M::Law<'_>, _>(VolumeRatio { law: self.law(row), F, J, Z });
    }

    fn dilatation(&self, row: &[f64], J: &[Lane], U: &mut [Lane]) {
        compiled::<M::Law<'_>, _>(Dilatation { law: self.law(row), J, U });
    }

    fn pressure(&self, row: &[f64], J: &[Lane], out: &mut [[Lane; 2]]) {
        compiled::<M::Law<'_>, _>(Pressure { law: self.law(row), J, out });
    }
}

impl<M: Family, T: Real> SeriesKernels<T> for M {
    fn stress_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<T>,
        table: &'static Monomials,
        deformation: &[T],
        shared: SharedSeries<'_, T>,
        out: &mut [T],
    ) {
        let law = self.law(row);
        compiled::<M::Law<'_>, _>(StressSeries { law, cache, table, deformation, shared, out });
    }

    fn volume_series(
        &self,
        row: &[f64],
        table: &'static Monomials,
        deformation: &[T],
        out: &mut [T],
    ) {
        compiled::<M::Law<'_>, _>(VolumeSeries { law: self.law(row), table, deformation, out });
    }

    fn pressure_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<T>,
        table: &'static Monomials,
        ratio: &[T],
        out: &mut [T],
    ) {
        compiled::<M::Law<'_>, _>(PressureSeries { law: self.law(row), cache, table, ratio, out });
    }
}

struct Energy<'a, L> {
    law: L,
    F: &'a [Mat3<Lane>],
    part: f64,
    psi: &'a mut [Lane],
}

impl<L: Law> Kernel for Energy<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Energy { law, F, part, psi } = self;
        for (F, psi) in F.iter().zip(psi) {
            *psi = law.energy(F);
            if part != 0.0 {
                let (J, _) = law.volume_ratio(F);
                *psi = *psi - law.dilatation(&J) * part;
            }
        }
    }
}

struct Stress<'a, L> {
    law: L,
    F: &'a [Mat3<Lane>],
    shared: Shared<'a>,
    psi: &'a mut [Lane],
    P: &'a mut [Mat3<Lane>],
}

impl<L: Law> Kernel for Stress<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Stress { law, F, shared: Shared { part, pressure }, psi, P } = self;
        for ((F, psi), P) in F.iter().zip(&mut *psi).zip(&mut *P) {
            (*psi, *P) = law.energy_and_stress(F);
        }
        for (((F, p), psi), P) in F.iter().zip(pressure).zip(psi).zip(P) {
            let (J, Z) = law.volume_ratio(F);
            *psi = *psi - law.dilatation(&J) * part;
            let q = *p - law.pressure(&J) * part;
            *P = tabulate!(|i, j| P[i][j] + q * Z[i][j]);
        }
    }
}

struct Tangent<'a, L> {
    law: &'a L,
    F: &'a [Mat3<Lane>],
    g: &'a [[Vec3<Lane>; 3]],
    P: &'a mut [Mat3<Lane>],
    A: &'a mut [TangentBlocks<Lane>],
}

impl<L: Law> Kernel for Tangent<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Tangent { law, F, g, P, A } = self;
        for (((F, g), P), A) in F.iter().zip(g).zip(P).zip(A) {
            (*P, *A) = law.tangent(F, g);
        }
    }
}

/// Compiled on its own, as two pieces of code of half the size compile faster.
struct TangentShared<'a, L> {
    law: &'a L,
    F: &'a [Mat3<Lane>],
    g: &'a [[Vec3<Lane>; 3]],
    shared: Shared<'a>,
    P: &'a mut [Mat3<Lane>],
    A: &'a mut [TangentBlocks<Lane>],
}

impl<L: Law> Kernel for TangentShared<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let TangentShared { law, F, g, shared: Shared { part, pressure }, P, A } = self;
        for ((((F, p), g), P), A) in F.iter().zip(pressure).zip(g).zip(P).zip(A) {
            let (J, Z) = law.volume_ratio(F);
            let [own, modulus] = law.pressure_and_modulus(&J);
            let q = *p - own * part;
            *P = tabulate!(|i, j| P[i][j] + q * Z[i][j]);
            let z: [Vec3<Lane>; 3] = array!(3, |k| mul_vector(&Z, &g[k]));
            let mz: [Vec3<Lane>; 3] = array!(3, |k| array!(3, |i| z[k][i] * modulus * part));
            let curvature = law.volume_curvature(F, g);
            for a in 0..3 {
                for b in a..3 {
                    let (A, C) = (&mut A[a][b], &curvature[a][b]);
                    *A = tabulate!(|i, k| A[i][k] + q * C[i][k] - mz[a][i] * z[b][k]);
                }
            }
        }
    }
}

struct VolumeRatio<'a, L> {
    law: L,
    F: &'a [Mat3<Lane>],
    J: &'a mut [Lane],
    Z: &'a mut [Mat3<Lane>],
}

impl<L: Law> Kernel for VolumeRatio<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        for ((F, J), Z) in self.F.iter().zip(self.J).zip(self.Z) {
            (*J, *Z) = self.law.volume_ratio(F);
        }
    }
}

struct Dilatation<'a, L> {
    law: L,
    J: &'a [Lane],
    U: &'a mut [Lane],
}

impl<L: Law> Kernel for Dilatation<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        for (J, U) in self.J.iter().zip(self.U) {
            *U = self.law.dilatation(J);
        }
    }
}

struct Pressure<'a, L> {
    law: L,
    J: &'a [Lane],
    out: &'a mut [[Lane; 2]],
}

impl<L: Law> Kernel for Pressure<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        for (J, out) in self.J.iter().zip(self.out) {
            *out = self.law.pressure_and_modulus(J);
        }
    }
}

struct StressSeries<'a, L, T: Real> {
    law: L,
    cache: &'a mut TaylorCache<T>,
    table: &'static Monomials,
    deformation: &'a [T],
    shared: SharedSeries<'a, T>,
    out: &'a mut [T],
}

impl<L: Law, T: Real> Kernel for StressSeries<'_, L, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let StressSeries { law, cache, table, deformation, shared, out } = self;
        law.stress_series(cache, table, deformation, shared, out);
    }
}

struct VolumeSeries<'a, L, T> {
    law: L,
    table: &'static Monomials,
    deformation: &'a [T],
    out: &'a mut [T],
}

impl<L: Law, T: Real> Kernel for VolumeSeries<'_, L, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.law.volume_series(self.table, self.deformation, self.out);
    }
}

struct PressureSeries<'a, L, T: Real> {
    law: L,
    cache: &'a mut TaylorCache<T>,
    table: &'static Monomials,
    ratio: &'a [T],
    out: &'a mut [T],
}

impl<L: Law, T: Real> Kernel for PressureSeries<'_, L, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let ratio = Jet::new(self.table, self.ratio);
        let pressure = |ratio: Jet<T>| vec![self.law.pressure(&ratio)];
        let pressure = ratio.substituted_in(&self.cache.of(&ratio, pressure)[0]);
        self.out.iter_mut().zip(pressure.coefficients()).for_each(|(out, &p)| *out = p);
    }
}
