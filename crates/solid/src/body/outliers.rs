//! Quadrature points whose volume ratio is out of a range, and how it changes with the displacement of their nodes.

use super::cells::{CellBatches, deformation};
use crate::element::{Geometry, Shape};
use crate::tensor::{cofactor, determinant, mul_vector};

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
                // dJ/du_a = cof F grad N_a.
                let slope = |a: usize| {
                    let gradient = std::array::from_fn(|j| {
                        (0..3).map(|k| slopes[a][k] * g.gradients[k][j]).sum::<f64>()
                    });
                    (nodes[a], mul_vector(&cofactor, &gradient))
                };
                outliers.push(Outlier {
                    cell,
                    point: cell * E::POINTS + point,
                    volume_ratio,
                    volume: g.volume / E::POINTS as f64,
                    slopes: (0..N).map(slope).collect(),
                });
            }
        }
        outliers
    }
}
