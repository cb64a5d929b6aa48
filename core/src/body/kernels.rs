//! Energy and internal force: loops over batches, compiled for the processor's vectors.

use super::Lane;
use super::cells::{Batch, Cells, add_product};
use super::tangent::Response;
use crate::element::Shape;
use crate::law::{Law, LawVisitor, Material};
use crate::simd::{Kernel, dispatch_here};
use crate::tensor::{Mat3, Vec3, cofactor, determinant, dot};
use crate::threads::share;
use crate::unroll::array;
use rayon::prelude::*;
use std::marker::PhantomData;

dispatch_here!();

/// Batches per parallel task: large enough to hide the hand-over, fixed so that results do not
/// depend on the number of threads.
pub(super) const TASK: usize = 64;

/// Number of tasks that so many batches make.
pub(super) fn tasks(batches: usize) -> usize {
    batches.div_ceil(TASK)
}

/// Runs every task, with its number, on what belongs to its batches.
pub(super) fn for_tasks<T: Send>(of_batches: &mut [T], run: impl Fn(usize, &mut [T]) + Sync) {
    if share(tasks(of_batches.len())) {
        of_batches.par_chunks_mut(TASK).enumerate().for_each(|(task, part)| run(task, part));
    } else {
        of_batches.chunks_mut(TASK).enumerate().for_each(|(task, part)| run(task, part));
    }
}

/// Volume ratios of cells that are the right way round.
pub const UPRIGHT: [f64; 2] = [0.0, f64::INFINITY];

/// What a cell's neighbours add to its own response; `batch` is its number.
pub(super) trait Surroundings: Copy + Send + Sync {
    /// Added to the energy density.
    fn energy<L: Law>(&self, law: &L, batch: usize, f: &Mat3<Lane>, energy: &mut Lane);
    /// Added to the stress.
    fn stress<L: Law>(&self, law: &L, batch: usize, f: &Mat3<Lane>, stress: &mut Mat3<Lane>);
    /// Added to stress and tangent, what the neighbours do being kept.
    fn tangent<L: Law>(
        &self,
        law: &L,
        batch: usize,
        at: (&Mat3<Lane>, &[Vec3<Lane>; 3]),
        response: &mut Response,
    );
}

/// A cell on its own.
#[derive(Clone, Copy)]
pub(super) struct Alone;

impl Surroundings for Alone {
    #[inline(always)]
    fn energy<L: Law>(&self, _: &L, _: usize, _: &Mat3<Lane>, _: &mut Lane) {}
    #[inline(always)]
    fn stress<L: Law>(&self, _: &L, _: usize, _: &Mat3<Lane>, _: &mut Mat3<Lane>) {}
    #[inline(always)]
    fn tangent<L: Law>(
        &self,
        _: &L,
        _: usize,
        _: (&Mat3<Lane>, &[Vec3<Lane>; 3]),
        _: &mut Response,
    ) {
    }
}

impl<E: Shape<N>, const N: usize> Cells<E, N> {
    /// Number of tasks that the batches make.
    pub fn n_tasks(&self) -> usize {
        tasks(self.batches.len())
    }

    /// Strain energy [J]; infinite where a law that forbids it finds a cell turned inside out.
    pub fn energy(&self, material: &Material, around: impl Surroundings, u: &[f64]) -> f64 {
        let (n, mut energy) = (self.n_tasks(), 0.0);
        let tasks = &mut |run: &RunEnergy<'_>| {
            energy = if share(n) {
                (0..n).into_par_iter().map(run).collect::<Vec<f64>>().into_iter().sum()
            } else {
                (0..n).map(run).sum()
            };
        };
        material.visit(Energy { cells: self, around, u, tasks });
        energy
    }

    /// Internal force `f_int = dW/du` [N], and the strain energy W [J]; infinite where a law that forbids inversion
    /// finds a cell whose `J` is outside of `range`, and then the force means nothing.
    pub fn force(
        &self,
        material: &Material,
        around: impl Surroundings,
        (u, range): (&[f64], [f64; 2]),
        out: &mut [f64],
    ) -> f64 {
        let mut forces = vec![[[Lane::default(); 3]; N]; self.batches.len()];
        let mut energy = 0.0;
        let tasks = &mut |run: &RunForces<'_, N>| {
            let of_task = |(task, forces): (usize, &mut [[Vec3<Lane>; N]])| run(task, forces);
            energy = if share(self.n_tasks()) {
                let tasks = forces.par_chunks_mut(TASK).enumerate();
                tasks.map(of_task).collect::<Vec<f64>>().into_iter().sum()
            } else {
                forces.chunks_mut(TASK).enumerate().map(of_task).sum()
            };
        };
        material.visit(Force { cells: self, around, u, range, tasks });
        self.gather_forces(&forces, out);
        energy
    }

    /// Adds up what the cells give to each node.
    pub(super) fn gather_forces(&self, forces: &[[Vec3<Lane>; N]], out: &mut [f64]) {
        let (out, _) = out.as_chunks_mut::<3>();
        let gather = |(node, out): (usize, &mut [f64; 3])| {
            *out = [0.0; 3];
            for &(slot, a) in self.incidence.of(node) {
                let f = &forces[slot.batch as usize][a as usize];
                (0..3).for_each(|i| out[i] += f[i][slot.lane as usize]);
            }
        };
        if share(self.n_tasks()) {
            out.par_iter_mut().enumerate().with_min_len(1024).for_each(gather);
        } else {
            out.iter_mut().enumerate().for_each(gather);
        }
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
        for a in 0..N {
            for k in 0..3 {
                for i in 0..3 {
                    add_product(&mut forces[a][i], slopes[a][k], &flux[k][i]);
                }
            }
        }
    }
}

// The visitors call back with what goes through the cells of a task: nothing but that is compiled for every law.

/// The energy of the cells of a task.
type RunEnergy<'a> = dyn Fn(usize) -> f64 + Sync + 'a;

struct Energy<'a, E, A, const N: usize> {
    cells: &'a Cells<E, N>,
    around: A,
    u: &'a [f64],
    tasks: &'a mut dyn FnMut(&RunEnergy<'_>),
}

impl<E: Shape<N>, A: Surroundings, const N: usize> LawVisitor for Energy<'_, E, A, N> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        let Energy { cells, around, u, tasks } = self;
        tasks(&|task| {
            let first = task * TASK;
            let batches = &cells.batches[first..cells.batches.len().min(first + TASK)];
            dispatch(EnergyKernel { first, batches, around, u, make, shape: PhantomData::<E> })
        });
    }
}

struct EnergyKernel<'a, L, E, A, const N: usize> {
    first: usize,
    batches: &'a [Batch<N>],
    around: A,
    u: &'a [f64],
    make: fn(&[f64]) -> L,
    shape: PhantomData<E>,
}

impl<L: Law, E: Shape<N>, A: Surroundings, const N: usize> Kernel for EnergyKernel<'_, L, E, A, N> {
    type Output = f64;
    #[inline(always)]
    fn run(self) -> f64 {
        let mut sum = 0.0;
        for (number, batch) in (self.first..).zip(self.batches) {
            let law = (self.make)(&batch.parameters);
            let weight = batch.volume * (1.0 / E::POINTS as f64);
            for point in 0..E::POINTS {
                let f = batch.deformation(E::slopes(point), self.u);
                if L::FORBIDS_INVERSION && is_outside(&f, UPRIGHT) {
                    return f64::INFINITY;
                }
                let mut energy: Lane = law.energy(&f);
                self.around.energy(&law, number, &f, &mut energy);
                sum += (energy * weight).0.iter().sum::<f64>();
            }
        }
        sum
    }
}

/// Puts the forces of the cells of a task in place, and returns their energy.
type RunForces<'a, const N: usize> = dyn Fn(usize, &mut [[Vec3<Lane>; N]]) -> f64 + Sync + 'a;

struct Force<'a, E, A, const N: usize> {
    cells: &'a Cells<E, N>,
    around: A,
    u: &'a [f64],
    range: [f64; 2],
    tasks: &'a mut dyn FnMut(&RunForces<'_, N>),
}

impl<E: Shape<N>, A: Surroundings, const N: usize> LawVisitor for Force<'_, E, A, N> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        let Force { cells, around, u, range, tasks } = self;
        tasks(&|task, forces| {
            let (first, shape) = (task * TASK, PhantomData::<E>);
            let batches = &cells.batches[first..first + forces.len()];
            dispatch(ForceKernel { first, batches, around, u, range, make, forces, shape })
        });
    }
}

struct ForceKernel<'a, L, E, A, const N: usize> {
    first: usize,
    batches: &'a [Batch<N>],
    around: A,
    u: &'a [f64],
    range: [f64; 2],
    make: fn(&[f64]) -> L,
    forces: &'a mut [[Vec3<Lane>; N]],
    shape: PhantomData<E>,
}

impl<L: Law, E: Shape<N>, A: Surroundings, const N: usize> Kernel for ForceKernel<'_, L, E, A, N> {
    type Output = f64;
    #[inline(always)]
    fn run(self) -> f64 {
        let mut sum = Lane::default();
        for (number, (batch, forces)) in (self.first..).zip(self.batches.iter().zip(self.forces)) {
            let law = (self.make)(&batch.parameters);
            let weight = batch.volume * (1.0 / E::POINTS as f64);
            *forces = [[Lane::default(); 3]; N];
            for point in 0..E::POINTS {
                let slopes = E::slopes(point);
                let f = batch.deformation(slopes, self.u);
                if L::FORBIDS_INVERSION && is_outside(&f, self.range) {
                    return f64::INFINITY;
                }
                let (mut energy, mut stress) = law.energy_and_stress(&f);
                self.around.energy(&law, number, &f, &mut energy);
                self.around.stress(&law, number, &f, &mut stress);
                batch.add_forces(slopes, weight, &stress, forces);
                sum = sum + energy * weight;
            }
        }
        sum.0.iter().sum()
    }
}

/// Whether any cell of a batch has a `J` outside of an open range, or none at all.
#[inline(always)]
fn is_outside(f: &Mat3<Lane>, range: [f64; 2]) -> bool {
    determinant(f, &cofactor(f)).0.iter().any(|&j| !(j > range[0] && j < range[1]))
}
