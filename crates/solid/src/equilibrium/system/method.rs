//! The methods that solve linear systems, and which of their settings go together.

use super::{ConjugateGradients, Preconditioner};
use crate::body::Body;
use crate::equilibrium::tangent::Tangent;
use crate::error::Error;
use crate::settings;

/// How linear systems are solved.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Method {
    /// Sparse Cholesky, a new factor for every tangent.
    #[default]
    Cholesky,
    /// Sparse `L D Lᵀ`, whatever the signs of the eigenvalues: a path that passes a limit point.
    Ldlt,
    /// Preconditioned conjugate gradients.
    ConjugateGradients(ConjugateGradients),
    /// What is likely to be the fastest for a whole solution ([`Choice`](super::Choice)); frames are given a solver.
    Automatic,
}

impl Method {
    /// # Errors
    /// A tolerance that is not between 0 and 1; no iterations; a preconditioner made from the matrix, and no matrix.
    pub fn check(&self) -> Result<(), Error> {
        let Method::ConjugateGradients(cg) = self else {
            return Ok(());
        };
        settings::check(&ConjugateGradients::SETTINGS, cg, "conjugate gradients")?;
        if cg.is_matrix_free && cg.preconditioner != Preconditioner::BlockJacobi {
            return Err(Error::input(
                "without a matrix there is nothing to make a factor from; choose the preconditioner \"block_jacobi\"",
            ));
        }
        let is_assembled_block_jacobi =
            cg.preconditioner == Preconditioner::BlockJacobi && !cg.is_matrix_free;
        if cg.device.is_some() && !is_assembled_block_jacobi {
            return Err(Error::input(
                "a device takes the assembled tangent and the preconditioner \"block_jacobi\", no other",
            ));
        }
        Ok(())
    }

    /// Its name in results.
    pub fn name(&self) -> &'static str {
        match self {
            Method::Cholesky => "cholesky",
            Method::Ldlt => "ldlt",
            Method::ConjugateGradients(cg) => cg.preconditioner.name(),
            Method::Automatic => "auto",
        }
    }

    /// A tangent in the form that this method needs, without values.
    pub fn tangent(&self, body: &Body) -> Tangent {
        match self {
            Method::ConjugateGradients(cg) if cg.is_matrix_free => Tangent::product(body),
            Method::ConjugateGradients(cg) if cg.device.is_some() => Tangent::either(body),
            _ => Tangent::matrix(body),
        }
    }
}
