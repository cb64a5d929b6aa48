//! The reduced tangent under its constraints, factorised: small, dense and without allocation.
//!
//! If tools hold the organ, its tangent `K` may be indefinite although the equilibrium is stable: only displacements
//! that keep the means of the patches, `A dq = 0`, must cost energy. `K_g = K + g A^T A` is then definite, and the step
//! of `K_g` under `A dq = m` is that of `K`, with contact forces larger by `g m`.

use crate::linear::next_shift;
use crate::number::dot;
use crate::simd::{Kernel, dispatch};

/// `g` in units of the mean diagonal entries of `K` and `A A^T`.
const PENALTY: f64 = 10.0;
/// First shift of an indefinite tangent, over its mean diagonal.
const FIRST_SHIFT: f64 = 1e-3;

/// Cholesky factor of `K_g`, and of `A K_g^-1 A^T`.
#[derive(Clone)]
pub(super) struct ReducedFactor {
    r: usize,
    /// Rows of the lower factor, each `r` long.
    lower: Vec<f64>,
    /// Rows of `A K_g^-1`.
    influence: Vec<f64>,
    /// Rows of the lower factor of `A K_g^-1 A^T`, each as long as there are constraints.
    compliance: Vec<f64>,
    constraints: usize,
    penalty: f64,
    is_ready: bool,
    is_shifted: bool,
}

impl ReducedFactor {
    /// Memory for `r` coordinates under some constraints.
    pub fn new(r: usize, constraints: usize) -> Self {
        ReducedFactor {
            r,
            lower: vec![0.0; r * r],
            influence: vec![0.0; constraints * r],
            compliance: vec![0.0; constraints * constraints],
            constraints,
            penalty: 0.0,
            is_ready: false,
            is_shifted: false,
        }
    }

    /// The factor at the origin, where the tangent of `r` orthonormal modes is the identity.
    pub fn in_origin(constraints: &[Vec<f64>], r: usize) -> Self {
        let mut factor = ReducedFactor::new(r, constraints.len());
        let mut identity = vec![0.0; r * r];
        (0..r).for_each(|k| identity[k * r + k] = 1.0);
        factor.factorize(&identity, constraints);
        factor
    }

    /// Whether there is a tangent.
    pub fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Whether the tangent had to be shifted to be definite under the constraints.
    pub fn is_shifted(&self) -> bool {
        self.is_shifted
    }

    /// Discards the tangent, so that a new one is factorised.
    pub fn forget(&mut self) {
        self.is_ready = false;
    }

    /// Factorises a tangent, shifted until it is definite.
    pub fn factorize(&mut self, tangent: &[f64], constraints: &[Vec<f64>]) {
        let (r, n) = (self.r, self.constraints);
        let mean = (0..r).map(|k| tangent[k * r + k].abs()).sum::<f64>() / r as f64;
        let size = constraints.iter().map(|row| dot(row, row)).sum::<f64>() / n as f64;
        self.penalty = PENALTY * mean / size;
        let mut shift = 0.0;
        loop {
            self.lower.copy_from_slice(tangent);
            for (k, row) in self.lower.chunks_exact_mut(r).enumerate() {
                row[k] += shift * mean;
                for a in constraints {
                    let scale = self.penalty * a[k];
                    row[..=k].iter_mut().zip(a).for_each(|(x, a)| *x += scale * a);
                }
            }
            if cholesky(&mut self.lower, r) {
                break;
            }
            let Some(next) = next_shift(shift, FIRST_SHIFT) else { break };
            shift = next;
        }
        self.is_shifted = shift > 0.0;
        for (row, mean) in self.influence.chunks_exact_mut(r).zip(constraints) {
            row.copy_from_slice(mean);
            solve(&self.lower, r, row);
        }
        for i in 0..n {
            for j in 0..n {
                let row = &self.influence[j * r..(j + 1) * r];
                self.compliance[i * n + j] = dot(&constraints[i], row);
            }
        }
        self.is_ready = cholesky(&mut self.compliance, n);
    }

    /// `dq` and the contact forces `F` of `K dq - A^T F = -force`, `A dq = missing`.
    pub fn step(
        &self,
        force: &[f64],
        constraint_residual: &[f64],
        constraints: &[Vec<f64>],
        step: &mut [f64],
        forces: &mut [f64],
    ) {
        step.iter_mut().zip(force).for_each(|(x, f)| *x = -f);
        solve(&self.lower, self.r, step);
        for ((f, row), m) in forces.iter_mut().zip(constraints).zip(constraint_residual) {
            *f = m - dot(row, step);
        }
        solve(&self.compliance, self.constraints, forces);
        for (row, f) in self.influence.chunks_exact(self.r).zip(forces.iter()) {
            step.iter_mut().zip(row).for_each(|(x, a)| *x += f * a);
        }
        forces.iter_mut().zip(constraint_residual).for_each(|(f, m)| *f -= self.penalty * m);
    }

    /// `dF/dd = (A K_g^-1 A^T)^-1 - g`, row by row.
    pub fn stiffness(&self, inverse: &mut Vec<f64>) {
        let n = self.constraints;
        inverse.clear();
        inverse.resize(n * n, 0.0);
        for (k, row) in inverse.chunks_exact_mut(n).enumerate() {
            row[k] = 1.0;
            solve(&self.compliance, n, row);
            row[k] -= self.penalty;
        }
    }
}

/// Overwrites a symmetric matrix by its lower Cholesky factor, row by row; false where it is not positive definite.
fn cholesky(a: &mut [f64], n: usize) -> bool {
    dispatch(Cholesky { a, n })
}

struct Cholesky<'a> {
    a: &'a mut [f64],
    n: usize,
}

impl Kernel for Cholesky<'_> {
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        let Cholesky { a, n } = self;
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
