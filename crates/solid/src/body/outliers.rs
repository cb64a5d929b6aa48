//! Quadrature points whose volume ratio is out of a range, and how it changes with the displacement of their nodes, to
//! first and second order.

use super::cells::{CellBatches, deformation};
use super::convex::make_convex;
use crate::element::{Geometry, Shape};
use crate::law::TangentBlocks;
use crate::number::{LANES, Lanes};
use crate::tensor::{Mat3, cofactor, determinant, mul_vector};
use crate::unroll::tabulate;

/// A quadrature point of a cell at a displacement.
#[derive(Clone, Debug)]
pub struct Outlier {
    /// Its cell.
    pub cell: usize,
    /// Its number in the body: cell by cell, as in [`Body::volume_ratios`](super::Body::volume_ratios).
    pub point: usize,
    /// `J`.
    pub volume_ratio: f64,
    /// Its weight: its share of the cell's volume at rest [m^3].
    pub volume: f64,
    /// `dJ/du` of each node of the cell [1/m].
    pub slopes: Vec<(u32, [f64; 3])>,
    /// `grad N` of each node [1/m].
    gradients: Vec<[f64; 3]>,
    /// `F`, and its cofactor, `dJ/dF`.
    deformation: Mat3<f64>,
    cofactor: Mat3<f64>,
}

impl Outlier {
    /// The second derivative in `F` of a function of `J`, of which the first and second derivative are given:
    /// `f'' dJ/dF dJ/dF + f' d2J/dF2` with `d2J/(dF_ij dF_kl) = eps_ikm eps_jln F_mn`, entry `[j][l][i][k]`.
    pub fn curvature(&self, [first, second]: [f64; 2]) -> TangentBlocks<f64> {
        let (f, cofactor) = (&self.deformation, &self.cofactor);
        // Sign of the permutation that begins with a and b, and its last number.
        let third = |a: usize, b: usize| ([0.0, 1.0, -1.0][(3 + b - a) % 3], (6 - a - b) % 3);
        blocks_of(|j, l, i, k| {
            let ((row, m), (column, n)) = (third(i, k), third(j, l));
            second * cofactor[i][j] * cofactor[k][l] + first * row * column * f[m][n]
        })
    }

    /// That derivative made convex.
    pub fn convex_curvature(&self, derivatives: [f64; 2]) -> TangentBlocks<f64> {
        let exact = self.curvature(derivatives);
        let mut lanes = exact
            .map(|row| row.map(|block| block.map(|row| row.map(|entry| Lanes([entry; LANES])))));
        make_convex(&mut lanes);
        blocks_of(|j, l, i, k| if j <= l { lanes[j][l][i][k][0] } else { lanes[l][j][k][i][0] })
    }

    /// The stiffness that a curvature in `F` means for each pair of nodes `(a, b)`, `a <= b`, entries `[3 i + k]`.
    pub fn stiffness(
        &self,
        curvature: &TangentBlocks<f64>,
    ) -> impl Iterator<Item = (u32, u32, [f64; 9])> {
        let nodes = || self.slopes.iter().map(|(node, _)| *node).zip(&self.gradients);
        let pairs = nodes().flat_map(move |a| nodes().map(move |b| (a, b)));
        pairs.filter(|((a, _), (b, _))| a <= b).map(|((a, grad_a), (b, grad_b))| {
            let entry = |i: usize, k: usize| -> f64 {
                let part = |p: usize| (p / 3, p % 3);
                let parts = (0..9).map(part);
                parts.map(|(j, l)| curvature[j][l][i][k] * grad_a[j] * grad_b[l]).sum()
            };
            (a, b, std::array::from_fn(|p| entry(p / 3, p % 3)))
        })
    }
}

fn blocks_of(entry: impl Fn(usize, usize, usize, usize) -> f64) -> TangentBlocks<f64> {
    let block = |j, l| tabulate!(|i, k| entry(j, l, i, k));
    tabulate!(|j, l| block(j, l))
}

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    pub fn outliers(
        &self,
        geometry: &[Geometry],
        u: &[f64],
        [low, high]: [f64; 2],
    ) -> Vec<Outlier> {
        let mut outliers = Vec::new();
        for (cell, (nodes, g)) in self.nodes.iter().zip(geometry).enumerate() {
            for point in 0..E::POINTS {
                let slopes = E::slopes(point);
                let value = |a: usize, i: usize| u[3 * nodes[a] as usize + i];
                let f = deformation(slopes, &g.gradients, value);
                let cofactor = cofactor(&f);
                let volume_ratio = determinant(&f, &cofactor);
                if volume_ratio > low && volume_ratio < high {
                    continue;
                }
                let gradient = |a: usize| {
                    std::array::from_fn(|j| {
                        (0..3).map(|k| slopes[a][k] * g.gradients[k][j]).sum::<f64>()
                    })
                };
                // dJ/du_a = cof F grad N_a.
                let slope = |a: usize| (nodes[a], mul_vector(&cofactor, &gradient(a)));
                outliers.push(Outlier {
                    cell,
                    point: cell * E::POINTS + point,
                    volume_ratio,
                    volume: g.volume / E::POINTS as f64,
                    slopes: (0..N).map(slope).collect(),
                    gradients: (0..N).map(gradient).collect(),
                    deformation: f,
                    cofactor,
                });
            }
        }
        outliers
    }
}
