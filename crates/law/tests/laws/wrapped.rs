//! Laws in other clothes.

use viscera_law::{Law, SharedSeries, TangentBlocks, TaylorCache};
use viscera_number::tensor::{Mat3, Vec3};
use viscera_number::{Monomials, Real, Scalar};

/// A law whose functions are compiled once for each kind of number: they are written to be inlined, and inlined at
/// every call below they would take minutes.
#[derive(Clone, Copy, PartialEq)]
pub struct Once<L>(pub L);

#[allow(non_snake_case)]
impl<L: Law> Law for Once<L> {
    const FORBIDS_INVERSION: bool = L::FORBIDS_INVERSION;
    #[inline(never)]
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S {
        self.0.energy(F)
    }
    #[inline(never)]
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S> {
        self.0.stress(F)
    }
    #[inline(never)]
    fn energy_and_stress<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        self.0.energy_and_stress(F)
    }
    #[inline(never)]
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> (Mat3<S>, TangentBlocks<S>) {
        self.0.tangent(F, g)
    }
    #[inline(never)]
    fn volume_ratio<S: Scalar>(&self, F: &Mat3<S>) -> (S, Mat3<S>) {
        self.0.volume_ratio(F)
    }
    #[inline(never)]
    fn volume_curvature<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> TangentBlocks<S> {
        self.0.volume_curvature(F, g)
    }
    #[inline(never)]
    fn dilatation<S: Scalar>(&self, J: &S) -> S {
        self.0.dilatation(J)
    }
    #[inline(never)]
    fn pressure<S: Scalar>(&self, J: &S) -> S {
        self.0.pressure(J)
    }
    #[inline(never)]
    fn pressure_and_modulus<S: Scalar>(&self, J: &S) -> [S; 2] {
        self.0.pressure_and_modulus(J)
    }
    #[inline(never)]
    fn stress_series<T: Real>(
        &self,
        cache: &mut TaylorCache<T>,
        table: &'static Monomials,
        deformation: &[T],
        shared: SharedSeries<'_, T>,
        out: &mut [T],
    ) {
        self.0.stress_series(cache, table, deformation, shared, out);
    }
    #[inline(never)]
    fn volume_series<T: Real>(&self, table: &'static Monomials, deformation: &[T], out: &mut [T]) {
        self.0.volume_series(table, deformation, out);
    }
}

/// A law that only knows its energy, stress and tangent: what it inherits against what strain
/// energies do faster.
#[derive(Clone, Copy, PartialEq)]
pub struct Plain<L>(pub L);

#[allow(non_snake_case)]
impl<L: Law> Law for Plain<L> {
    const FORBIDS_INVERSION: bool = true;
    fn energy<S: Scalar>(&self, F: &Mat3<S>) -> S {
        self.0.energy(F)
    }
    fn stress<S: Scalar>(&self, F: &Mat3<S>) -> Mat3<S> {
        self.0.stress(F)
    }
    fn tangent<S: Scalar>(&self, F: &Mat3<S>, g: &[Vec3<S>; 3]) -> (Mat3<S>, TangentBlocks<S>) {
        self.0.tangent(F, g)
    }
}
