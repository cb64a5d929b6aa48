//! The matrix of a level as a smoother reads it: the upper triangle by block columns, in single precision, each block
//! read once for both triangles.
//!
//! `B` rows and columns of a block, padded to `W` lanes of a vector register: 3 and 4 on the finest level, 6 and 8 below.

use super::super::FactorError;
use viscera_number::simd::{Kernel, dispatch};

/// Upper triangle of a block matrix in compressed columns: rows ascend within a column, so that the diagonal comes last.
#[derive(Clone)]
pub(super) struct Upper {
    start: Vec<u32>,
    row: Vec<u32>,
}

impl Upper {
    /// From its pairs of row and column, column by column, rows ascending, the diagonal among them.
    pub fn new(n: usize, pairs: impl Iterator<Item = (u32, u32)>) -> Result<Self, FactorError> {
        let invalid =
            |column: usize, reason| Err(FactorError::InvalidPattern { column: 3 * column, reason });
        let (mut start, mut row) = (vec![0u32; n + 1], Vec::new());
        let mut last = (0, 0);
        for (r, c) in pairs {
            if r > c || c as usize >= n || (!row.is_empty() && (c, r) <= last) {
                return invalid(
                    c as usize,
                    "its blocks must come by columns, their rows ascending",
                );
            }
            last = (c, r);
            row.push(r);
            start[c as usize + 1] = row.len() as u32;
        }
        for column in 0..n {
            let (from, end) = (start[column], start[column + 1]);
            if end <= from || row[end as usize - 1] as usize != column {
                return invalid(column, "its last block must be the diagonal");
            }
        }
        Ok(Upper { start, row })
    }

    /// The same from pairs that are in this order.
    pub fn sorted(n: usize, pairs: &[(u32, u32)]) -> Self {
        let mut start = vec![0u32; n + 1];
        pairs.iter().for_each(|&(_, column)| start[column as usize + 1] += 1);
        (0..n).for_each(|column| start[column + 1] += start[column]);
        Upper { start, row: pairs.iter().map(|pair| pair.0).collect() }
    }

    /// Number of block rows.
    pub fn n(&self) -> usize {
        self.start.len() - 1
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.row.len()
    }

    /// Row and column of every block.
    pub fn pairs(&self) -> impl Iterator<Item = (u32, u32)> + Clone + '_ {
        (0..self.n())
            .flat_map(|column| self.rows(column).iter().map(move |&row| (row, column as u32)))
    }

    /// Places of a column's blocks; the last is the diagonal.
    #[inline(always)]
    pub fn column(&self, column: usize) -> std::ops::Range<usize> {
        self.start[column] as usize..self.start[column + 1] as usize
    }

    /// Rows of a column's blocks.
    #[inline(always)]
    pub fn rows(&self, column: usize) -> &[u32] {
        &self.row[self.column(column)]
    }

    /// Place of the diagonal block.
    pub fn diagonal(&self, column: usize) -> usize {
        self.start[column + 1] as usize - 1
    }

    /// Place of a block, row <= column, that is there.
    pub fn place(&self, row: u32, column: u32) -> usize {
        let found = self.rows(column as usize).binary_search(&row);
        self.start[column as usize] as usize
            + found.unwrap_or_else(|_| unreachable!("no such block"))
    }
}

/// A matrix and the inverses of its diagonal blocks; rows without unknowns have a zero inverse, and stay zero.
pub(super) struct Smoother<const B: usize, const W: usize> {
    pub pattern: Upper,
    /// Columns of each block.
    blocks: Vec<[[f32; W]; B]>,
    inverses: Vec<[[f32; W]; B]>,
    /// Sums over blocks right of the diagonal.
    right: Vec<[f32; W]>,
}

impl<const B: usize, const W: usize> Smoother<B, W> {
    pub fn new(pattern: Upper) -> Self {
        let (n, zero) = (pattern.n(), [[0.0; W]; B]);
        Smoother {
            blocks: vec![zero; pattern.len()],
            inverses: vec![zero; n],
            right: vec![[0.0; W]; n],
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
        for (block, values) in self.blocks.iter_mut().zip(values.chunks_exact(B * B)) {
            for k in 0..B {
                (0..B).for_each(|i| block[k][i] = values[B * i + k] as f32);
            }
        }
        for node in 0..self.pattern.n() {
            let at = self.pattern.diagonal(node);
            (0..B).for_each(|k| self.blocks[at][k][k] += shift as f32);
            let values = &values[B * B * at..B * B * (at + 1)];
            let entry = |i: usize, k: usize| values[B * i + k] + if i == k { shift } else { 0.0 };
            let inverse =
                inverse_of_positive::<B>(entry, |i| has_unknown(B * node + i)).ok_or(node)?;
            for k in 0..B {
                (0..B).for_each(|i| self.inverses[node][k][i] = inverse[i][k] as f32);
            }
        }
        Ok(())
    }

    /// `x = (D + L)⁻¹ b`, and what of `A x` lies right of the diagonal: minus the residual.
    pub fn forward(&mut self, b: &[[f32; W]], x: &mut [[f32; W]]) -> &[[f32; W]] {
        dispatch(Forward { smoother: self, b, x });
        &self.right
    }

    /// `x <- (D + U)⁻¹ (b - L x)`.
    pub fn backward(&mut self, b: &[[f32; W]], x: &mut [[f32; W]]) {
        dispatch(Backward { smoother: self, b, x });
    }

    /// `y = D⁻¹ A x`.
    pub fn jacobi(&mut self, x: &[[f32; W]], y: &mut [[f32; W]]) {
        dispatch(Jacobi { smoother: self, x, y });
    }

    /// `D⁻¹ a` for a node.
    #[inline(always)]
    pub fn solve_diagonal(&self, node: usize, a: [f32; W]) -> [f32; W] {
        times(&self.inverses[node], &a)
    }
}

struct Forward<'a, const B: usize, const W: usize> {
    smoother: &'a mut Smoother<B, W>,
    b: &'a [[f32; W]],
    x: &'a mut [[f32; W]],
}

impl<const B: usize, const W: usize> Kernel for Forward<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Smoother { pattern, blocks, inverses, right } = self.smoother;
        right.fill([0.0; W]);
        for column in 0..pattern.n() {
            let places = pattern.column(column);
            let blocks = &blocks[places.start..places.end - 1];
            let left = gather(blocks, pattern.rows(column), self.x);
            let own = times(&inverses[column], &less(&self.b[column], &left));
            self.x[column] = own;
            scatter(blocks, pattern.rows(column), &own, right);
        }
    }
}

struct Backward<'a, const B: usize, const W: usize> {
    smoother: &'a mut Smoother<B, W>,
    b: &'a [[f32; W]],
    x: &'a mut [[f32; W]],
}

impl<const B: usize, const W: usize> Kernel for Backward<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Smoother { pattern, blocks, inverses, right } = self.smoother;
        right.fill([0.0; W]);
        for column in (0..pattern.n()).rev() {
            let places = pattern.column(column);
            let blocks = &blocks[places.start..places.end - 1];
            let left = gather(blocks, pattern.rows(column), self.x);
            let rest = less(&less(&self.b[column], &left), &right[column]);
            let own = times(&inverses[column], &rest);
            self.x[column] = own;
            scatter(blocks, pattern.rows(column), &own, right);
        }
    }
}

struct Jacobi<'a, const B: usize, const W: usize> {
    smoother: &'a mut Smoother<B, W>,
    x: &'a [[f32; W]],
    y: &'a mut [[f32; W]],
}

impl<const B: usize, const W: usize> Kernel for Jacobi<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Smoother { pattern, blocks, inverses, .. } = self.smoother;
        let y = self.y;
        for column in 0..pattern.n() {
            let places = pattern.column(column);
            let (own, blocks) = (&self.x[column], &blocks[places]);
            // With the diagonal block: its row is not summed up yet.
            y[column] = gather(blocks, pattern.rows(column), self.x);
            let left = &blocks[..blocks.len() - 1];
            scatter(left, pattern.rows(column), own, y);
        }
        for (y, inverse) in y.iter_mut().zip(inverses) {
            *y = times(inverse, y);
        }
    }
}

/// `sum_r A_rᵀ x_r` over the blocks of a column.
#[inline(always)]
fn gather<const B: usize, const W: usize>(
    blocks: &[[[f32; W]; B]],
    rows: &[u32],
    x: &[[f32; W]],
) -> [f32; W] {
    let mut products = [[0.0f32; W]; B];
    for (block, &row) in blocks.iter().zip(rows) {
        let x = &x[row as usize];
        for k in 0..B {
            (0..W).for_each(|i| products[k][i] += block[k][i] * x[i]);
        }
    }
    let mut sum = [0.0; W];
    for k in 0..B {
        sum[k] = products[k].iter().sum();
    }
    sum
}

/// `y_r += A_r x` over the blocks of a column.
#[inline(always)]
fn scatter<const B: usize, const W: usize>(
    blocks: &[[[f32; W]; B]],
    rows: &[u32],
    x: &[f32; W],
    y: &mut [[f32; W]],
) {
    for (block, &row) in blocks.iter().zip(rows) {
        let y = &mut y[row as usize];
        for k in 0..B {
            (0..W).for_each(|i| y[i] += block[k][i] * x[k]);
        }
    }
}

/// `A x` of a block given by its columns.
#[inline(always)]
fn times<const B: usize, const W: usize>(block: &[[f32; W]; B], x: &[f32; W]) -> [f32; W] {
    let mut y = [0.0; W];
    for k in 0..B {
        (0..W).for_each(|i| y[i] += block[k][i] * x[k]);
    }
    y
}

#[inline(always)]
fn less<const W: usize>(a: &[f32; W], b: &[f32; W]) -> [f32; W] {
    std::array::from_fn(|i| a[i] - b[i])
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
