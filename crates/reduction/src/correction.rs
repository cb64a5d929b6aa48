//! What one iteration of Newton's method on the full organ changes in an answer: nearly its error, where the tangent that
//! the answer leads to is not singular.

use crate::body::{Body, Curvature};
use crate::equilibrium::{ConstrainedSystem, Method, Tangent, dofs_of, mean_rows};
use crate::error::Error;
use crate::mesh::Patch;

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
    /// inside out, or where the organ under the patch is not stable, so that the iteration leads elsewhere.
    pub fn of(&mut self, patch: &Patch, u: &[f64], force: [f64; 3]) -> Option<[f64; 2]> {
        let Correction { body, base, load, tangent, system } = self;
        let total: Vec<f64> = base.iter().zip(u).map(|(base, u)| base + u).collect();
        if !body.energy(&total).is_finite() {
            return None;
        }
        let mut residual = vec![0.0; total.len()];
        tangent.linearize(body, &total, Curvature::Exact, &mut residual);
        residual.iter_mut().zip(load).for_each(|(r, load)| *r = *load - *r);
        system.bind(mean_rows(std::slice::from_ref(patch)));
        system.prepare(tangent, 0.0).ok()?;
        let (mut step, mut next) = (vec![0.0; u.len()], Vec::new());
        system.solve(&mut residual, &[0.0; 3], &mut step, &mut next, None).ok()?;
        let becomes: Vec<f64> = u.iter().zip(&step).map(|(u, step)| u + step).collect();
        let change: Vec<f64> = next.iter().zip(force).map(|(next, force)| next - force).collect();
        Some([norm(&step) / norm(&becomes), norm(&change) / norm(&next)])
    }
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}
