//! The kernels of a law for power series: what [`Law`] defines, for eight series side by side.

use super::{Family, compiled};
use crate::{Law, TaylorCache};
use viscera_number::simd::Kernel;
use viscera_number::{Jet, Monomials, Real, Wide};

/// [`Shared`](super::Shared) of series: all `table.len()` coefficients of the pressure, or none for a cell on its own.
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

/// The power series of a law, as [`Law`] defines them: of one cell at several load positions, or of several cells with one
/// row along a path. All of `out` is zero on entry.
/// Functions of the volume ratio and of the invariants are taken from `cache`, which the caller has turned to the row and
/// the shared part.
pub trait SeriesKernels {
    /// [`Law::stress_series`].
    fn stress_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<Wide>,
        table: &'static Monomials,
        deformation: &[Wide],
        shared: SharedSeries<'_, Wide>,
        out: &mut [Wide],
    );

    /// [`Law::volume_series`].
    fn volume_series(
        &self,
        row: &[f64],
        table: &'static Monomials,
        deformation: &[Wide],
        out: &mut [Wide],
    );

    /// All `table.len()` coefficients of `U'(J)`.
    fn pressure_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<Wide>,
        table: &'static Monomials,
        ratio: &[Wide],
        out: &mut [Wide],
    );
}

impl<M: Family> SeriesKernels for M {
    fn stress_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<Wide>,
        table: &'static Monomials,
        deformation: &[Wide],
        shared: SharedSeries<'_, Wide>,
        out: &mut [Wide],
    ) {
        let law = self.law(row);
        compiled::<M::Law<'_>, _>(StressSeries { law, cache, table, deformation, shared, out });
    }

    fn volume_series(
        &self,
        row: &[f64],
        table: &'static Monomials,
        deformation: &[Wide],
        out: &mut [Wide],
    ) {
        compiled::<M::Law<'_>, _>(VolumeSeries { law: self.law(row), table, deformation, out });
    }

    fn pressure_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<Wide>,
        table: &'static Monomials,
        ratio: &[Wide],
        out: &mut [Wide],
    ) {
        compiled::<M::Law<'_>, _>(PressureSeries { law: self.law(row), cache, table, ratio, out });
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
