//! The on-line evaluator: caller-owned memory, a fixed number of operations, no allocation, no lock, no system call. It
//! does not depend on finite elements.

use super::combine::Combine;
use super::contact::Contact;
use super::interpolation::{Interpolation, MAX_TERMS, norm, weighted};
use super::model::ReducedModel;
use super::resummation::MAX_ORDER;
use viscera_mesh::Patch;
use viscera_number::evaluate_monomials;
use viscera_number::simd::dispatch;
use viscera_number::tensor::Mat3;

/// A mode that moves nothing by more than this part of the tool's displacement is left out.
const NEGLIGIBLE: f64 = 1e-5;

/// Whether a force, or a field, is trusted, and if not, why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// The error estimate is within the allowance at this depth.
    Trusted,
    /// The displacement is larger than the depth the model was made for.
    BeyondDepth,
    /// The error estimate is larger than allowed.
    ErrorTooLarge,
}

/// Force, stiffness and their error estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Force of the tool on the organ [N].
    pub force: [f64; 3],
    /// Contact stiffness `dF/dd` [N/m], the derivative of this force. Its own error is larger and not estimated; it need not
    /// be symmetric.
    pub stiffness: Mat3<f64>,
    /// Estimated error of the force, relative to its norm; at most 1.
    pub error_estimate: f64,
    /// Whether the force is trusted.
    pub trust: Trust,
    /// Estimated error of the field, relative to its norm; at most 1. It also contains the loss by compression of the
    /// field, which does not affect the force.
    pub shape_error_estimate: f64,
    /// Whether the field is trusted.
    pub shape_trust: Trust,
}

/// Error allowed at a depth: 1 % up to 5 % of the organ's diagonal, rising to 5 % at 10 %.
pub fn allowance(depth_fraction: f64) -> f64 {
    0.01 + 0.04 * ((depth_fraction - 0.05) / 0.05).clamp(0.0, 1.0)
}

impl ReducedModel {
    /// The closest touchable point; none for a point that is not finite.
    pub fn locate(&self, point: [f64; 3]) -> Option<Contact> {
        let closest = self.tree.closest(&self.positions, &self.triangles, point)?;
        Some(Contact {
            triangle: closest.triangle as usize,
            weights: closest.barycentric,
            point: closest.point,
            distance: closest.distance,
        })
    }

    /// Whether a contact is on the touchable surface, to within an edge length.
    pub fn is_on_surface(&self, contact: &Contact) -> bool {
        contact.distance <= self.edge_length
    }

    /// Mean edge length of the touchable triangles [m].
    pub fn edge_length(&self) -> f64 {
        self.edge_length
    }

    /// Force, stiffness and error estimate; the field is not needed for them.
    pub fn respond(&self, contact: &Contact, d: [f64; 3]) -> Answer {
        let here = Interpolation::new(self, contact);
        let mut monomials = [0.0; MAX_TERMS];
        let monomials = &mut monomials[..self.n_terms()];
        evaluate_monomials(&self.exponents, d, monomials);
        let order_weights = here.order_weights(monomials, d);
        let second = here.second_order(d);
        let parts = here.force(monomials, d, second.as_ref());
        let force = weighted(&order_weights.weights, &parts.0);
        let stiffness = here.stiffness(d, &parts.0, &order_weights.weights, second.as_ref());
        let estimates = here.error_estimates(monomials, force, &parts, &order_weights);
        let depth = norm(d);
        Answer {
            force,
            stiffness,
            error_estimate: estimates.force,
            trust: self.trust(depth, estimates.force),
            shape_error_estimate: estimates.shape,
            shape_trust: self.trust(depth, estimates.shape),
        }
    }

    /// Force and stiffness alone.
    pub(super) fn reaction(&self, contact: &Contact, d: [f64; 3]) -> ([f64; 3], Mat3<f64>) {
        let here = Interpolation::new(self, contact);
        let mut monomials = [0.0; MAX_TERMS];
        let monomials = &mut monomials[..self.n_terms()];
        evaluate_monomials(&self.exponents, d, monomials);
        let (weights, second) = (here.weights(monomials, d), here.second_order(d));
        let (orders, _) = here.force(monomials, d, second.as_ref());
        (weighted(&weights, &orders), here.stiffness(d, &orders, &weights, second.as_ref()))
    }

    /// Error that is allowed of a force or a field displaced by a depth [m], relative to its norm.
    pub fn allowed(&self, depth: f64) -> f64 {
        allowance(depth / self.metadata.diagonal)
    }

    fn trust(&self, depth: f64, error_estimate: f64) -> Trust {
        // Written so that a displacement that is not a number is not trusted either.
        if !(depth <= self.metadata.depth * (1.0 + 1e-9)) {
            Trust::BeyondDepth
        } else if error_estimate > self.allowed(depth) {
            Trust::ErrorTooLarge
        } else {
            Trust::Trusted
        }
    }

    /// Force of the series cut after an order of at least 1, below the model's own a polynomial; the
    /// first is linear elasticity.
    pub fn force_to_order(&self, contact: &Contact, d: [f64; 3], order: usize) -> [f64; 3] {
        let mut monomials = [0.0; MAX_TERMS];
        evaluate_monomials(&self.exponents, d, &mut monomials);
        let here = Interpolation::new(self, contact).cut_after(order);
        let second = here.second_order(d);
        weighted(&here.weights(&monomials, d), &here.force(&monomials, d, second.as_ref()).0)
    }

    /// How much each order counts in the answer to a touch: 1 where they are summed as a polynomial.
    pub fn order_weights(&self, contact: &Contact, d: [f64; 3]) -> [f64; MAX_ORDER] {
        let mut monomials = [0.0; MAX_TERMS];
        evaluate_monomials(&self.exponents, d, &mut monomials);
        Interpolation::new(self, contact).weights(&monomials, d).map(|weight| weight.value)
    }

    /// What the error of the series that a model leaves out is in proportion to. None for models whose orders are summed as a
    /// polynomial.
    pub fn truncation(&self, contact: &Contact, d: [f64; 3]) -> Option<f64> {
        let mut monomials = [0.0; MAX_TERMS];
        let monomials = &mut monomials[..self.n_terms()];
        evaluate_monomials(&self.exponents, d, monomials);
        let here = Interpolation::new(self, contact);
        let order_weights = here.order_weights(monomials, d);
        let (orders, _) = here.force(monomials, d, here.second_order(d).as_ref());
        let force = norm(weighted(&order_weights.weights, &orders));
        here.truncation(monomials, &orders, force, &order_weights)
    }

    /// How much the positions around a contact disagree there, relative to the answer: what the errors of its force and of
    /// its field by interpolation are in proportion to. None for models whose orders are summed as a polynomial.
    pub fn disagreement(&self, contact: &Contact, d: [f64; 3]) -> Option<[f64; 2]> {
        let mut monomials = [0.0; MAX_TERMS];
        let monomials = &mut monomials[..self.n_terms()];
        evaluate_monomials(&self.exponents, d, monomials);
        let here = Interpolation::new(self, contact);
        let order_weights = here.order_weights(monomials, d);
        let parts = here.force(monomials, d, here.second_order(d).as_ref());
        let force = norm(weighted(&order_weights.weights, &parts.0));
        here.disagreement(monomials, &parts, force, &order_weights)
    }

    /// What the compression of the field loses at a contact, relative to the field.
    pub fn compression(&self, contact: &Contact, d: [f64; 3]) -> f64 {
        Interpolation::new(self, contact).compression(norm(d) / self.metadata.depth)
    }

    /// Numbers of workspace that the field functions need.
    pub fn workspace_len(&self) -> usize {
        3 * self.largest_region
    }

    /// Displacement of the surface nodes [m], `3 * surface_nodes.len()` numbers.
    ///
    /// # Panics
    /// If `workspace` or `out` is too short.
    pub fn surface_displacement(
        &self,
        contact: &Contact,
        d: [f64; 3],
        workspace: &mut [f32],
        out: &mut [f32],
    ) {
        self.surface_displacement_to_order(contact, d, self.metadata.order, workspace, out);
    }

    /// The same of the series cut after an order of at least 1; the first is linear elasticity.
    ///
    /// # Panics
    /// If `workspace` or `out` is too short.
    pub fn surface_displacement_to_order(
        &self,
        contact: &Contact,
        d: [f64; 3],
        order: usize,
        workspace: &mut [f32],
        out: &mut [f32],
    ) {
        let here = Interpolation::new(self, contact).cut_after(order);
        let out = &mut out[..3 * self.arrays.surface_nodes.len()];
        self.combine(&here, d, workspace, &self.arrays.surface_modes, out);
    }

    /// Displacement of the nodes inside [m], `3 * interior_nodes().len()` numbers.
    ///
    /// # Panics
    /// If `workspace` or `out` is too short.
    pub fn interior_displacement(
        &self,
        contact: &Contact,
        d: [f64; 3],
        workspace: &mut [f32],
        out: &mut [f32],
    ) {
        let here = Interpolation::new(self, contact);
        let out = &mut out[..3 * self.interior_nodes.len()];
        self.combine(&here, d, workspace, &self.arrays.interior_modes, out);
    }

    /// Numbers of workspace that [`ReducedModel::displacement`] needs.
    pub fn field_workspace_len(&self) -> usize {
        self.workspace_len() + 3 * self.arrays.surface_nodes.len()
    }

    /// Displacement of all nodes [m], `3 * n_points()` numbers.
    ///
    /// # Panics
    /// If `workspace` or `out` is too short.
    pub fn displacement(
        &self,
        contact: &Contact,
        d: [f64; 3],
        workspace: &mut [f32],
        out: &mut [f32],
    ) {
        let (workspace, surface) = workspace.split_at_mut(self.workspace_len());
        self.surface_displacement(contact, d, workspace, surface);
        self.interior_displacement(contact, d, workspace, out);
        // Both are ascending: merged from behind, what lies inside moves within `out`.
        let mut on_surface = self.arrays.surface_nodes.len();
        for node in (0..self.n_points()).rev() {
            let to = 3 * node..3 * node + 3;
            if on_surface > 0 && self.arrays.surface_nodes[on_surface - 1] as usize == node {
                on_surface -= 1;
                out[to].copy_from_slice(&surface[3 * on_surface..3 * on_surface + 3]);
            } else {
                let inside = 3 * (node - on_surface);
                out.copy_within(inside..inside + 3, to.start);
            }
        }
    }

    /// Displacement [m] of the nodes that some modes are given at, `out.len() / 3` of them.
    pub(super) fn modes_displacement(
        &self,
        contact: &Contact,
        d: [f64; 3],
        workspace: &mut [f32],
        modes: &[i16],
        out: &mut [f32],
    ) {
        self.combine(&Interpolation::new(self, contact), d, workspace, modes, out);
    }

    /// The middle of a touchable triangle.
    pub fn centroid(&self, triangle: usize) -> Contact {
        let corners = self.triangles[triangle].map(|p| self.positions[p as usize]);
        let point = std::array::from_fn(|i| corners.iter().map(|x| x[i]).sum::<f64>() / 3.0);
        Contact { triangle, weights: [1.0 / 3.0; 3], point, distance: 0.0 }
    }

    /// The patch of a contact: what a full solution must prescribe to be compared. Allocates.
    pub fn patch(&self, contact: &Contact) -> Patch {
        let corners = self.triangles[contact.triangle].map(|p| {
            let (start, end) = (
                self.arrays.patch_start[p as usize] as usize,
                self.arrays.patch_start[p as usize + 1] as usize,
            );
            Patch {
                nodes: self.arrays.patch_nodes[start..end].to_vec(),
                weights: self.arrays.patch_weights[start..end].to_vec(),
            }
        });
        let w = contact.weights;
        Patch::blend(&[(w[0], &corners[0]), (w[1], &corners[1]), (w[2], &corners[2])])
    }

    /// Nodes that are not on the surface, ascending.
    pub fn interior_nodes(&self) -> &[u32] {
        &self.interior_nodes
    }

    /// The three positions of a contact's triangle.
    pub fn corners(&self, contact: &Contact) -> [u32; 3] {
        self.triangles[contact.triangle]
    }

    fn combine(
        &self,
        here: &Interpolation,
        d: [f64; 3],
        workspace: &mut [f32],
        modes: &[i16],
        out: &mut [f32],
    ) {
        out.fill(0.0);
        let slots = here.amplitudes(d, workspace);
        let rows = out.len();
        let negligible = (NEGLIGIBLE * norm(d)) as f32 / f32::from(i16::MAX);
        for (slot, amplitudes) in slots.iter().zip(workspace.chunks_exact(self.largest_region)) {
            let Some(region) = *slot else { continue };
            let range = self.region_modes(region);
            let amplitudes = &amplitudes[..range.len()];
            let scales = &self.arrays.mode_scale[range.clone()];
            let modes = &modes[range.start * rows..range.end * rows];
            dispatch(Combine { amplitudes, scales, modes, negligible, out });
        }
    }

    /// Modes of a region.
    pub fn region_modes(&self, region: u32) -> std::ops::Range<usize> {
        let starts = &self.arrays.region_start;
        starts[region as usize] as usize..starts[region as usize + 1] as usize
    }
}
