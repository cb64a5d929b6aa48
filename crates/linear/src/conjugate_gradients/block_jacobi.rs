//! The inverse of the diagonal blocks, one for each node: the cheapest preconditioner of an elastic body.

use super::super::FactorError;
use super::Preconditioner;
use crate::threads::for_parts;

/// Nodes that a thread takes at once.
const PART: usize = 4_096;

/// Block-Jacobi preconditioner.
pub struct BlockJacobi {
    inverses: Vec<[[f64; 3]; 3]>,
    is_held: Vec<bool>,
}

impl BlockJacobi {
    /// Room for the inverses of `n_nodes` blocks; factorise before use.
    pub fn new(n_nodes: usize) -> Self {
        Self { inverses: vec![[[0.0; 3]; 3]; n_nodes], is_held: vec![false; 3 * n_nodes] }
    }

    /// Inverts a block for each node; rows that are held are those of the identity there.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`] names a row of the block that is not, which may be any of its rows.
    pub fn factorize(
        &mut self,
        blocks: impl Iterator<Item = [[f64; 3]; 3]>,
        is_held: impl Fn(usize) -> bool,
    ) -> Result<(), FactorError> {
        for (node, (inverse, block)) in self.inverses.iter_mut().zip(blocks).enumerate() {
            (*inverse, _) = inverse_of_positive(block)
                .ok_or(FactorError::NotPositiveDefinite { row: 3 * node })?;
        }
        self.is_held.iter_mut().enumerate().for_each(|(row, held)| *held = is_held(row));
        Ok(())
    }
}

impl Preconditioner for BlockJacobi {
    fn n(&self) -> usize {
        self.is_held.len()
    }

    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let (r, _) = r.as_chunks::<3>();
        let (z, _) = z.as_chunks_mut::<3>();
        let (is_held, _) = self.is_held.as_chunks::<3>();
        for_parts(z, PART, |number, z| {
            let nodes = number * PART..number * PART + z.len();
            let of_nodes = self.inverses[nodes.clone()].iter().zip(&r[nodes.clone()]);
            for ((z, (inverse, r)), is_held) in z.iter_mut().zip(of_nodes).zip(&is_held[nodes]) {
                for i in 0..3 {
                    let product =
                        inverse[i][0] * r[0] + inverse[i][1] * r[1] + inverse[i][2] * r[2];
                    z[i] = if is_held[i] { 0.0 } else { product };
                }
            }
        });
    }
}

/// Inverse by cofactors and determinant, or nothing unless all leading minors are positive (Sylvester's criterion).
pub(super) fn inverse_of_positive(a: [[f64; 3]; 3]) -> Option<([[f64; 3]; 3], f64)> {
    let minor = |i: usize, j: usize| {
        let (p, q, r, s) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        a[p][r] * a[q][s] - a[p][s] * a[q][r]
    };
    let determinant = (0..3).map(|j| a[0][j] * minor(0, j)).sum::<f64>();
    let is_positive =
        a[0][0] > 0.0 && minor(2, 2) > 0.0 && determinant > 0.0 && determinant.is_finite();
    let inverse = || std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i) / determinant));
    is_positive.then(|| (inverse(), determinant))
}

#[cfg(test)]
mod tests {
    use super::super::super::BlockMatrix;
    use super::super::super::block_matrix::tests::blocked;
    use super::super::super::test_matrices::Matrix;
    use super::*;

    fn factorize(inverse: &mut BlockJacobi, matrix: &BlockMatrix) -> Result<(), FactorError> {
        let blocks = (0..matrix.n_nodes()).map(|node| matrix.diagonal_block(node));
        inverse.factorize(blocks, |row| matrix.is_held(row))
    }

    fn block_diagonal() -> Matrix {
        let entries = [(0, 1, 1.0), (3, 4, -1.0), (3, 5, 0.5), (4, 5, 1.5)];
        Matrix::from_entries(6, &entries).shifted(4.0)
    }

    #[test]
    fn inverts_a_block_diagonal_matrix() {
        let matrix = block_diagonal();
        let mut preconditioner = BlockJacobi::new(2);
        factorize(&mut preconditioner, &blocked(&matrix)).unwrap();
        let x = [1.0, -2.0, 3.0, 0.5, 0.0, 4.0];
        let mut z = [f64::NAN; 6];
        preconditioner.apply(&matrix.multiply(&x), &mut z);
        z.iter().zip(x).for_each(|(z, x)| assert!((z - x).abs() < 1e-14));
    }

    #[test]
    fn leaves_held_rows_out() {
        let matrix = block_diagonal();
        let mut blocked = blocked(&matrix);
        blocked.hold(&[false, true, false, false, false, true]);
        let mut preconditioner = BlockJacobi::new(2);
        factorize(&mut preconditioner, &blocked).unwrap();
        let mut z = [f64::NAN; 6];
        preconditioner.apply(&[4.0, 9.0, 8.0, 3.0, 3.0, 9.0], &mut z);
        let expected = [1.0, 0.0, 2.0, 1.0, 1.0, 0.0]; // [4 -1; -1 4] of the rows that are left
        z.iter().zip(expected).for_each(|(z, x)| assert!((z - x).abs() < 1e-14));
    }

    #[test]
    fn refuses_an_indefinite_block() {
        let matrix = block_diagonal().shifted(-3.5);
        let mut preconditioner = BlockJacobi::new(2);
        assert_eq!(
            factorize(&mut preconditioner, &blocked(&matrix)),
            Err(FactorError::NotPositiveDefinite { row: 0 })
        );
    }
}
