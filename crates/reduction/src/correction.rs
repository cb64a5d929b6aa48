//! What one iteration of Newton's method on the full organ changes in an answer: nearly its error, where the tangent that
//! the answer leads to is not singular.

use crate::body::{Body, Curvature};
use crate::equilibrium::{ConstrainedSystem, Method, Tangent, dofs_of, mean_rows};
use crate::error::Error;
use crate::mesh::Patch;

/// Most iterations of one correction.
const MOST_ITERATIONS: usize = 5;
/// A second step by the same tangent, over the first, above which the iteration converges slowly: of a power law it is a third.
const SLOW: f64 = 0.2;

/// A full organ, with room for one tangent.
pub(super) struct Correction<'a> {
    body: &'a Body,
    /// Displacement of the preload, and the dead load that it balances.
    base: Vec<f64>,
    load: Vec<f64>,
    tangent: Tangent,
    system: ConstrainedSystem,
}

impl<'a> Correction<'a> {
    /// Of touches that start from a preload, or from rest if that is empty.
    ///
    /// # Errors
    /// A pattern that the solver refuses.
    pub fn new(body: &'a Body, fixed: &[u32], preload: &[f64]) -> Result<Self, Error> {
        let mut load = vec![0.0; body.n_dofs()];
        let base = if preload.is_empty() { load.clone() } else { preload.to_vec() };
        body.internal_force(&base, &mut load);
        let system = ConstrainedSystem::new(Method::Cholesky, body, dofs_of(fixed), Vec::new())?;
        Ok(Correction { body, base, load, tangent: Tangent::matrix(body), system })
    }

    /// By how much the field u and the force of a touch change, relative to what they become; none where a cell is turned
    /// inside out, or where the organ under the patch is not stable, so that the iteration leads elsewhere. One iteration, or
    /// several where it converges slowly, as it does where the stiffness grows by a high power of the strain.
    pub fn of(
        &mut self,
        patch: &Patch,
        u: &[f64],
        force: [f64; 3],
        curvature: Curvature,
    ) -> Option<[f64; 2]> {
        self.system.bind(mean_rows(std::slice::from_ref(patch)));
        let (mut becomes, mut next) = (u.to_vec(), self.iterate(u, curvature)?);
        for iteration in 1.. {
            becomes.iter_mut().zip(&next.step).for_each(|(u, step)| *u += step);
            if iteration == MOST_ITERATIONS || !self.is_slow(&becomes, &next.step) {
                break;
            }
            match self.iterate(&becomes, curvature) {
                Some(after) => next = after,
                None => break,
            }
        }
        let field: Vec<f64> = becomes.iter().zip(u).map(|(becomes, u)| becomes - u).collect();
        let change: Vec<f64> = next.force.iter().zip(force).map(|(next, f)| next - f).collect();
        Some([norm(&field) / norm(&becomes), norm(&change) / norm(&next.force)])
    }

    /// An iteration of Newton's method from u.
    fn iterate(&mut self, u: &[f64], curvature: Curvature) -> Option<Next> {
        let total = self.total(u);
        if !self.body.energy(&total).is_finite() {
            return None;
        }
        let mut residual = vec![0.0; total.len()];
        self.tangent.linearize(self.body, &total, curvature, &mut residual);
        self.system.prepare(&self.tangent, 0.0).ok()?;
        self.solve(residual)
    }

    /// Whether the same tangent asks at u for another step not much smaller than the last.
    fn is_slow(&mut self, u: &[f64], last: &[f64]) -> bool {
        let total = self.total(u);
        let mut residual = vec![0.0; total.len()];
        self.body.internal_force(&total, &mut residual);
        self.solve(residual).is_some_and(|next| norm(&next.step) > SLOW * norm(last))
    }

    /// The step against internal forces, by the tangent at hand.
    fn solve(&mut self, mut residual: Vec<f64>) -> Option<Next> {
        residual.iter_mut().zip(&self.load).for_each(|(r, load)| *r = *load - *r);
        let (mut step, mut force) = (vec![0.0; residual.len()], Vec::new());
        self.system.solve(&mut residual, &[0.0; 3], &mut step, &mut force, None).ok()?;
        Some(Next { step, force })
    }

    fn total(&self, u: &[f64]) -> Vec<f64> {
        self.base.iter().zip(u).map(|(base, u)| base + u).collect()
    }
}

/// What an iteration leads to: the step of the field, and the force under the patch.
struct Next {
    step: Vec<f64>,
    force: Vec<f64>,
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}
