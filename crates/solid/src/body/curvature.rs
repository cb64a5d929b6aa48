//! The two tangents.

/// Which tangent is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// The derivative of the force.
    Exact,
    /// Cells that are not positive semidefinite are made so.
    Projected,
}
