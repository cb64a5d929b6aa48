//! The shape that touches start from: rest, or an equilibrium under a dead load.
//!
//! A preload is its displacement `u_0` alone. The load is dead, so it equals the internal force
//! `f_int(u_0)` at free nodes, and `u_0` is an equilibrium by definition. The caller must ensure
//! that this load is the intended one.

use crate::body::Body;
use crate::error::Error;
use crate::linear::FactorError;
use crate::mesh::Surface;
use crate::series::TouchExpansion;

/// Refuses a displacement from which no touch can start; an empty one is rest.
///
/// # Errors
/// A wrong length, a value that is not finite, a fixed node that moves, a cell turned inside out.
pub(super) fn check(body: &Body, fixed: &[u32], preload: &[f64]) -> Result<(), Error> {
    if preload.is_empty() {
        return Ok(());
    }
    if preload.len() != body.n_dofs() {
        return Err(Error::input(format!(
            "the preload has {} values; it needs {}, three for each point",
            preload.len(),
            body.n_dofs()
        )));
    }
    if let Some(dof) = preload.iter().position(|u| !u.is_finite()) {
        let (value, node) = (preload[dof], dof / 3);
        return Err(Error::input(format!(
            "the preload is {value} at point {node}; it must be finite"
        )));
    }
    let moves = |node: &&u32| preload[3 * **node as usize..][..3].iter().any(|&u| u != 0.0);
    if let Some(node) = fixed.iter().find(moves) {
        return Err(Error::input(format!(
            "the preload moves the fixed point {node}; solve it with the same points fixed"
        )));
    }
    if !body.energy(preload).is_finite() {
        let (jacobian, cell) = body.smallest_jacobian(preload);
        return Err(Error::input(format!(
            "the preload turns cell {cell} inside out (J = {jacobian:.3}); reduce about an equilibrium"
        )));
    }
    Ok(())
}

/// The surface that is touched, with its areas and normals; in the loaded shape if there is a
/// preload.
pub(super) fn shape(rest: &Surface, preload: &[f64]) -> Surface {
    if preload.is_empty() {
        return rest.clone();
    }
    let displaced = rest.points().iter().zip(preload.chunks_exact(3));
    let points: Vec<[f64; 3]> =
        displaced.map(|(x, u)| std::array::from_fn(|i| x[i] + u[i])).collect();
    Surface::new(&points, rest.triangles())
}

/// The expansion of all touches about the preload.
///
/// # Errors
/// A preload that is not stable, so that the result of a touch is not determined.
pub(super) fn expansion<'a>(
    body: &'a Body,
    fixed: &[u32],
    preload: &[f64],
    order: usize,
) -> Result<TouchExpansion<'a>, Error> {
    if preload.is_empty() {
        return TouchExpansion::new(body, fixed, vec![0.0; body.n_dofs()], order);
    }
    TouchExpansion::new(body, fixed, preload.to_vec(), order).map_err(|error| match error {
        Error::Factor(FactorError::NotPositiveDefinite { row } | FactorError::Singular { row }) => {
            Error::input(format!(
                "the preload is no stable equilibrium (the tangent is not positive definite at point {}); \
                 load the organ less, or fix more of it",
                row / 3
            ))
        }
        other => other,
    })
}
