//! Why conjugate gradients stop before the tolerance is reached.

use std::fmt;

use super::Info;

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
    /// The budget of iterations or of time ran out before the tolerance was reached.
    BudgetSpent(Info),
}

impl Error {
    pub(super) fn expect_length(
        argument: &'static str,
        expected: usize,
        found: usize,
    ) -> Result<(), Self> {
        if expected == found { Ok(()) } else { Err(Self::Length { argument, expected, found }) }
    }
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
            Self::Length { argument, expected, found } => {
                write!(f, "{argument} has {found} entries, the operator asks for {expected}")
            }
            Self::NotFinite { iterations } => {
                write!(
                    f,
                    "a value is not finite after {iterations} iterations; check the loads and the matrix"
                )
            }
            Self::IndefiniteOperator { iterations, curvature } => write!(
                f,
                "curvature {curvature:.3e} after {iterations} iterations: the matrix is not positive definite; \
                 the equilibrium is unstable or a part is not held"
            ),
            Self::IndefinitePreconditioner { iterations } => {
                write!(f, "preconditioner is not positive definite (after {iterations} iterations)")
            }
            Self::BudgetSpent(Info { iterations, relative_residual }) => write!(
                f,
                "residual {relative_residual:.3e} after {iterations} iterations; raise the budget, loosen \
                 relative_tolerance or use a stronger preconditioner"
            ),
        }
    }
}

impl std::error::Error for Error {}
