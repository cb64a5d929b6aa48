//! The usual finite element solution, for comparison: Newton's method with full steps and equal load increments,
//! without line search or cutback. (To solve problems, use `crate::equilibrium::Newton`.)

use crate::body::{Body, Curvature};
use crate::equilibrium::{
    ConstrainedSystem, Iteration, Limits, Method, Rounding, Stop, Tangent, dofs_of, iterate,
};
use crate::error::Error;
use crate::number::norm;

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

/// The result.
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
    /// Applies `force` [N] with `fixed` nodes held, increment by increment, until one does not converge;
    /// `go_on` is asked in every iteration and may stop it.
    ///
    /// # Errors
    /// Settings of zero; a force of the wrong length or not finite; a stop on request.
    pub fn solve(
        &self,
        body: &Body,
        fixed: &[u32],
        force: &[f64],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Reached, Error> {
        if self.increments == 0 || self.max_iterations == 0 || !(self.tolerance > 0.0) {
            return Err(Error::input("increments, max_iterations and tolerance must be positive"));
        }
        if force.len() != body.n_dofs() || force.iter().any(|f| !f.is_finite()) {
            return Err(Error::input("the force must be finite, three components for each point"));
        }
        // A tangent beyond an instability is no reason to stop for a method that does not look.
        let mut system = ConstrainedSystem::new(Method::Ldlt, body, dofs_of(fixed), Vec::new())?;
        // The last of the iterations is not taken: nothing would say that it is an equilibrium.
        let steps = self.max_iterations - 1;
        let limits = Limits { tolerance: self.tolerance, steps, waits: false };
        let rounding = Rounding::of(body);
        let mut reached =
            Reached { displacement: vec![0.0; body.n_dofs()], increments: 0, iterations: 0 };
        for increment in 1..=self.increments {
            let share = increment as f64 / self.increments as f64;
            let target: Vec<f64> = force.iter().map(|f| share * f).collect();
            let mut run = Increment {
                body,
                system: &mut system,
                force: vec![0.0; body.n_dofs()],
                tangent: Tangent::matrix(body),
                step: Vec::new(),
                u: reached.displacement.clone(),
                iterations: &mut reached.iterations,
                rounding,
                tolerance: self.tolerance,
                target,
                go_on: &mut *go_on,
            };
            match iterate(&mut run, limits) {
                Ok(Stop::Converged) => {}
                Err(Failure::Cancelled) => return Err(Error::Cancelled),
                _ => break,
            }
            let u = run.u;
            if !body.energy(&u).is_finite() {
                break;
            }
            reached.displacement = u;
            reached.increments = increment;
        }
        Ok(reached)
    }
}

/// One load increment in progress.
struct Increment<'a> {
    body: &'a Body,
    system: &'a mut ConstrainedSystem,
    target: Vec<f64>,
    force: Vec<f64>,
    tangent: Tangent,
    /// The residual on the free degrees of freedom, then the step.
    step: Vec<f64>,
    u: Vec<f64>,
    iterations: &'a mut usize,
    rounding: Rounding,
    tolerance: f64,
    go_on: &'a mut dyn FnMut() -> bool,
}

enum Failure {
    /// The iterations have left the range of finite numbers.
    Diverged,
    Cancelled,
}

impl Iteration for Increment<'_> {
    type Failure = Failure;

    fn residual(&mut self) -> Result<f64, Failure> {
        self.tangent.linearize(self.body, &self.u, Curvature::Exact, &mut self.force);
        let applied = self.system.gather(&self.target);
        let internal = self.system.gather(&self.force);
        self.step = applied.iter().zip(&internal).map(|(f, i)| f - i).collect();
        let residual = self.rounding.relative(norm(&self.step), norm(&applied), self.tolerance);
        if residual.is_finite() { Ok(residual) } else { Err(Failure::Diverged) }
    }

    fn step(&mut self) -> Result<(), Failure> {
        if !(self.go_on)() {
            return Err(Failure::Cancelled);
        }
        *self.iterations += 1;
        self.system.prepare(&self.tangent, 0.0).map_err(|_| Failure::Diverged)?;
        self.system.solve_columns(&mut self.step).map_err(|_| Failure::Diverged)?;
        let free = self.system.free().iter();
        free.zip(&self.step).for_each(|(&dof, s)| self.u[dof as usize] += s);
        Ok(())
    }
}
