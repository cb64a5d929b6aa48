//! Matrices for the tests of this module, and the dense answers to hold the solvers against.

use super::Pattern;
use viscera_number::norm;

/// A symmetric matrix: a pattern and its values.
#[derive(Clone)]
pub(super) struct Matrix {
    pub pattern: Pattern,
    pub values: Vec<f64>,
}

impl Matrix {
    /// From entries of either triangle; entries at the same place add up.
    pub fn from_entries(n: usize, entries: &[(usize, usize, f64)]) -> Self {
        let mut sorted: Vec<_> = entries.iter().map(|&(i, j, v)| (i.max(j), i.min(j), v)).collect();
        sorted.extend((0..n).map(|i| (i, i, 0.0)));
        sorted.sort_by_key(|&(column, row, _)| (column, row));
        let mut matrix = Self {
            pattern: Pattern { n, column_start: vec![0; n + 1], row: vec![] },
            values: vec![],
        };
        let mut last = None;
        for (column, row, value) in sorted {
            if last == Some((column, row)) {
                *matrix.values.last_mut().unwrap() += value;
                continue;
            }
            last = Some((column, row));
            matrix.pattern.row.push(row as u32);
            matrix.values.push(value);
            matrix.pattern.column_start[column + 1] += 1;
        }
        (0..n).for_each(|i| matrix.pattern.column_start[i + 1] += matrix.pattern.column_start[i]);
        matrix
    }

    /// Position of a diagonal entry in the values.
    pub fn diagonal(&self, row: usize) -> usize {
        self.pattern.column(row).end - 1
    }

    /// Adds `shift` to the whole diagonal.
    pub fn shifted(mut self, shift: f64) -> Self {
        for row in 0..self.pattern.n {
            let diagonal = self.diagonal(row);
            self.values[diagonal] += shift;
        }
        self
    }

    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        self.pattern.multiply(&self.values, x, &mut y);
        y
    }

    /// `|b - A x| / |b|`.
    pub fn relative_residual(&self, x: &[f64], b: &[f64]) -> f64 {
        let residual: Vec<f64> = self.multiply(x).iter().zip(b).map(|(ax, b)| b - ax).collect();
        norm(&residual) / norm(b)
    }

    /// The full matrix, column-major.
    pub fn dense(&self) -> faer::Mat<f64> {
        let mut dense = faer::Mat::zeros(self.pattern.n, self.pattern.n);
        for column in 0..self.pattern.n {
            for entry in self.pattern.column(column) {
                let row = self.pattern.row[entry] as usize;
                dense[(row, column)] = self.values[entry];
                dense[(column, row)] = self.values[entry];
            }
        }
        dense
    }
}

/// An elastic block of `nx x ny x nz` free nodes, three dofs each, numbered node by node and clamped beyond
/// the face `x = 0`: springs along the edges of the six-tetrahedra split of every cell, with some shear stiffness.
pub(super) fn elastic_block(nx: usize, ny: usize, nz: usize) -> Matrix {
    block(nx, ny, nz, true)
}

/// The same block, held by nothing.
pub(super) fn floating_block(nx: usize, ny: usize, nz: usize) -> Matrix {
    block(nx, ny, nz, false)
}

fn block(nx: usize, ny: usize, nz: usize, is_held: bool) -> Matrix {
    const DIRECTIONS: [[usize; 3]; 7] =
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 1, 1]];
    let node = |p: [usize; 3]| 3 * (p[0] + nx * (p[1] + ny * p[2]));
    let mut entries = Vec::new();
    let mut spring = |a: Option<usize>, b: usize, direction: [usize; 3], stiffness: f64| {
        let length2 = direction.iter().sum::<usize>() as f64;
        for i in 0..3 {
            for j in 0..3 {
                let along = (direction[i] * direction[j]) as f64 / length2;
                let k = stiffness * (along + if i == j { 0.3 } else { 0.0 });
                if i <= j {
                    entries.push((b + i, b + j, k));
                    a.iter().for_each(|a| entries.push((a + i, a + j, k)));
                }
                a.iter().for_each(|a| entries.push((a + i, b + j, -k)));
            }
        }
    };
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                for (index, direction) in DIRECTIONS.into_iter().enumerate() {
                    let end = [x + direction[0], y + direction[1], z + direction[2]];
                    let stiffness = 1.0 + 0.5 * ((node([x, y, z]) * 7 + index * 13) as f64).sin();
                    if end[0] < nx && end[1] < ny && end[2] < nz {
                        spring(Some(node([x, y, z])), node(end), direction, stiffness);
                    }
                    if is_held && x == 0 && direction[0] == 1 {
                        spring(None, node([x, y, z]), direction, stiffness);
                    }
                }
            }
        }
    }
    Matrix::from_entries(3 * nx * ny * nz, &entries)
}

/// A vector without structure, the same on every run.
pub(super) fn load(n: usize, seed: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 37 + seed * 101 + 1) as f64 * 0.7).sin()).collect()
}

/// `|x - y| / |y|`.
pub(super) fn relative_difference(x: &[f64], y: &[f64]) -> f64 {
    norm(&x.iter().zip(y).map(|(x, y)| x - y).collect::<Vec<_>>()) / norm(y)
}
