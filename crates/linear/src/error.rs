//! What can go wrong in a factorisation or a solve, in the caller's row numbers.

use std::fmt;

/// Why a matrix could not be factorised or a system not solved.
#[derive(Clone, Debug, PartialEq)]
pub enum FactorError {
    /// The pattern is no sorted upper triangle with a full diagonal.
    InvalidPattern {
        /// First column found at fault.
        column: usize,
        /// What is wrong there.
        reason: &'static str,
    },
    /// The factor would hold more entries than its 32-bit indices can number.
    TooLarge {
        /// Rows of the matrix.
        n: usize,
    },
    /// The memory for the factor could not be had.
    OutOfMemory,
    /// A slice does not have the length that the pattern asks for.
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Length asked for.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// A matrix value is NaN or infinite.
    NotFinite {
        /// Index into the values, parallel to [`Pattern::row`](super::Pattern::row).
        position: usize,
    },
    /// A right-hand side is NaN or infinite.
    RightHandSideNotFinite {
        /// Row of the value.
        row: usize,
        /// Right-hand side it belongs to.
        column: usize,
    },
    /// The solution overflowed.
    SolutionNotFinite {
        /// Row of the value.
        row: usize,
        /// Right-hand side it belongs to.
        column: usize,
    },
    /// A pivot is negative or zero: the matrix is not positive definite.
    NotPositiveDefinite {
        /// Row of the pivot.
        row: usize,
    },
    /// A pivot vanished to rounding: the matrix is singular to working precision.
    Singular {
        /// Row of the pivot.
        row: usize,
    },
    /// Elimination without pivoting broke down: the entries of the factor outgrew those of the matrix.
    Unstable {
        /// Row of the outgrown pivot.
        row: usize,
        /// Size of the factor beside that of the matrix.
        growth: f64,
    },
    /// The residual stayed large after refinement.
    Inaccurate {
        /// Largest residual over the largest entries of `|A| |x| + |b|`.
        backward_error: f64,
    },
    /// No successful factorisation precedes the solve.
    NotFactorized,
}

impl FactorError {
    /// Whether it is a pivot that is not positive: the matrix is there, and has no Cholesky factor.
    pub fn is_of_a_pivot(&self) -> bool {
        matches!(self, Self::NotPositiveDefinite { .. } | Self::Singular { .. })
    }

    pub(super) fn expect_length(
        argument: &'static str,
        expected: usize,
        found: usize,
    ) -> Result<(), Self> {
        if expected == found { Ok(()) } else { Err(Self::Length { argument, expected, found }) }
    }
}

impl fmt::Display for FactorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InvalidPattern { column, reason } => {
                write!(f, "matrix pattern is invalid at column {column}: {reason}")
            }
            Self::TooLarge { n } => write!(
                f,
                "the factor of this matrix with {n} rows exceeds 2^31 entries; use conjugate gradients"
            ),
            Self::OutOfMemory => {
                write!(
                    f,
                    "not enough memory for the factor; use conjugate gradients or a coarser mesh"
                )
            }
            Self::Length { argument, expected, found } => {
                write!(f, "{argument} has {found} entries, the matrix asks for {expected}")
            }
            Self::NotFinite { position } => {
                write!(
                    f,
                    "matrix value {position} is not finite; check the material and the deformation"
                )
            }
            Self::RightHandSideNotFinite { row, column } => {
                write!(f, "right-hand side {column} is not finite at row {row}; check the loads")
            }
            Self::SolutionNotFinite { row, column } => {
                write!(
                    f,
                    "solution {column} overflowed at row {row}; check the units of the system"
                )
            }
            Self::NotPositiveDefinite { row } => write!(
                f,
                "matrix is not positive definite at row {row}; the equilibrium is unstable there or a part is not held"
            ),
            Self::Singular { row } => {
                write!(
                    f,
                    "matrix is singular at row {row} to working precision; hold the free part"
                )
            }
            Self::Unstable { row, growth } => write!(
                f,
                "elimination broke down at row {row} (growth {growth:.1e}); perturb the load or the matrix"
            ),
            Self::Inaccurate { backward_error } => write!(
                f,
                "solution has a backward error of {backward_error:.1e} after refinement; the matrix is close to singular"
            ),
            Self::NotFactorized => write!(f, "no factor to solve with; factorize the matrix first"),
        }
    }
}

impl std::error::Error for FactorError {}
