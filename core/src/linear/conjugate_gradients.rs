//! Preconditioned conjugate gradients for positive definite systems, matrix-free, without allocation.
//!
//! Where it differs from the textbook: it starts from the caller's guess; the residual that ends it is computed
//! anew from the solution, not carried by the recurrence; and every failure leaves the last iterate in `x`.

use std::fmt;

use super::Pattern;

/// A symmetric linear map.
pub trait Operator {
    /// Number of rows.
    fn n(&self) -> usize;

    /// `y = A x`.
    fn apply(&self, x: &[f64], y: &mut [f64]);
}

/// An approximate inverse, symmetric and positive definite.
pub trait Preconditioner {
    /// Number of rows.
    fn n(&self) -> usize;

    /// `z = M⁻¹ r`.
    fn apply(&self, r: &[f64], z: &mut [f64]);
}

/// The symmetric matrix with `values` on `pattern`.
#[derive(Clone, Copy)]
pub struct Matrix<'a> {
    /// Where the entries of the upper triangle are.
    pub pattern: &'a Pattern,
    /// The entries, parallel to [`Pattern::row`].
    pub values: &'a [f64],
}

impl Operator for Matrix<'_> {
    fn n(&self) -> usize {
        self.pattern.n
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        self.pattern.multiply(self.values, x, y);
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Residual to reach, `|b - A x| <= relative_tolerance |b|`; default 1e-8.
    pub relative_tolerance: f64,
    /// Budget of iterations, each one product with the operator; default 1000.
    pub max_iterations: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            relative_tolerance: 1e-8,
            max_iterations: 1000,
        }
    }
}

/// How a solve went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Info {
    /// Iterations used.
    pub iterations: usize,
    /// `|b - A x| / |b|` of the iterate returned.
    pub relative_residual: f64,
}

/// Why a solve stopped early; `x` holds the last iterate.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// The tolerance is not a positive number.
    InvalidTolerance {
        /// The tolerance given.
        relative_tolerance: f64,
    },
    /// An argument does not have the operator's size.
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Length asked for.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// The right-hand side, the first guess or a product with the operator is NaN or infinite.
    NotFinite {
        /// Iterations done before.
        iterations: usize,
    },
    /// A search direction has no positive curvature: the operator is not positive definite.
    IndefiniteOperator {
        /// Iterations done before.
        iterations: usize,
        /// `pᵀ A p / pᵀ p` of the direction.
        curvature: f64,
    },
    /// The preconditioner turned a residual by a right angle or more: it is not positive definite.
    IndefinitePreconditioner {
        /// Iterations done before.
        iterations: usize,
    },
    /// The budget ran out before the tolerance was reached.
    MaxIterations(Info),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InvalidTolerance { relative_tolerance } => {
                write!(
                    f,
                    "relative_tolerance is {relative_tolerance}; give a positive number, 1e-8 for instance"
                )
            }
            Self::Length {
                argument,
                expected,
                found,
            } => {
                write!(
                    f,
                    "{argument} has {found} entries, the operator asks for {expected}"
                )
            }
            Self::NotFinite { iterations } => {
                write!(
                    f,
                    "a value is not finite after {iterations} iterations; check the loads and the matrix"
                )
            }
            Self::IndefiniteOperator {
                iterations,
                curvature,
            } => write!(
                f,
                "curvature {curvature:.3e} after {iterations} iterations: the matrix is not positive definite; \
                 the equilibrium is unstable or a part is not held"
            ),
            Self::IndefinitePreconditioner { iterations } => {
                write!(
                    f,
                    "preconditioner is not positive definite (after {iterations} iterations)"
                )
            }
            Self::MaxIterations(Info {
                iterations,
                relative_residual,
            }) => write!(
                f,
                "residual {relative_residual:.3e} after {iterations} iterations; raise max_iterations, loosen \
                 relative_tolerance or use a stronger preconditioner"
            ),
        }
    }
}

impl std::error::Error for Error {}

/// The vectors of an iteration, made once and used for any number of solves.
#[derive(Clone, Debug)]
pub struct Workspace {
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
}

impl Workspace {
    /// Room for systems of `n` rows.
    pub fn new(n: usize) -> Self {
        let zeros = vec![0.0; n];
        Self {
            residual: zeros.clone(),
            preconditioned: zeros.clone(),
            direction: zeros.clone(),
            image: zeros,
        }
    }

    /// Sets out from `x` afresh: computes the residual and returns its norm.
    fn restart(&mut self, operator: &impl Operator, b: &[f64], x: &[f64]) -> f64 {
        operator.apply(x, &mut self.residual);
        self.residual
            .iter_mut()
            .zip(b)
            .for_each(|(r, b)| *r = b - *r);
        self.direction.fill(0.0);
        norm(&self.residual)
    }
}

/// Solves `A x = b` from the guess in `x`.
///
/// # Errors
/// Every [`Error`] but the first two leaves the last iterate in `x`; [`Error::MaxIterations`] says how good it is.
pub fn solve(
    x: &mut [f64],
    operator: &impl Operator,
    preconditioner: &impl Preconditioner,
    b: &[f64],
    settings: &Settings,
    workspace: &mut Workspace,
) -> Result<Info, Error> {
    check_settings(settings)?;
    let n = operator.n();
    expect_length("x", n, x.len())?;
    expect_length("b", n, b.len())?;
    expect_length("preconditioner", n, preconditioner.n())?;
    expect_length("workspace", n, workspace.residual.len())?;
    if x.iter().chain(b).any(|value| !value.is_finite()) {
        return Err(Error::NotFinite { iterations: 0 });
    }
    let scale = norm(b);
    if scale == 0.0 {
        x.fill(0.0);
        return Ok(Info::default());
    }
    let mut info = Info::default();
    loop {
        let mut residual = workspace.restart(operator, b, x);
        let mut energy = f64::INFINITY;
        info.relative_residual = residual / scale;
        if !info.relative_residual.is_finite() {
            return Err(Error::NotFinite {
                iterations: info.iterations,
            });
        }
        if info.relative_residual <= settings.relative_tolerance {
            return Ok(info);
        }
        // The recurrence drifts from the true residual by rounding only, so that more than one round is rare.
        while residual > settings.relative_tolerance * scale {
            if info.iterations == settings.max_iterations {
                return Err(Error::MaxIterations(info));
            }
            residual = step(
                x,
                operator,
                preconditioner,
                &mut energy,
                info.iterations,
                workspace,
            )?;
            info.iterations += 1;
            info.relative_residual = residual / scale;
        }
    }
}

/// One iteration; `energy` is `rᵀ M⁻¹ r` of the step before. Returns the norm of the new residual.
fn step(
    x: &mut [f64],
    operator: &impl Operator,
    preconditioner: &impl Preconditioner,
    energy: &mut f64,
    iterations: usize,
    workspace: &mut Workspace,
) -> Result<f64, Error> {
    let Workspace {
        residual,
        preconditioned,
        direction,
        image,
    } = workspace;
    preconditioner.apply(residual, preconditioned);
    let previous = std::mem::replace(energy, dot(residual, preconditioned));
    if *energy <= 0.0 {
        return Err(Error::IndefinitePreconditioner { iterations });
    }
    let turn = *energy / previous;
    direction
        .iter_mut()
        .zip(&*preconditioned)
        .for_each(|(p, z)| *p = z + turn * *p);
    operator.apply(direction, image);
    let curvature = dot(direction, image);
    if !(curvature.is_finite() && energy.is_finite()) {
        return Err(Error::NotFinite { iterations });
    }
    if curvature <= 0.0 {
        return Err(Error::IndefiniteOperator {
            iterations,
            curvature: curvature / dot(direction, direction),
        });
    }
    let length = *energy / curvature;
    x.iter_mut()
        .zip(&*direction)
        .for_each(|(x, p)| *x += length * p);
    residual
        .iter_mut()
        .zip(&*image)
        .for_each(|(r, q)| *r -= length * q);
    Ok(norm(residual))
}

fn check_settings(
    &Settings {
        relative_tolerance, ..
    }: &Settings,
) -> Result<(), Error> {
    let is_valid = relative_tolerance > 0.0 && relative_tolerance.is_finite();
    if is_valid {
        Ok(())
    } else {
        Err(Error::InvalidTolerance { relative_tolerance })
    }
}

fn expect_length(argument: &'static str, expected: usize, found: usize) -> Result<(), Error> {
    if expected == found {
        Ok(())
    } else {
        Err(Error::Length {
            argument,
            expected,
            found,
        })
    }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::test_matrices::{self as matrices, elastic_block, load, relative_difference};
    use super::super::{BlockJacobi, Cholesky, Factorization, IncompleteCholesky};
    use super::*;

    /// No preconditioner, or with -1 an indefinite one.
    struct Multiple(usize, f64);

    impl Preconditioner for Multiple {
        fn n(&self) -> usize {
            self.0
        }

        fn apply(&self, r: &[f64], z: &mut [f64]) {
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
                let (left, right) = (
                    i.checked_sub(1).map_or(0.0, |i| x[i]),
                    x.get(i + 1).unwrap_or(&x[i]),
                );
                y[i] = 2.0 * x[i] - left - right;
            }
        }
    }

    fn operator(matrix: &matrices::Matrix) -> Matrix<'_> {
        Matrix {
            pattern: &matrix.pattern,
            values: &matrix.values,
        }
    }

    fn solved(
        matrix: &matrices::Matrix,
        preconditioner: &impl Preconditioner,
        tolerance: f64,
    ) -> (Vec<f64>, Info) {
        let n = matrix.pattern.n;
        let settings = Settings {
            relative_tolerance: tolerance,
            ..Settings::default()
        };
        let mut x = vec![0.0; n];
        let workspace = &mut Workspace::new(n);
        let info = solve(
            &mut x,
            &operator(matrix),
            preconditioner,
            &load(n, 0),
            &settings,
            workspace,
        )
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
        let node: Vec<u32> = (0..matrix.pattern.n as u32).map(|dof| dof / 3).collect();
        let mut preconditioner = BlockJacobi::analyze(&matrix.pattern, &node).unwrap();
        preconditioner.factorize(&matrix.values).unwrap();
        preconditioner
    }

    fn incomplete_cholesky(matrix: &matrices::Matrix) -> IncompleteCholesky {
        let mut preconditioner = IncompleteCholesky::analyze(&matrix.pattern).unwrap();
        preconditioner.factorize(&matrix.values).unwrap();
        preconditioner
    }

    #[test]
    fn agrees_with_the_direct_solver() {
        let matrix = uneven_block();
        let mut direct = load(matrix.pattern.n, 0);
        let mut cholesky = Cholesky::analyze(&matrix.pattern).unwrap();
        cholesky.factorize(&matrix.values).unwrap();
        cholesky.solve(&mut direct, 1).unwrap();
        let (x, info) = solved(&matrix, &block_jacobi(&matrix), 1e-12);
        assert!(relative_difference(&x, &direct) < 1e-10);
        let (x, _) = solved(&matrix, &incomplete_cholesky(&matrix), 1e-12);
        assert!(relative_difference(&x, &direct) < 1e-10);
        assert!(
            (matrix.relative_residual(&x, &load(x.len(), 0)) - info.relative_residual).abs()
                < 1e-12
        );
    }

    #[test]
    fn a_stronger_preconditioner_takes_fewer_iterations() {
        let matrix = uneven_block();
        let (_, none) = solved(&matrix, &Multiple(matrix.pattern.n, 1.0), 1e-8);
        let (_, block) = solved(&matrix, &block_jacobi(&matrix), 1e-8);
        let (_, incomplete) = solved(&matrix, &incomplete_cholesky(&matrix), 1e-8);
        assert!(2 * block.iterations < none.iterations, "{block:?} {none:?}");
        assert!(
            2 * incomplete.iterations < block.iterations,
            "{incomplete:?} {block:?}"
        );
    }

    #[test]
    fn solves_without_a_matrix_in_as_many_iterations_as_there_are_rows() {
        let n = 40;
        let mut x = vec![0.0; n];
        let mut tip_force = vec![0.0; n];
        tip_force[n - 1] = 1.0;
        let settings = Settings {
            relative_tolerance: 1e-12,
            max_iterations: n,
        };
        solve(
            &mut x,
            &Bar(n),
            &Multiple(n, 1.0),
            &tip_force,
            &settings,
            &mut Workspace::new(n),
        )
        .unwrap();
        (0..n).for_each(|i| assert!((x[i] - (i + 1) as f64).abs() < 1e-9));
    }

    #[test]
    fn starts_from_the_guess() {
        let matrix = elastic_block(6, 5, 4);
        let preconditioner = block_jacobi(&matrix);
        let (solution, cold) = solved(&matrix, &preconditioner, 1e-8);
        let (b, settings) = (load(solution.len(), 0), Settings::default());
        let mut workspace = Workspace::new(b.len());
        let mut again = |x: &mut Vec<f64>| {
            solve(
                x,
                &operator(&matrix),
                &preconditioner,
                &b,
                &settings,
                &mut workspace,
            )
            .unwrap()
        };
        assert_eq!(again(&mut solution.clone()).iterations, 0);
        let mut near: Vec<f64> = solution
            .iter()
            .enumerate()
            .map(|(i, x)| x * (1.0 + 1e-4 * (i as f64).sin()))
            .collect();
        assert!(2 * again(&mut near).iterations < 3 * cold.iterations / 2);
    }

    #[test]
    fn a_spent_budget_keeps_the_last_iterate() {
        let matrix = elastic_block(6, 5, 4);
        let preconditioner = block_jacobi(&matrix);
        let b = load(matrix.pattern.n, 0);
        let mut workspace = Workspace::new(b.len());
        let mut x = vec![0.0; b.len()];
        let mut run = |x: &mut Vec<f64>, max_iterations| {
            let settings = Settings {
                max_iterations,
                ..Settings::default()
            };
            solve(
                x,
                &operator(&matrix),
                &preconditioner,
                &b,
                &settings,
                &mut workspace,
            )
        };
        let Err(Error::MaxIterations(info)) = run(&mut x, 12) else {
            panic!("12 iterations cannot do")
        };
        assert_eq!(info.iterations, 12);
        assert!(info.relative_residual < 0.5);
        assert!((matrix.relative_residual(&x, &b) - info.relative_residual).abs() < 1e-12);
        assert!(run(&mut x, 1000).is_ok());
    }

    #[test]
    fn reports_an_indefinite_operator_and_preconditioner() {
        let matrix = elastic_block(5, 4, 3).shifted(-1.0);
        let (b, settings) = (load(180, 0), Settings::default());
        let mut workspace = Workspace::new(180);
        let mut x = vec![0.0; 180];
        let mut run = |matrix: &matrices::Matrix, sign| {
            solve(
                &mut x,
                &operator(matrix),
                &Multiple(180, sign),
                &b,
                &settings,
                &mut workspace,
            )
        };
        let failed = run(&matrix, 1.0);
        assert!(
            matches!(failed, Err(Error::IndefiniteOperator { curvature, .. }) if curvature < 0.0),
            "{failed:?}"
        );
        let failed = run(&matrix.shifted(1.0), -1.0);
        assert_eq!(
            failed,
            Err(Error::IndefinitePreconditioner { iterations: 0 })
        );
    }

    #[test]
    fn refuses_bad_arguments() {
        let mut x = vec![0.0; 3];
        let mut run = |b: &[f64], relative_tolerance| {
            let settings = Settings {
                relative_tolerance,
                ..Settings::default()
            };
            solve(
                &mut x,
                &Bar(3),
                &Multiple(3, 1.0),
                b,
                &settings,
                &mut Workspace::new(3),
            )
        };
        assert_eq!(
            run(&[1.0; 3], 0.0),
            Err(Error::InvalidTolerance {
                relative_tolerance: 0.0
            })
        );
        assert_eq!(
            run(&[1.0; 2], 1e-8),
            Err(Error::Length {
                argument: "b",
                expected: 3,
                found: 2
            })
        );
        assert_eq!(
            run(&[1.0, f64::NAN, 0.0], 1e-8),
            Err(Error::NotFinite { iterations: 0 })
        );
        assert_eq!(run(&[0.0; 3], 1e-8), Ok(Info::default()));
    }

    #[test]
    fn stops_at_rounding_rather_than_run_for_ever() {
        let matrix = elastic_block(4, 3, 3);
        let b = load(matrix.pattern.n, 0);
        let settings = Settings {
            relative_tolerance: 1e-30,
            max_iterations: 300,
        };
        let mut x = vec![0.0; b.len()];
        let stopped = solve(
            &mut x,
            &operator(&matrix),
            &block_jacobi(&matrix),
            &b,
            &settings,
            &mut Workspace::new(b.len()),
        );
        assert!(matches!(stopped, Err(Error::MaxIterations(_))));
        assert!(matrix.relative_residual(&x, &b) < 1e-14);
    }
}
