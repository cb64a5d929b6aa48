//! `A = L Lᵀ` for positive definite matrices: supernodal, ordered by nested dissection. A pivot that is not
//! positive is an answer, not an accident: the equilibrium is unstable or a part of the body is not held.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::cholesky::supernodal::{
    factorize_supernodal_numeric_llt, factorize_supernodal_numeric_llt_scratch,
};

use super::analysis::Analysis;
use super::substitution::{Factor, zeros};
use super::{FactorError, Factorization, LOST, Pattern};

/// Sparse Cholesky factorisation with a symbolic analysis done once.
pub struct Cholesky {
    analysis: Analysis,
    factor: Vec<f64>,
    memory: MemBuffer,
    is_factorized: bool,
}

impl Cholesky {
    /// Orders the pattern and allocates everything that [`Factorization::factorize`] needs.
    ///
    /// # Errors
    /// An invalid pattern, or a factor too large to number or to hold.
    pub fn analyze(pattern: &Pattern) -> Result<Self, FactorError> {
        let analysis = Analysis::new(pattern)?;
        let request = factorize_supernodal_numeric_llt_scratch::<u32, f64>(
            &analysis.supernodes,
            analysis.parallelism,
            Default::default(),
        );
        let memory = MemBuffer::try_new(request).map_err(|_| FactorError::OutOfMemory)?;
        let factor = zeros(analysis.supernodes.len_val())?;
        Ok(Self { analysis, factor, memory, is_factorized: false })
    }
}

impl Factorization for Cholesky {
    fn n(&self) -> usize {
        self.analysis.n()
    }

    fn factorize(&mut self, values: &[f64]) -> Result<(), FactorError> {
        self.is_factorized = false;
        self.analysis.load(values)?;
        let analysis = &self.analysis;
        factorize_supernodal_numeric_llt(
            &mut self.factor,
            analysis.matrix(),
            Default::default(),
            &analysis.supernodes,
            analysis.parallelism,
            MemStack::new(&mut self.memory),
            Default::default(),
        )
        .map_err(|LltError::NonPositivePivot { index }| {
            FactorError::NotPositiveDefinite { row: analysis.row(index) }
        })?;
        for (step, position) in analysis.pivots() {
            let pivot = self.factor[position] * self.factor[position];
            // Only an overflow can leave a NaN here.
            if pivot.is_nan() || pivot <= LOST * analysis.diagonal(step) {
                return Err(FactorError::Singular { row: analysis.row(step) });
            }
        }
        self.is_factorized = true;
        Ok(())
    }

    fn solve(&self, rhs: &mut [f64], columns: usize) -> Result<(), FactorError> {
        if !self.is_factorized {
            return Err(FactorError::NotFactorized);
        }
        let symbolic = &self.analysis.supernodes;
        let factor = Factor { symbolic, values: &self.factor, has_unit_diagonal: false };
        self.analysis.solve(rhs, columns, |panel| {
            factor.forward(panel);
            factor.backward(panel);
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_matrices::{Matrix, elastic_block, load, relative_difference};
    use super::*;
    use faer::prelude::Solve;

    fn factorized(matrix: &Matrix) -> Cholesky {
        let mut cholesky = Cholesky::analyze(&matrix.pattern).unwrap();
        cholesky.factorize(&matrix.values).unwrap();
        cholesky
    }

    fn solved(cholesky: &Cholesky, rhs: &[f64]) -> Vec<f64> {
        let mut x = rhs.to_vec();
        cholesky.solve(&mut x, rhs.len() / cholesky.n()).unwrap();
        x
    }

    #[test]
    fn agrees_with_a_dense_solve() {
        let matrix = elastic_block(5, 4, 3);
        let b = load(matrix.pattern.n, 0);
        let mut dense = faer::Mat::from_fn(b.len(), 1, |i, _| b[i]);
        matrix.dense().llt(faer::Side::Lower).unwrap().solve_in_place(&mut dense);
        let x = solved(&factorized(&matrix), &b);
        assert!(relative_difference(&x, dense.col_as_slice(0)) < 1e-12);
    }

    #[test]
    fn leaves_a_residual_of_rounding_size() {
        let matrix = elastic_block(12, 9, 10);
        let b = load(matrix.pattern.n, 1);
        assert!(matrix.relative_residual(&solved(&factorized(&matrix), &b), &b) < 1e-12);
    }

    #[test]
    fn solves_many_right_hand_sides_as_it_solves_one() {
        let matrix = elastic_block(6, 5, 4);
        let n = matrix.pattern.n;
        let cholesky = factorized(&matrix);
        let loads: Vec<f64> = (0..150).flat_map(|seed| load(n, seed)).collect(); // more than two panels
        let together = solved(&cholesky, &loads);
        for (x, b) in together.chunks(n).zip(loads.chunks(n)) {
            assert!(relative_difference(x, &solved(&cholesky, b)) < 1e-12);
        }
    }

    #[test]
    fn threads_share_one_factor() {
        let matrix = elastic_block(6, 5, 4);
        let n = matrix.pattern.n;
        let cholesky = factorized(&matrix);
        let expected: Vec<Vec<f64>> =
            (0..8).map(|seed| solved(&cholesky, &load(n, seed))).collect();
        std::thread::scope(|scope| {
            for (seed, expected) in expected.iter().enumerate() {
                let cholesky = &cholesky;
                scope.spawn(move || {
                    (0..20).for_each(|_| assert_eq!(&solved(cholesky, &load(n, seed)), expected))
                });
            }
        });
    }

    #[test]
    fn a_refactor_equals_a_fresh_factor() {
        let first = elastic_block(6, 5, 4);
        let second = first.clone().shifted(0.7);
        let b = load(first.pattern.n, 2);
        let mut cholesky = factorized(&first);
        cholesky.factorize(&second.values).unwrap();
        assert_eq!(solved(&cholesky, &b), solved(&factorized(&second), &b));
    }

    #[test]
    fn names_the_row_of_a_negative_or_zeroed_diagonal() {
        for row in [0, 17, 91, 179] {
            let mut matrix = elastic_block(5, 4, 3);
            let mut cholesky = Cholesky::analyze(&matrix.pattern).unwrap();
            for bad in [-1.0, 0.0] {
                let diagonal = matrix.diagonal(row);
                let column = matrix.pattern.column(row);
                matrix.values[column].fill(0.0);
                for entry in 0..matrix.values.len() {
                    if matrix.pattern.row[entry] as usize == row {
                        matrix.values[entry] = 0.0;
                    }
                }
                matrix.values[diagonal] = bad;
                assert_eq!(
                    cholesky.factorize(&matrix.values),
                    Err(FactorError::NotPositiveDefinite { row })
                );
                assert_eq!(cholesky.solve(&mut load(180, 0), 1), Err(FactorError::NotFactorized));
            }
        }
    }

    #[test]
    fn refuses_an_indefinite_and_a_floating_body() {
        let held = elastic_block(5, 4, 3);
        let mut cholesky = Cholesky::analyze(&held.pattern).unwrap();
        let indefinite = cholesky.factorize(&held.clone().shifted(-1.0).values);
        assert!(
            matches!(indefinite, Err(FactorError::NotPositiveDefinite { row }) if row < 180),
            "{indefinite:?}"
        );

        let floating = Matrix::from_entries(
            3,
            &[(0, 0, 1.0), (0, 1, -1.0), (1, 1, 3.0), (1, 2, -2.0), (2, 2, 2.0)],
        );
        let mut cholesky = Cholesky::analyze(&floating.pattern).unwrap();
        assert!(matches!(
            cholesky.factorize(&floating.values),
            Err(FactorError::Singular { .. } | FactorError::NotPositiveDefinite { .. })
        ));
    }

    #[test]
    fn refuses_values_that_are_not_finite() {
        let mut matrix = elastic_block(3, 3, 3);
        let cholesky = factorized(&matrix);
        let mut b = load(162, 0);
        b[100] = f64::INFINITY;
        assert_eq!(
            cholesky.solve(&mut b, 2),
            Err(FactorError::RightHandSideNotFinite { row: 19, column: 1 })
        );
        let mut huge = vec![1e307; 81];
        let soft = factorized(&Matrix {
            values: matrix.values.iter().map(|v| 1e-3 * v).collect(),
            ..matrix.clone()
        });
        assert!(matches!(
            soft.solve(&mut huge, 1),
            Err(FactorError::SolutionNotFinite { column: 0, .. })
        ));
        matrix.values[40] = f64::NAN;
        let mut cholesky = cholesky;
        assert_eq!(
            cholesky.factorize(&matrix.values),
            Err(FactorError::NotFinite { position: 40 })
        );
    }

    #[test]
    fn refuses_slices_of_the_wrong_length() {
        let matrix = elastic_block(2, 2, 2);
        let mut cholesky = factorized(&matrix);
        let rhs = FactorError::Length { argument: "rhs", expected: 48, found: 47 };
        assert_eq!(cholesky.solve(&mut [0.0; 47], 2), Err(rhs));
        assert!(matches!(
            cholesky.factorize(&[1.0]),
            Err(FactorError::Length { argument: "values", .. })
        ));
    }

    #[test]
    fn handles_no_row_and_one_row() {
        let empty = factorized(&Matrix::from_entries(0, &[]));
        assert_eq!(empty.solve(&mut [], 3), Ok(()));
        let one = factorized(&Matrix::from_entries(1, &[(0, 0, 4.0)]));
        assert_eq!(solved(&one, &[2.0, 6.0]), [0.5, 1.5]);
    }

    #[test]
    fn handles_disconnected_parts_and_a_dense_row() {
        let mut entries: Vec<_> = (0..400).map(|i| (i, i, 5.0)).collect();
        entries.extend((1..200).map(|i| (i - 1, i, -1.0)));
        entries.extend((200..399).map(|i| (399, i, 0.01)));
        let matrix = Matrix::from_entries(400, &entries);
        let b = load(400, 3);
        assert!(matrix.relative_residual(&solved(&factorized(&matrix), &b), &b) < 1e-14);
    }
}
