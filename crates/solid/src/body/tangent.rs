//! The tangent: stress and stiffness batch by batch, then the blocks of all cells added up.

use super::batch::Batch;
use super::blocks::SymmetricBlocks;
use super::cell_tangent::{StressTangent, add, add_times};
use super::cells::CellBatches;
use super::clusters::Around;
use super::convex::make_convex;
use super::curvature::Curvature;
use super::task_sums::{BlockPlace, add_to_blocks};
use super::workspace::CellWorkspace;
use crate::element::Shape;
use crate::law::LawKernels;
use crate::number::Lane;
use crate::simd::{Kernel, dispatch_solver};
use crate::tensor::{Mat3, Vec3};
use crate::threads::for_parts;
use rayon::prelude::*;
use std::marker::PhantomData;
use std::slice::{from_mut, from_ref};

/// Blocks that a thread takes at once.
const PART: usize = 4_096;

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// Internal force and tangent, to each block of which `rest` adds.
    pub fn force_and_tangent(
        &self,
        (law, around): (&dyn LawKernels, Around<'_>),
        (u, curvature): (&[f64], Curvature),
        workspace: &mut CellWorkspace,
        out: &mut [f64],
        tangent: &mut SymmetricBlocks,
        rest: impl Fn(usize, &mut [f64; 9]) + Sync,
    ) {
        let of_task = TangentLoop { cells: self, law, around, u, curvature };
        let SymmetricBlocks { values, of_tasks, .. } = tangent;
        let values = values.as_chunks_mut::<9>().0;
        if workspace.shares(self.n_tasks()) {
            self.tangents_by_threads(&of_task, of_tasks, out, values);
            for_parts(values, PART, |number, values| {
                let blocks = values.iter_mut().enumerate();
                blocks.for_each(|(k, sum)| rest(number * PART + k, sum));
            });
        } else {
            self.tangents_by_one(&of_task, workspace, out, values);
            values.iter_mut().enumerate().for_each(|(k, sum)| rest(k, sum));
        }
    }

    /// Sums forces and tangents of all cells, task after task.
    fn tangents_by_one(
        &self,
        of_task: &TangentLoop<'_, E, N>,
        workspace: &mut CellWorkspace,
        out: &mut [f64],
        values: &mut [[f64; 9]],
    ) {
        let CellWorkspace { forces, tangents, nodal, blocks, .. } = workspace;
        tangents.resize(Self::PAIRS, Mat3::default());
        blocks.resize(self.sums.most[1], [0.0; 9]);
        self.sums.clear_others(values);
        self.forces_by_one((forces, nodal), out, |task, forces| {
            let blocks = &mut blocks[..self.sums.n_blocks(task)];
            blocks.fill([0.0; 9]);
            of_task.run(task, forces, tangents, Purpose::Blocks(blocks));
            self.sums.add_blocks(task, blocks, values);
            0.0
        });
    }

    /// The same by all threads, wave by wave.
    fn tangents_by_threads(
        &self,
        of_task: &TangentLoop<'_, E, N>,
        of_tasks: &mut Vec<[f64; 9]>,
        out: &mut [f64],
        values: &mut [[f64; 9]],
    ) {
        let mut nodal = self.sums.room();
        let mut of_nodes = self.sums.nodes_by_task(&mut nodal).into_iter();
        let room =
            || (vec![[[Lane::default(); 3]; N]; Self::TASK], vec![Mat3::default(); Self::PAIRS]);
        self.sums.clear_others(values);
        for wave in self.sums.waves().iter() {
            of_tasks.resize(of_tasks.len().max(wave.n_blocks), [0.0; 9]);
            let of_blocks = self.sums.blocks_by_task(wave, of_tasks);
            let parts: Vec<_> = wave.tasks.clone().zip(of_nodes.by_ref().zip(of_blocks)).collect();
            parts.into_par_iter().for_each_init(
                room,
                |(forces, tangents), (task, (nodal, blocks))| {
                    let batches = self.batches_of(task);
                    let forces = &mut forces[..batches.len()];
                    blocks.fill([0.0; 9]);
                    of_task.run(task, forces, tangents, Purpose::Blocks(blocks));
                    self.sums.sum_forces(task, batches, forces, nodal);
                },
            );
            wave.gather(of_tasks, values);
        }
        self.sums.gather_forces(&nodal, out.as_chunks_mut().0);
    }
}

/// Use of the tangents of a task's cells.
pub(super) enum Purpose<'a, const N: usize> {
    /// Sums at the blocks of the task.
    Blocks(&'a mut [[f64; 9]]),
    /// The blocks of each node with itself.
    Diagonal(&'a mut [[Mat3<Lane>; N]]),
    /// Products with a vector, instead of the forces.
    Product(&'a [f64]),
}

impl<const N: usize> Purpose<'_, N> {
    /// Takes the blocks of a batch's cells, pair by pair; `local` is the number of the batch in its task.
    fn take(
        &mut self,
        local: usize,
        n_cells: usize,
        tangents: &[Mat3<Lane>],
        places: &[BlockPlace],
    ) {
        match self {
            Purpose::Blocks(blocks) => add_to_blocks(tangents, n_cells, places, blocks),
            Purpose::Diagonal(blocks) => {
                let own = |a: usize| tangents[a * (2 * N + 1 - a) / 2];
                blocks[local].iter_mut().enumerate().for_each(|(a, block)| *block = own(a));
            }
            Purpose::Product(_) => {}
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
    /// Goes through a task: as many batches as there are `forces`; `tangents` is where those of a batch are put.
    pub fn run(
        &self,
        task: usize,
        forces: &mut [[Vec3<Lane>; N]],
        tangents: &mut [Mat3<Lane>],
        mut purpose: Purpose<'_, N>,
    ) {
        let &TangentLoop { cells, law, around, u, curvature } = self;
        let mut response = StressTangent::default();
        let mut pressure = [Lane::default()];
        for (local, forces) in forces.iter_mut().enumerate() {
            let number = task * CellBatches::<E, N>::TASK + local;
            let batch = &cells.batches[number];
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
                    add::<E, N>(batch, point, &response, forces, tangents);
                }
            }
            let places = cells.sums.block_places(number);
            purpose.take(local, batch.n_cells as usize, tangents, places);
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
