//! A linear system of a small body, and its solution by elimination.

use super::{Block, internal_force, moduli};
use std::sync::Arc;
use viscera_gpu::{Gpu, Law, Mean, Settings, System};

pub const TIGHT: Settings =
    Settings { tolerance: 1e-6, max_iterations: 2000, check_every: 16, deadline: None };

/// A block's tangent at rest in double precision: linear elasticity, whose blocks are those of differences of forces.
pub struct Problem {
    pub pairs: Vec<(u32, u32)>,
    pub values: Vec<f64>,
    pub dense: Vec<Vec<f64>>,
    pub is_held: Vec<bool>,
    pub b: Vec<f64>,
}

impl Problem {
    pub fn new(block: &Block, nu: f64) -> Self {
        let (mu, lam) = moduli(nu);
        let rows = [vec![mu, lam]];
        let solid = block.solid(&Law::Linear, &rows);
        let n = 3 * block.points.len();
        let size = 1e-3;
        let column = |dof: usize| {
            let mut u = vec![0.0; n];
            u[dof] = size;
            internal_force(&solid, &u).into_iter().map(|f| f / size).collect::<Vec<f64>>()
        };
        let columns: Vec<Vec<f64>> = (0..n).map(column).collect();
        let entry = |r: usize, c: usize| 0.5 * (columns[c][r] + columns[r][c]);
        let pairs = block.pairs();
        let of_block = |&(r, c): &(u32, u32)| {
            (0..9).map(move |k| (3 * r as usize + k / 3, 3 * c as usize + k % 3))
        };
        let values = pairs.iter().flat_map(of_block).map(|(r, c)| entry(r, c)).collect();
        let dense = (0..n).map(|r| (0..n).map(|c| entry(r, c)).collect()).collect();
        let b = (0..n).map(|k| (1.3 * k as f64).sin()).collect();
        Problem { pairs, values, dense, is_held: block.is_held(), b }
    }

    pub fn system(&self, gpu: &Arc<Gpu>, means: &[Mean]) -> System {
        let mut system = System::new(gpu, self.b.len() / 3, &self.pairs).unwrap();
        system.hold(&self.is_held, means).unwrap();
        system.load(&self.values, 0.0).unwrap();
        system
    }

    /// Gaussian elimination of `[A W^T; W 0]`, with rows of the identity for held degrees of freedom.
    pub fn exact(&self, means: &[Mean], shift: f64) -> Vec<f64> {
        let (n, k) = (self.b.len(), means.len());
        let mut a = vec![vec![0.0; n + k + 1]; n + k];
        for r in 0..n {
            for c in 0..n {
                let is_free = !self.is_held[r] && !self.is_held[c];
                let diagonal = f64::from(u8::from(r == c));
                a[r][c] = if is_free { self.dense[r][c] + shift * diagonal } else { diagonal };
            }
            a[r][n + k] = if self.is_held[r] { 0.0 } else { self.b[r] };
        }
        for (m, mean) in means.iter().enumerate() {
            for &(dof, weight) in mean {
                a[dof as usize][n + m] = weight;
                a[n + m][dof as usize] = weight;
            }
        }
        for pivot in 0..n + k {
            let best =
                (pivot..n + k).max_by(|&r, &s| a[r][pivot].abs().total_cmp(&a[s][pivot].abs()));
            a.swap(pivot, best.unwrap());
            let row = a[pivot].clone();
            for r in (0..n + k).filter(|&r| r != pivot) {
                let factor = a[r][pivot] / row[pivot];
                (pivot..=n + k).for_each(|c| a[r][c] -= factor * row[c]);
            }
        }
        (0..n).map(|r| a[r][n + k] / a[r][r]).collect()
    }
}

/// Three means of a few points of the free end, weights of each summing to 1.
pub fn means(block: &Block) -> Vec<Mean> {
    let nodes: Vec<u32> = (0..4).map(|k| (block.points.len() - 2 * k - 1) as u32).collect();
    let row = |i: u32| (1..).zip(&nodes).map(|(w, n)| (3 * n + i, f64::from(w) / 10.0)).collect();
    (0..3).map(row).collect()
}
