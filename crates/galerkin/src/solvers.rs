//! Solvers of the whole body, kept for reuse.

use super::origin::Origin;
use crate::equilibrium::{ConstrainedSystem, Method, mean_rows};
use crate::error::Error;
use crate::mesh::Patch;
use std::sync::{Mutex, PoisonError};

/// Solvers for the tangents of one body, lent to one thread after the other, since the analysis of a pattern takes as
/// long as several factorisations.
#[derive(Default)]
pub(super) struct Solvers {
    idle: Mutex<Vec<ConstrainedSystem>>,
}

impl Solvers {
    pub fn lend<T>(
        &self,
        origin: &Origin,
        patches: &[Patch],
        work: impl FnOnce(&mut ConstrainedSystem) -> T,
    ) -> Result<T, Error> {
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let waiting = idle().pop();
        let mut solver = match waiting {
            Some(solver) => solver,
            None => {
                let fixed = origin.fixed.iter().copied();
                ConstrainedSystem::new(Method::Cholesky, &origin.body, fixed, Vec::new())?
            }
        };
        solver.hold(&[], mean_rows(patches));
        let done = work(&mut solver);
        idle().push(solver);
        Ok(done)
    }
}
