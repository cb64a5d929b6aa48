//! Sparse symmetric linear systems: Cholesky for stable tangents, LDLᵀ for indefinite ones,
//! conjugate gradients where a factor costs too much. The matrix is a [`Pattern`] that never changes and
//! a slice of values that changes at every Newton iteration. The dense kernels underneath are faer's;
//! nothing outside this module sees them.

mod analysis;
mod cholesky;
pub mod conjugate_gradients;
mod error;
mod gmres;
mod ldlt;
mod ordering;
mod pattern;
mod substitution;
#[cfg(test)]
mod test_matrices;

pub use cholesky::Cholesky;
pub use error::FactorError;
pub use gmres::gmres;
pub use ldlt::{Inertia, Ldlt};
pub use pattern::Pattern;

/// A pivot below this fraction of the terms it is the difference of has no digit left to trust: rounding alone
/// leaves 5e-14 of them in the zero pivots of a body of 3e4 rows that nothing holds.
const LOST: f64 = 1e-12;

/// A direct solver for `A x = b`, `A` symmetric on a fixed [`Pattern`].
pub trait Factorization: Send + Sync {
    /// Number of rows of the matrix.
    fn n(&self) -> usize;

    /// Factorises the matrix whose upper triangle holds `values`, parallel to [`Pattern::row`].
    ///
    /// # Errors
    /// [`FactorError`] names the offending value or pivot; until the next success every solve is refused.
    fn factorize(&mut self, values: &[f64]) -> Result<(), FactorError>;

    /// Solves for `columns` right-hand sides in place; `rhs` is column-major, `n x columns`.
    ///
    /// Any number of threads may solve with one factor at once.
    ///
    /// # Errors
    /// Refuses a right-hand side or a solution that is not finite, and a missing factor.
    fn solve(&self, rhs: &mut [f64], columns: usize) -> Result<(), FactorError>;
}
