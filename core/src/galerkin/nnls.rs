//! Non-negative least squares, `min |A w - b|` over `w >= 0`: which cells, and how much each counts.

use faer::linalg::solvers::{Llt, Solve};
use faer::{Mat, MatRef, Side};

/// Relative size of the shift that keeps Gram matrices of nearly dependent columns definite.
const SHIFT: f64 = 1e-12;

/// Columns of `A`, one after the other.
pub(super) struct Columns<'a> {
    pub rows: usize,
    pub values: &'a [f64],
}

impl Columns<'_> {
    fn column(&self, k: usize) -> &[f64] {
        &self.values[k * self.rows..(k + 1) * self.rows]
    }

    fn len(&self) -> usize {
        self.values.len() / self.rows
    }
}

/// The columns that Lawson and Hanson's method has taken, ascending, when the residual falls below
/// `tolerance |b|`: few of them for a rough answer.
pub(super) fn greedy(a: &Columns, b: &[f64], tolerance: f64) -> Vec<usize> {
    let goal = tolerance * norm(b);
    let rounding = 1e-12 * dot(b, b);
    let mut active = Active::default();
    let mut residual = b.to_vec();
    while norm(&residual) > goal && active.columns.len() < a.len().min(a.rows) {
        let gain = |k: usize| dot(a.column(k), &residual);
        let free = (0..a.len()).filter(|k| !active.columns.contains(k));
        let best = free.map(|k| (gain(k), k)).fold((rounding, None), |best: (f64, _), (gain, k)| {
            if gain > best.0 { (gain, Some(k)) } else { best }
        });
        let Some(column) = best.1 else { break };
        if !active.add(a, b, column) {
            break;
        }
        residual.copy_from_slice(b);
        for (&k, w) in active.columns.iter().zip(&active.weights) {
            residual.iter_mut().zip(a.column(k)).for_each(|(r, x)| *r -= w * x);
        }
    }
    active.columns.sort_unstable();
    active.columns
}

/// The columns in use, their Gram matrix and its Cholesky factor, row by row.
#[derive(Default)]
struct Active {
    columns: Vec<usize>,
    weights: Vec<f64>,
    gram: Vec<Vec<f64>>,
    rhs: Vec<f64>,
    factor: Vec<Vec<f64>>,
}

impl Active {
    /// Takes a column in, and those out that would need a negative weight; false where it brings nothing new.
    fn add(&mut self, a: &Columns, b: &[f64], column: usize) -> bool {
        let new = a.column(column);
        let mut row: Vec<f64> = self.columns.iter().map(|&k| dot(a.column(k), new)).collect();
        row.push(dot(new, new) * (1.0 + SHIFT));
        self.columns.push(column);
        self.weights.push(0.0);
        self.gram.push(row);
        self.rhs.push(dot(new, b));
        let last = self.columns.len() - 1;
        if !self.factorize_from(last) {
            self.columns.truncate(last);
            self.weights.truncate(last);
            self.gram.truncate(last);
            self.rhs.truncate(last);
            return false;
        }
        loop {
            let full = self.solution();
            let blocking = full.iter().zip(&self.weights).filter(|(s, _)| **s <= 0.0);
            let step = blocking.map(|(s, w)| w / (w - s)).fold(1.0, f64::min);
            self.weights.iter_mut().zip(&full).for_each(|(w, s)| *w += step * (s - *w));
            if step >= 1.0 {
                return true;
            }
            let Some(first) = self.drop_empty() else { return false };
            if !self.factorize_from(first) {
                return false;
            }
        }
    }

    /// Forgets columns without weight; the place of the first of them.
    fn drop_empty(&mut self) -> Option<usize> {
        let largest = self.weights.iter().fold(0.0, |m: f64, &w| m.max(w));
        let is_kept: Vec<bool> = self.weights.iter().map(|&w| w > 1e-12 * largest).collect();
        let kept = |k: &usize| is_kept[*k];
        let places: Vec<usize> = (0..self.columns.len()).filter(kept).collect();
        self.gram = places
            .iter()
            .enumerate()
            .map(|(k, &row)| places[..=k].iter().map(|&column| self.gram[row][column]).collect())
            .collect();
        self.columns = places.iter().map(|&k| self.columns[k]).collect();
        self.weights = places.iter().map(|&k| self.weights[k]).collect();
        self.rhs = places.iter().map(|&k| self.rhs[k]).collect();
        is_kept.iter().position(|kept| !kept)
    }

    /// Renews the rows of the factor from one on.
    fn factorize_from(&mut self, first: usize) -> bool {
        self.factor.truncate(first);
        for k in first..self.columns.len() {
            let mut row = self.gram[k].clone();
            for j in 0..k {
                let sum = dot(&row[..j], &self.factor[j][..j]);
                row[j] = (row[j] - sum) / self.factor[j][j];
            }
            let square = row[k] - dot(&row[..k], &row[..k]);
            if !(square > SHIFT * row[k]) {
                return false;
            }
            row[k] = square.sqrt();
            self.factor.push(row);
        }
        true
    }

    /// The unconstrained solution.
    fn solution(&self) -> Vec<f64> {
        let n = self.columns.len();
        let mut x = self.rhs.clone();
        for k in 0..n {
            x[k] = (x[k] - dot(&x[..k], &self.factor[k][..k])) / self.factor[k][k];
        }
        for k in (0..n).rev() {
            x[k] /= self.factor[k][k];
            let xk = x[k];
            x[..k].iter_mut().zip(&self.factor[k]).for_each(|(x, l)| *x -= l * xk);
        }
        x
    }
}

/// `min w.G w / 2 - c.w` over `w >= 0` by block principal pivoting, from a Gram matrix `G` and `c = A^T b`: all columns
/// of the wrong sign change sides at once, one at a time where that cycles.
/// Portugal, Judice and Vicente, Math. Comp. 63 (1994) 625.
pub(super) fn solve(gram: MatRef<f64>, c: &[f64]) -> Vec<f64> {
    let n = c.len();
    let mean = (0..n).map(|k| gram[(k, k)]).sum::<f64>() / n.max(1) as f64;
    let mut is_active = vec![true; n];
    let (mut fewest, mut patience) = (usize::MAX, 3);
    for _ in 0..100 {
        let active: Vec<usize> = (0..n).filter(|&k| is_active[k]).collect();
        let w = restricted(gram, c, &active, 1e-10 * mean);
        let slope = |k: usize| active.iter().map(|&j| gram[(k, j)] * w[j]).sum::<f64>() - c[k];
        let is_wrong = |&k: &usize| if is_active[k] { w[k] < 0.0 } else { slope(k) < 0.0 };
        let wrong: Vec<usize> = (0..n).filter(is_wrong).collect();
        if wrong.is_empty() {
            return w;
        }
        if wrong.len() < fewest {
            (fewest, patience) = (wrong.len(), 3);
        } else {
            patience = patience.max(1) - 1;
        }
        let moved = if patience > 0 { &wrong[..] } else { &wrong[wrong.len() - 1..] };
        moved.iter().for_each(|&k| is_active[k] = !is_active[k]);
    }
    // Not settled: the columns that still have a positive weight, then nothing below zero.
    let active: Vec<usize> = (0..n).filter(|&k| is_active[k]).collect();
    restricted(gram, c, &active, 1e-10 * mean).into_iter().map(|w| w.max(0.0)).collect()
}

/// The minimum over some columns alone, zero elsewhere.
fn restricted(gram: MatRef<f64>, c: &[f64], active: &[usize], shift: f64) -> Vec<f64> {
    let mut w = vec![0.0; c.len()];
    let m = active.len();
    let part =
        Mat::from_fn(m, m, |i, j| gram[(active[i], active[j])] + if i == j { shift } else { 0.0 });
    let rhs = Mat::from_fn(m, 1, |i, _| c[active[i]]);
    let Ok(factor) = Llt::new(part.as_ref(), Side::Lower) else { return w };
    let solution = factor.solve(&rhs);
    active.iter().enumerate().for_each(|(i, &k)| w[k] = solution[(i, 0)]);
    w
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums side by side: one alone waits for itself.
    let (head, tail) = (a.len() / 4 * 4, a.len().min(b.len()));
    let mut sums = [0.0; 4];
    for (x, y) in a[..head].chunks_exact(4).zip(b[..head].chunks_exact(4)) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + (head..tail).map(|k| a[k] * b[k]).sum::<f64>()
}

pub(super) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}
