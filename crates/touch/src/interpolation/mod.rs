//! A model at a contact: what its corners and edges know, interpolated to the point touched.
//!
//! Between positions the contact patch is the blend of the patches at the triangle's corners with
//! barycentric weights `l`, so the first order is exact there: with `C(s) = sum l_a l_b C_ab`,
//!   f = C(s)^-1 d,   u_1 = sum_a l_a G_a f.
//! The second order is exact too, see `second_order`. Orders from there up to the edge order are interpolated
//! quadratically through corners and edge midpoints, higher ones linearly.

mod second_order;

use super::combine::Blend;
use super::contact::Contact;
use super::forms::SECOND;
use super::model::ReducedModel;
use super::resummation::{Dual, MAX_ORDER, NO_PARTS, Parts, Products, SKETCH, constant};
use second_order::SecondOrder;
use viscera_number::simd::{Kernel, dispatch};
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
    pub(super) triangle: usize,
    pub(super) corners: [usize; 3],
    pub(super) edges: [usize; 3],
    pub(super) weights: [f64; 3],
    pub(super) edge_weights: [f64; 3],
    /// `C(s)^-1` [N/m].
    pub(super) stiffness: Mat3<f64>,
    /// Monomials taken into account.
    terms: usize,
}

impl<'a> Interpolation<'a> {
    pub(super) fn new(model: &'a ReducedModel, contact: &Contact) -> Self {
        let triangle = contact.triangle;
        let corners = model.triangles[triangle].map(|p| p as usize);
        let edges: [usize; 3] =
            std::array::from_fn(|k| model.arrays.triangle_edges[3 * triangle + k] as usize);
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
        Interpolation { model, triangle, corners, edges, weights, edge_weights, stiffness, terms }
    }

    /// Whether the second order is known exactly between positions, and asked for.
    pub(super) fn is_second_exact(&self) -> bool {
        !self.model.arrays.answers.edge_energy.is_empty() && self.terms >= SECOND.end
    }

    /// Where the terms begin that are interpolated.
    pub(super) fn first_blended(&self) -> usize {
        if self.is_second_exact() { SECOND.end } else { SECOND.start }
    }

    /// Compliance of the patch at corner k, or at edge midpoint k - 3.
    pub(super) fn place_compliance(&self, k: usize) -> Mat3<f64> {
        let answers = &self.model.arrays.answers;
        let own = |k: usize| -> &[f64] {
            &answers.compliance[9 * self.corners[k]..9 * self.corners[k] + 9]
        };
        if k < 3 {
            let own = own(k);
            return tabulate!(|i, j| own[3 * i + j]);
        }
        let (a, b) = (own(k - 3), own((k - 2) % 3));
        let cross = &answers.cross_compliance[9 * self.edges[k - 3]..9 * self.edges[k - 3] + 9];
        tabulate!(|i, j| {
            0.25 * (a[3 * i + j] + b[3 * i + j] + cross[3 * i + j] + cross[3 * j + i])
        })
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
        let mut parts = NO_PARTS;
        if self.find_parts(monomials, d, &mut parts) {
            let order = self.model.metadata.order;
            return Products::new(&parts, order).form(order).weights;
        }
        std::array::from_fn(|_| constant(1.0))
    }

    /// Adds the part of each order in the sketch, blended from the corners; false if orders are summed as a polynomial.
    pub(super) fn find_parts(&self, monomials: &[f64], d: [f64; 3], parts: &mut Parts) -> bool {
        let model = self.model;
        if model.arrays.answers.sketch.is_empty()
            || self.terms < model.n_terms()
            || model.metadata.order < 3
        {
            return false;
        }
        dispatch(Sketch { at: self, monomials, d, parts });
        true
    }

    /// The parts of the force by order, and the size of the quadratic correction.
    pub(super) fn force(
        &self,
        monomials: &[f64],
        d: [f64; 3],
        second: Option<&SecondOrder>,
    ) -> ([[f64; 3]; MAX_ORDER], f64) {
        let model = self.model;
        let mut orders = [[0.0; 3]; MAX_ORDER];
        let mut correction = [0.0; 3];
        orders[0] = mul_vector(&self.stiffness, &d);
        if let Some(second) = second {
            orders[1] = second.force;
        }
        let first = self.first_blended();
        for (k, &corner) in self.corners.iter().enumerate() {
            let coefficients = model.position_force(corner);
            for term in first..self.terms {
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
            for term in first - 3..self.edge_terms() {
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
        second: Option<&SecondOrder>,
    ) -> Mat3<f64> {
        let model = self.model;
        let mut stiffness = self.stiffness;
        if let Some(second) = second {
            let part = weights[1].value;
            stiffness = tabulate!(|i, j| stiffness[i][j] + part * second.stiffness[i][j]);
        }
        for (force, Gradient { first, .. }) in orders.iter().zip(weights) {
            for i in 0..3 {
                for j in 0..3 {
                    stiffness[i][j] += force[i] * first[j];
                }
            }
        }
        for term in self.first_blended()..self.terms {
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
        let second = self.second_order(d).map(|second| (second, weights[1].value));
        self.blend(mul_vector(&self.stiffness, &d), second.as_ref(), monomials, workspace)
    }

    /// The same of the field of one term, as if its monomial were 1 and all others 0.
    pub(super) fn term_amplitudes(&self, term: usize, workspace: &mut [f32]) -> [Option<u32>; 3] {
        let mut monomials = [0.0; MAX_TERMS];
        monomials[term] = 1.0;
        let f = mul_vector(&self.stiffness, &[monomials[0], monomials[1], monomials[2]]);
        let second = if SECOND.contains(&term) { self.second_order_term(term) } else { None };
        let second = second.map(|second| (second, 1.0));
        self.blend(f, second.as_ref(), &monomials[..self.model.n_terms()], workspace)
    }

    /// Amplitudes under a first-order force `f`, a second order with its weight, and monomials of higher order.
    fn blend(
        &self,
        f: [f64; 3],
        second: Option<&(SecondOrder, f64)>,
        monomials: &[f64],
        workspace: &mut [f32],
    ) -> [Option<u32>; 3] {
        let model = self.model;
        let arrays = &model.arrays;
        let stride = model.largest_region;
        workspace[..3 * stride].fill(0.0);
        let first = self.first_blended();
        let of_second = |k: usize, term: usize| {
            let at = |(second, weight): &(SecondOrder, f64)| weight * second.monomials[k][term];
            self.shape(k) * second.map_or(0.0, at)
        };
        let mut slots = [None; 3];
        for (k, &corner) in self.corners.iter().enumerate() {
            let region = arrays.position_region[corner];
            let slot = slot_of(&mut slots, region);
            let out =
                &mut workspace[slot * stride..slot * stride + model.region_modes(region).len()];
            let linear = self.linear_displacement(k, f, second);
            let range = model.position_offset[corner]..model.position_offset[corner + 1];
            let mut weights = [0.0; MAX_TERMS];
            for (term, weight) in weights[..self.terms].iter_mut().enumerate() {
                *weight = if term < SECOND.start {
                    linear[term]
                } else if term < first {
                    of_second(k, term - SECOND.start)
                } else {
                    self.corner_weight(k, term) * monomials[term]
                } as f32;
            }
            let rows = &arrays.answers.position_coefficients[range];
            dispatch(Blend { weights: &weights[..self.terms], rows, out });
        }
        for (k, &edge) in self.edges.iter().enumerate() {
            let region = arrays.edge_region[edge];
            let slot = slot_of(&mut slots, region);
            let out =
                &mut workspace[slot * stride..slot * stride + model.region_modes(region).len()];
            let range = model.edge_offset[edge]..model.edge_offset[edge + 1];
            let mut weights = [0.0; MAX_TERMS];
            for (term, weight) in weights[..self.edge_terms()].iter_mut().enumerate() {
                *weight = if SECOND.start + term < first {
                    of_second(3 + k, term)
                } else {
                    4.0 * self.edge_weights[k] * monomials[3 + term]
                } as f32;
            }
            let rows = &arrays.answers.edge_coefficients[range];
            dispatch(Blend { weights: &weights[..self.edge_terms()], rows, out });
        }
        slots
    }

    /// What the linear rows of corner k are multiplied by. The first order moves as if the corner's own patch carried
    /// its share of the force `f`.
    fn linear_displacement(
        &self,
        k: usize,
        f: [f64; 3],
        second: Option<&(SecondOrder, f64)>,
    ) -> [f64; 3] {
        let own = mul_vector(&self.place_compliance(k), &f).map(|x| self.weights[k] * x);
        let Some((second, weight)) = second else { return own };
        let held = self.constraint_displacement(k, second);
        std::array::from_fn(|i| own[i] + weight * held[i])
    }
}

/// The parts of a touch in the sketch, compiled for the processor's vectors.
struct Sketch<'a> {
    at: &'a Interpolation<'a>,
    monomials: &'a [f64],
    d: [f64; 3],
    parts: &'a mut Parts,
}

impl Kernel for Sketch<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Sketch { at, monomials, d, parts } = self;
        let (model, [l0, l1, l2]) = (at.model, at.weights);
        let size = SKETCH * model.n_terms();
        let rows = at
            .corners
            .map(|c| model.arrays.answers.sketch[c * size..(c + 1) * size].as_chunks::<SKETCH>().0);
        for (term, exponents) in model.exponents.iter().enumerate() {
            let (value, slope) = (monomials[term], monomial_gradient(exponents, d));
            let [r0, r1, r2] = rows.map(|rows| &rows[term]);
            let part = &mut parts[degree_of(exponents) - 1];
            for s in 0..SKETCH {
                let blend = l0 * f64::from(r0[s]) + l1 * f64::from(r1[s]) + l2 * f64::from(r2[s]);
                part.value[s] += blend * value;
                (0..3).for_each(|i| part.first[i][s] += blend * slope[i]);
            }
        }
    }
}

impl ReducedModel {
    pub(super) fn position_force(&self, position: usize) -> &[f64] {
        let n = 3 * self.n_terms();
        &self.arrays.answers.force[position * n..(position + 1) * n]
    }

    pub(super) fn edge_force(&self, edge: usize) -> &[f64] {
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
