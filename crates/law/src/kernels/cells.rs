//! The kernels of a law for the cells of statics and frames: energy, stress, tangent and volume ratio, batch by batch.

#![allow(non_snake_case)]

use super::Shared;
use crate::{Law, TangentBlocks};
use viscera_number::Lane;
use viscera_number::simd::Kernel;
use viscera_number::tensor::{Mat3, Vec3, mul_vector};
use viscera_number::unroll::{array, tabulate};

pub(super) struct Energy<'a, L> {
    pub law: L,
    pub F: &'a [Mat3<Lane>],
    pub part: f64,
    pub psi: &'a mut [Lane],
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

pub(super) struct Stress<'a, L> {
    pub law: L,
    pub F: &'a [Mat3<Lane>],
    pub shared: Shared<'a>,
    pub psi: &'a mut [Lane],
    pub P: &'a mut [Mat3<Lane>],
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

pub(super) struct Tangent<'a, L> {
    pub law: &'a L,
    pub F: &'a [Mat3<Lane>],
    pub g: &'a [[Vec3<Lane>; 3]],
    pub P: &'a mut [Mat3<Lane>],
    pub A: &'a mut [TangentBlocks<Lane>],
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
pub(super) struct TangentShared<'a, L> {
    pub law: &'a L,
    pub F: &'a [Mat3<Lane>],
    pub g: &'a [[Vec3<Lane>; 3]],
    pub shared: Shared<'a>,
    pub P: &'a mut [Mat3<Lane>],
    pub A: &'a mut [TangentBlocks<Lane>],
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

pub(super) struct VolumeRatio<'a, L> {
    pub law: L,
    pub F: &'a [Mat3<Lane>],
    pub J: &'a mut [Lane],
    pub Z: &'a mut [Mat3<Lane>],
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

pub(super) struct Dilatation<'a, L> {
    pub law: L,
    pub J: &'a [Lane],
    pub U: &'a mut [Lane],
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

pub(super) struct Pressure<'a, L> {
    pub law: L,
    pub J: &'a [Lane],
    pub out: &'a mut [[Lane; 2]],
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
