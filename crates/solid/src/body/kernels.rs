//! Energy and internal force: from displacements to deformation gradients, through the law, to forces on nodes.

use super::batch::{Batch, add_product};
use super::cells::CellBatches;
use super::clusters::Around;
use super::tasks::RUN;
use super::workspace::CellWorkspace;
use crate::element::Shape;
use crate::law::LawKernels;
use crate::number::Lane;
use crate::simd::{Kernel, dispatch_solver};
use crate::tensor::{Mat3, Vec3, cofactor, determinant, dot};
use crate::threads::share;
use crate::unroll::{array, each};
use rayon::prelude::*;

/// Volume ratios of cells that are not inverted.
pub const UPRIGHT: [f64; 2] = [0.0, f64::INFINITY];

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// Number of tasks that the batches make.
    pub fn n_tasks(&self) -> usize {
        self.batches.len().div_ceil(Self::TASK)
    }

    /// Strain energy W [J]; infinite if the law forbids inversion and the `J` of a cell is outside `range`.
    pub fn energy(
        &self,
        law: &dyn LawKernels,
        around: Around<'_>,
        (u, range): (&[f64], [f64; 2]),
    ) -> f64 {
        let of_task = |task: usize| {
            let first = task * Self::TASK;
            let last = self.batches.len().min(first + Self::TASK);
            dispatch_solver(EnergyKernel { cells: self, first, last, law, around, u, range })
        };
        let n = self.n_tasks();
        if share(n) {
            (0..n).into_par_iter().map(of_task).collect::<Vec<f64>>().into_iter().sum()
        } else {
            (0..n).map(of_task).sum()
        }
    }

    /// Internal force `f_int = dW/du` [N], and the strain energy W [J]; infinite if the law forbids inversion and the
    /// `J` of a cell is outside `range`; the force then has no meaning.
    pub fn force(
        &self,
        law: &dyn LawKernels,
        around: Around<'_>,
        (u, range): (&[f64], [f64; 2]),
        workspace: &mut CellWorkspace,
        out: &mut [f64],
    ) -> f64 {
        let of_task = |task: usize, forces: &mut [[Vec3<Lane>; N]]| {
            let first = task * Self::TASK;
            dispatch_solver(ForceKernel { cells: self, first, law, around, u, range, forces })
        };
        if workspace.shares(self.n_tasks()) {
            self.forces_by_threads(out, of_task)
        } else {
            let CellWorkspace { forces, nodal, .. } = workspace;
            self.forces_by_one((forces, nodal), out, of_task)
        }
    }

    /// Sums at the nodes the forces that each task finds for its batches; returns the sum of what the tasks return.
    pub(super) fn forces_by_one(
        &self,
        (forces, nodal): (&mut Vec<Vec3<Lane>>, &mut Vec<[f64; 3]>),
        out: &mut [f64],
        mut of_task: impl FnMut(usize, &mut [[Vec3<Lane>; N]]) -> f64,
    ) -> f64 {
        forces.resize(Self::TASK.min(self.batches.len()) * N, Vec3::default());
        nodal.resize(self.sums.most[0], [0.0; 3]);
        let (mut sum, out) = (0.0, out.as_chunks_mut::<3>().0);
        out.fill([0.0; 3]);
        for (task, batches) in self.batches.chunks(Self::TASK).enumerate() {
            let forces = &mut forces.as_chunks_mut::<N>().0[..batches.len()];
            sum += of_task(task, forces);
            let nodal = &mut nodal[..self.sums.n_nodes(task)];
            self.sums.sum_forces(task, batches, forces, nodal);
            self.sums.add_forces(task, nodal, out);
        }
        sum
    }

    /// The same by all threads, which add the sums of the tasks when those of all are there.
    pub(super) fn forces_by_threads(
        &self,
        out: &mut [f64],
        of_task: impl Fn(usize, &mut [[Vec3<Lane>; N]]) -> f64 + Sync,
    ) -> f64 {
        let mut nodal = self.sums.room();
        let parts = self.sums.nodes_by_task(&mut nodal).into_par_iter().enumerate();
        let task = |forces: &mut Vec<_>, (task, nodal): (usize, &mut [[f64; 3]])| {
            let batches = self.batches_of(task);
            let forces = &mut forces[..batches.len()];
            let sum = of_task(task, forces);
            self.sums.sum_forces(task, batches, forces, nodal);
            sum
        };
        let sums: Vec<f64> =
            parts.map_init(|| vec![[[Lane::default(); 3]; N]; Self::TASK], task).collect();
        self.sums.gather_forces(&nodal, out.as_chunks_mut().0);
        sums.into_iter().sum()
    }

    /// The batches of a task.
    pub(super) fn batches_of(&self, task: usize) -> &[Batch<N>] {
        &self.batches[task * Self::TASK..self.batches.len().min((task + 1) * Self::TASK)]
    }

    /// The next batches of one tissue from `first` on, [`RUN`] at most and none from `last` on.
    pub(super) fn run(&self, first: usize, last: usize) -> std::ops::Range<usize> {
        let tissue = self.batches[first].tissue;
        let end = last.min(first + RUN);
        let next = (first..end).find(|&batch| self.batches[batch].tissue != tissue);
        first..next.unwrap_or(end)
    }
}

impl<const N: usize> Batch<N> {
    /// Adds `f_a = w P grad N_a` of a quadrature point of weight `w`.
    #[inline(always)]
    pub(super) fn add_forces(
        &self,
        slopes: &[[f64; 3]; N],
        weight: Lane,
        stress: &Mat3<Lane>,
        forces: &mut [Vec3<Lane>; N],
    ) {
        let flux: [Vec3<Lane>; 3] =
            array!(3, |k| array!(3, |i| dot(&stress[i], &self.gradients[k]) * weight));
        each!(N, |a| {
            array!(3, |k| array!(3, |i| add_product(&mut forces[a][i], slopes[a][k], &flux[k][i])));
        });
    }
}

/// Energy of the batches from `first` to before `last`.
struct EnergyKernel<'a, E, const N: usize> {
    cells: &'a CellBatches<E, N>,
    first: usize,
    last: usize,
    law: &'a dyn LawKernels,
    around: Around<'a>,
    u: &'a [f64],
    range: [f64; 2],
}

impl<E: Shape<N>, const N: usize> Kernel for EnergyKernel<'_, E, N> {
    type Output = f64;
    #[inline(always)]
    fn run(self) -> f64 {
        let EnergyKernel { cells, mut first, last, law, around, u, range } = self;
        let (mut f, mut psi) = ([Mat3::<Lane>::default(); RUN], [Lane::default(); RUN]);
        let (mut sum, forbids) = (0.0, law.forbids_inversion());
        while first < last {
            let run = cells.run(first, last);
            let (n, row) = (run.len(), &cells.tissues[cells.batches[first].tissue as usize]);
            for point in 0..E::POINTS {
                for (f, batch) in f.iter_mut().zip(&cells.batches[run.clone()]) {
                    *f = batch.deformation(E::slopes(point), u);
                    if forbids && is_outside(f, range) {
                        return f64::INFINITY;
                    }
                }
                law.energy(row, &f[..n], around.part(first), &mut psi[..n]);
                for (psi, batch) in psi.iter().zip(&cells.batches[run.clone()]) {
                    let weight = batch.volume * (1.0 / E::POINTS as f64);
                    sum += (*psi * weight).0.iter().sum::<f64>();
                }
            }
            first = run.end;
        }
        sum
    }
}

/// Energy of the batches from `first` on, and their forces.
struct ForceKernel<'a, E, const N: usize> {
    cells: &'a CellBatches<E, N>,
    first: usize,
    law: &'a dyn LawKernels,
    around: Around<'a>,
    u: &'a [f64],
    range: [f64; 2],
    forces: &'a mut [[Vec3<Lane>; N]],
}

impl<E: Shape<N>, const N: usize> Kernel for ForceKernel<'_, E, N> {
    type Output = f64;
    #[inline(always)]
    fn run(self) -> f64 {
        let ForceKernel { cells, first: begin, law, around, u, range, forces } = self;
        let (mut f, mut stress) = ([Mat3::<Lane>::default(); RUN], [Mat3::<Lane>::default(); RUN]);
        let (mut psi, mut pressures) = ([Lane::default(); RUN], [Lane::default(); RUN]);
        let (mut sum, forbids) = (Lane::default(), law.forbids_inversion());
        let (mut first, last) = (begin, begin + forces.len());
        while first < last {
            let run = cells.run(first, last);
            let (n, row) = (run.len(), &cells.tissues[cells.batches[first].tissue as usize]);
            let shared = around.of(run.clone(), &mut pressures);
            let forces = &mut forces[first - begin..run.end - begin];
            for point in 0..E::POINTS {
                let slopes = E::slopes(point);
                for (f, batch) in f.iter_mut().zip(&cells.batches[run.clone()]) {
                    *f = batch.deformation(slopes, u);
                    if forbids && is_outside(f, range) {
                        return f64::INFINITY;
                    }
                }
                law.stress(row, &f[..n], shared, &mut psi[..n], &mut stress[..n]);
                for (k, (batch, forces)) in
                    cells.batches[run.clone()].iter().zip(&mut *forces).enumerate()
                {
                    if point == 0 {
                        *forces = [[Lane::default(); 3]; N];
                    }
                    let weight = batch.volume * (1.0 / E::POINTS as f64);
                    batch.add_forces(slopes, weight, &stress[k], forces);
                    sum = sum + psi[k] * weight;
                }
            }
            first = run.end;
        }
        sum.0.iter().sum()
    }
}

/// Whether any cell of a batch has a `J` outside of an open range, or none at all.
#[inline(always)]
fn is_outside(f: &Mat3<Lane>, range: [f64; 2]) -> bool {
    // No lane is asked before the others: that would be four determinants one after the other.
    let j = determinant(f, &cofactor(f)).0;
    !j.iter().fold(true, |inside, &j| inside & (j > range[0]) & (j < range[1]))
}
