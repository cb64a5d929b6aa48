//! The tangent: stress and stiffness batch by batch, then the blocks of all cells added up.

use super::blocks::SymmetricBlocks;
use super::cell_tangent::{add, add_times};
use super::cells::{Batch, Cells, Destination, NOWHERE};
use super::convex::make_convex;
use super::kernels::{Surroundings, TASK};
use super::{LANES, Lane};
use crate::element::Shape;
use crate::law::{Law, LawVisitor, Material, TangentBlocks};
use crate::simd::{Kernel, dispatch_here};
use crate::tensor::{Mat3, Vec3};
use crate::threads::share;
use rayon::prelude::*;
use std::marker::PhantomData;

dispatch_here!();

/// Which tangent is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// The derivative of the force.
    Exact,
    /// Cells that are not positive semidefinite are made so.
    Convex,
}

/// Stress and tangent of a law in the cells of a batch.
pub(super) type Response = (Mat3<Lane>, TangentBlocks<Lane>);

impl<E: Shape<N>, const N: usize> Cells<E, N> {
    /// Internal force and tangent, to each block of which `rest` adds.
    pub fn force_and_tangent(
        &self,
        material: &Material,
        around: impl Surroundings,
        (u, curvature): (&[f64], Curvature),
        out: &mut [f64],
        tangent: &mut SymmetricBlocks,
        rest: impl Fn(usize, &mut [f64; 9]) + Sync,
    ) {
        let mut forces = vec![[[Lane::default(); 3]; N]; self.batches.len()];
        let SymmetricBlocks { values, of_cells, .. } = tangent;
        let of_batch = LANES * 9 * Self::PAIRS;
        self.with_tangents(material, around, (u, curvature), &mut |run| {
            if share(self.n_tasks()) {
                of_cells.resize(of_batch * self.batches.len(), 0.0);
                let of_tasks = of_cells.par_chunks_mut(TASK * of_batch);
                let tasks = forces.par_chunks_mut(TASK).zip(of_tasks).enumerate();
                tasks.for_each(|(task, (forces, of_cells))| {
                    run(task, forces, Purpose::OfCells(of_cells));
                });
                return;
            }
            let (values, _) = values.as_chunks_mut::<9>();
            values.fill([0.0; 9]);
            for (task, forces) in forces.chunks_mut(TASK).enumerate() {
                let destinations = &self.destinations[task * TASK * LANES * Self::PAIRS..];
                run(task, forces, Purpose::Summed { destinations, values });
            }
        });
        if share(self.n_tasks()) {
            self.gather_tangents(of_cells, values, rest);
        } else {
            let (values, _) = values.as_chunks_mut::<9>();
            values.iter_mut().enumerate().for_each(|(k, sum)| rest(k, sum));
        }
        self.gather_forces(&forces, out);
    }

    /// Calls `tasks` with what goes through the cells of a task. Nothing but that is compiled for every law.
    pub(super) fn with_tangents(
        &self,
        material: &Material,
        around: impl Surroundings,
        at: (&[f64], Curvature),
        tasks: &mut dyn FnMut(&Run<'_, N>),
    ) {
        material.visit(Tangents { cells: self, around, at, tasks });
    }

    /// Adds up what the cells of all batches give to each block.
    fn gather_tangents(
        &self,
        of_cells: &[f64],
        values: &mut [f64],
        rest: impl Fn(usize, &mut [f64; 9]) + Sync,
    ) {
        let (of_cells, _) = of_cells.as_chunks::<9>();
        values.par_chunks_mut(9).enumerate().with_min_len(1024).for_each(|(block, out)| {
            let mut sum = [0.0; 9];
            for c in self.contributions.of(block) {
                add_block(&of_cells[c.of_cell as usize], c.transposed, &mut sum);
            }
            rest(block, &mut sum);
            out.copy_from_slice(&sum);
        });
    }
}

#[inline(always)]
fn add_block(block: &[f64; 9], transposed: bool, sum: &mut [f64; 9]) {
    if transposed {
        (0..9).for_each(|entry| sum[entry] += block[3 * (entry % 3) + entry / 3]);
    } else {
        (0..9).for_each(|entry| sum[entry] += block[entry]);
    }
}

/// Goes through the cells of a task: its number, their forces, and what their tangents are for.
pub(super) type Run<'a, const N: usize> =
    dyn Fn(usize, &mut [[Vec3<Lane>; N]], Purpose<'_, N>) + Sync + 'a;

struct Tangents<'a, E, A, const N: usize> {
    cells: &'a Cells<E, N>,
    around: A,
    at: (&'a [f64], Curvature),
    tasks: &'a mut dyn FnMut(&Run<'_, N>),
}

impl<E: Shape<N>, A: Surroundings, const N: usize> LawVisitor for Tangents<'_, E, A, N> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        let Tangents { cells, around, at, tasks } = self;
        tasks(&|task, forces, purpose| {
            TangentLoop::new(cells, task, around, at, make).run(forces, purpose);
        });
    }
}

/// What the tangents of a task's cells are for.
pub(super) enum Purpose<'a, const N: usize> {
    /// Blocks one after the other, to be gathered when all threads are done.
    OfCells(&'a mut [f64]),
    /// Blocks into the tangent, by one thread.
    Summed { destinations: &'a [Destination], values: &'a mut [[f64; 9]] },
    /// The blocks of each node with itself.
    Diagonal(&'a mut [[Mat3<Lane>; N]]),
    /// Products with a vector, which take the place of the forces.
    Product(&'a [f64]),
}

impl<const N: usize> Purpose<'_, N> {
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

/// The pieces of the tangent's loop. Each is compiled once for what it depends on, the law's for all elements, and not
/// inlined into the product of laws, elements and surroundings: that would take minutes.
struct TangentLoop<'a, L, E, A, const N: usize> {
    /// Number of the first batch.
    first: usize,
    /// Batches from there to the last of all.
    batches: &'a [Batch<N>],
    around: A,
    u: &'a [f64],
    curvature: Curvature,
    make: fn(&[f64]) -> L,
    shape: PhantomData<E>,
}

impl<'a, L: Law, E: Shape<N>, A: Surroundings, const N: usize> TangentLoop<'a, L, E, A, N> {
    /// Of the cells of a task.
    fn new(
        cells: &'a Cells<E, N>,
        task: usize,
        around: A,
        (u, curvature): (&'a [f64], Curvature),
        make: fn(&[f64]) -> L,
    ) -> Self {
        let first = task * TASK;
        let (batches, shape) = (&cells.batches[first..], PhantomData);
        TangentLoop { first, batches, around, u, curvature, make, shape }
    }

    /// Goes through as many batches as there are `forces`.
    fn run(self, forces: &mut [[Vec3<Lane>; N]], mut purpose: Purpose<'_, N>) {
        let TangentLoop { first, batches, around, u, curvature, make, .. } = self;
        let mut sums = vec![Mat3::<Lane>::default(); Cells::<E, N>::PAIRS];
        for (local, (batch, forces)) in batches.iter().zip(forces).enumerate() {
            let law = make(&batch.parameters);
            *forces = [[Lane::default(); 3]; N];
            for point in 0..E::POINTS {
                let f = dispatch(Deform::<E, N> { batch, point, u, shape: PhantomData });
                let g = &batch.gradients;
                let mut response = law_tangent(&law, &f, g);
                around.tangent(&law, first + local, (&f, g), &mut response);
                if curvature == Curvature::Convex {
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

/// [`Law::tangent`].
#[inline(never)]
fn law_tangent<L: Law>(law: &L, f: &Mat3<Lane>, g: &[Vec3<Lane>; 3]) -> Response {
    struct Tangent<'a, L>(&'a L, &'a Mat3<Lane>, &'a [Vec3<Lane>; 3]);
    impl<L: Law> Kernel for Tangent<'_, L> {
        type Output = Response;
        #[inline(always)]
        fn run(self) -> Response {
            self.0.tangent(self.1, self.2)
        }
    }
    dispatch(Tangent(law, f, g))
}
