//! The solver against the direct one, preconditioners against each other, and every failure.

use super::super::block_matrix::tests::blocked;
use super::super::test_matrices::{self as matrices, elastic_block, load, relative_difference};
use super::super::{Cholesky, Factorization};
use super::*;

/// No preconditioner, or with -1 an indefinite one.
struct Multiple(usize, f64);

impl Preconditioner for Multiple {
    fn n(&self) -> usize {
        self.0
    }

    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.iter_mut().zip(r).for_each(|(z, r)| *z = self.1 * r);
    }
}

/// A clamped bar of equal springs, never assembled.
struct Bar(usize);

impl Operator for Bar {
    fn n(&self) -> usize {
        self.0
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        for i in 0..self.0 {
            let (left, right) =
                (i.checked_sub(1).map_or(0.0, |i| x[i]), x.get(i + 1).unwrap_or(&x[i]));
            y[i] = 2.0 * x[i] - left - right;
        }
    }
}

fn operator(matrix: &matrices::Matrix) -> Matrix<'_> {
    Matrix { pattern: &matrix.pattern, values: &matrix.values }
}

fn solved(
    matrix: &matrices::Matrix,
    preconditioner: &mut impl Preconditioner,
    tolerance: f64,
) -> (Vec<f64>, Info) {
    let n = matrix.pattern.n;
    let settings = Settings { relative_tolerance: tolerance, ..Settings::default() };
    let mut x = vec![0.0; n];
    let workspace = &mut Workspace::new(n);
    let info = solve(&mut x, &operator(matrix), preconditioner, &load(n, 0), &settings, workspace)
        .unwrap();
    (x, info)
}

/// A block whose nodes differ in stiffness by up to two orders of magnitude.
fn uneven_block() -> matrices::Matrix {
    let mut matrix = elastic_block(8, 7, 6);
    let stiffness = |dof: usize| 10f64.powf(((dof / 3) as f64 * 0.7).sin());
    for column in 0..matrix.pattern.n {
        for entry in matrix.pattern.column(column) {
            let row = matrix.pattern.row[entry] as usize;
            matrix.values[entry] *= (stiffness(row) * stiffness(column)).sqrt();
        }
    }
    matrix
}

fn block_jacobi(matrix: &matrices::Matrix) -> BlockJacobi {
    let mut preconditioner = BlockJacobi::new(matrix.pattern.n / 3);
    let matrix = blocked(matrix);
    let blocks = (0..matrix.n_nodes()).map(|node| matrix.diagonal_block(node));
    preconditioner.factorize(blocks, |_| false).unwrap();
    preconditioner
}

fn incomplete_cholesky(matrix: &matrices::Matrix) -> IncompleteCholesky {
    let matrix = blocked(matrix);
    let mut preconditioner = IncompleteCholesky::new(&matrix);
    preconditioner.factorize(&matrix).unwrap();
    preconditioner
}

#[test]
fn agrees_with_the_direct_solver() {
    let matrix = uneven_block();
    let mut direct = load(matrix.pattern.n, 0);
    let mut cholesky = Cholesky::analyze(&matrix.pattern).unwrap();
    cholesky.factorize(&matrix.values).unwrap();
    cholesky.solve(&mut direct, 1).unwrap();
    let (x, info) = solved(&matrix, &mut block_jacobi(&matrix), 1e-12);
    assert!(relative_difference(&x, &direct) < 1e-10);
    let (x, _) = solved(&matrix, &mut incomplete_cholesky(&matrix), 1e-12);
    assert!(relative_difference(&x, &direct) < 1e-10);
    assert!(
        (matrix.relative_residual(&x, &load(x.len(), 0)) - info.relative_residual).abs() < 1e-12
    );
}

#[test]
fn a_stronger_preconditioner_takes_fewer_iterations() {
    let matrix = uneven_block();
    let (_, none) = solved(&matrix, &mut Multiple(matrix.pattern.n, 1.0), 1e-8);
    let (_, block) = solved(&matrix, &mut block_jacobi(&matrix), 1e-8);
    let (_, incomplete) = solved(&matrix, &mut incomplete_cholesky(&matrix), 1e-8);
    assert!(2 * block.iterations < none.iterations, "{block:?} {none:?}");
    assert!(2 * incomplete.iterations < block.iterations, "{incomplete:?} {block:?}");
}

#[test]
fn solves_without_a_matrix_in_as_many_iterations_as_there_are_rows() {
    let n = 40;
    let mut x = vec![0.0; n];
    let mut tip_force = vec![0.0; n];
    tip_force[n - 1] = 1.0;
    let settings = Settings { relative_tolerance: 1e-12, max_iterations: n, ..Settings::default() };
    solve(&mut x, &Bar(n), &mut Multiple(n, 1.0), &tip_force, &settings, &mut Workspace::new(n))
        .unwrap();
    (0..n).for_each(|i| assert!((x[i] - (i + 1) as f64).abs() < 1e-9));
}

#[test]
fn starts_from_the_guess() {
    let matrix = elastic_block(6, 5, 4);
    let mut preconditioner = block_jacobi(&matrix);
    let (solution, cold) = solved(&matrix, &mut preconditioner, 1e-8);
    let (b, settings) = (load(solution.len(), 0), Settings::default());
    let mut workspace = Workspace::new(b.len());
    let mut again = |x: &mut Vec<f64>| {
        solve(x, &operator(&matrix), &mut preconditioner, &b, &settings, &mut workspace).unwrap()
    };
    assert_eq!(again(&mut solution.clone()).iterations, 0);
    let mut near: Vec<f64> =
        solution.iter().enumerate().map(|(i, x)| x * (1.0 + 1e-4 * (i as f64).sin())).collect();
    assert!(2 * again(&mut near).iterations < 3 * cold.iterations / 2);
}

#[test]
fn a_spent_budget_keeps_the_last_iterate() {
    let matrix = elastic_block(6, 5, 4);
    let mut preconditioner = block_jacobi(&matrix);
    let b = load(matrix.pattern.n, 0);
    let mut workspace = Workspace::new(b.len());
    let mut x = vec![0.0; b.len()];
    let mut run = |x: &mut Vec<f64>, max_iterations| {
        let settings = Settings { max_iterations, ..Settings::default() };
        solve(x, &operator(&matrix), &mut preconditioner, &b, &settings, &mut workspace)
    };
    let Err(Error::BudgetSpent(info)) = run(&mut x, 12) else { panic!("12 iterations cannot do") };
    assert_eq!(info.iterations, 12);
    assert!(info.relative_residual < 0.5);
    assert!((matrix.relative_residual(&x, &b) - info.relative_residual).abs() < 1e-12);
    assert!(run(&mut x, 1000).is_ok());
}

#[test]
fn a_deadline_that_has_passed_leaves_one_iteration() {
    let matrix = elastic_block(4, 3, 3);
    let b = load(matrix.pattern.n, 0);
    let settings = Settings { deadline: Some(crate::clock::Instant::now()), ..Settings::default() };
    let mut x = vec![0.0; b.len()];
    let workspace = &mut Workspace::new(b.len());
    let preconditioner = &mut block_jacobi(&matrix);
    let stopped = solve(&mut x, &operator(&matrix), preconditioner, &b, &settings, workspace);
    let Err(Error::BudgetSpent(info)) = stopped else { panic!("{stopped:?}") };
    assert_eq!(info.iterations, 1);
    // The first step lowers the energy, 0 at the start.
    let mut product = vec![0.0; b.len()];
    operator(&matrix).apply(&x, &mut product);
    assert!(0.5 * dot(&x, &product) < dot(&x, &b));
}

#[test]
fn the_least_iterations_are_made_but_not_beyond_the_budget() {
    let matrix = elastic_block(4, 3, 3);
    let b = load(matrix.pattern.n, 0);
    let run = |x: &mut Vec<f64>, settings: Settings| {
        let preconditioner = &mut block_jacobi(&matrix);
        let workspace = &mut Workspace::new(b.len());
        solve(x, &operator(&matrix), preconditioner, &b, &settings, workspace)
    };
    // A tolerance that the first iteration reaches.
    let loose = Settings { relative_tolerance: 0.99, ..Settings::default() };
    let (mut one, mut three) = (vec![0.0; b.len()], vec![0.0; b.len()]);
    assert_eq!(run(&mut one, loose).unwrap().iterations, 1);
    let info = run(&mut three, Settings { least_iterations: 3, ..loose }).unwrap();
    assert_eq!(info.iterations, 3);
    assert!(matrix.relative_residual(&three, &b) < matrix.relative_residual(&one, &b));
    // Solved is solved: neither a spent budget nor a deadline makes that a failure, and a good guess needs no iteration.
    let least = Settings { least_iterations: 3, ..loose };
    let deadline = Some(crate::clock::Instant::now());
    for settings in [Settings { max_iterations: 1, ..least }, Settings { deadline, ..least }] {
        assert_eq!(run(&mut vec![0.0; b.len()], settings).unwrap().iterations, 1);
    }
    assert_eq!(run(&mut three, least).unwrap().iterations, 0);
}

#[test]
fn a_solve_that_pauses_after_every_iteration_comes_to_the_same() {
    let matrix = uneven_block();
    let b = load(matrix.pattern.n, 0);
    let (x, info) = solved(&matrix, &mut block_jacobi(&matrix), 1e-12);
    let (operator, preconditioner) = (operator(&matrix), &mut block_jacobi(&matrix));
    let settings = Settings { relative_tolerance: 1e-12, ..Settings::default() };
    let (workspace, now) = (&mut Workspace::new(b.len()), Some(crate::clock::Instant::now()));
    let mut paused = vec![0.0; b.len()];
    let mut solve =
        Solve::begin(&mut paused, &operator, preconditioner, &b, &settings, workspace).unwrap();
    let mut pauses = 0;
    while !solve.iterate(&mut paused, &operator, preconditioner, &b, workspace, now).unwrap() {
        pauses += 1;
    }
    assert_eq!((pauses, solve.info()), (info.iterations, info));
    assert_eq!(paused, x);
}

#[test]
fn reports_an_indefinite_operator_and_preconditioner() {
    let matrix = elastic_block(5, 4, 3).shifted(-1.0);
    let (b, settings) = (load(180, 0), Settings::default());
    let mut workspace = Workspace::new(180);
    let mut x = vec![0.0; 180];
    let mut run = |matrix: &matrices::Matrix, sign| {
        solve(&mut x, &operator(matrix), &mut Multiple(180, sign), &b, &settings, &mut workspace)
    };
    let failed = run(&matrix, 1.0);
    assert!(
        matches!(failed, Err(Error::IndefiniteOperator { curvature, .. }) if curvature < 0.0),
        "{failed:?}"
    );
    let failed = run(&matrix.shifted(1.0), -1.0);
    assert_eq!(failed, Err(Error::IndefinitePreconditioner { iterations: 0 }));
}

#[test]
fn refuses_bad_arguments() {
    let mut x = vec![0.0; 3];
    let mut run = |b: &[f64], relative_tolerance| {
        let settings = Settings { relative_tolerance, ..Settings::default() };
        solve(&mut x, &Bar(3), &mut Multiple(3, 1.0), b, &settings, &mut Workspace::new(3))
    };
    assert_eq!(run(&[1.0; 3], 0.0), Err(Error::InvalidTolerance { relative_tolerance: 0.0 }));
    assert_eq!(run(&[1.0; 2], 1e-8), Err(Error::Length { argument: "b", expected: 3, found: 2 }));
    assert_eq!(run(&[1.0, f64::NAN, 0.0], 1e-8), Err(Error::NotFinite { iterations: 0 }));
    assert_eq!(run(&[0.0; 3], 1e-8), Ok(Info::default()));
}

#[test]
fn stops_at_rounding_rather_than_run_for_ever() {
    let matrix = elastic_block(4, 3, 3);
    let b = load(matrix.pattern.n, 0);
    let settings =
        Settings { relative_tolerance: 1e-30, max_iterations: 300, ..Settings::default() };
    let mut x = vec![0.0; b.len()];
    let stopped = solve(
        &mut x,
        &operator(&matrix),
        &mut block_jacobi(&matrix),
        &b,
        &settings,
        &mut Workspace::new(b.len()),
    );
    assert!(matches!(stopped, Err(Error::BudgetSpent(_))));
    assert!(matrix.relative_residual(&x, &b) < 1e-14);
}
