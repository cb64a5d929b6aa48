//! The whole body in the state that touches start from: rest, or an equilibrium under a dead load.
//!
//! Displacements `u` count from there. The dead load balances the internal force `f_0` of that state `u_0`, so touches
//! work against the energy
//!   V(u) = W(u_0 + u) - W(u_0) - f_0 . u,
//! whose derivative is `f(u_0 + u) - f_0`, and whose second one is the tangent.

use crate::body::{Body, Curvature, SymmetricBlocks};
use crate::element::Element;
use crate::equilibrium::{ConstrainedSystem, Rounding, Tangent, dofs_of};
use crate::error::Error;
use crate::law::Material;
use crate::reduced::{Parameter, ReducedModel};

/// A body, and the state that touches start from.
pub(super) struct Origin {
    pub body: Body,
    /// `u_0`: zero at rest.
    pub displacement: Vec<f64>,
    /// The tangent there, with which fields are made orthonormal.
    pub stiffness: SymmetricBlocks,
    /// The same, factorised.
    pub system: ConstrainedSystem,
    /// Degrees of freedom that never move.
    pub fixed: Vec<u32>,
    /// `W(u_0)` and `f_0`.
    energy: f64,
    pub force: Vec<f64>,
    pub rounding: Rounding,
}

impl Origin {
    /// Of the touches of a series model.
    ///
    /// # Errors
    /// Points that are not those of its cells; a tangent that is not positive definite.
    pub fn new(model: &ReducedModel) -> Result<Self, Error> {
        let body = body(model)?;
        let mut displacement = model.arrays().preload.clone();
        displacement.resize(body.n_dofs(), 0.0);
        let (mut stiffness, mut force) = (body.zero_tangent(), vec![0.0; body.n_dofs()]);
        body.internal_force_and_tangent(&displacement, &mut force, &mut stiffness);
        let fixed: Vec<u32> = dofs_of(&model.arrays().fixed).collect();
        let system = ConstrainedSystem::at(&body, &displacement, &model.arrays().fixed)?;
        let energy = body.energy(&displacement);
        let rounding = Rounding::of(&body);
        Ok(Origin { body, displacement, stiffness, system, fixed, energy, force, rounding })
    }

    /// `f(u_0 + u) - f_0`, in place; returns `V(u)`. If that is infinite, the force has no meaning.
    pub fn internal_force(&self, u: &[f64], force: &mut [f64]) -> f64 {
        let energy = self.body.internal_force(&self.moved(u), force);
        self.balance(force);
        let work: f64 = self.force.iter().zip(u).map(|(f, u)| f * u).sum();
        energy - self.energy - work
    }

    /// The same force, and the tangent.
    pub fn linearize(
        &self,
        u: &[f64],
        curvature: Curvature,
        force: &mut [f64],
        tangent: &mut Tangent,
    ) {
        tangent.linearize(&self.body, &self.moved(u), curvature, force);
        self.balance(force);
    }

    /// Whether an energy is not higher than another, as far as rounding lets them be compared.
    pub fn is_no_higher(&self, energy: f64, than: f64) -> bool {
        self.rounding.is_no_higher(energy, than, than.abs() + self.energy.abs())
    }

    /// The smallest volume ratio.
    pub fn smallest_jacobian(&self, u: &[f64]) -> f64 {
        self.body.smallest_jacobian(&self.moved(u)).0
    }

    /// `u_0 + u`.
    pub fn moved(&self, u: &[f64]) -> Vec<f64> {
        self.displacement.iter().zip(u).map(|(start, u)| start + u).collect()
    }

    fn balance(&self, force: &mut [f64]) {
        force.iter_mut().zip(&self.force).for_each(|(f, start)| *f -= start);
    }
}

/// The body that a model was reduced from, at rest, with the law at the value that the model is set to.
fn body(model: &ReducedModel) -> Result<Body, Error> {
    let (metadata, arrays) = (model.metadata(), model.arrays());
    let cells: Vec<[u32; 4]> = arrays.cells.as_chunks().0.to_vec();
    let mut points = arrays.points.clone();
    points.iter_mut().zip(&arrays.preload).for_each(|(x, u)| *x -= u);
    // The midpoints of quadratic cells come after all corners.
    let n_corners = arrays.cells.iter().max().map_or(0, |&last| last as usize + 1);
    let points = points.as_chunks().0[..n_corners].to_vec();
    let rows = arrays.law_parameters.chunks_exact(metadata.law_parameter_names.len());
    let mut material = Material::new(&metadata.law, rows.map(<[f64]>::to_vec).collect())?;
    // A model that has been set to another value since it was read still has the parameters of its file.
    if let Some(Parameter { name, value, .. }) =
        metadata.parameter.as_ref().filter(|p| p.is_of_law())
    {
        material = material.varied(name, *value, &arrays.parameter_cells, cells.len())?;
    }
    let element = Element::named(&metadata.element)?;
    let body = Body::with_element(element, points, cells, material)?;
    if body.points().len() != model.n_points() {
        return Err(Error::input(format!(
            "the model has {} points, but its cells of element {:?} have {}; reduce the organ anew",
            model.n_points(),
            metadata.element,
            body.points().len()
        )));
    }
    Ok(body)
}
