//! The finite element solution as it is usually had, to compare with: Newton's method with full steps and equal
//! load increments, without line search or cutback. (`crate::equilibrium::Newton` is the one to solve with.)

use crate::body::Body;
use crate::equilibrium::System;
use crate::error::Error;

/// Settings.
#[derive(Clone, Copy, Debug)]
pub struct PlainNewton {
    /// Equal load increments.
    pub increments: usize,
    /// Iterations in one increment before it counts as failed.
    pub max_iterations: usize,
    /// Residual relative to the applied force.
    pub tolerance: f64,
}

/// How far it came.
#[derive(Clone, Debug)]
pub struct Reached {
    /// The last equilibrium [m].
    pub displacement: Vec<f64>,
    /// Increments that converged.
    pub increments: usize,
    /// Iterations in all.
    pub iterations: usize,
}

impl PlainNewton {
    /// Applies `force` [N] with `fixed` nodes held, increment by increment, until one does not converge.
    ///
    /// # Errors
    /// Settings of zero; a force of the wrong length or not finite.
    pub fn solve(&self, body: &Body, fixed: &[u32], force: &[f64]) -> Result<Reached, Error> {
        if self.increments == 0 || self.max_iterations == 0 || !(self.tolerance > 0.0) {
            return Err(Error::input("increments, max_iterations and tolerance must be positive"));
        }
        if force.len() != body.n_dofs() || force.iter().any(|f| !f.is_finite()) {
            return Err(Error::input("the force must be finite, three components for each point"));
        }
        let dofs = fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i));
        // A tangent beyond an instability is no reason to stop for a method that does not look.
        let mut system = System::indefinite(&body.zero_tangent(), body.n_dofs(), dofs)?;
        let mut reached =
            Reached { displacement: vec![0.0; body.n_dofs()], increments: 0, iterations: 0 };
        for increment in 1..=self.increments {
            let share = increment as f64 / self.increments as f64;
            let target: Vec<f64> = force.iter().map(|f| share * f).collect();
            let start = reached.displacement.clone();
            let Some(u) = self.iterate(body, &mut system, &target, start, &mut reached.iterations)
            else {
                break;
            };
            reached.displacement = u;
            reached.increments = increment;
        }
        Ok(reached)
    }

    /// Equilibrium under `target`, or none where the iterations run out or leave what can be computed.
    fn iterate(
        &self,
        body: &Body,
        system: &mut System,
        target: &[f64],
        mut u: Vec<f64>,
        iterations: &mut usize,
    ) -> Option<Vec<f64>> {
        let (mut force, mut tangent) = (vec![0.0; u.len()], body.zero_tangent());
        for _ in 0..self.max_iterations {
            body.internal_force_and_tangent(&u, &mut force, &mut tangent);
            let free = system.free();
            let mut step: Vec<f64> =
                free.iter().map(|&d| target[d as usize] - force[d as usize]).collect();
            let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
            let size = square(&mut free.iter().map(|&d| target[d as usize]));
            let residual = square(&mut step.iter().copied());
            if residual <= self.tolerance * size {
                return body.energy(&u).is_finite().then_some(u);
            }
            if !residual.is_finite() {
                return None;
            }
            *iterations += 1;
            system.factorize(&tangent, 0.0).ok()?;
            system.solve_free(&mut step, 1).ok()?;
            system.free().iter().zip(&step).for_each(|(&d, s)| u[d as usize] += s);
        }
        None
    }
}
