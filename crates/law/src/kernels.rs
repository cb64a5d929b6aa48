//! A law for the rest of the core: one object that evaluates many cells at once.
//!
//! A law is written over any [`Scalar`](viscera_number::Scalar). Its users hold a `dyn` [`LawKernels`] and give it
//! slices of [`Lane`]s that share one row of parameters. The kernels of a law are therefore compiled once,
//! independently of elements and solvers, and these independently of laws. A call serves a run of cells, so its cost is
//! too small to be measured (`benches/assembly.rs`).

#![allow(non_snake_case)]

mod cells;
mod series;

pub use series::{SeriesKernels, SharedSeries};

use super::expression::Expression;
use super::{Law, TangentBlocks, Template};
use cells::{Dilatation, Energy, Pressure, Stress, Tangent, TangentShared, VolumeRatio};
use viscera_number::Lane;
use viscera_number::simd::Kernel;
use viscera_number::tensor::{Mat3, Vec3};

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

/// A law over slices: entry k of the results is of the cells whose deformation gradients are `F[k]`. All slices of a call
/// have one length, and `row` holds the parameters of all its cells, as [`LawKernels::prepare`] gives them.
pub trait LawKernels: SeriesKernels + Send + Sync {
    /// Whether an inverted cell (`J <= 0`) is outside the law's domain.
    fn forbids_inversion(&self) -> bool;

    /// Prepares the `row` that all other functions take: a row of parameters, or values that the law computes from it.
    fn prepare(&self, row: &[f64]) -> Vec<f64>;

    /// The energy of a row as an expression, see [`Law::expression`].
    fn expression(&self, row: &[f64]) -> Option<Expression>;

    /// The law of a row, recorded, see [`Law::template`].
    fn template(&self, row: &[f64], part: Option<f64>) -> Option<Template>;

    /// Its energy of dilatation, recorded, see [`Law::dilatation_template`].
    fn dilatation_template(&self, row: &[f64], part: f64) -> Option<Template>;

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

    fn dilatation_template(&self, row: &[f64], part: f64) -> Option<Template> {
        self.law(row).dilatation_template(part)
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
