//! The two tangents.

/// The kind of tangent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// The derivative of the force.
    Exact,
    /// The derivative of the force, with the tangents of cells made positive semidefinite.
    Projected,
}
