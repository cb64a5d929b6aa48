//! What a search for equilibrium answers.

use super::newton::ReducedStatus;

/// An equilibrium of the reduced energy, or how near it came.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Coordinates in the modes.
    pub coordinates: Vec<f64>,
    /// Force of each tool on the organ [N]; zero where the search broke off before there was one.
    pub forces: Vec<[f64; 3]>,
    /// Derivative of the forces by the displacements [N/m], rows and columns by contact and component; empty where it
    /// was not asked for.
    pub stiffness: Vec<f64>,
    /// Reduced strain energy [J].
    pub energy: f64,
    /// Largest displacement of a contact [m].
    pub depth: f64,
    /// How it ended.
    pub status: ReducedStatus,
    /// Smallest volume ratio of a sampled cell.
    pub smallest_jacobian: f64,
    /// Newton steps.
    pub iterations: usize,
    /// Tangents among them.
    pub tangents: usize,
    /// Last step, relative to the coordinates.
    pub residual: f64,
    /// Time spent [s].
    pub seconds: f64,
}
