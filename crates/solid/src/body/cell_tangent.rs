//! The tangent of a cell from that of its law: summed over quadrature points, or multiplied with a vector.

use super::batch::{Batch, add_product};
use crate::element::Shape;
use crate::law::TangentBlocks;
use crate::number::{LANES, Lane};
use crate::simd::{Kernel, dispatch_solver};
use crate::tensor::{Mat3, Vec3};
use crate::unroll::{array, each, tabulate};
use std::marker::PhantomData;

/// Stress and tangent of a law in the cells of a batch.
pub(super) type StressTangent = (Mat3<Lane>, TangentBlocks<Lane>);

/// Adds the forces and tangents of a quadrature point; those of the first point overwrite the old values.
#[inline(never)]
pub(super) fn add<E: Shape<N>, const N: usize>(
    batch: &Batch<N>,
    point: usize,
    response: &StressTangent,
    forces: &mut [Vec3<Lane>; N],
    sums: &mut [Mat3<Lane>],
) {
    struct Add<'a, E, const N: usize> {
        batch: &'a Batch<N>,
        point: usize,
        response: &'a StressTangent,
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
            if self.point == 0 {
                *self.forces = [[Lane::default(); 3]; N];
            }
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
    dispatch_solver(Add { batch, point, response, forces, sums, shape: PhantomData::<E> });
}

/// Adds `K_e x` of the tangents at a quadrature point, with a vector `x` of all nodes; those of the first point overwrite
/// the old values.
#[inline(never)]
pub(super) fn add_times<E: Shape<N>, const N: usize>(
    batch: &Batch<N>,
    point: usize,
    blocks: &TangentBlocks<Lane>,
    x: &[f64],
    products: &mut [Vec3<Lane>; N],
) {
    struct AddTimes<'a, E, const N: usize> {
        batch: &'a Batch<N>,
        point: usize,
        blocks: &'a TangentBlocks<Lane>,
        x: &'a [f64],
        products: &'a mut [Vec3<Lane>; N],
        shape: PhantomData<E>,
    }
    impl<E: Shape<N>, const N: usize> Kernel for AddTimes<'_, E, N> {
        type Output = ();
        #[inline(always)]
        fn run(self) {
            let weight = self.batch.volume * (1.0 / E::POINTS as f64);
            let slopes = E::slopes(self.point);
            let nodal = |a: usize, i: usize| {
                let mut value = Lane::default();
                for lane in 0..LANES {
                    value[lane] = self.x[3 * self.batch.nodes[lane][a] as usize + i];
                }
                value
            };
            // sum_b slopes[b][l] x_b
            let mut along = [[Lane::default(); 3]; 3];
            each!(N, |b| {
                for i in 0..3 {
                    let value = nodal(b, i);
                    array!(3, |l| add_product(&mut along[l][i], slopes[b][l], &value));
                }
            });
            if self.point == 0 {
                *self.products = [[Lane::default(); 3]; N];
            }
            for k in 0..3 {
                let flux = contract(self.blocks, k, &along);
                each!(N, |a| {
                    array!(3, |i| add_product(
                        &mut self.products[a][i],
                        slopes[a][k],
                        &(flux[i] * weight)
                    ));
                });
            }
        }
    }
    dispatch_solver(AddTimes { batch, point, blocks, x, products, shape: PhantomData::<E> });
}

/// `sum_l blocks[k][l] along[l]`.
#[inline(always)]
fn contract(blocks: &TangentBlocks<Lane>, k: usize, along: &[Vec3<Lane>; 3]) -> Vec3<Lane> {
    let mut flux = [Lane::default(); 3];
    for l in 0..3 {
        for i in 0..3 {
            for j in 0..3 {
                let entry = if k <= l { blocks[k][l][i][j] } else { blocks[l][k][j][i] };
                flux[i] = flux[i] + entry * along[l][j];
            }
        }
    }
    flux
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
