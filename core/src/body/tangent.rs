//! The tangent: stress and stiffness batch by batch, then the blocks of all cells added up.

use super::blocks::SymmetricBlocks;
use super::cells::{Batch, Cells, Destination, NOWHERE};
use super::convex::make_convex;
use super::kernels::{Surroundings, TASK};
use super::{LANES, Lane};
use crate::element::Shape;
use crate::law::{Law, LawVisitor, Material, TangentBlocks};
use crate::simd::{Kernel, dispatch};
use crate::tensor::{Mat3, Vec3};
use crate::threads::share;
use crate::unroll::{array, tabulate};
use rayon::prelude::*;
use std::marker::PhantomData;

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
        material.visit(Tangent {
            cells: self,
            around,
            u,
            curvature,
            forces: &mut forces,
            tangent,
            rest,
        });
        self.gather_forces(&forces, out);
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

struct Tangent<'a, E, A, R, const N: usize> {
    cells: &'a Cells<E, N>,
    around: A,
    u: &'a [f64],
    curvature: Curvature,
    forces: &'a mut [[Vec3<Lane>; N]],
    tangent: &'a mut SymmetricBlocks,
    rest: R,
}

impl<E, A, R, const N: usize> LawVisitor for Tangent<'_, E, A, R, N>
where
    E: Shape<N>,
    A: Surroundings,
    R: Fn(usize, &mut [f64; 9]) + Sync,
{
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        let Tangent { cells, around, u, curvature, forces, tangent, rest } = self;
        let SymmetricBlocks { values, of_cells, .. } = tangent;
        let of_batch = LANES * 9 * Cells::<E, N>::PAIRS;
        let run = |task: usize, forces: &mut [[Vec3<Lane>; N]], blocks: Blocks<'_>| {
            let (first, shape) = (task * TASK, PhantomData::<E>);
            let batches = &cells.batches[first..first + forces.len()];
            TangentLoop { first, batches, around, u, curvature, make, forces, blocks, shape }.run();
        };
        if share(cells.n_tasks()) {
            of_cells.resize(of_batch * cells.batches.len(), 0.0);
            let tasks = forces.par_chunks_mut(TASK).zip(of_cells.par_chunks_mut(TASK * of_batch));
            tasks.enumerate().for_each(|(task, (forces, of_cells))| {
                run(task, forces, Blocks::OfCells(of_cells));
            });
            cells.gather_tangents(of_cells, values, rest);
            return;
        }
        let (values, _) = values.as_chunks_mut::<9>();
        values.fill([0.0; 9]);
        for (task, forces) in forces.chunks_mut(TASK).enumerate() {
            let destinations = &cells.destinations[task * TASK * LANES * Cells::<E, N>::PAIRS..];
            run(task, forces, Blocks::Summed { destinations, values });
        }
        values.iter_mut().enumerate().for_each(|(k, sum)| rest(k, sum));
    }
}

/// Where the blocks of a task's cells go.
enum Blocks<'a> {
    /// One after the other, to be gathered when all threads are done.
    OfCells(&'a mut [f64]),
    /// Into the tangent, by one thread.
    Summed { destinations: &'a [Destination], values: &'a mut [[f64; 9]] },
}

impl Blocks<'_> {
    /// Takes the blocks of a batch's cells, pair by pair; `number` is that of the batch in its task.
    fn take(&mut self, number: usize, sums: &[Mat3<Lane>]) {
        let cells = LANES * sums.len();
        match self {
            Blocks::OfCells(of_cells) => {
                let of_batch = &mut of_cells[9 * number * cells..9 * (number + 1) * cells];
                spread(sums, of_batch);
            }
            Blocks::Summed { destinations, values } => {
                scatter(sums, &destinations[number * cells..(number + 1) * cells], values);
            }
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
    first: usize,
    batches: &'a [Batch<N>],
    around: A,
    u: &'a [f64],
    curvature: Curvature,
    make: fn(&[f64]) -> L,
    forces: &'a mut [[Vec3<Lane>; N]],
    blocks: Blocks<'a>,
    shape: PhantomData<E>,
}

impl<L: Law, E: Shape<N>, A: Surroundings, const N: usize> TangentLoop<'_, L, E, A, N> {
    fn run(self) {
        let TangentLoop { first, batches, around, u, curvature, make, forces, mut blocks, .. } =
            self;
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
                add::<E, N>(batch, point, &response, forces, &mut sums);
            }
            blocks.take(local, &sums);
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

/// Adds the forces of a quadrature point, and sums its tangents: the first point's take the place of what is there.
#[inline(never)]
fn add<E: Shape<N>, const N: usize>(
    batch: &Batch<N>,
    point: usize,
    response: &Response,
    forces: &mut [Vec3<Lane>; N],
    sums: &mut [Mat3<Lane>],
) {
    struct Add<'a, E, const N: usize> {
        batch: &'a Batch<N>,
        point: usize,
        response: &'a Response,
        forces: &'a mut [Vec3<Lane>; N],
        sums: &'a mut [Mat3<Lane>],
        shape: PhantomData<E>,
    }
    impl<E: Shape<N>, const N: usize> Kernel for Add<'_, E, N> {
        type Output = ();
        #[inline(always)]
        fn run(self) {
            let (stress, blocks) = self.response;
            let slopes = E::slopes(self.point);
            let weight = self.batch.volume * (1.0 / E::POINTS as f64);
            self.batch.add_forces(slopes, weight, stress, self.forces);
            if N == 4 {
                set_linear_tangents(weight, blocks, self.sums);
                return;
            }
            if self.point == 0 {
                self.sums.fill(Mat3::default());
            }
            add_tangents(slopes, weight, blocks, self.sums);
        }
    }
    dispatch(Add { batch, point, response, forces, sums, shape: PhantomData::<E> });
}

/// `K_ab = w blocks[a - 1][b - 1]` for all pairs `a <= b` of the linear cell, whose slopes are those of the
/// barycentric coordinates: minus their sum for node 0.
#[inline(always)]
fn set_linear_tangents(weight: Lane, blocks: &TangentBlocks<Lane>, out: &mut [Mat3<Lane>]) {
    let Some(out) = out.first_chunk_mut::<10>() else {
        return;
    };
    for i in 0..3 {
        for j in 0..3 {
            let of = |a: usize, b: usize, i: usize, j: usize| blocks[a][b][i][j] * weight;
            let (aa, bb, cc) = (of(0, 0, i, j), of(1, 1, i, j), of(2, 2, i, j));
            let (ab, ac, bc) = (of(0, 1, i, j), of(0, 2, i, j), of(1, 2, i, j));
            let (ba, ca, cb) = (of(0, 1, j, i), of(0, 2, j, i), of(1, 2, j, i));
            let columns = [aa + ba + ca, ab + bb + cb, ac + bc + cc];
            let entries = [
                columns[0] + columns[1] + columns[2],
                -columns[0],
                -columns[1],
                -columns[2],
                aa,
                ab,
                ac,
                bb,
                bc,
                cc,
            ];
            (0..10).for_each(|pair| out[pair][i][j] = entries[pair]);
        }
    }
}

/// Adds `K_ab = w sum_kl slopes[a][k] blocks[k][l] slopes[b][l]` for all pairs `a <= b`.
#[inline(always)]
fn add_tangents<const N: usize>(
    slopes: &[[f64; 3]; N],
    weight: Lane,
    blocks: &TangentBlocks<Lane>,
    out: &mut [Mat3<Lane>],
) {
    let blocks: TangentBlocks<Lane> = array!(3, |k| {
        array!(3, |l| {
            tabulate!(|i, j| (if k <= l { blocks[k][l][i][j] } else { blocks[l][k][j][i] }) * weight)
        })
    });
    for b in 0..N {
        // sum_l blocks[k][l] slopes[b][l]
        let mut column = [Mat3::<Lane>::default(); 3];
        for k in 0..3 {
            for l in 0..3 {
                add_scaled(&mut column[k], slopes[b][l], &blocks[k][l]);
            }
        }
        for a in 0..=b {
            let pair = a * (2 * N + 1 - a) / 2 + b - a;
            for k in 0..3 {
                add_scaled(&mut out[pair], slopes[a][k], &column[k]);
            }
        }
    }
}

#[inline(always)]
fn add_scaled(sum: &mut Mat3<Lane>, slope: f64, block: &Mat3<Lane>) {
    for i in 0..3 {
        for j in 0..3 {
            sum[i][j] = sum[i][j] + block[i][j] * slope;
        }
    }
}
