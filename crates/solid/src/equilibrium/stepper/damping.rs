//! What the damping by stiffness of a frame is made of, so that a caller may tell its parts, as that of a support.

use super::{Dynamics, Stepper};
use crate::body::Curvature;

/// Rayleigh's damping by stiffness as it acted at the end of a frame: the nodal forces `beta K(u) v` [N], with the
/// tangent `K` of the body and its ties; loads, such as pressure and contact, have no part in it.
#[derive(Clone, Debug)]
pub struct StiffnessDamping {
    /// `beta` [s].
    pub beta: f64,
    /// `v` [m/s]: that of the rule in time. The frame itself may end with another, as one in which contact begins.
    pub velocity: Vec<f64>,
    /// `u` [m], where the tangent of the frame's last iteration was taken: where that iteration set out.
    pub displacement: Vec<f64>,
    /// The kind of that tangent.
    pub curvature: Curvature,
}

impl StiffnessDamping {
    /// None without `beta`.
    pub(super) fn new(dynamics: &Dynamics, n_dofs: usize) -> Option<Self> {
        let [_, beta] = dynamics.damping;
        (beta > 0.0).then(|| StiffnessDamping {
            beta,
            velocity: vec![0.0; n_dofs],
            displacement: vec![0.0; n_dofs],
            curvature: Curvature::Exact,
        })
    }

    /// A tangent is taken.
    pub(super) fn linearize(&mut self, displacement: &[f64], curvature: Curvature) {
        self.displacement.copy_from_slice(displacement);
        self.curvature = curvature;
    }
}

impl Stepper {
    /// The damping by stiffness of the last frame; none without inertia and `beta`.
    pub fn stiffness_damping(&self) -> Option<&StiffnessDamping> {
        self.stiffness_damping.as_ref()
    }
}
