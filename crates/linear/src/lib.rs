//! Sparse symmetric linear systems: Cholesky for stable tangents, LDLᵀ for indefinite ones,
//! conjugate gradients where a factor costs too much. The matrix is a [`Pattern`] that never changes and
//! a slice of values that changes at every Newton iteration. The dense kernels underneath are its own for the fronts of
//! Cholesky factors, faer's for all else; nothing outside this crate sees them.
//!
//! With them come the [`clock`] that deadlines are told by and [`threads`], which say what loops are shared.

mod analysis;
mod block_matrix;
mod cholesky;
mod column;
pub mod conjugate_gradients;
mod dissection;
mod elimination;
mod entry;
mod error;
mod front;
mod fronts;
mod gmres;
mod graph;
mod handover;
mod ldlt;
mod multigrid;
mod neighbours;
mod numbering;
mod ordering;
mod pattern;
mod precision;
mod shift;
mod signs;
mod strip;
mod substitution;
mod subtrees;
#[cfg(test)]
mod test_matrices;
pub mod threads;
mod tree;

pub use viscera_clock as clock;

pub use block_matrix::BlockMatrix;
pub use cholesky::Cholesky;
pub use column::{Column, FEW};
pub use error::FactorError;
pub use gmres::gmres;
pub use ldlt::{Inertia, Ldlt};
pub use multigrid::Multigrid;
pub use numbering::Numbering;
pub use pattern::Pattern;
pub use precision::Precision;
pub use shift::next_shift;

/// A direct solver for `A x = b`, `A` symmetric on a fixed [`Pattern`].
pub trait Factorization: Send + Sync {
    /// Number of rows of the matrix.
    fn n(&self) -> usize;

    /// Entries that the factor stores, zeros within its dense blocks included.
    fn fill(&self) -> usize;

    /// The rows in the order in which they are eliminated.
    fn order(&self) -> &[u32];

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
