//! Energy, internal force and tangent: loops over batches, compiled for the processor's vectors.

use super::blocks::{LOCAL_PAIRS, SymmetricBlocks};
use super::{Batch, Body, LANES, Lane};
use crate::law::{Law, LawVisitor};
use crate::number::Lanes;
use crate::simd::{Kernel, dispatch};
use crate::tensor::{Mat3, cofactor, determinant, mul_vector, tabulate};
use rayon::prelude::*;

/// Batches per parallel task: large enough to hide the hand-over, fixed so that results do not
/// depend on the number of threads.
const TASK: usize = 64;

/// Nodal forces of a batch.
type Forces = [[Lane; 3]; 4];
/// Blocks of a batch, in the order of `LOCAL_PAIRS`.
type Tangents = [Mat3<Lane>; 10];

impl Body {
    /// Strain energy [J]; infinite where a law that forbids it finds a cell turned inside out.
    pub fn energy(&self, u: &[f64]) -> f64 {
        self.material.visit(Energy { body: self, u })
    }

    /// Internal force `f_int = dW/du` [N].
    pub fn internal_force(&self, u: &[f64], force: &mut [f64]) {
        let mut forces = vec![Forces::default(); self.batches.len()];
        self.material.visit(Evaluate { body: self, u, forces: &mut forces, tangents: &mut [] });
        self.gather_forces(&forces, force);
    }

    /// Internal force and tangent `d f_int / du`, in place.
    pub fn internal_force_and_tangent(
        &self,
        u: &[f64],
        force: &mut [f64],
        tangent: &mut SymmetricBlocks,
    ) {
        let mut forces = vec![Forces::default(); self.batches.len()];
        let mut tangents = vec![Tangents::default(); self.batches.len()];
        let evaluate = Evaluate { body: self, u, forces: &mut forces, tangents: &mut tangents };
        self.material.visit(evaluate);
        self.gather_forces(&forces, force);
        self.gather_tangents(&tangents, tangent);
    }

    /// A tangent of the right shape, zero.
    pub fn zero_tangent(&self) -> SymmetricBlocks {
        self.block_map.zeros()
    }

    fn gather_forces(&self, forces: &[Forces], out: &mut [f64]) {
        out.par_chunks_mut(3).enumerate().with_min_len(1024).for_each(|(node, out)| {
            let range = self.incidence_start[node]..self.incidence_start[node + 1];
            out.fill(0.0);
            for &(slot, a) in &self.incidence[range.start as usize..range.end as usize] {
                let f = &forces[slot.batch as usize][a as usize];
                for i in 0..3 {
                    out[i] += f[i][slot.lane as usize];
                }
            }
        });
    }

    fn gather_tangents(&self, tangents: &[Tangents], out: &mut SymmetricBlocks) {
        out.values.par_chunks_mut(9).enumerate().with_min_len(1024).for_each(|(block, out)| {
            let mut sum = [0.0; 9];
            for c in self.block_map.contributions(block) {
                let local = &tangents[c.slot.batch as usize][c.block as usize];
                for i in 0..3 {
                    for k in 0..3 {
                        let (p, q) = if c.transposed { (k, i) } else { (i, k) };
                        sum[3 * i + k] += local[p][q][c.slot.lane as usize];
                    }
                }
            }
            out.copy_from_slice(&sum);
        });
    }
}

impl Batch {
    /// `F = I + sum_a u_a (x) g_a`.
    #[inline(always)]
    fn deformation(&self, u: &[f64]) -> Mat3<Lane> {
        let mut f = tabulate(|i, j| Lanes([(i == j) as u8 as f64; LANES]));
        for a in 0..4 {
            for i in 0..3 {
                let value = Lanes(std::array::from_fn(|l| u[3 * self.nodes[l][a] as usize + i]));
                for j in 0..3 {
                    f[i][j] = f[i][j] + value * self.gradients[a][j];
                }
            }
        }
        f
    }

    /// `f_a = V P g_a`.
    #[inline(always)]
    fn forces(&self, stress: &Mat3<Lane>) -> Forces {
        std::array::from_fn(|a| {
            mul_vector(stress, &self.gradients[a]).map(|component| component * self.volume)
        })
    }
}

struct Energy<'a> {
    body: &'a Body,
    u: &'a [f64],
}

impl LawVisitor for Energy<'_> {
    type Output = f64;
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) -> f64 {
        let sums: Vec<f64> = self
            .body
            .batches
            .par_chunks(TASK)
            .map(|batches| dispatch(EnergyKernel { batches, u: self.u, make }))
            .collect();
        sums.iter().sum()
    }
}

struct EnergyKernel<'a, L> {
    batches: &'a [Batch],
    u: &'a [f64],
    make: fn(&[f64]) -> L,
}

impl<L: Law> Kernel for EnergyKernel<'_, L> {
    type Output = f64;
    #[inline(always)]
    fn run(self) -> f64 {
        let mut sum = 0.0;
        for batch in self.batches {
            let f = batch.deformation(self.u);
            let inverted = determinant(&f, &cofactor(&f)).0.iter().any(|&j| !(j > 0.0));
            if L::FORBIDS_INVERSION && inverted {
                return f64::INFINITY;
            }
            let energy: Lane = (self.make)(&batch.parameters).energy(&f) * batch.volume;
            sum += energy.0.iter().sum::<f64>();
        }
        sum
    }
}

struct Evaluate<'a> {
    body: &'a Body,
    u: &'a [f64],
    forces: &'a mut [Forces],
    tangents: &'a mut [Tangents],
}

impl LawVisitor for Evaluate<'_> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        let u = self.u;
        let batches = self.body.batches.par_chunks(TASK);
        let forces = self.forces.par_chunks_mut(TASK);
        if self.tangents.is_empty() {
            batches.zip(forces).for_each(|(batches, forces)| {
                dispatch(ForceKernel { batches, u, make, forces });
            });
        } else {
            let tangents = self.tangents.par_chunks_mut(TASK);
            batches.zip(forces).zip(tangents).for_each(|((batches, forces), tangents)| {
                dispatch(TangentKernel { batches, u, make, forces, tangents });
            });
        }
    }
}

struct ForceKernel<'a, L> {
    batches: &'a [Batch],
    u: &'a [f64],
    make: fn(&[f64]) -> L,
    forces: &'a mut [Forces],
}

impl<L: Law> Kernel for ForceKernel<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        for (batch, forces) in self.batches.iter().zip(self.forces) {
            let law = (self.make)(&batch.parameters);
            *forces = batch.forces(&law.stress(&batch.deformation(self.u)));
        }
    }
}

struct TangentKernel<'a, L> {
    batches: &'a [Batch],
    u: &'a [f64],
    make: fn(&[f64]) -> L,
    forces: &'a mut [Forces],
    tangents: &'a mut [Tangents],
}

impl<L: Law> Kernel for TangentKernel<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let results = self.forces.iter_mut().zip(self.tangents);
        for (batch, (forces, tangents)) in self.batches.iter().zip(results) {
            let law = (self.make)(&batch.parameters);
            let (stress, blocks) = law.tangent(&batch.deformation(self.u), &batch.gradients);
            *forces = batch.forces(&stress);
            for (out, &(a, b)) in tangents.iter_mut().zip(&LOCAL_PAIRS) {
                *out = blocks[a][b].map(|row| row.map(|entry| entry * batch.volume));
            }
        }
    }
}
