//! `A = L Lᵀ` for positive definite matrices: supernodal, front by front or, where it is large, by faer. A pivot that is
//! not positive is an answer, not an accident: the equilibrium is unstable or a part of the body is not held.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::cholesky::supernodal::{
    factorize_supernodal_numeric_llt, factorize_supernodal_numeric_llt_scratch,
};

use super::analysis::Analysis;
use super::column::Column;
use super::fronts::Fronts;
use super::substitution::{Factor, zeros};
use super::{FactorError, Factorization, Pattern, Precision};

/// Sparse Cholesky factorisation with a symbolic analysis done once; in single precision, `Cholesky<f32>`, a
/// preconditioner.
pub struct Cholesky<T: Precision = f64> {
    analysis: Analysis<T>,
    factor: Vec<T>,
    elimination: Elimination<T>,
    is_factorized: bool,
    /// Fronts of the factor in hand that are done.
    done: usize,
}

/// How the factor is computed.
enum Elimination<T> {
    /// On one thread.
    Fronts(Fronts<T>),
    /// By faer, on all threads, in this memory.
    Shared(MemBuffer),
}

impl Cholesky {
    /// Orders the pattern and allocates everything that [`Factorization::factorize`] needs.
    ///
    /// # Errors
    /// An invalid pattern, or a factor too large to number or to hold.
    pub fn analyze(pattern: &Pattern) -> Result<Self, FactorError> {
        Self::with_precision(pattern)
    }
}

impl<T: Precision> Cholesky<T> {
    /// [`Cholesky::analyze`] for a factor in any precision.
    ///
    /// # Errors
    /// Those of [`Cholesky::analyze`].
    pub fn with_precision(pattern: &Pattern) -> Result<Self, FactorError> {
        Self::with_analysis(Analysis::new(pattern)?)
    }

    fn with_analysis(analysis: Analysis<T>) -> Result<Self, FactorError> {
        let elimination = if analysis.is_large {
            let request = factorize_supernodal_numeric_llt_scratch::<u32, T>(
                &analysis.supernodes,
                analysis.parallelism,
                Default::default(),
            );
            let memory = MemBuffer::try_new(request).map_err(|_| FactorError::OutOfMemory)?;
            Elimination::Shared(memory)
        } else {
            Elimination::Fronts(Fronts::new(&analysis.supernodes, &analysis.lower)?)
        };
        let factor = zeros(analysis.supernodes.len_val())?;
        Ok(Self { analysis, factor, elimination, is_factorized: false, done: 0 })
    }

    /// The caller's row eliminated at each step.
    pub fn order(&self) -> &[u32] {
        self.analysis.order()
    }

    /// Data of each entry of the pattern in the order in which [`Cholesky::factorize_placed`] wants the values.
    pub fn place(&self, of_entries: &[u32]) -> Vec<u32> {
        self.analysis.place(of_entries)
    }

    /// [`Factorization::factorize`] with values that come in the order of [`Cholesky::place`]: no copy between.
    ///
    /// # Errors
    /// Those of [`Factorization::factorize`].
    pub fn factorize_placed(
        &mut self,
        values: impl Iterator<Item = f64>,
    ) -> Result<(), FactorError> {
        self.is_factorized = false;
        self.analysis.load_placed(values)?;
        self.eliminate()
    }

    /// Takes the values of a factor that [`Cholesky::factorize_part`] makes, and forgets the one before.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn begin_placed(&mut self, values: impl Iterator<Item = f64>) -> Result<(), FactorError> {
        (self.is_factorized, self.done) = (false, 0);
        self.analysis.load_placed(values)
    }

    /// Does so many multiplications of the factor that was begun, about; returns whether it is complete. A factor that
    /// faer makes is made at once.
    ///
    /// # Errors
    /// Those of [`Factorization::factorize`].
    pub fn factorize_part(&mut self, work: f64) -> Result<bool, FactorError> {
        let Elimination::Fronts(fronts) = &mut self.elimination else {
            return self.eliminate().map(|()| true);
        };
        let values = self.analysis.values();
        match fronts.factorize_part(&mut self.done, work, values, &mut self.factor) {
            Ok(false) => Ok(false),
            whole => self.judge(whole.map(|_| ())).map(|()| true),
        }
    }

    /// Multiplications of a factor, about; none if it cannot be made in parts.
    pub fn work(&self) -> Option<f64> {
        match &self.elimination {
            Elimination::Fronts(fronts) => Some(fronts.work()),
            Elimination::Shared(_) => None,
        }
    }

    /// Room for [`Cholesky::solve_column`].
    pub fn column(&self) -> Column<T> {
        Column::new(&self.analysis.supernodes)
    }

    /// Solves for one right-hand side without allocation: row `rows[k]` of `b` and `x` is eliminated at step `k`;
    /// rows that are not listed stay as they are. A solution that is not finite is the caller's to notice.
    ///
    /// # Errors
    /// A missing factor.
    pub fn solve_column(
        &self,
        rows: &[u32],
        b: &[f64],
        x: &mut [f64],
        column: &mut Column<T>,
    ) -> Result<(), FactorError> {
        if !self.is_factorized {
            return Err(FactorError::NotFactorized);
        }
        FactorError::expect_length("rows", self.analysis.n(), rows.len())?;
        column.solve(&self.factor(), rows, b, x);
        Ok(())
    }

    fn factor(&self) -> Factor<'_, T> {
        let symbolic = &self.analysis.supernodes;
        Factor { symbolic, values: &self.factor, has_unit_diagonal: false }
    }

    fn eliminate(&mut self) -> Result<(), FactorError> {
        let analysis = &self.analysis;
        let outcome = match &mut self.elimination {
            Elimination::Fronts(fronts) => fronts.factorize(analysis.values(), &mut self.factor),
            Elimination::Shared(memory) => factorize_supernodal_numeric_llt(
                &mut self.factor,
                analysis.matrix(),
                Default::default(),
                &analysis.supernodes,
                analysis.parallelism,
                MemStack::new(memory),
                Default::default(),
            )
            .map(|_| ())
            .map_err(|LltError::NonPositivePivot { index }| index),
        };
        self.judge(outcome)
    }

    /// Whether the factor is one: the step of a pivot that is not positive is given.
    fn judge(&mut self, outcome: Result<(), usize>) -> Result<(), FactorError> {
        let analysis = &self.analysis;
        outcome.map_err(|step| FactorError::NotPositiveDefinite { row: analysis.row(step) })?;
        for (step, position) in analysis.pivots() {
            let pivot = self.factor[position] * self.factor[position];
            // Only an overflow can leave a NaN here.
            if !pivot.is_finite() || pivot <= T::round(T::LOST) * analysis.diagonal(step) {
                return Err(FactorError::Singular { row: analysis.row(step) });
            }
        }
        self.is_factorized = true;
        Ok(())
    }
}

impl<T: Precision> Factorization for Cholesky<T> {
    fn n(&self) -> usize {
        self.analysis.n()
    }

    fn fill(&self) -> usize {
        self.factor.len()
    }

    fn order(&self) -> &[u32] {
        self.analysis.order()
    }

    fn factorize(&mut self, values: &[f64]) -> Result<(), FactorError> {
        self.is_factorized = false;
        self.analysis.load(values)?;
        self.eliminate()
    }

    fn solve(&self, rhs: &mut [f64], columns: usize) -> Result<(), FactorError> {
        if !self.is_factorized {
            return Err(FactorError::NotFactorized);
        }
        let factor = self.factor();
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
    fn a_factor_in_parts_is_the_factor_in_one_piece() {
        let matrix = elastic_block(6, 5, 4);
        let indefinite = matrix.clone().shifted(-1.0);
        let b = load(matrix.pattern.n, 3);
        let mut cholesky = factorized(&matrix);
        let whole = solved(&cholesky, &b);
        let entries: Vec<u32> = (0..matrix.values.len() as u32).collect();
        let placed = cholesky.place(&entries);
        let work = cholesky.work().unwrap();
        for (values, least) in [(&indefinite.values, 1), (&matrix.values, 2)] {
            let outcome = cholesky.factorize(values);
            cholesky.begin_placed(placed.iter().map(|&e| values[e as usize])).unwrap();
            let mut x = b.clone();
            assert_eq!(Factorization::solve(&cholesky, &mut x, 1), Err(FactorError::NotFactorized));
            let mut parts = 1;
            let end = loop {
                match cholesky.factorize_part(0.1 * work) {
                    Ok(false) => parts += 1,
                    end => break end,
                }
            };
            assert_eq!(end.map(|_| ()), outcome);
            assert!((least..=10).contains(&parts), "{parts}");
        }
        assert_eq!(solved(&cholesky, &b), whole);
    }

    #[test]
    fn fronts_and_shared_supernodes_make_the_same_factor() {
        let matrix = elastic_block(9, 8, 7);
        let b = load(matrix.pattern.n, 4);
        let mut analysis = Analysis::new(&matrix.pattern).unwrap();
        analysis.is_large = true;
        let mut shared = Cholesky::with_analysis(analysis).unwrap();
        shared.factorize(&matrix.values).unwrap();
        let own = solved(&factorized(&matrix), &b);
        assert!(relative_difference(&own, &solved(&shared, &b)) < 1e-12);

        let indefinite = matrix.clone().shifted(-1.0);
        let mut fronts = factorized(&matrix);
        assert_eq!(
            fronts.factorize(&indefinite.values),
            shared.factorize(&indefinite.values),
            "the same row is named"
        );
    }

    #[test]
    fn one_column_without_allocation_is_the_same_solution() {
        let matrix = elastic_block(8, 7, 6);
        let n = matrix.pattern.n;
        let b = load(n, 5);
        let cholesky = factorized(&matrix);
        // Rows of a longer vector, and values in elimination order.
        let rows: Vec<u32> = cholesky.order().iter().map(|row| row + 2).collect();
        let long: Vec<f64> = [7.0, 8.0].iter().chain(&b).copied().collect();
        let mut placed = Cholesky::analyze(&matrix.pattern).unwrap();
        let entries: Vec<u32> = (0..matrix.values.len() as u32).collect();
        let values = placed.place(&entries).into_iter().map(|e| matrix.values[e as usize]);
        placed.factorize_placed(values).unwrap();
        let mut x = long.clone();
        placed.solve_column(&rows, &long, &mut x, &mut placed.column()).unwrap();
        assert_eq!(x[..2], [7.0, 8.0]);
        assert!(relative_difference(&x[2..], &solved(&cholesky, &b)) < 1e-12);
    }

    #[test]
    fn single_precision_is_a_close_preconditioner() {
        let matrix = elastic_block(8, 7, 6);
        let b: Vec<f64> = load(matrix.pattern.n, 6).iter().map(|b| 1e60 * b).collect();
        let mut single = Cholesky::<f32>::with_precision(&matrix.pattern).unwrap();
        single.factorize(&matrix.values).unwrap();
        let rows = single.order().to_vec();
        let mut x = vec![0.0; b.len()];
        single.solve_column(&rows, &b, &mut x, &mut single.column()).unwrap();
        assert!(relative_difference(&x, &solved(&factorized(&matrix), &b)) < 1e-4);
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
