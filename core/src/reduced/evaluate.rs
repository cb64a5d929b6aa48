//! The on-line evaluator: caller-owned memory, a fixed number of operations, no allocation, no
//! lock, no system call. It knows nothing of finite elements.
//!
//! Between positions the contact patch is the blend of the patches at the triangle's corners with
//! barycentric weights `l`, so the first order is exact there: with `C(s) = sum l_a l_b C_ab`,
//!   f = C(s)^-1 d,   u_1 = sum_a l_a G_a f.
//! Orders up to the edge order are interpolated quadratically through corners and edge midpoints,
//! higher ones linearly.

use super::model::ReducedModel;
use crate::mesh::Patch;
use crate::number::evaluate_monomials;
use crate::series::inverse;
use crate::simd::{Kernel, dispatch};
use crate::tensor::{Mat3, mul_vector, tabulate};

/// Monomials of order 8 in three variables, the constant left out.
const MAX_TERMS: usize = 164;
/// Highest order.
const MAX_ORDER: usize = 8;
/// Part of the quadratic correction that is left as interpolation error (measured: 0.1 to 0.3).
const INTERPOLATION_SHARE: f64 = 0.3;
/// A mode that moves nothing by more than this part of the tool's displacement is left out.
const NEGLIGIBLE: f64 = 1e-5;

/// Where a tool touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Touchable triangle.
    pub triangle: usize,
    /// Barycentric weights of its corners.
    pub weights: [f64; 3],
    /// Closest point of the touchable surface [m].
    pub point: [f64; 3],
    /// Distance to it [m].
    pub distance: f64,
}

/// Whether an answer may be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// The estimated error is within what is allowed at this depth.
    Trusted,
    /// The displacement is larger than the depth the model was made for.
    BeyondDepth,
    /// The estimated error is larger than allowed.
    ErrorTooLarge,
}

/// Force, stiffness and what they are worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Force of the tool on the organ [N].
    pub force: [f64; 3],
    /// Contact stiffness `dF/dd` [N/m].
    pub stiffness: Mat3<f64>,
    /// Estimated error of field and force, relative to their norms; at most 1.
    pub error_estimate: f64,
    /// Whether the estimate is within the allowance.
    pub trust: Trust,
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
    pub fn respond(&self, contact: &Contact, d: [f64; 3]) -> Response {
        let touch = Touch::new(self, contact);
        let mut monomials = [0.0; MAX_TERMS];
        let monomials = &mut monomials[..self.n_terms()];
        evaluate_monomials(&self.exponents, d, monomials);
        let (force, orders, correction) = touch.force(monomials, d);
        let stiffness = touch.stiffness(d);
        let error_estimate = touch.error_estimate(monomials, force, &orders, correction);
        let depth = norm(d);
        // Written so that a displacement that is not a number is not trusted either.
        let trust = if !(depth <= self.metadata.depth * (1.0 + 1e-9)) {
            Trust::BeyondDepth
        } else if error_estimate > allowance(depth / self.metadata.diagonal) {
            Trust::ErrorTooLarge
        } else {
            Trust::Trusted
        };
        Response { force, stiffness, error_estimate, trust }
    }

    /// Numbers of workspace that the field functions need.
    pub fn workspace_len(&self) -> usize {
        3 * self.largest_region
    }

    /// Displacement of the surface nodes [m], `3 * surface_nodes.len()` numbers.
    ///
    /// # Panics
    /// When `workspace` or `out` is too short.
    pub fn surface_displacement(
        &self,
        contact: &Contact,
        d: [f64; 3],
        workspace: &mut [f32],
        out: &mut [f32],
    ) {
        let out = &mut out[..3 * self.arrays.surface_nodes.len()];
        self.combine(contact, d, workspace, &self.arrays.surface_modes, out);
    }

    /// Displacement of the nodes inside [m], `3 * interior_nodes().len()` numbers.
    ///
    /// # Panics
    /// When `workspace` or `out` is too short.
    pub fn interior_displacement(
        &self,
        contact: &Contact,
        d: [f64; 3],
        workspace: &mut [f32],
        out: &mut [f32],
    ) {
        let out = &mut out[..3 * self.interior_nodes.len()];
        self.combine(contact, d, workspace, &self.arrays.interior_modes, out);
    }

    /// Displacement of all nodes [m], `3 * n_points()` numbers. Allocates; for off-line use.
    ///
    /// # Panics
    /// When `workspace` or `out` is too short.
    pub fn displacement(
        &self,
        contact: &Contact,
        d: [f64; 3],
        workspace: &mut [f32],
        out: &mut [f32],
    ) {
        let mut part = vec![0.0; out.len()];
        let mut scatter = |nodes: &[u32], part: &[f32]| {
            for (&node, u) in nodes.iter().zip(part.chunks_exact(3)) {
                out[3 * node as usize..3 * node as usize + 3].copy_from_slice(u);
            }
        };
        self.surface_displacement(contact, d, workspace, &mut part);
        scatter(&self.arrays.surface_nodes, &part);
        self.interior_displacement(contact, d, workspace, &mut part);
        scatter(&self.interior_nodes, &part);
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
        contact: &Contact,
        d: [f64; 3],
        workspace: &mut [f32],
        modes: &[i16],
        out: &mut [f32],
    ) {
        out.fill(0.0);
        let slots = Touch::new(self, contact).amplitudes(d, workspace);
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

    fn region_modes(&self, region: u32) -> std::ops::Range<usize> {
        let starts = &self.arrays.region_start;
        starts[region as usize] as usize..starts[region as usize + 1] as usize
    }
}

/// A model at a contact: corners, edges and interpolation weights.
struct Touch<'a> {
    model: &'a ReducedModel,
    corners: [usize; 3],
    edges: [usize; 3],
    weights: [f64; 3],
    edge_weights: [f64; 3],
    stiffness: Mat3<f64>,
}

impl<'a> Touch<'a> {
    fn new(model: &'a ReducedModel, contact: &Contact) -> Self {
        let t = contact.triangle;
        let corners = model.triangles[t].map(|p| p as usize);
        let edges: [usize; 3] =
            std::array::from_fn(|k| model.arrays.triangle_edges[3 * t + k] as usize);
        let weights = contact.weights;
        let edge_weights = std::array::from_fn(|k| weights[k] * weights[(k + 1) % 3]);
        let mut compliance = tabulate(|_, _| 0.0);
        for k in 0..3 {
            let own = &model.arrays.compliance[9 * corners[k]..9 * corners[k] + 9];
            let cross = &model.arrays.cross_compliance[9 * edges[k]..9 * edges[k] + 9];
            for i in 0..3 {
                for j in 0..3 {
                    // C_ab and C_ba are transposes of each other.
                    compliance[i][j] += weights[k] * weights[k] * own[3 * i + j]
                        + edge_weights[k] * (cross[3 * i + j] + cross[3 * j + i]);
                }
            }
        }
        let stiffness = inverse(&compliance).unwrap_or_else(|| tabulate(|_, _| 0.0));
        Touch { model, corners, edges, weights, edge_weights, stiffness }
    }

    /// Weight of a corner's term: quadratic up to the edge order, linear beyond.
    fn corner_weight(&self, k: usize, term: usize) -> f64 {
        let l = self.weights[k];
        if term < 3 + self.model.edge_terms { l * (2.0 * l - 1.0) } else { l }
    }

    /// Force, its parts by order, and the size of the quadratic correction.
    fn force(&self, monomials: &[f64], d: [f64; 3]) -> ([f64; 3], [[f64; 3]; MAX_ORDER], f64) {
        let model = self.model;
        let mut orders = [[0.0; 3]; MAX_ORDER];
        let mut correction = [0.0; 3];
        orders[0] = mul_vector(&self.stiffness, &d);
        for (k, &corner) in self.corners.iter().enumerate() {
            let coefficients = model.position_force(corner);
            for term in 3..model.n_terms() {
                let order = degree(&model.exponents[term]) - 1;
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
            for term in 0..model.edge_terms {
                let order = degree(&model.exponents[3 + term]) - 1;
                let weight = 4.0 * self.edge_weights[k] * monomials[3 + term];
                for i in 0..3 {
                    orders[order][i] += weight * coefficients[3 * term + i];
                    correction[i] += weight * coefficients[3 * term + i];
                }
            }
        }
        let total = std::array::from_fn(|i| orders.iter().map(|f| f[i]).sum());
        (total, orders, norm(correction))
    }

    /// `dF/dd`: the same sum over the derivatives of the monomials.
    fn stiffness(&self, d: [f64; 3]) -> Mat3<f64> {
        let model = self.model;
        let mut stiffness = self.stiffness;
        for term in 3..model.n_terms() {
            let slope = monomial_gradient(&model.exponents[term], d);
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

    /// Estimated relative error: the tail of the series as a geometric one whose ratio is that of
    /// its last orders extrapolated, plus interpolation, plus compression.
    fn error_estimate(
        &self,
        monomials: &[f64],
        force: [f64; 3],
        orders: &[[f64; 3]; MAX_ORDER],
        correction: f64,
    ) -> f64 {
        let model = self.model;
        let order = model.metadata.order;
        let size = self.field_norms(monomials);
        if !(size[0] > 0.0) {
            return 0.0;
        }
        let last = size[order - 1];
        let mut ratio = last / size[order - 2].max(f64::MIN_POSITIVE);
        if order > 2 {
            ratio = ratio.max((last / size[order - 3].max(f64::MIN_POSITIVE)).sqrt());
        }
        // At a limit point the solution branches like a square root, whose coefficients have
        // ratios that grow with the order p as 1 - 3/(2p): extrapolated to the tail.
        ratio /= 1.0 - 1.5 / order as f64;
        if !(ratio < 0.9) {
            return 1.0;
        }
        let tail = ratio / (1.0 - ratio);
        let force_size = norm(force).max(f64::MIN_POSITIVE);
        let truncation = (tail * last / size[0]).max(tail * norm(orders[order - 1]) / force_size);
        let interpolation = INTERPOLATION_SHARE * correction / force_size;
        let depth = (monomials[0].powi(2) + monomials[1].powi(2) + monomials[2].powi(2)).sqrt();
        let stored = &model.arrays.compression;
        let worst: f64 = (0..3).map(|k| self.weights[k] * f64::from(stored[self.corners[k]])).sum();
        let compression = worst * depth / model.metadata.depth;
        (truncation + interpolation + compression).min(1.0)
    }

    /// `|u_p(d)|` of each order, interpolated linearly.
    fn field_norms(&self, monomials: &[f64]) -> [f64; MAX_ORDER] {
        let model = self.model;
        let mut size = [0.0; MAX_ORDER];
        let squares = model.arrays.norms.len() / model.n_positions();
        for (k, &corner) in self.corners.iter().enumerate() {
            let mut rest = &model.arrays.norms[corner * squares..(corner + 1) * squares];
            let mut term = 0;
            for (order, size) in size.iter_mut().enumerate().take(model.metadata.order) {
                let n = (order + 2) * (order + 3) / 2;
                let (gram, after) = rest.split_at(n * n);
                let m = &monomials[term..term + n];
                let mut square = 0.0;
                for i in 0..n {
                    let row: f64 = gram[i * n..(i + 1) * n]
                        .iter()
                        .zip(m)
                        .map(|(&g, m)| f64::from(g) * m)
                        .sum();
                    square += m[i] * row;
                }
                *size += self.weights[k] * square.max(0.0).sqrt();
                (rest, term) = (after, term + n);
            }
        }
        size
    }

    /// Mode amplitudes in up to three regions; returns the region of each slot of the workspace.
    fn amplitudes(&self, d: [f64; 3], workspace: &mut [f32]) -> [Option<u32>; 3] {
        let model = self.model;
        let arrays = &model.arrays;
        let stride = model.largest_region;
        workspace[..3 * stride].fill(0.0);
        let mut monomials = [0.0; MAX_TERMS];
        let monomials = &mut monomials[..model.n_terms()];
        evaluate_monomials(&model.exponents, d, monomials);
        let f = mul_vector(&self.stiffness, &d);
        let mut slots = [None; 3];
        for (k, &corner) in self.corners.iter().enumerate() {
            let region = arrays.position_region[corner];
            let slot = slot_of(&mut slots, region);
            let out =
                &mut workspace[slot * stride..slot * stride + model.region_modes(region).len()];
            // The first order moves as if the corner's own patch carried its share of the force.
            let own = &arrays.compliance[9 * corner..9 * corner + 9];
            let range = model.position_offset[corner]..model.position_offset[corner + 1];
            let rows = arrays.position_coefficients[range].chunks_exact(out.len().max(1));
            for (term, row) in rows.enumerate() {
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
            let rows = arrays.edge_coefficients[range].chunks_exact(out.len().max(1));
            for (term, row) in rows.enumerate() {
                let weight = 4.0 * self.edge_weights[k] * monomials[3 + term];
                add_scaled(weight as f32, row, out);
            }
        }
        slots
    }
}

impl ReducedModel {
    fn position_force(&self, position: usize) -> &[f64] {
        let n = 3 * self.n_terms();
        &self.arrays.force[position * n..(position + 1) * n]
    }

    fn edge_force(&self, edge: usize) -> &[f64] {
        let n = 3 * self.edge_terms;
        &self.arrays.edge_force[edge * n..(edge + 1) * n]
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

fn degree(exponents: &[u8; 3]) -> usize {
    exponents.iter().map(|&e| e as usize).sum()
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

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// `out += sum_m amplitude_m scale_m mode_m`, four modes at a time.
struct Combine<'a> {
    amplitudes: &'a [f32],
    scales: &'a [f32],
    modes: &'a [i16],
    negligible: f32,
    out: &'a mut [f32],
}

impl Kernel for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let rows = self.out.len();
        let mut batch = [(0.0f32, 0usize); 4];
        let mut filled = 0;
        for (m, (&a, &scale)) in self.amplitudes.iter().zip(self.scales).enumerate() {
            let factor = a * scale;
            if factor.abs() <= self.negligible {
                continue;
            }
            batch[filled] = (factor, m);
            filled += 1;
            if filled == 4 {
                let mode = |k: usize| &self.modes[batch[k].1 * rows..(batch[k].1 + 1) * rows];
                let (m0, m1, m2, m3) = (mode(0), mode(1), mode(2), mode(3));
                let [f0, f1, f2, f3] = batch.map(|(factor, _)| factor);
                for i in 0..rows {
                    self.out[i] += f0 * f32::from(m0[i])
                        + f1 * f32::from(m1[i])
                        + f2 * f32::from(m2[i])
                        + f3 * f32::from(m3[i]);
                }
                filled = 0;
            }
        }
        for &(factor, m) in &batch[..filled] {
            let mode = &self.modes[m * rows..(m + 1) * rows];
            for (out, &q) in self.out.iter_mut().zip(mode) {
                *out += factor * f32::from(q);
            }
        }
    }
}
