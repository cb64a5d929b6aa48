//! Input and result of a frame.

use super::turn::{Torque, Turn};
use crate::error::Error;
use crate::mesh::Patch;

/// Motion of the hands and loads in a frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Input<'a> {
    /// Displacements of the grasped degrees of freedom [m].
    pub values: &'a [f64],
    /// Mean displacements of the grasped patches [m].
    pub means: &'a [[f64; 3]],
    /// Mean rotations of grasped patches; of the others only the mean displacement is held.
    pub turns: &'a [Turn],
    /// Dead nodal forces [N]; none if empty.
    pub force: &'a [f64],
    /// Torques on places that no hand holds.
    pub torques: &'a [Torque],
    /// Gravity [m/s^2].
    pub gravity: [f64; 3],
}

/// The result of one frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Residual: remaining out-of-balance force, relative to all nodal forces.
    pub residual: f64,
    /// Whether the forces can be relied on: the residual is that of [`StepperSettings::settled`] or less, the hands are
    /// where they are to be, no cell is at a bound, and no body with inertia was cut back in its last step.
    ///
    /// [`StepperSettings::settled`]: super::StepperSettings::settled
    pub is_settled: bool,
    /// Newton iterations done.
    pub steps: usize,
    /// Number of cells whose volume ratio is next to a bound, or was beyond it at the start. The barrier acts on them
    /// beside the law.
    pub cells_at_bound: usize,
    /// Part of the step taken: 1, or less if a cell would have been crushed or torn.
    pub taken: f64,
    /// Whether the last tangent of the frame was not positive definite: the state is not stable.
    pub is_unstable: bool,
    /// Iterations of the linear solver; 0 for a direct one.
    pub iterations: usize,
    /// Whether the linear solver reached its tolerance.
    pub is_solved: bool,
    /// Residual of the linear systems that single precision alone would leave, relative; 0 in double precision.
    pub floor: f64,
    /// Whether the frame took no longer than its budget of time.
    pub within_budget: bool,
    /// Wall time [s].
    pub seconds: f64,
    /// Strain energy of the law [J].
    pub energy: f64,
    /// Kinetic energy [J].
    pub kinetic_energy: f64,
    /// Force of each patch's tool on the body [N].
    pub patch_forces: Vec<[f64; 3]>,
    /// Torque of each patch's tool on the body [N m] about the patch's weighted centre; 0 if its rotation is not held.
    pub patch_torques: Vec<[f64; 3]>,
}

impl Input<'_> {
    /// Whether there is a value for every grasped degree of freedom and patch, and all are finite.
    pub(super) fn check(
        &self,
        grasped: usize,
        patches: &[Patch],
        dofs: usize,
    ) -> Result<(), Error> {
        let has_force = self.force.is_empty() || self.force.len() == dofs;
        if (self.values.len(), self.means.len()) != (grasped, patches.len()) || !has_force {
            return Err(Error::input(format!(
                "a frame needs {grasped} grasped values, {} patch displacements and {dofs} force components or \
                 none; got {}, {} and {}",
                patches.len(),
                self.values.len(),
                self.means.len(),
                self.force.len()
            )));
        }
        let moves = self.values.iter().chain(self.means.iter().flatten());
        if !moves.chain(self.force).chain(&self.gravity).all(|v| v.is_finite()) {
            return Err(Error::input("a frame's values must be finite"));
        }
        self.turns.iter().try_for_each(|turn| turn.check(patches))?;
        self.torques.iter().try_for_each(|torque| torque.check(dofs / 3))
    }
}

/// Refuses a vector of another length than `n`, and values that are not finite.
pub(super) fn check_vector(name: &str, values: &[f64], n: usize) -> Result<(), Error> {
    if values.len() != n {
        return Err(Error::input(format!(
            "{name} has {} values; it needs {n}, three for each point",
            values.len()
        )));
    }
    match values.iter().position(|v| !v.is_finite()) {
        Some(dof) => Err(Error::input(format!(
            "{name} is {} at point {}; it must be finite",
            values[dof],
            dof / 3
        ))),
        None => Ok(()),
    }
}
