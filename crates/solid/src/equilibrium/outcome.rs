//! A solution: the state, the status, and the history of the iteration.

use super::system::Origin;

/// How a solution ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Equilibrium at the full load, stable.
    Converged,
    /// Equilibrium at the full load. But there, or near another equilibrium on the way, the tangent is not positive
    /// definite on the displacements that are free: the path passed an instability, and other equilibria exist.
    ConvergedPastInstability,
    /// The tangent becomes nearly singular before the full load, as at a limit point, where the path turns back, or at a
    /// buckling load, where it bends aside; the result is the last equilibrium before.
    LimitPoint,
    /// The load step became too small; the result is the last equilibrium.
    StepTooSmall,
}

impl Status {
    /// Whether the full load was reached.
    pub fn is_converged(self) -> bool {
        matches!(self, Status::Converged | Status::ConvergedPastInstability)
    }

    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Status::Converged => "converged",
            Status::ConvergedPastInstability => "converged past an instability",
            Status::LimitPoint => "limit point",
            Status::StepTooSmall => "step too small",
        }
    }
}

/// Times by stage [s].
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds {
    /// Pattern, ordering, symbolic factorisation.
    pub analysis: f64,
    /// Element loops and assembly.
    pub assembly: f64,
    /// Numeric factorisation.
    pub factorization: f64,
    /// Triangular solves.
    pub solve: f64,
    /// Everything.
    pub total: f64,
}

/// A solution with its history.
pub struct Equilibrium {
    /// Displacement [m].
    pub displacement: Vec<f64>,
    /// Internal force [N]; minus the external force, the reactions where something is prescribed.
    pub internal_force: Vec<f64>,
    /// External force of the part of the load that was reached [N]: dead, and pressure on the surface as deformed.
    pub external_force: Vec<f64>,
    /// Force of each patch's tool on the body [N].
    pub patch_forces: Vec<[f64; 3]>,
    /// Strain energy [J].
    pub energy: f64,
    /// How it ended.
    pub status: Status,
    /// One sentence for users: the reason of the status, with numbers.
    pub message: String,
    /// Why the requested device failed, if it did; the processor then continued.
    pub device_fault: Option<String>,
    /// Where the last tangent on the requested device came from; none without one.
    pub origin: Option<Origin>,
    /// Load fraction reached, 1 for the full load.
    pub load: f64,
    /// Newton iterations in all, failed load steps included.
    pub iterations: usize,
    /// Tangents prepared for a solution, rejected ones and failed load steps included: with a direct solver,
    /// factorisations.
    pub factorizations: usize,
    /// Iterations of conjugate gradients in all.
    pub linear_iterations: usize,
    /// The linear solvers that led here, in this order: a second one where the first was given up.
    pub solvers: Vec<&'static str>,
    /// Relative residuals of each load step that succeeded.
    pub residuals: Vec<Vec<f64>>,
    /// Timings.
    pub seconds: Seconds,
}
