//! The matrix of a level as a smoother reads it: one triangle by block columns, in single precision, each block read once
//! for both triangles.
//!
//! `B` rows and columns of a block, padded to `W` lanes of a vector register: 3 and 4 on the finest level, 6 and 8 below.

use super::columns::Upper;
use super::order::Order;
use super::parts::Parts;

/// A matrix and the inverses of its diagonal blocks; rows without unknowns have a zero inverse, and stay zero.
pub(super) struct Smoother<const B: usize, const W: usize> {
    pub pattern: Upper,
    pub parts: Parts,
    pub order: Order,
    /// Columns of each block.
    pub blocks: Vec<[[f32; W]; B]>,
    pub inverses: Vec<[[f32; W]; B]>,
    /// Sums over the blocks to nodes that a sweep comes to later.
    pub later: Vec<[f32; W]>,
}

impl<const B: usize, const W: usize> Smoother<B, W> {
    pub fn new(pattern: Upper, parts: Parts) -> Self {
        let (n, zero) = (pattern.n(), [[0.0; W]; B]);
        Smoother {
            blocks: vec![zero; pattern.len()],
            inverses: vec![zero; n],
            later: vec![[0.0; W]; n],
            order: Order::new(&pattern, &parts),
            parts,
            pattern,
        }
    }

    /// Takes over a matrix, `B * B` values for each block, row-major, with `shift` added to its diagonal, on the rows
    /// that have an unknown. Fails with the node whose diagonal block is not positive definite.
    pub fn fill(
        &mut self,
        values: &[f64],
        shift: f64,
        has_unknown: impl Fn(usize) -> bool,
    ) -> Result<(), usize> {
        let Smoother { pattern, order, blocks, inverses, .. } = self;
        let block = |place: usize| {
            let values = &values[B * B * place..B * B * (place + 1)];
            move |i: usize, k: usize| values[B * i + k]
        };
        for (node, inverse) in inverses.iter_mut().enumerate() {
            let (from, to) = order.staying(pattern, node);
            from.zip(to).for_each(|(from, to)| blocks[to] = columns_of(block(from)));
            let diagonal = block(pattern.diagonal(node));
            let shifted = |i, k| diagonal(i, k) + if i == k { shift } else { 0.0 };
            blocks[order.columns.diagonal(node)] = columns_of(shifted);
            let exact = inverse_of_positive::<B>(shifted, |i| has_unknown(B * node + i));
            let exact = exact.ok_or(node)?;
            *inverse = columns_of(|i, k| exact[i][k]);
        }
        for &[from, to] in &order.transposed {
            let block = block(from as usize);
            blocks[to as usize] = columns_of(|i, k| block(k, i));
        }
        Ok(())
    }
}

/// The columns of a block, padded.
#[inline(always)]
fn columns_of<const B: usize, const W: usize>(
    entry: impl Fn(usize, usize) -> f64,
) -> [[f32; W]; B] {
    let mut columns = [[0.0; W]; B];
    for k in 0..B {
        (0..B).for_each(|i| columns[k][i] = entry(i, k) as f32);
    }
    columns
}

/// `A x` of a block given by its columns.
#[inline(always)]
pub(super) fn times<const B: usize, const W: usize>(
    block: &[[f32; W]; B],
    x: &[f32; W],
) -> [f32; W] {
    let mut y = [0.0; W];
    for k in 0..B {
        (0..W).for_each(|i| y[i] += block[k][i] * x[k]);
    }
    y
}

/// Inverse of the rows and columns that have an unknown, zero elsewhere; none if it is not positive definite.
fn inverse_of_positive<const B: usize>(
    entry: impl Fn(usize, usize) -> f64,
    has_unknown: impl Fn(usize) -> bool,
) -> Option<[[f64; B]; B]> {
    // Cholesky, then its inverse M, then Mᵀ M.
    let (mut l, mut m) = ([[0.0; B]; B], [[0.0; B]; B]);
    let known: [bool; B] = std::array::from_fn(|i| !has_unknown(i));
    for j in (0..B).filter(|&j| !known[j]) {
        let pivot = entry(j, j) - (0..j).map(|k| l[j][k] * l[j][k]).sum::<f64>();
        if !(pivot > f64::EPSILON * entry(j, j) && pivot.is_finite()) {
            return None;
        }
        l[j][j] = pivot.sqrt();
        for i in (j + 1..B).filter(|&i| !known[i]) {
            l[i][j] = (entry(i, j) - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>()) / l[j][j];
        }
        m[j][j] = 1.0 / l[j][j];
        for k in 0..j {
            m[j][k] = -(k..j).map(|i| l[j][i] * m[i][k]).sum::<f64>() / l[j][j];
        }
    }
    Some(std::array::from_fn(|i| {
        std::array::from_fn(|k| (i.max(k)..B).map(|r| m[r][i] * m[r][k]).sum())
    }))
}
