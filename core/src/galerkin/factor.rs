//! The reduced tangent with its constraints, factorised: small, dense and without allocation where it matters.

use super::nnls::dot;

/// First shift of an indefinite tangent, in units of its mean diagonal entry; ten times more until it is definite.
const SHIFT: f64 = 1e-3;

/// Cholesky factor of `K`, and of `A K^-1 A^T`.
pub(super) struct Factor {
    r: usize,
    /// Rows of the lower factor, each `r` long.
    lower: Vec<f64>,
    /// Rows of `A K^-1`.
    influence: Vec<f64>,
    /// Rows of the lower factor of `A K^-1 A^T`, each as long as there are constraints.
    compliance: Vec<f64>,
    constraints: usize,
    is_ready: bool,
    is_shifted: bool,
}

impl Factor {
    /// Room for `r` coordinates under some constraints.
    pub fn new(r: usize, constraints: usize) -> Self {
        Factor {
            r,
            lower: vec![0.0; r * r],
            influence: vec![0.0; constraints * r],
            compliance: vec![0.0; constraints * constraints],
            constraints,
            is_ready: false,
            is_shifted: false,
        }
    }

    /// Whether there is a tangent.
    pub fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Whether it had to be shifted to be positive definite.
    pub fn is_shifted(&self) -> bool {
        self.is_shifted
    }

    /// Asks for a new tangent.
    pub fn forget(&mut self) {
        self.is_ready = false;
    }

    /// Factorises a tangent, shifted until it is positive definite.
    pub fn factorize(&mut self, tangent: &[f64], means: &[Vec<f64>]) {
        let r = self.r;
        let mean = (0..r).map(|k| tangent[k * r + k].abs()).sum::<f64>() / r as f64;
        let mut shift = 0.0;
        loop {
            self.lower.copy_from_slice(tangent);
            (0..r).for_each(|k| self.lower[k * r + k] += shift * mean);
            if cholesky(&mut self.lower, r) || !(shift < 1e6) {
                break;
            }
            shift = if shift == 0.0 { SHIFT } else { 10.0 * shift };
        }
        self.is_shifted = shift > 0.0;
        for (row, mean) in self.influence.chunks_exact_mut(r).zip(means) {
            row.copy_from_slice(mean);
            solve(&self.lower, r, row);
        }
        let n = self.constraints;
        for i in 0..n {
            for j in 0..n {
                let row = &self.influence[j * r..(j + 1) * r];
                self.compliance[i * n + j] = dot(&means[i], row);
            }
        }
        self.is_ready = cholesky(&mut self.compliance, n);
    }

    /// `dq` and the contact forces `F` of `K dq - A^T F = -force`, `A dq = missing`.
    pub fn step(&self, force: &[f64], missing: &[f64], means: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
        let r = self.r;
        let mut step: Vec<f64> = force.iter().map(|f| -f).collect();
        solve(&self.lower, r, &mut step);
        let mut forces: Vec<f64> =
            means.iter().zip(missing).map(|(row, m)| m - dot(row, &step)).collect();
        solve(&self.compliance, self.constraints, &mut forces);
        for (row, f) in self.influence.chunks_exact(r).zip(&forces) {
            step.iter_mut().zip(row).for_each(|(x, a)| *x += f * a);
        }
        (step, forces)
    }

    /// `dF/dd = (A K^-1 A^T)^-1`, row by row.
    pub fn stiffness(&self) -> Vec<f64> {
        let n = self.constraints;
        let mut inverse = vec![0.0; n * n];
        for (k, row) in inverse.chunks_exact_mut(n).enumerate() {
            row[k] = 1.0;
            solve(&self.compliance, n, row);
        }
        inverse
    }
}

/// Overwrites a symmetric matrix by its lower Cholesky factor, row by row; false where it is not positive definite.
fn cholesky(a: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        let (above, rest) = a.split_at_mut(i * n);
        let row = &mut rest[..n];
        for j in 0..i {
            let other = &above[j * n..j * n + j + 1];
            row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
        }
        let pivot = row[i] - dot(&row[..i], &row[..i]);
        if !(pivot > 1e-12 * row[i].abs()) {
            return false;
        }
        row[i] = pivot.sqrt();
    }
    true
}

/// `x = (L L^T)^-1 x`.
fn solve(lower: &[f64], n: usize, x: &mut [f64]) {
    for i in 0..n {
        let row = &lower[i * n..i * n + i + 1];
        x[i] = (x[i] - dot(&x[..i], &row[..i])) / row[i];
    }
    for i in (0..n).rev() {
        let row = &lower[i * n..i * n + i + 1];
        x[i] /= row[i];
        let xi = x[i];
        x[..i].iter_mut().zip(row).for_each(|(x, l)| *x -= l * xi);
    }
}
