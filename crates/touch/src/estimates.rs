//! What an answer is worth: how far corners and edges disagree at a contact, what the last order changes, and what the
//! rest of the series and interpolation may leave.

use super::departure::{DIRECTIONS, along};
use super::interpolation::{Interpolation, norm};
use super::metadata::Metadata;
use super::resummation::{Dual, Form, MAX_ORDER, NO_PARTS, Parts, Products, SKETCH, constant};
use viscera_number::degree_of;

/// An extrapolated tail is no bound: without it one trusted answer in some hundreds was 1.06 times
/// its estimate from the truth.
const MARGIN: f64 = 1.25;
/// The difference of the last two Padé forms is no bound either: the error of trusted answers was up to 1.7 times it.
const PADE_MARGIN: f64 = 1.6;
/// Part of the quadratic correction that is left as interpolation error where nothing was measured.
const INTERPOLATION_SHARE: f64 = 0.5;
/// The rest of the series, in units of the geometric mean of its last order and of what that changes, and of the weight of
/// what was measured in these units. This margin and the next two are fitted to the touches of `benchmarks/trust.py tuning`.
const TRUNCATION_MARGIN: f64 = 1.1;
/// Takes the place of what was not measured.
const TRUNCATION_SHARE: f64 = 0.53;
/// The error of interpolation, in units of what was measured at centroids.
const INTERPOLATION_MARGIN: f64 = 2.0;
/// The same of files whose second order is interpolated: at least the estimate of the version that wrote them.
const OLD_INTERPOLATION_MARGIN: f64 = 4.0;
/// How much an order that is interpolated linearly counts in the disagreement of the corners.
const LINEAR: f64 = 4.0;
/// How much the quadratic correction of the force counts there.
const CORRECTION: f64 = 0.25;

/// How much the measured share of the rest of the series counts: half of what a model says of itself, half of what models have
/// in common. A share above 1 counts in full: there the last order is small by the form of the law, and tells little.
fn weight(share: f64) -> f64 {
    share.sqrt().max(share)
}

/// The share of the rest of the series with which the estimate of its truncation is an error, where the rest is in proportion
/// to another number.
pub fn truncation_share(error: f64, rest: f64) -> f64 {
    let weight = error / (TRUNCATION_MARGIN * rest);
    if weight < 1.0 { weight * weight } else { weight }
}

/// How much each order counts.
type Weights = [Dual; MAX_ORDER];
/// The part of each order in a force.
type Orders = [[f64; 3]; MAX_ORDER];

/// How much each order of the series counts, and what the sketch tells about the sum.
pub(super) struct OrderWeights {
    pub weights: [Dual; MAX_ORDER],
    sketched: Option<Sketched>,
}

/// What the sketch tells about a field that is summed in its Padé form.
struct Sketched {
    /// Weights less those of the form of one order less.
    difference: [f64; MAX_ORDER],
    /// Norm of what the last order has changed, relative to the field.
    change: f64,
    /// How far the fields of the corners are from their blend, relative to it.
    spread: f64,
    /// By how much errors grow as a pole comes near: one over the denominator of the form, at least 1.
    magnification: f64,
}

/// Estimated relative errors of an answer, at most 1.
pub(super) struct Estimates {
    pub force: f64,
    pub shape: f64,
}

impl Interpolation<'_> {
    /// How much each order counts, and what the sketch tells about the sum.
    pub(super) fn order_weights(&self, monomials: &[f64], d: [f64; 3]) -> OrderWeights {
        let mut parts = NO_PARTS;
        if !self.find_parts(monomials, d, &mut parts) {
            return OrderWeights {
                weights: std::array::from_fn(|_| constant(1.0)),
                sketched: None,
            };
        }
        let order = self.model.metadata.order;
        let products = Products::new(&parts, order);
        let lower = products.form(order - 1).weights;
        let Form { weights, denominator } = products.form(order);
        let difference: [f64; MAX_ORDER] = std::array::from_fn(|p| {
            let before = if p + 1 < order { lower[p].value } else { 0.0 };
            if p < order { weights[p].value - before } else { 0.0 }
        });
        let (mut changed, mut all) = ([0.0; SKETCH], [0.0; SKETCH]);
        for (part, (change, weight)) in parts.iter().zip(difference.iter().zip(&weights)) {
            for s in 0..SKETCH {
                changed[s] += change * part.value[s];
                all[s] += weight.value * part.value[s];
            }
        }
        let norm = |sums: [f64; SKETCH]| sums.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (change, whole) = (norm(changed), norm(all));
        let spread = self.spread(monomials, &parts, &weights) / whole;
        OrderWeights {
            weights,
            sketched: Some(Sketched {
                difference,
                change: change / whole,
                spread,
                magnification: self.magnification(denominator),
            }),
        }
    }

    /// `sum_p c_p w_p (sum_k l_k |v_kp - v_p|^2)^(1/2)` over the orders p that are interpolated, of the corners k: their
    /// sketches v_kp beside the blend v_p.
    fn spread(&self, monomials: &[f64], parts: &Parts, weights: &Weights) -> f64 {
        let model = self.model;
        let size = SKETCH * model.n_terms();
        let first = self.first_blended();
        let mut squares = [0.0; MAX_ORDER];
        for (k, &corner) in self.corners.iter().enumerate() {
            let mut own = [[0.0; SKETCH]; MAX_ORDER];
            let rows = model.arrays.answers.sketch[corner * size..(corner + 1) * size]
                .chunks_exact(SKETCH);
            for ((row, exponents), monomial) in
                rows.zip(&model.exponents).zip(monomials).skip(first)
            {
                let part = &mut own[degree_of(exponents) - 1];
                part.iter_mut().zip(row).for_each(|(sum, &x)| *sum += f64::from(x) * monomial);
            }
            for ((square, own), blend) in squares.iter_mut().zip(&own).zip(parts) {
                let apart = own.iter().zip(&blend.value).map(|(x, y)| (x - y).powi(2));
                *square += self.weights[k] * apart.sum::<f64>();
            }
        }
        self.sum_of_spreads(&squares, weights)
    }

    /// The same of the forces of the corners beside what is made of them.
    fn force_spread(&self, monomials: &[f64], orders: &Orders, weights: &Weights) -> f64 {
        let model = self.model;
        let first = self.first_blended();
        let mut squares = [0.0; MAX_ORDER];
        for (k, &corner) in self.corners.iter().enumerate() {
            let mut own = [[0.0; 3]; MAX_ORDER];
            let rows = self.model.position_force(corner).chunks_exact(3);
            for ((row, exponents), monomial) in
                rows.zip(&model.exponents).zip(monomials).skip(first)
            {
                let part = &mut own[degree_of(exponents) - 1];
                part.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * monomial);
            }
            for ((square, own), blend) in squares.iter_mut().zip(&own).zip(orders) {
                let apart = own.iter().zip(blend).map(|(x, y)| (x - y).powi(2));
                *square += self.weights[k] * apart.sum::<f64>();
            }
        }
        self.sum_of_spreads(&squares, weights)
    }

    fn sum_of_spreads(&self, squares: &[f64; MAX_ORDER], weights: &Weights) -> f64 {
        let Metadata { order, edge_order, .. } = self.model.metadata;
        let counts = |p: usize| if p < edge_order { 1.0 } else { LINEAR };
        // Exact orders have nothing to disagree about.
        let exact = if self.is_second_exact() { 2 } else { 1 };
        (exact..order).map(|p| counts(p) * weights[p].value.abs() * squares[p].sqrt()).sum()
    }

    /// How much corners and edges disagree at a contact, relative to the answer: what the errors of
    /// interpolation, of force and of field, are in proportion to.
    pub(super) fn disagreement(
        &self,
        monomials: &[f64],
        (orders, correction): &(Orders, f64),
        force: f64,
        order_weights: &OrderWeights,
    ) -> Option<[f64; 2]> {
        let sketched = order_weights.sketched.as_ref()?;
        let force = force.max(f64::MIN_POSITIVE);
        let common = sketched.spread + CORRECTION * correction / force;
        let of_force = self.force_spread(monomials, orders, &order_weights.weights) / force;
        Some([common + of_force, common].map(|of| sketched.magnification * of))
    }

    /// Files from before poles were seen have shares in units that do not grow.
    fn magnification(&self, denominator: f64) -> f64 {
        if self.model.metadata.is_pole_aware { denominator.recip().max(1.0) } else { 1.0 }
    }

    /// What the last order changes in field and force, relative to them; none where the orders are summed as a polynomial.
    fn change(
        &self,
        orders: &Orders,
        force: f64,
        order_weights: &OrderWeights,
    ) -> Option<[f64; 2]> {
        let sketched = order_weights.sketched.as_ref()?;
        let parts = sketched.difference.iter().zip(orders);
        let change =
            parts.fold([0.0; 3], |sum, (w, force)| std::array::from_fn(|i| sum[i] + w * force[i]));
        Some([sketched.change, norm(change) / force])
    }

    /// What the rest of the series is in proportion to: the geometric mean of the size of the last order, relative to the
    /// first, and of what it changes.
    fn last_order(
        &self,
        size: &[f64; MAX_ORDER],
        [field, force]: [f64; 2],
        order_weights: &OrderWeights,
    ) -> f64 {
        let last = size[self.model.metadata.order - 1] / size[0];
        let magnification = order_weights.sketched.as_ref().map_or(1.0, |of| of.magnification);
        magnification * (last * field.hypot(force)).sqrt()
    }

    /// What the rest of the series is in proportion to.
    pub(super) fn truncation(
        &self,
        monomials: &[f64],
        orders: &Orders,
        force: f64,
        order_weights: &OrderWeights,
    ) -> Option<f64> {
        let change = self.change(orders, force.max(f64::MIN_POSITIVE), order_weights)?;
        Some(self.last_order(&self.field_norms(monomials), change, order_weights))
    }

    /// Estimated relative errors: of the sum over the orders, of interpolation, and what a parameter
    /// between its nodes costs; of the field also what its compression loses.
    pub(super) fn error_estimates(
        &self,
        monomials: &[f64],
        force: [f64; 3],
        parts: &(Orders, f64),
        order_weights: &OrderWeights,
    ) -> Estimates {
        let model = self.model;
        let (orders, correction) = parts;
        let size = self.field_norms(monomials);
        if !(size[0] > 0.0) {
            return Estimates { force: 0.0, shape: 0.0 };
        }
        let force_size = norm(force).max(f64::MIN_POSITIVE);
        let depth = (monomials[0].powi(2) + monomials[1].powi(2) + monomials[2].powi(2)).sqrt();
        let compression = self.compression(depth / model.metadata.depth);
        let parameter = model.metadata.errors.parameter;
        let change = self.change(orders, force_size, order_weights);
        let shares = model.metadata.interpolation_shares;
        let disagreement = self.disagreement(monomials, parts, force_size, order_weights);
        if let (Some([field, force]), Some(shares), Some(disagreement)) =
            (change, shares, disagreement)
        {
            let share = model.metadata.truncation_share.unwrap_or(TRUNCATION_SHARE);
            let last = self.last_order(&size, [field, force], order_weights);
            let departure = self.departure([monomials[0], monomials[1], monomials[2]]);
            let truncation =
                (TRUNCATION_MARGIN * weight(share) * last).max(departure * last.powi(3));
            let is_exact = self.is_second_exact();
            let margin = if is_exact { INTERPOLATION_MARGIN } else { OLD_INTERPOLATION_MARGIN };
            let [force, shape]: [f64; 2] = std::array::from_fn(|k| {
                let interpolation = margin * shares[k] * disagreement[k];
                // They know nothing of each other: their squares add up.
                truncation.hypot(interpolation) + parameter
            });
            let shape = force.max(shape) + compression;
            return Estimates { force: force.min(1.0), shape: shape.min(1.0) };
        }
        let polynomial = MARGIN * self.polynomial_error(&size, force_size, orders);
        let truncation = match change {
            None => polynomial,
            Some([field, force]) => {
                let pade = PADE_MARGIN * field.max(force);
                // Where the polynomial is good the difference of two Padé forms is far too careful.
                (pade * pade.min(polynomial)).sqrt()
            }
        };
        let interpolation = INTERPOLATION_SHARE * correction / force_size;
        let force = truncation + MARGIN * interpolation + parameter;
        Estimates { force: force.min(1.0), shape: (force + compression).min(1.0) }
    }

    /// How fast the organ departs from the path of the series at a contact, under a touch along d: what was measured at the
    /// corners, blended by their weights.
    fn departure(&self, d: [f64; 3]) -> f64 {
        let stored = &self.model.arrays.answers.departure;
        if stored.is_empty() {
            return 0.0;
        }
        along(d, &self.model.directions, |k| {
            let corners = self.corners.iter().zip(self.weights);
            corners.map(|(a, l)| l * f64::from(stored[DIRECTIONS * a + k])).sum()
        })
    }

    /// What the compression of the field loses, relative to it, at a share of the full depth: of the
    /// first order the same at any depth, of the others in proportion to it.
    pub(super) fn compression(&self, share: f64) -> f64 {
        let stored = &self.model.arrays.answers;
        let at = |values: &[f32]| -> f64 {
            let of = |k: usize| values.get(self.corners[k]).copied().unwrap_or(0.0);
            (0..3).map(|k| self.weights[k] * f64::from(of(k))).sum()
        };
        at(&stored.linear_compression) + share * at(&stored.compression)
    }

    /// The tail of the polynomial as a geometric series whose ratio is that of the last orders
    /// extrapolated; infinite where that says nothing.
    fn polynomial_error(
        &self,
        size: &[f64; MAX_ORDER],
        force_size: f64,
        orders: &[[f64; 3]; MAX_ORDER],
    ) -> f64 {
        let order = self.model.metadata.order;
        let last = size[order - 1];
        let mut ratio = last / size[order - 2].max(f64::MIN_POSITIVE);
        if order > 2 {
            ratio = ratio.max((last / size[order - 3].max(f64::MIN_POSITIVE)).sqrt());
        }
        // At a limit point the solution branches like a square root, whose coefficients have
        // ratios that grow with the order p as 1 - 3/(2p): extrapolated to the tail.
        ratio /= 1.0 - 1.5 / order as f64;
        if !(ratio < 0.9) {
            return f64::INFINITY;
        }
        let tail = ratio / (1.0 - ratio);
        (tail * last / size[0]).max(tail * norm(orders[order - 1]) / force_size)
    }

    /// `|u_p(d)|` of each order, interpolated linearly.
    fn field_norms(&self, monomials: &[f64]) -> [f64; MAX_ORDER] {
        let model = self.model;
        let mut size = [0.0; MAX_ORDER];
        let squares = model.arrays.answers.norms.len() / model.n_positions();
        for (k, &corner) in self.corners.iter().enumerate() {
            let mut rest = &model.arrays.answers.norms[corner * squares..(corner + 1) * squares];
            let (mut term, mut unit) = (0, 1.0);
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
                *size += self.weights[k] * square.max(0.0).sqrt() / unit;
                unit *= model.metadata.norm_length;
                (rest, term) = (after, term + n);
            }
        }
        size
    }
}
