//! Non-negative least squares, `min |A w - b|` over `w >= 0`, stopped early: finds the sampled cells and their weights.
//! Lawson and Hanson, *Solving Least Squares Problems* (1974), chapter 23. When there are many columns, several are
//! added at a time, since computing the gain of all columns takes longer than adding some.

use crate::number::{dot, norm};
use rayon::prelude::*;

/// A column is added only if more than this part of it is independent of those in use.
const DEPENDENT: f64 = 1e-12;
/// Number of columns in use for each one that is added at a time.
const AT_ONCE: usize = 16;
/// Number of columns below which a thread has too little to do.
const FEW: usize = 128;

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

/// Columns and their weights, ascending, of the first iterate with a residual below `tolerance |b|`.
pub(super) fn greedy(a: &Columns, b: &[f64], tolerance: f64) -> Vec<(usize, f64)> {
    let goal = tolerance * norm(b);
    let norms: Vec<f64> = (0..a.len()).map(|k| norm(a.column(k))).collect();
    // A column that brought nothing new is not asked again, unless another of its round was why.
    let mut is_free: Vec<bool> = norms.iter().map(|&n| n > 0.0).collect();
    let mut active = Active::default();
    let mut residual = b.to_vec();
    while norm(&residual) > goal && active.columns.len() < a.rows {
        let gain = |k: usize| dot(a.column(k), &residual) / norms[k];
        let free = (0..a.len()).into_par_iter().with_min_len(FEW).filter(|&k| is_free[k]);
        let mut best: Vec<(f64, usize)> = free.map(|k| (gain(k), k)).collect();
        best.retain(|(gain, _)| *gain > 1e-10 * norm(b));
        best.sort_unstable_by(|x, y| y.0.total_cmp(&x.0));
        if best.is_empty() {
            break;
        }
        let at_once = (active.columns.len() / AT_ONCE).max(1);
        for (number, &(_, column)) in best.iter().take(at_once).enumerate() {
            is_free[column] = false;
            for dropped in active.add(a, b, column) {
                is_free[dropped] = dropped != column || number > 0;
            }
        }
        residual.copy_from_slice(b);
        for (&k, w) in active.columns.iter().zip(&active.weights) {
            residual.iter_mut().zip(a.column(k)).for_each(|(r, x)| *r -= w * x);
        }
    }
    let mut chosen: Vec<(usize, f64)> = active.columns.into_iter().zip(active.weights).collect();
    chosen.sort_unstable_by_key(|(k, _)| *k);
    chosen
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
    /// Adds a column, and removes those that would need a negative weight; returns these.
    fn add(&mut self, a: &Columns, b: &[f64], column: usize) -> Vec<usize> {
        let new = a.column(column);
        let mut row: Vec<f64> = self.columns.par_iter().map(|&k| dot(a.column(k), new)).collect();
        row.push(dot(new, new));
        self.columns.push(column);
        self.weights.push(0.0);
        self.gram.push(row);
        self.rhs.push(dot(new, b));
        let mut out = Vec::new();
        if !self.factorize_from(self.columns.len() - 1) {
            out.extend(self.columns.pop());
            self.weights.pop();
            self.gram.pop();
            self.rhs.pop();
            return out;
        }
        loop {
            let full = self.solution();
            let blocking = full.iter().zip(&self.weights).filter(|(s, _)| **s <= 0.0);
            let step = blocking.map(|(s, w)| w / (w - s)).fold(1.0, f64::min);
            self.weights.iter_mut().zip(&full).for_each(|(w, s)| *w += step * (s - *w));
            if step >= 1.0 {
                return out;
            }
            let Some(first) = self.drop_empty(&mut out) else { return out };
            if !self.factorize_from(first) {
                return out;
            }
        }
    }

    /// Moves columns without weight to `out`; the place of the first of them.
    fn drop_empty(&mut self, out: &mut Vec<usize>) -> Option<usize> {
        let largest = self.weights.iter().fold(0.0, |m: f64, &w| m.max(w));
        let is_kept: Vec<bool> = self.weights.iter().map(|&w| w > 1e-12 * largest).collect();
        let places: Vec<usize> = (0..self.columns.len()).filter(|&k| is_kept[k]).collect();
        out.extend((0..self.columns.len()).filter(|&k| !is_kept[k]).map(|k| self.columns[k]));
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

    /// Renews the rows of the factor from one on; false where a column depends on those before it.
    fn factorize_from(&mut self, first: usize) -> bool {
        self.factor.truncate(first);
        for k in self.factor.len()..self.columns.len() {
            let mut row = self.gram[k].clone();
            for j in 0..k {
                let sum = dot(&row[..j], &self.factor[j][..j]);
                row[j] = (row[j] - sum) / self.factor[j][j];
            }
            let own = row[k] - dot(&row[..k], &row[..k]);
            if !(own > DEPENDENT * row[k]) {
                return false;
            }
            row[k] = own.sqrt();
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
