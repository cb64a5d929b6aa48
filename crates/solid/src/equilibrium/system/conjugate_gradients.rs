//! Settings of conjugate gradients that users may choose.

use super::OnDevice;
use crate::error::Error;
use crate::settings::{Setting, Values};

/// Settings of conjugate gradients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConjugateGradients {
    /// The preconditioner.
    pub preconditioner: Preconditioner,
    /// Residual to reach, relative to the right-hand side; in frames up to 30 times as much where Newton's method gains
    /// nothing from less.
    pub tolerance: f64,
    /// Iterations after which to stop and return the last iterate.
    pub max_iterations: usize,
    /// Whether the tangent is never assembled and multiplies cell by cell. For block-Jacobi only, since other
    /// preconditioners need the matrix.
    pub is_matrix_free: bool,
    /// Where they run, if not on the processor; with block-Jacobi and a matrix only.
    pub device: Option<OnDevice>,
}

impl Default for ConjugateGradients {
    fn default() -> Self {
        Self {
            preconditioner: Preconditioner::LaggedCholesky,
            tolerance: 1e-3,
            max_iterations: 200,
            is_matrix_free: false,
            device: None,
        }
    }
}

impl ConjugateGradients {
    /// What users may choose of them beside the preconditioner and the device.
    pub const SETTINGS: [Setting<Self>; 3] = [
        Setting {
            name: "tolerance",
            means: "residual of the linear system to reach, relative to its right-hand side",
            values: Values::Fraction,
            get: |cg| cg.tolerance,
            set: |cg, value| cg.tolerance = value,
        },
        Setting {
            name: "max_iterations",
            means: "iterations after which to stop with what there is",
            values: Values::Whole(1, 1_000_000),
            get: |cg| cg.max_iterations as f64,
            set: |cg, value| cg.max_iterations = value as usize,
        },
        Setting {
            name: "matrix_free",
            means: "never assemble the tangent: cells multiply it with a vector",
            values: Values::Flag,
            get: |cg| f64::from(cg.is_matrix_free),
            set: |cg, value| cg.is_matrix_free = value != 0.0,
        },
    ];
}

/// Preconditioners of conjugate gradients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preconditioner {
    /// The inverse of each node's diagonal block
    /// (*Implementation and Evaluation of Hyperelastic Model for Surgical Simulator and Navigation*).
    BlockJacobi,
    /// Incomplete Cholesky without fill, by node blocks.
    IncompleteCholesky,
    /// The Cholesky factor of an earlier tangent, in single precision; renewed when iterations grow, beside frames by a
    /// second thread, or in parts.
    LaggedCholesky,
    /// A V-cycle on aggregates of nodes with their rigid-body modes; renewed when iterations grow.
    Multigrid,
}

impl Preconditioner {
    /// Names, for messages and other languages.
    pub const NAMES: [(&'static str, Preconditioner); 4] = [
        ("block_jacobi", Preconditioner::BlockJacobi),
        ("incomplete_cholesky", Preconditioner::IncompleteCholesky),
        ("lagged_cholesky", Preconditioner::LaggedCholesky),
        ("multigrid", Preconditioner::Multigrid),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        let found = Self::NAMES.into_iter().find(|(_, known)| *known == self);
        found.map_or("", |(name, _)| name)
    }

    /// The preconditioner with a name.
    ///
    /// # Errors
    /// An unknown name.
    pub fn named(name: &str) -> Result<Self, Error> {
        let found = Self::NAMES.into_iter().find(|(known, _)| *known == name);
        found.map(|(_, preconditioner)| preconditioner).ok_or_else(|| {
            let known = Self::NAMES.map(|(name, _)| name).join(", ");
            Error::input(format!("no preconditioner is called {name:?}; there are {known}"))
        })
    }
}
