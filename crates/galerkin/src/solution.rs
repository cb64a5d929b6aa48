//! The result of a search for equilibrium.

use super::newton::ReducedStatus;

/// An equilibrium of the reduced energy, or the last iterate of a search that failed.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Coordinates in the modes.
    pub coordinates: Vec<f64>,
    /// Force of each tool on the organ [N]; zero if the search ended before the first step.
    pub forces: Vec<[f64; 3]>,
    /// Derivative of the forces with respect to the displacements [N/m], rows and columns by contact and component;
    /// empty if it was not requested.
    pub stiffness: Vec<f64>,
    /// Reduced strain energy [J].
    pub energy: f64,
    /// Largest displacement of a contact [m].
    pub depth: f64,
    /// How the search ended.
    pub status: ReducedStatus,
    /// Smallest volume ratio of a sampled cell.
    pub smallest_jacobian: f64,
    /// Newton steps.
    pub iterations: usize,
    /// Number of tangents that were evaluated.
    pub tangents: usize,
    /// Last step, relative to the coordinates.
    pub residual: f64,
    /// Time spent [s].
    pub seconds: f64,
}
