//! The tangent: stress and stiffness batch by batch, then the blocks of all cells added up.

use super::blocks::SymmetricBlocks;
use super::cell_tangent::{StressTangent, add, add_times};
use super::cells::{Batch, CellBatches};
use super::clusters::Around;
use super::convex::make_convex;
use super::curvature::Curvature;
use super::tasks::TASK;
use super::waves::{Destination, NOWHERE, Waves};
use crate::element::Shape;
use crate::law::LawKernels;
use crate::number::{LANES, Lane};
use crate::simd::{Kernel, dispatch_solver, prefetch};
use crate::tensor::{Mat3, Vec3};
use crate::threads::{for_parts, share_among_many};
use rayon::prelude::*;
use std::marker::PhantomData;
use std::slice::{from_mut, from_ref};

/// Blocks that a thread takes at once.
const PART: usize = 4_096;

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// Internal force and tangent, to each block of which `rest` adds.
    pub fn force_and_tangent(
        &self,
        law: &dyn LawKernels,
        around: Around<'_>,
        (u, curvature): (&[f64], Curvature),
        out: &mut [f64],
        tangent: &mut SymmetricBlocks,
        rest: impl Fn(usize, &mut [f64; 9]) + Sync,
    ) {
        let SymmetricBlocks { values, of_cells, .. } = tangent;
        let of_task = TangentLoop { cells: self, law, around, u, curvature };
        let (values, _) = values.as_chunks_mut::<9>();
        if share_among_many(self.n_tasks()) {
            let mut forces = vec![[[Lane::default(); 3]; N]; self.batches.len()];
            let run = |task: usize, forces: &mut [_], blocks: &mut [f64]| {
                of_task.run(task, forces, Purpose::OfCells(blocks));
            };
            self.gather_tangents(run, &mut forces, of_cells, values);
            for_parts(values, PART, |number, values| {
                let blocks = values.iter_mut().enumerate();
                blocks.for_each(|(k, sum)| rest(number * PART + k, sum));
            });
            self.gather_forces(&forces, out);
        } else {
            values.fill([0.0; 9]);
            self.forces_by_one(out, |task, forces| {
                let destinations = &self.destinations[task * TASK * LANES * Self::PAIRS..];
                of_task.run(task, forces, Purpose::Summed { destinations, values });
                0.0
            });
            values.iter_mut().enumerate().for_each(|(k, sum)| rest(k, sum));
        }
    }

    /// Sums the blocks of all cells, which `of_task` finds for the batches of a task, with their forces.
    fn gather_tangents(
        &self,
        of_task: impl Fn(usize, &mut [[Vec3<Lane>; N]], &mut [f64]) + Sync,
        forces: &mut [[Vec3<Lane>; N]],
        of_cells: &mut Vec<f64>,
        values: &mut [[f64; 9]],
    ) {
        let in_task = TASK * LANES * Self::PAIRS;
        let waves = self.waves.get_or_init(|| Waves::new(&self.destinations, in_task));
        of_cells.resize(9 * in_task * waves.n_tasks(), 0.0);
        for_parts(values, PART, |_, values| values.fill([0.0; 9]));
        for ((tasks, wave), forces) in waves.iter().zip(forces.chunks_mut(TASK * waves.n_tasks())) {
            let parts = forces.par_chunks_mut(TASK).zip(of_cells.par_chunks_mut(9 * in_task));
            parts.zip(tasks).for_each(|((forces, blocks), task)| of_task(task, forces, blocks));
            wave.gather(of_cells.as_chunks().0, values);
        }
    }
}

/// Use of the tangents of a task's cells.
pub(super) enum Purpose<'a, const N: usize> {
    /// Blocks one after the other, to be gathered when all threads are done.
    OfCells(&'a mut [f64]),
    /// Blocks into the tangent, by one thread.
    Summed { destinations: &'a [Destination], values: &'a mut [[f64; 9]] },
    /// The blocks of each node with itself.
    Diagonal(&'a mut [[Mat3<Lane>; N]]),
    /// Products with a vector, instead of the forces.
    Product(&'a [f64]),
}

impl<const N: usize> Purpose<'_, N> {
    /// Asks for the blocks to which the next batch adds, while its law is evaluated: their places are as good as random.
    #[inline(always)]
    fn prefetch(&self, number: usize, pairs: usize) {
        if let Purpose::Summed { destinations, values } = self {
            let cells = LANES * pairs;
            for d in &destinations[number * cells..(number + 1) * cells] {
                if let Some(block) = values.get(d.block as usize) {
                    prefetch(block);
                }
            }
        }
    }

    /// Takes the blocks of a batch's cells, pair by pair; `number` is that of the batch in its task.
    fn take(&mut self, number: usize, sums: &[Mat3<Lane>]) {
        let cells = LANES * sums.len();
        match self {
            Purpose::OfCells(of_cells) => {
                let of_batch = &mut of_cells[9 * number * cells..9 * (number + 1) * cells];
                spread(sums, of_batch);
            }
            Purpose::Summed { destinations, values } => {
                scatter(sums, &destinations[number * cells..(number + 1) * cells], values);
            }
            Purpose::Diagonal(blocks) => {
                let own = |a: usize| sums[a * (2 * N + 1 - a) / 2];
                blocks[number].iter_mut().enumerate().for_each(|(a, block)| *block = own(a));
            }
            Purpose::Product(_) => {}
        }
    }
}

/// Cell by cell, so that the gathering finds the nine entries of a block side by side.
fn spread(sums: &[Mat3<Lane>], of_cells: &mut [f64]) {
    for (lane, cell) in of_cells.chunks_exact_mut(9 * sums.len()).enumerate() {
        for (out, block) in cell.as_chunks_mut::<9>().0.iter_mut().zip(sums) {
            (0..9).for_each(|entry| out[entry] = block[entry / 3][entry % 3][lane]);
        }
    }
}

/// Adds the blocks of each cell to those of the tangent.
fn scatter(sums: &[Mat3<Lane>], destinations: &[Destination], values: &mut [[f64; 9]]) {
    for (lane, destinations) in destinations.chunks_exact(sums.len()).enumerate() {
        for (block, d) in sums.iter().zip(destinations) {
            if d.block == NOWHERE {
                continue;
            }
            let sum = &mut values[d.block as usize];
            if d.transposed {
                (0..9).for_each(|entry| sum[entry] += block[entry % 3][entry / 3][lane]);
            } else {
                (0..9).for_each(|entry| sum[entry] += block[entry / 3][entry % 3][lane]);
            }
        }
    }
}

/// Goes through the cells of tasks. Its pieces are compiled once for what each depends on.
pub(super) struct TangentLoop<'a, E, const N: usize> {
    pub cells: &'a CellBatches<E, N>,
    pub law: &'a dyn LawKernels,
    pub around: Around<'a>,
    pub u: &'a [f64],
    pub curvature: Curvature,
}

impl<E: Shape<N>, const N: usize> TangentLoop<'_, E, N> {
    /// Goes through a task: as many batches as there are `forces`.
    pub fn run(&self, task: usize, forces: &mut [[Vec3<Lane>; N]], mut purpose: Purpose<'_, N>) {
        let &TangentLoop { cells, law, around, u, curvature } = self;
        let mut sums = vec![Mat3::<Lane>::default(); CellBatches::<E, N>::PAIRS];
        let mut response = StressTangent::default();
        let mut pressure = [Lane::default()];
        for (local, forces) in forces.iter_mut().enumerate() {
            let number = task * TASK + local;
            let batch = &cells.batches[number];
            purpose.prefetch(local, CellBatches::<E, N>::PAIRS);
            let (row, g) = (&cells.tissues[batch.tissue as usize], &batch.gradients);
            let shared = around.of(number..number + 1, &mut pressure);
            for point in 0..E::POINTS {
                let f = dispatch_solver(Deform::<E, N> { batch, point, u, shape: PhantomData });
                let (stress, blocks) = &mut response;
                law.tangent(row, &[f], from_ref(g), shared, from_mut(stress), from_mut(blocks));
                if curvature == Curvature::Projected {
                    make_convex(&mut response.1);
                }
                if let Purpose::Product(x) = purpose {
                    add_times::<E, N>(batch, point, &response.1, x, forces);
                } else {
                    add::<E, N>(batch, point, &response, forces, &mut sums);
                }
            }
            purpose.take(local, &sums);
        }
    }
}

struct Deform<'a, E, const N: usize> {
    batch: &'a Batch<N>,
    point: usize,
    u: &'a [f64],
    shape: PhantomData<E>,
}

impl<E: Shape<N>, const N: usize> Kernel for Deform<'_, E, N> {
    type Output = Mat3<Lane>;
    #[inline(always)]
    fn run(self) -> Mat3<Lane> {
        self.batch.deformation(E::slopes(self.point), self.u)
    }
}
