//! `A = L D Lᵀ` for symmetric indefinite matrices, beyond a limit point for instance. The signs of `D` are
//! the inertia of `A` (Sylvester): the number of negative ones counts the unstable modes of an equilibrium.
//!
//! Pivots are taken in elimination order without exchange, so a factor is not always accurate: its growth is
//! checked once per factorisation, and the residual of every solution, which a refinement repairs if need be. As in
//! [`Cholesky`], factors are made front by front or, where they are large, by faer; in fronts, `D` is the signs alone.

use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::ldlt::factor::{LdltError, LdltRegularization};
use faer::sparse::linalg::cholesky::supernodal::{
    factorize_supernodal_numeric_ldlt, factorize_supernodal_numeric_ldlt_scratch,
};

use super::analysis::Analysis;
use super::elimination::Elimination;
use super::substitution::{Factor, Panel, zeros};
use super::{Cholesky, FactorError, Factorization, Pattern, Precision};

/// Where a pivot is this small beside the matrix it is lifted to that size: harmless in an empty column of the
/// factor, where it stands for a zero eigenvalue; anywhere else the growth gives it away.
const LIFTED: f64 = 1e-24;

/// The same beside its own row, in fronts: it counts as zero then, and what rounding has left in the rows after it stays as
/// small as it is.
const LIFTED_OF_ROW: f64 = 0.1 * f64::LOST;

/// Growth `max |L| |D| |Lᵀ| / max |A|` beyond which neither factor nor inertia can be trusted.
const MAX_GROWTH: f64 = 1e10;

/// Backward error that every solution must reach.
const BACKWARD_ERROR: f64 = 1e-13;

/// Refinements before a solution is given up.
const REFINEMENTS: usize = 3;

/// Numbers of positive, negative and zero eigenvalues of a symmetric matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inertia {
    /// Number of positive eigenvalues.
    pub positive: usize,
    /// Number of negative eigenvalues: the unstable modes of a tangent.
    pub negative: usize,
    /// Number of eigenvalues that are zero to working precision.
    pub zero: usize,
}

/// What a factorisation found out.
struct Outcome {
    inertia: Inertia,
    /// The caller's row of a vanishing pivot.
    null_row: Option<usize>,
    /// Largest row sum of `|A|`.
    norm: f64,
}

/// Sparse LDLᵀ factorisation with a symbolic analysis done once.
pub struct Ldlt {
    analysis: Analysis<f64>,
    factor: Vec<f64>,
    /// Of each step, `D`. Fronts leave the signs of the pivots there, and the roots of their sizes on the diagonal of `L`.
    pivots: Vec<f64>,
    elimination: Elimination<f64>,
    outcome: Option<Outcome>,
}

impl Ldlt {
    /// Orders the pattern and allocates everything that [`Factorization::factorize`] needs.
    ///
    /// # Errors
    /// An invalid pattern, or a factor too large to number or to hold.
    pub fn analyze(pattern: &Pattern) -> Result<Self, FactorError> {
        Self::with_analysis(Analysis::new(pattern)?)
    }

    fn with_analysis(analysis: Analysis<f64>) -> Result<Self, FactorError> {
        let elimination = Elimination::new(&analysis, |analysis| {
            let Analysis { supernodes, parallelism, .. } = analysis;
            factorize_supernodal_numeric_ldlt_scratch::<u32, f64>(
                supernodes,
                *parallelism,
                Default::default(),
            )
        })?;
        let factor = zeros(analysis.supernodes.len_val())?;
        let pivots = zeros(analysis.n())?;
        Ok(Self { analysis, factor, pivots, elimination, outcome: None })
    }

    /// Inertia of the matrix factorised last.
    ///
    /// # Errors
    /// [`FactorError::NotFactorized`] where there is none.
    pub fn inertia(&self) -> Result<Inertia, FactorError> {
        self.outcome.as_ref().map(|outcome| outcome.inertia).ok_or(FactorError::NotFactorized)
    }

    /// Goes on where [`Cholesky::factorize`] met a pivot that is not positive, with its matrix: one of the same pattern. No
    /// more is left of that factor.
    ///
    /// # Errors
    /// Those of [`Factorization::factorize`]; another pattern.
    pub fn go_on(&mut self, begun: &mut Cholesky) -> Result<(), FactorError> {
        FactorError::expect_length("rows", self.n(), begun.n())?;
        FactorError::expect_length("factor", self.factor.len(), begun.factor.len())?;
        (self.outcome, begun.is_factorized) = (None, false);
        std::mem::swap(&mut self.analysis.values, &mut begun.analysis.values);
        std::mem::swap(&mut self.factor, &mut begun.factor);
        std::mem::swap(&mut self.elimination, &mut begun.elimination);
        self.eliminate(begun.done)
    }

    /// Factorises the loaded matrix, of which so many fronts are done.
    fn eliminate(&mut self, done: usize) -> Result<(), FactorError> {
        let Ldlt { analysis, factor, pivots, .. } = self;
        let largest = analysis.values.iter().fold(0.0, |max: f64, value| max.max(value.abs()));
        let lifted = (LIFTED * largest).max(f64::MIN_POSITIVE);
        let broken =
            |step: usize| FactorError::Unstable { row: analysis.row(step), growth: f64::INFINITY };
        match &mut self.elimination {
            Elimination::Fronts(fronts) => {
                let least = |step| (LIFTED_OF_ROW * analysis.diagonal(step).abs()).max(lifted);
                let least: Vec<f64> = (0..analysis.n()).map(least).collect();
                let signed = fronts.factorize_rest(done, &least, &analysis.values, factor);
                pivots.fill(1.0);
                signed.map_err(broken)?.into_iter().for_each(|step| pivots[step] = -1.0);
            }
            Elimination::Shared(memory) => {
                factorize_supernodal_numeric_ldlt(
                    factor,
                    analysis.matrix(),
                    LdltRegularization {
                        dynamic_regularization_signs: None,
                        dynamic_regularization_delta: lifted,
                        dynamic_regularization_epsilon: lifted,
                    },
                    &analysis.supernodes,
                    analysis.parallelism,
                    MemStack::new(memory),
                    Default::default(),
                )
                .map_err(|LdltError::ZeroPivot { index }| broken(index))?;
                analysis.pivots().for_each(|(step, position)| pivots[step] = factor[position]);
            }
        }
        self.outcome = Some(self.judge(largest.max(f64::MIN_POSITIVE))?);
        Ok(())
    }

    fn factor(&self) -> Factor<'_, f64> {
        Factor {
            symbolic: &self.analysis.supernodes,
            values: &self.factor,
            has_unit_diagonal: matches!(self.elimination, Elimination::Shared(_)),
        }
    }

    /// Judges the factor: signs, vanished pivots, growth.
    fn judge(&self, largest: f64) -> Result<Outcome, FactorError> {
        let (mut inertia, mut null_row) = (Inertia::default(), None);
        let factor = self.factor();
        let subtracted = factor.weighted_row_squares(&self.pivots);
        for (step, position) in self.analysis.pivots() {
            let root = if factor.has_unit_diagonal { 1.0 } else { self.factor[position] };
            let (pivot, subtracted) = (self.pivots[step] * root * root, subtracted[step]);
            let row = self.analysis.row(step);
            let growth = (pivot.abs() + subtracted) / largest;
            if growth.is_nan() || growth > MAX_GROWTH {
                return Err(FactorError::Unstable { row, growth });
            }
            if pivot.abs() <= f64::LOST * (self.analysis.diagonal(step).abs() + subtracted) {
                inertia.zero += 1;
                null_row = null_row.or(Some(row));
            } else if pivot > 0.0 {
                inertia.positive += 1;
            } else {
                inertia.negative += 1;
            }
        }
        Ok(Outcome { inertia, null_row, norm: self.analysis.norm() })
    }

    fn substitute(&self, panel: &mut Panel<f64>) {
        let factor = self.factor();
        factor.forward(panel);
        panel.divide_rows(&self.pivots);
        factor.backward(panel);
    }

    /// Solves for a panel of right-hand sides and refines until the residual says that the solution is one.
    fn solve_refined(&self, panel: &mut Panel<f64>, norm: f64) -> Result<(), FactorError> {
        let rhs = panel.values.clone();
        self.substitute(panel);
        for refinement in 0.. {
            let solution = std::mem::replace(&mut panel.values, rhs.clone());
            self.analysis.subtract_product(&solution, panel);
            let error = panel.backward_error(&solution, &rhs, norm);
            if error <= BACKWARD_ERROR {
                panel.values = solution;
                break;
            }
            if refinement == REFINEMENTS || !error.is_finite() {
                return Err(FactorError::Inaccurate { backward_error: error });
            }
            self.substitute(panel);
            panel.values.iter_mut().zip(solution).for_each(|(correction, x)| *correction += x);
        }
        Ok(())
    }
}

impl Factorization for Ldlt {
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
        self.outcome = None;
        self.analysis.load(values)?;
        self.eliminate(0)
    }

    fn solve(&self, rhs: &mut [f64], columns: usize) -> Result<(), FactorError> {
        let outcome = self.outcome.as_ref().ok_or(FactorError::NotFactorized)?;
        if let Some(row) = outcome.null_row {
            return Err(FactorError::Singular { row });
        }
        self.analysis.solve(rhs, columns, |panel| self.solve_refined(panel, outcome.norm))
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_matrices::{
        Matrix, elastic_block, floating_block, load, relative_difference,
    };
    use super::*;

    fn factorized(matrix: &Matrix) -> Ldlt {
        let mut ldlt = Ldlt::analyze(&matrix.pattern).unwrap();
        ldlt.factorize(&matrix.values).unwrap();
        ldlt
    }

    fn solved(ldlt: &Ldlt, rhs: &[f64]) -> Vec<f64> {
        let mut x = rhs.to_vec();
        ldlt.solve(&mut x, rhs.len() / ldlt.n()).unwrap();
        x
    }

    /// Inertia by the eigenvalues of the dense matrix.
    fn dense_inertia(matrix: &Matrix) -> Inertia {
        let eigenvalues = matrix.dense().self_adjoint_eigenvalues(faer::Side::Lower).unwrap();
        let negative = eigenvalues.iter().filter(|&&value| value < 0.0).count();
        Inertia { positive: eigenvalues.len() - negative, negative, zero: 0 }
    }

    /// `[K Bᵀ; B -c]`: an elastic block whose nodes share pressures, one for every `group` of nodes.
    fn saddle_point(compliance: f64) -> Matrix {
        let block = elastic_block(5, 4, 3);
        let n = block.pattern.n;
        let mut entries = Vec::new();
        for column in 0..n {
            for entry in block.pattern.column(column) {
                entries.push((block.pattern.row[entry] as usize, column, block.values[entry]));
            }
            entries.push((column, n + column / 12, (column as f64).cos()));
        }
        entries.extend((0..n / 12).map(|pressure| (n + pressure, n + pressure, -compliance)));
        Matrix::from_entries(n + n / 12, &entries)
    }

    #[test]
    fn counts_the_negative_eigenvalues_of_a_shifted_matrix() {
        for shift in [0.0, -0.31, -1.3, -4.7, -40.0] {
            let matrix = elastic_block(5, 4, 3).shifted(shift);
            let ldlt = factorized(&matrix);
            assert_eq!(ldlt.inertia().unwrap(), dense_inertia(&matrix), "shift {shift}");
            let b = load(180, 0);
            assert!(matrix.relative_residual(&solved(&ldlt, &b), &b) < 1e-11, "shift {shift}");
        }
    }

    #[test]
    fn goes_on_where_a_cholesky_factor_ends() {
        for (block, shift) in [((5, 4, 3), -0.31), ((5, 4, 3), -40.0), ((12, 11, 9), -0.05)] {
            let matrix = elastic_block(block.0, block.1, block.2).shifted(shift);
            let mut cholesky = Cholesky::analyze(&matrix.pattern).unwrap();
            let ended = cholesky.factorize(&matrix.values);
            assert!(matches!(ended, Err(FactorError::NotPositiveDefinite { .. })), "{ended:?}");
            let mut ldlt = Ldlt::analyze(&matrix.pattern).unwrap();
            ldlt.go_on(&mut cholesky).unwrap();
            let whole = factorized(&matrix);
            assert_eq!(ldlt.inertia(), whole.inertia());
            let b = load(matrix.pattern.n, 0);
            assert_eq!(solved(&ldlt, &b), solved(&whole, &b));
            assert_eq!(cholesky.solve(&mut b.clone(), 1), Err(FactorError::NotFactorized));
            // What it was given in exchange serves as well.
            let definite = elastic_block(block.0, block.1, block.2);
            cholesky.factorize(&definite.values).unwrap();
            let mut x = b.clone();
            cholesky.solve(&mut x, 1).unwrap();
            assert!(definite.relative_residual(&x, &b) < 1e-11);
        }
    }

    #[test]
    fn fronts_and_faer_give_the_same() {
        for shift in [0.0, -0.31, -1.3, -4.7, -40.0] {
            let matrix = elastic_block(7, 6, 5).shifted(shift);
            let mut analysis = Analysis::new(&matrix.pattern).unwrap();
            analysis.is_large = true;
            let mut shared = Ldlt::with_analysis(analysis).unwrap();
            shared.factorize(&matrix.values).unwrap();
            let fronts = factorized(&matrix);
            assert_eq!(shared.inertia(), fronts.inertia(), "shift {shift}");
            let b = load(matrix.pattern.n, 0);
            let difference = relative_difference(&solved(&shared, &b), &solved(&fronts, &b));
            assert!(difference < 1e-9, "shift {shift}: {difference}");
        }
    }

    #[test]
    fn goes_on_with_a_pattern_of_its_own_alone() {
        let (one, other) = (elastic_block(3, 3, 3), elastic_block(4, 3, 3));
        let mut ldlt = Ldlt::analyze(&one.pattern).unwrap();
        let mut cholesky = Cholesky::analyze(&other.pattern).unwrap();
        let refused = ldlt.go_on(&mut cholesky);
        assert!(matches!(refused, Err(FactorError::Length { .. })), "{refused:?}");
    }

    #[test]
    fn counts_the_multipliers_of_a_saddle_point() {
        for compliance in [1e-2, 1e-6] {
            let matrix = saddle_point(compliance);
            let ldlt = factorized(&matrix);
            assert_eq!(ldlt.inertia().unwrap(), Inertia { positive: 180, negative: 15, zero: 0 });
            let b = load(195, 0);
            assert!(matrix.relative_residual(&solved(&ldlt, &b), &b) < 1e-11);
        }
    }

    #[test]
    fn reports_a_singular_matrix_and_refuses_to_solve_with_it() {
        // Two chains of springs that nothing holds: one zero eigenvalue each.
        let mut entries = Vec::new();
        for i in (0..9).chain(10..19) {
            let k = 1.0 + (i as f64).sin().abs();
            entries.extend([(i, i, k), (i + 1, i + 1, k), (i, i + 1, -k)]);
        }
        let ldlt = factorized(&Matrix::from_entries(20, &entries));
        assert_eq!(ldlt.inertia().unwrap(), Inertia { positive: 18, negative: 0, zero: 2 });
        assert!(
            matches!(ldlt.solve(&mut load(20, 0), 1), Err(FactorError::Singular { row }) if row < 20)
        );
    }

    #[test]
    fn counts_the_rigid_motions_of_a_floating_body() {
        // Springs with shear stiffness resist a rotation, so that the three translations remain.
        for matrix in [floating_block(5, 4, 3), floating_block(12, 11, 9)] {
            let inertia = factorized(&matrix).inertia().unwrap();
            assert_eq!(inertia, Inertia { positive: matrix.pattern.n - 3, negative: 0, zero: 3 });
        }
    }

    #[test]
    fn says_where_elimination_without_pivoting_breaks_down() {
        let matrix = Matrix::from_entries(2, &[(0, 1, 1.0)]);
        let mut ldlt = Ldlt::analyze(&matrix.pattern).unwrap();
        let broken = ldlt.factorize(&matrix.values);
        assert!(matches!(broken, Err(FactorError::Unstable { row, .. }) if row < 2), "{broken:?}");
        assert_eq!(ldlt.inertia(), Err(FactorError::NotFactorized));
        assert_eq!(ldlt.solve(&mut [1.0, 1.0], 1), Err(FactorError::NotFactorized));
    }

    #[test]
    fn refines_a_solution_that_growth_has_spoilt() {
        let matrix = saddle_point(1e-9);
        let b = load(195, 1);
        assert!(matrix.relative_residual(&solved(&factorized(&matrix), &b), &b) < 1e-11);
    }

    #[test]
    fn refuses_values_that_are_not_finite() {
        let mut matrix = elastic_block(2, 2, 2);
        let mut ldlt = Ldlt::analyze(&matrix.pattern).unwrap();
        matrix.values[7] = f64::NAN;
        assert_eq!(ldlt.factorize(&matrix.values), Err(FactorError::NotFinite { position: 7 }));
    }

    #[test]
    fn solves_many_right_hand_sides_as_it_solves_one() {
        let ldlt = factorized(&elastic_block(5, 4, 3).shifted(-1.3));
        let loads: Vec<f64> = (0..70).flat_map(|seed| load(180, seed)).collect();
        for (x, b) in solved(&ldlt, &loads).chunks(180).zip(loads.chunks(180)) {
            assert!(relative_difference(x, &solved(&ldlt, b)) < 1e-10);
        }
    }

    #[test]
    fn handles_no_row_and_one_row() {
        let empty = factorized(&Matrix::from_entries(0, &[]));
        assert_eq!(empty.solve(&mut [], 2), Ok(()));
        let one = factorized(&Matrix::from_entries(1, &[(0, 0, -4.0)]));
        assert_eq!(solved(&one, &[2.0]), [-0.5]);
        assert_eq!(one.inertia().unwrap().negative, 1);
    }
}
