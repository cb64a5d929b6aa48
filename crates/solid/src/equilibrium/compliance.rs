//! The compliance of a body about one state after another: the displacements by small forces, whatever the signs of the
//! tangent's eigenvalues. The analysis of its pattern is made once for each kind of factor.

use super::system::{ConstrainedSystem, Method, dofs_of};
use super::tangent::Tangent;
use crate::body::{Body, Curvature};
use crate::error::Error;

/// Factors of a body's tangents, some of its nodes fixed.
pub struct Compliance {
    fixed: Vec<u32>,
    tangent: Tangent,
    force: Vec<f64>,
    /// Each analysed when it is first needed.
    cholesky: Option<ConstrainedSystem>,
    ldlt: Option<ConstrainedSystem>,
    /// Whether the last tangent was positive definite: the next one is likely to be so too.
    is_definite: bool,
}

impl Compliance {
    /// For the tangents of this body, `fixed` nodes held.
    pub fn new(body: &Body, fixed: &[u32]) -> Self {
        Compliance {
            fixed: fixed.to_vec(),
            tangent: Tangent::matrix(body),
            force: vec![0.0; body.n_dofs()],
            cholesky: None,
            ldlt: None,
            is_definite: true,
        }
    }

    /// The factorised tangent of the body at `u`. Cholesky's method is tried where the last tangent was positive
    /// definite; `L D Lᵀ` serves all others.
    ///
    /// # Errors
    /// A factor that grows too much; a pattern the solver refuses.
    pub fn at(&mut self, body: &Body, u: &[f64]) -> Result<&ConstrainedSystem, Error> {
        let Compliance { fixed, tangent, force, cholesky, ldlt, is_definite } = self;
        tangent.linearize(body, u, Curvature::Exact, force);
        if *is_definite {
            let system = analysed(cholesky, Method::Cholesky, body, fixed)?;
            *is_definite = system.prepare(tangent, 0.0).is_ok();
            if *is_definite {
                return Ok(system);
            }
        }
        let system = analysed(ldlt, Method::Ldlt, body, fixed)?;
        system.prepare(tangent, 0.0)?;
        *is_definite = system.n_negative() == Some(0);
        Ok(system)
    }
}

/// A system, made if it was not yet.
fn analysed<'a>(
    system: &'a mut Option<ConstrainedSystem>,
    method: Method,
    body: &Body,
    fixed: &[u32],
) -> Result<&'a mut ConstrainedSystem, Error> {
    match system {
        Some(system) => Ok(system),
        empty => {
            let made = ConstrainedSystem::new(method, body, dofs_of(fixed), Vec::new())?;
            Ok(empty.insert(made))
        }
    }
}
