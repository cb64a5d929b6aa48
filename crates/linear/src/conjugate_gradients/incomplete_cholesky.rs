//! Incomplete Cholesky without fill by blocks, IC(0): `A ≈ L D Lᵀ` with `L` on the block pattern of `A`. On elastic
//! bodies it takes a quarter to a sixth of the iterations of block-Jacobi, each twice as long.
//!
//! A pivot block can lose its definiteness although `A` is positive definite; then the diagonal is raised,
//! `A + shift diag(A)`, until none does (Manteuffel 1980).

use super::super::block_matrix::{Block, add_product, add_transposed_product};
use super::super::{BlockMatrix, FactorError};
use super::Preconditioner;
use super::block_jacobi::inverse_of_positive;
use viscera_number::simd::{Kernel, dispatch};

/// A pivot block whose determinant falls below this fraction of that of its diagonal block counts as vanished:
/// its inverse would drown the others.
const PIVOT_FLOOR: f64 = 1e-6;

/// First shift tried after a breakdown; each further one is twice the last. The ladder for indefinite matrices, ten times
/// from rung to rung, would be too coarse: an incomplete factor gets worse with every shift.
const FIRST_SHIFT: f64 = 1e-3;

/// A shift of this size leaves little more than the diagonal, so that the matrix must be at fault.
const LAST_SHIFT: f64 = 10.0;

type Mat = [[f64; 3]; 3];

/// IC(0) preconditioner.
pub struct IncompleteCholesky {
    row_start: Vec<u32>,
    column: Vec<u32>,
    /// Blocks of `L` left of its unit diagonal.
    blocks: Vec<Block>,
    /// `D⁻¹`.
    inverses: Vec<Mat>,
    is_held: Vec<bool>,
    shift: f64,
}

impl IncompleteCholesky {
    /// Allocates a factor on the pattern of a matrix; factorise before use.
    pub fn new(matrix: &BlockMatrix) -> Self {
        let n = matrix.n_nodes();
        let (mut row_start, mut column) = (vec![0u32], Vec::new());
        for node in 0..n {
            column.extend_from_slice(matrix.left(node).0);
            row_start.push(column.len() as u32);
        }
        Self {
            blocks: vec![Block::default(); column.len()],
            row_start,
            column,
            inverses: vec![Mat::default(); n],
            is_held: vec![false; 3 * n],
            shift: 0.0,
        }
    }

    /// Part of the diagonal that had to be added to itself; zero where nothing broke down.
    pub fn shift(&self) -> f64 {
        self.shift
    }

    /// Factorises a matrix on the pattern.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`] where no shift helps.
    pub fn factorize(&mut self, matrix: &BlockMatrix) -> Result<(), FactorError> {
        FactorError::expect_length("matrix", self.inverses.len(), matrix.n_nodes())?;
        for (row, held) in self.is_held.iter_mut().enumerate() {
            *held = matrix.is_held(row);
        }
        self.shift = 0.0;
        while let Err(node) = self.try_factorize(matrix) {
            self.shift = (2.0 * self.shift).max(FIRST_SHIFT);
            if self.shift > LAST_SHIFT {
                return Err(FactorError::NotPositiveDefinite { row: 3 * node });
            }
        }
        Ok(())
    }

    /// Row by row: `U_ij = A_ij - sum_k L_ik U_jkᵀ`, `L_ij = U_ij D_j⁻¹`, `D_i = A_ii - sum_j L_ij U_ijᵀ`.
    /// Fails with the node of a vanished pivot.
    fn try_factorize(&mut self, matrix: &BlockMatrix) -> Result<(), usize> {
        let mut products: Vec<Mat> = Vec::new(); // U_ij of the row at hand
        for i in 0..self.inverses.len() {
            let (columns, blocks) = matrix.left(i);
            let mut pivot = matrix.diagonal_block(i);
            let determinant = self.shifted_determinant(&mut pivot);
            products.clear();
            for (&j, block) in columns.iter().zip(blocks) {
                let j = j as usize;
                let mut u = matrix.without_held(block, i, j);
                let row_j = self.row_start[j] as usize..self.row_start[j + 1] as usize;
                let mut known = columns.iter().zip(&products).peekable();
                for k in row_j {
                    while known.next_if(|(c, _)| **c < self.column[k]).is_some() {}
                    if let Some((_, product)) = known.next_if(|(c, _)| **c == self.column[k]) {
                        // L_ik U_jkᵀ = U_ik D_k⁻¹ U_jkᵀ = U_ik L_jkᵀ.
                        subtract_times_transposed(&mut u, product, &entries(&self.blocks[k]));
                    }
                }
                let l = times(&u, &self.inverses[j]);
                subtract_times_transposed(&mut pivot, &l, &u);
                self.blocks[self.row_start[i] as usize + products.len()] = packed(&l);
                products.push(u);
            }
            match inverse_of_positive(pivot) {
                Some((inverse, left)) if left > PIVOT_FLOOR * determinant => {
                    self.inverses[i] = inverse;
                }
                _ => return Err(i),
            }
        }
        Ok(())
    }

    /// Raises the diagonal by the shift; the determinant of the block.
    fn shifted_determinant(&self, pivot: &mut Mat) -> f64 {
        (0..3).for_each(|k| pivot[k][k] *= 1.0 + self.shift);
        let p = &*pivot;
        let minor = |a: usize, b: usize| p[1][a] * p[2][b] - p[1][b] * p[2][a];
        p[0][0] * minor(1, 2) - p[0][1] * minor(0, 2) + p[0][2] * minor(0, 1)
    }
}

fn entries(block: &Block) -> Mat {
    std::array::from_fn(|i| std::array::from_fn(|j| f64::from(block[j][i])))
}

fn packed(a: &Mat) -> Block {
    std::array::from_fn(|j| [a[0][j] as f32, a[1][j] as f32, a[2][j] as f32, 0.0])
}

fn times(a: &Mat, b: &Mat) -> Mat {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// `out -= A Bᵀ`.
fn subtract_times_transposed(out: &mut Mat, a: &Mat, b: &Mat) {
    for i in 0..3 {
        for j in 0..3 {
            out[i][j] -= a[i][0] * b[j][0] + a[i][1] * b[j][1] + a[i][2] * b[j][2];
        }
    }
}

impl Preconditioner for IncompleteCholesky {
    fn n(&self) -> usize {
        self.is_held.len()
    }

    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        dispatch(Substitution { factor: self, r, z });
        for (z, &held) in z.iter_mut().zip(&self.is_held) {
            *z = if held { 0.0 } else { *z };
        }
    }
}

struct Substitution<'a> {
    factor: &'a IncompleteCholesky,
    r: &'a [f64],
    z: &'a mut [f64],
}

impl Kernel for Substitution<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (factor, z) = (self.factor, self.z);
        let row = |i: usize| factor.row_start[i] as usize..factor.row_start[i + 1] as usize;
        for i in 0..factor.inverses.len() {
            let mut known = [0.0; 4];
            for k in row(i) {
                add_product(&mut known, &factor.blocks[k], &z[3 * factor.column[k] as usize..]);
            }
            for c in 0..3 {
                z[3 * i + c] = self.r[3 * i + c] - known[c];
            }
        }
        for (i, d) in factor.inverses.iter().enumerate() {
            let y = [z[3 * i], z[3 * i + 1], z[3 * i + 2]];
            let x: [f64; 3] =
                std::array::from_fn(|c| d[c][0] * y[0] + d[c][1] * y[1] + d[c][2] * y[2]);
            z[3 * i..3 * i + 3].copy_from_slice(&x);
        }
        for i in (0..factor.inverses.len()).rev() {
            let x = [-z[3 * i], -z[3 * i + 1], -z[3 * i + 2]];
            for k in row(i) {
                let at = 3 * factor.column[k] as usize;
                add_transposed_product(&mut z[at..at + 3], &factor.blocks[k], &x);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::block_matrix::tests::blocked;
    use super::super::super::test_matrices::{Matrix, elastic_block, load};
    use super::*;

    fn factorized(matrix: &BlockMatrix) -> IncompleteCholesky {
        let mut preconditioner = IncompleteCholesky::new(matrix);
        preconditioner.factorize(matrix).unwrap();
        preconditioner
    }

    fn applied(preconditioner: &mut IncompleteCholesky, r: &[f64]) -> Vec<f64> {
        let mut z = vec![f64::NAN; r.len()];
        preconditioner.apply(r, &mut z);
        z
    }

    #[test]
    fn is_exact_where_elimination_makes_no_fill() {
        let mut entries: Vec<_> = (0..60).map(|i| (i, i, 4.5 + (i as f64).sin())).collect();
        entries.extend((3..60).map(|i| (i - 3, i, -0.7)));
        entries.extend((1..60).map(|i| (i - 1, i, 0.2)));
        let matrix = Matrix::from_entries(60, &entries);
        let mut preconditioner = factorized(&blocked(&matrix));
        let b = load(60, 0);
        assert_eq!(preconditioner.shift(), 0.0);
        assert!(matrix.relative_residual(&applied(&mut preconditioner, &b), &b) < 1e-6);
    }

    /// `M = L D Lᵀ` agrees with `A` on its block pattern.
    #[test]
    fn reproduces_the_matrix_on_its_pattern() {
        let matrix = elastic_block(4, 3, 3);
        let n = matrix.pattern.n;
        let mut preconditioner = factorized(&blocked(&matrix));
        let mut inverse = faer::Mat::<f64>::zeros(n, n);
        for column in 0..n {
            let mut unit = vec![0.0; n];
            unit[column] = 1.0;
            let z = applied(&mut preconditioner, &unit);
            (0..n).for_each(|row| inverse[(row, column)] = z[row]);
        }
        use faer::linalg::solvers::DenseSolveCore;
        let product = inverse.partial_piv_lu().inverse();
        for column in 0..n {
            for k in matrix.pattern.column(column) {
                let row = matrix.pattern.row[k] as usize;
                assert!((product[(row, column)] - matrix.values[k]).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn raises_the_diagonal_where_a_pivot_vanishes() {
        // Kershaw (1978): positive definite, but its incomplete factorisation is not. One of its rows in a node.
        let at = |i: usize| 3 * i;
        let mut entries: Vec<_> =
            (0..12).map(|i| (i, i, if i % 3 == 0 { 3.0 } else { 1.0 })).collect();
        entries.extend(
            [(0, 1, -2.0), (1, 2, -2.0), (2, 3, -2.0), (0, 3, 2.0)]
                .map(|(i, j, v)| (at(i), at(j), v)),
        );
        let matrix = Matrix::from_entries(12, &entries);
        let mut preconditioner = factorized(&blocked(&matrix));
        let shift = preconditioner.shift();
        assert!(shift > 0.0 && shift < 0.5, "{shift}");
        let b = load(12, 0);
        let z = applied(&mut preconditioner, &b);
        assert!(z.iter().zip(&b).map(|(z, r)| z * r).sum::<f64>() > 0.0);
    }

    #[test]
    fn refuses_a_negative_diagonal() {
        let mut matrix = elastic_block(3, 2, 2);
        let diagonal = matrix.diagonal(20);
        matrix.values[diagonal] = -1.0;
        let matrix = blocked(&matrix);
        assert_eq!(
            IncompleteCholesky::new(&matrix).factorize(&matrix),
            Err(FactorError::NotPositiveDefinite { row: 18 })
        );
    }
}
