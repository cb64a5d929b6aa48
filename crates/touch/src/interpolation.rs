//! A model at a contact: what its corners and edges know, interpolated to the point touched.
//!
//! Between positions the contact patch is the blend of the patches at the triangle's corners with
//! barycentric weights `l`, so the first order is exact there: with `C(s) = sum l_a l_b C_ab`,
//!   f = C(s)^-1 d,   u_1 = sum_a l_a G_a f.
//! Orders up to the edge order are interpolated quadratically through corners and edge midpoints,
//! higher ones linearly.

use super::evaluate::Contact;
use super::model::ReducedModel;
use super::resummation::{Dual, MAX_ORDER, Parts, SKETCH, constant, weights};
use viscera_number::tensor::{Mat3, inverse, mul_vector};
use viscera_number::unroll::tabulate;
use viscera_number::{Gradient, degree_of, evaluate_monomials};

/// Monomials of order 8 in three variables, the constant left out.
pub(super) const MAX_TERMS: usize = 164;

/// The orders of a force, added up.
pub(super) fn weighted(weights: &[Dual; MAX_ORDER], orders: &[[f64; 3]; MAX_ORDER]) -> [f64; 3] {
    std::array::from_fn(|i| weights.iter().zip(orders).map(|(w, f)| w.value * f[i]).sum())
}

/// A model at a contact: corners, edges and interpolation weights.
pub(super) struct Interpolation<'a> {
    pub(super) model: &'a ReducedModel,
    pub(super) corners: [usize; 3],
    edges: [usize; 3],
    pub(super) weights: [f64; 3],
    edge_weights: [f64; 3],
    stiffness: Mat3<f64>,
    /// Monomials taken into account.
    terms: usize,
}

impl<'a> Interpolation<'a> {
    pub(super) fn new(model: &'a ReducedModel, contact: &Contact) -> Self {
        let t = contact.triangle;
        let corners = model.triangles[t].map(|p| p as usize);
        let edges: [usize; 3] =
            std::array::from_fn(|k| model.arrays.triangle_edges[3 * t + k] as usize);
        let weights = contact.weights;
        let edge_weights = std::array::from_fn(|k| weights[k] * weights[(k + 1) % 3]);
        let mut compliance = tabulate!(|_, _| 0.0);
        for k in 0..3 {
            let own = &model.arrays.answers.compliance[9 * corners[k]..9 * corners[k] + 9];
            let cross = &model.arrays.answers.cross_compliance[9 * edges[k]..9 * edges[k] + 9];
            for i in 0..3 {
                for j in 0..3 {
                    // C_ab and C_ba are transposes of each other.
                    compliance[i][j] += weights[k] * weights[k] * own[3 * i + j]
                        + edge_weights[k] * (cross[3 * i + j] + cross[3 * j + i]);
                }
            }
        }
        let stiffness = inverse(&compliance).unwrap_or_else(|| tabulate!(|_, _| 0.0));
        let terms = model.n_terms();
        Interpolation { model, corners, edges, weights, edge_weights, stiffness, terms }
    }

    /// The series cut after an order of at least 1: what a theory of that order answers.
    pub(super) fn cut_after(self, order: usize) -> Self {
        let is_kept = |exponents: &&[u8; 3]| degree_of(exponents) <= order.max(1);
        let terms = self.model.exponents.iter().take_while(is_kept).count();
        Interpolation { terms, ..self }
    }

    /// Terms of an edge among those taken into account.
    fn edge_terms(&self) -> usize {
        self.model.edge_terms.min(self.terms - 3)
    }

    /// Weight of a corner's term: quadratic up to the edge order, linear beyond.
    fn corner_weight(&self, k: usize, term: usize) -> f64 {
        let l = self.weights[k];
        if term < 3 + self.model.edge_terms { l * (2.0 * l - 1.0) } else { l }
    }

    /// How much each order counts.
    pub(super) fn weights(&self, monomials: &[f64], d: [f64; 3]) -> [Dual; MAX_ORDER] {
        match self.parts(monomials, d) {
            None => std::array::from_fn(|_| constant(1.0)),
            Some(parts) => weights(&parts, self.model.metadata.order),
        }
    }

    /// The part of each order in the sketch, blended from the corners; none where orders are summed as a polynomial.
    pub(super) fn parts(&self, monomials: &[f64], d: [f64; 3]) -> Option<Parts> {
        let model = self.model;
        if model.arrays.answers.sketch.is_empty()
            || self.terms < model.n_terms()
            || model.metadata.order < 3
        {
            return None;
        }
        let mut parts: Parts = std::array::from_fn(|_| std::array::from_fn(|_| constant(0.0)));
        let size = SKETCH * model.n_terms();
        let corners = self.corners.map(|c| &model.arrays.answers.sketch[c * size..(c + 1) * size]);
        for (term, exponents) in model.exponents.iter().enumerate() {
            let slope = monomial_gradient(exponents, d);
            for (s, part) in parts[degree_of(exponents) - 1].iter_mut().enumerate() {
                let at = SKETCH * term + s;
                let blend: f64 = (0..3).map(|k| self.weights[k] * f64::from(corners[k][at])).sum();
                part.value += blend * monomials[term];
                part.first.iter_mut().zip(slope).for_each(|(sum, x)| *sum += blend * x);
            }
        }
        Some(parts)
    }

    /// The parts of the force by order, and the size of the quadratic correction.
    pub(super) fn force(&self, monomials: &[f64], d: [f64; 3]) -> ([[f64; 3]; MAX_ORDER], f64) {
        let model = self.model;
        let mut orders = [[0.0; 3]; MAX_ORDER];
        let mut correction = [0.0; 3];
        orders[0] = mul_vector(&self.stiffness, &d);
        for (k, &corner) in self.corners.iter().enumerate() {
            let coefficients = model.position_force(corner);
            for term in 3..self.terms {
                let order = degree_of(&model.exponents[term]) - 1;
                let weight = self.corner_weight(k, term);
                for i in 0..3 {
                    let value = monomials[term] * coefficients[3 * term + i];
                    orders[order][i] += weight * value;
                    correction[i] += (weight - self.weights[k]) * value;
                }
            }
        }
        for (k, &edge) in self.edges.iter().enumerate() {
            let coefficients = model.edge_force(edge);
            for term in 0..self.edge_terms() {
                let order = degree_of(&model.exponents[3 + term]) - 1;
                let weight = 4.0 * self.edge_weights[k] * monomials[3 + term];
                for i in 0..3 {
                    orders[order][i] += weight * coefficients[3 * term + i];
                    correction[i] += weight * coefficients[3 * term + i];
                }
            }
        }
        (orders, norm(correction))
    }

    /// `dF/dd`: the same sum over the derivatives of the monomials, and over those of the weights.
    pub(super) fn stiffness(
        &self,
        d: [f64; 3],
        orders: &[[f64; 3]; MAX_ORDER],
        weights: &[Dual; MAX_ORDER],
    ) -> Mat3<f64> {
        let model = self.model;
        let mut stiffness = self.stiffness;
        for (force, Gradient { first, .. }) in orders.iter().zip(weights) {
            for i in 0..3 {
                for j in 0..3 {
                    stiffness[i][j] += force[i] * first[j];
                }
            }
        }
        for term in 3..self.terms {
            let part = weights[degree_of(&model.exponents[term]) - 1].value;
            let slope = monomial_gradient(&model.exponents[term], d).map(|x| part * x);
            let mut force = [0.0; 3];
            for (k, &corner) in self.corners.iter().enumerate() {
                let weight = self.corner_weight(k, term);
                let coefficients = &model.position_force(corner)[3 * term..3 * term + 3];
                for i in 0..3 {
                    force[i] += weight * coefficients[i];
                }
            }
            if term < 3 + model.edge_terms {
                for (k, &edge) in self.edges.iter().enumerate() {
                    let weight = 4.0 * self.edge_weights[k];
                    let coefficients = &model.edge_force(edge)[3 * (term - 3)..3 * (term - 3) + 3];
                    for i in 0..3 {
                        force[i] += weight * coefficients[i];
                    }
                }
            }
            for i in 0..3 {
                for j in 0..3 {
                    stiffness[i][j] += force[i] * slope[j];
                }
            }
        }
        stiffness
    }

    /// Mode amplitudes in up to three regions; returns the region of each slot of the workspace.
    pub(super) fn amplitudes(&self, d: [f64; 3], workspace: &mut [f32]) -> [Option<u32>; 3] {
        let mut monomials = [0.0; MAX_TERMS];
        let monomials = &mut monomials[..self.model.n_terms()];
        evaluate_monomials(&self.model.exponents, d, monomials);
        let weights = self.weights(monomials, d);
        for (monomial, exponents) in monomials.iter_mut().zip(&self.model.exponents) {
            *monomial *= weights[degree_of(exponents) - 1].value;
        }
        self.blend(mul_vector(&self.stiffness, &d), monomials, workspace)
    }

    /// The same of the field of one term, as if its monomial were 1 and all others 0.
    pub(super) fn term_amplitudes(&self, term: usize, workspace: &mut [f32]) -> [Option<u32>; 3] {
        let mut monomials = [0.0; MAX_TERMS];
        monomials[term] = 1.0;
        let f = mul_vector(&self.stiffness, &[monomials[0], monomials[1], monomials[2]]);
        self.blend(f, &monomials[..self.model.n_terms()], workspace)
    }

    /// Amplitudes under a first-order force `f` and monomials of higher order.
    fn blend(&self, f: [f64; 3], monomials: &[f64], workspace: &mut [f32]) -> [Option<u32>; 3] {
        let model = self.model;
        let arrays = &model.arrays;
        let stride = model.largest_region;
        workspace[..3 * stride].fill(0.0);
        let mut slots = [None; 3];
        for (k, &corner) in self.corners.iter().enumerate() {
            let region = arrays.position_region[corner];
            let slot = slot_of(&mut slots, region);
            let out =
                &mut workspace[slot * stride..slot * stride + model.region_modes(region).len()];
            // The first order moves as if the corner's own patch carried its share of the force.
            let own = &arrays.answers.compliance[9 * corner..9 * corner + 9];
            let range = model.position_offset[corner]..model.position_offset[corner + 1];
            let rows = arrays.answers.position_coefficients[range].chunks_exact(out.len().max(1));
            for (term, row) in rows.take(self.terms).enumerate() {
                let weight = if term < 3 {
                    let row = &own[3 * term..3 * term + 3];
                    self.weights[k] * (row[0] * f[0] + row[1] * f[1] + row[2] * f[2])
                } else {
                    self.corner_weight(k, term) * monomials[term]
                };
                add_scaled(weight as f32, row, out);
            }
        }
        for (k, &edge) in self.edges.iter().enumerate() {
            let region = arrays.edge_region[edge];
            let slot = slot_of(&mut slots, region);
            let out =
                &mut workspace[slot * stride..slot * stride + model.region_modes(region).len()];
            let range = model.edge_offset[edge]..model.edge_offset[edge + 1];
            let rows = arrays.answers.edge_coefficients[range].chunks_exact(out.len().max(1));
            for (term, row) in rows.take(self.edge_terms()).enumerate() {
                let weight = 4.0 * self.edge_weights[k] * monomials[3 + term];
                add_scaled(weight as f32, row, out);
            }
        }
        slots
    }
}

impl ReducedModel {
    pub(super) fn position_force(&self, position: usize) -> &[f64] {
        let n = 3 * self.n_terms();
        &self.arrays.answers.force[position * n..(position + 1) * n]
    }

    fn edge_force(&self, edge: usize) -> &[f64] {
        let n = 3 * self.edge_terms;
        &self.arrays.answers.edge_force[edge * n..(edge + 1) * n]
    }
}

/// The slot of a region. An edge's region is that of one of its ends (checked on loading), so
/// three slots suffice.
fn slot_of(slots: &mut [Option<u32>; 3], region: u32) -> usize {
    let slot = slots.iter().position(|s| s.is_none_or(|r| r == region)).unwrap_or(0);
    slots[slot] = Some(region);
    slot
}

#[inline(always)]
fn add_scaled(weight: f32, row: &[f32], out: &mut [f32]) {
    if weight != 0.0 {
        out.iter_mut().zip(row).for_each(|(out, &value)| *out += weight * value);
    }
}

fn monomial_gradient(exponents: &[u8; 3], d: [f64; 3]) -> [f64; 3] {
    let power = |i: usize, e: u8| (0..e).fold(1.0, |product, _| product * d[i]);
    std::array::from_fn(|i| {
        let e = exponents[i];
        if e == 0 {
            return 0.0;
        }
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        f64::from(e) * power(i, e - 1) * power(j, exponents[j]) * power(k, exponents[k])
    })
}

/// Euclidean norm.
pub(super) fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
