//! Factors against dense solutions, in every precision and size, and every way a matrix can be refused.

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
    let expected: Vec<Vec<f64>> = (0..8).map(|seed| solved(&cholesky, &load(n, seed))).collect();
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
fn a_few_columns_side_by_side_are_solved_as_each_alone() {
    let matrix = elastic_block(8, 7, 6);
    let n = matrix.pattern.n;
    let mut placed = Cholesky::analyze(&matrix.pattern).unwrap();
    let mut single = Cholesky::<f32>::with_precision(&matrix.pattern).unwrap();
    placed.factorize(&matrix.values).unwrap();
    single.factorize(&matrix.values).unwrap();
    let rows: Vec<u32> = placed.order().iter().map(|row| row + 2).collect();
    for count in 0..=FEW {
        let mut columns = vec![3.0; count * (n + 2)];
        for (k, column) in columns.chunks_exact_mut(n + 2).enumerate() {
            // Of very different size; one is zero.
            let size = [1e-30, 1.0, 0.0, 1e30][k];
            column[2..].iter_mut().zip(load(n, 5 + k)).for_each(|(x, b)| *x = size * b);
        }
        let before = columns.clone();
        placed.solve_few(&rows, &mut columns, n + 2, &mut placed.few()).unwrap();
        let mut in_single = before.clone();
        single.solve_few(&rows, &mut in_single, n + 2, &mut single.few()).unwrap();
        let each = before.chunks_exact(n + 2).zip(columns.chunks_exact(n + 2));
        for ((b, x), close) in each.zip(in_single.chunks_exact(n + 2)) {
            let mut alone = b.to_vec();
            placed.solve_column(&rows, b, &mut alone, &mut placed.column()).unwrap();
            assert_eq!(x[..2], [3.0, 3.0]);
            if b[2..].iter().any(|&b| b != 0.0) {
                assert!(relative_difference(&x[2..], &alone[2..]) < 1e-12);
                assert!(relative_difference(&close[2..], &alone[2..]) < 1e-4);
            } else {
                assert!(x[2..].iter().all(|&x| x == 0.0));
            }
        }
    }
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
    assert_eq!(cholesky.factorize(&matrix.values), Err(FactorError::NotFinite { position: 40 }));
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
