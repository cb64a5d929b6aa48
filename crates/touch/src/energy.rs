//! The energy of a touch: the work of its force.

use super::contact::Contact;
use super::interpolation::{Interpolation, MAX_TERMS};
use super::model::ReducedModel;
use super::resummation::{MAX_ORDER, NO_PARTS, Products, constant};
use viscera_mesh::dot;
use viscera_number::evaluate_monomials;

/// Half of Gauss's rule of eight points on [-1, 1], which is symmetric: places and weights.
const GAUSS: [[f64; 2]; 4] = [
    [0.183_434_642_495_649_8, 0.362_683_783_378_362],
    [0.525_532_409_916_329, 0.313_706_645_877_887_3],
    [0.796_666_477_413_626_7, 0.222_381_034_453_374_48],
    [0.960_289_856_497_536_3, 0.101_228_536_290_376_26],
];

impl ReducedModel {
    /// Energy that a touch has put into the organ [J]: the work of its force on the straight way to its displacement,
    /// `W = int_0^1 F(t d) . d dt`. It allocates nothing.
    ///
    /// The orders are homogeneous, `F(t d) = sum_p w_p(t d) t^p F_p(d)`, so only their weights are computed along the
    /// way. The rule is exact for polynomials, `w_p = 1`.
    pub fn energy(&self, contact: &Contact, d: [f64; 3]) -> f64 {
        let here = Interpolation::new(self, contact);
        let mut monomials = [0.0; MAX_TERMS];
        let monomials = &mut monomials[..self.n_terms()];
        evaluate_monomials(&self.exponents, d, monomials);
        let (orders, _) = here.force(monomials, d, here.second_order(d).as_ref());
        let work = orders.map(|force| dot(force, d));
        let order = self.metadata.order;
        let mut parts = NO_PARTS;
        let is_pade = here.find_parts(monomials, d, &mut parts);
        let products = Products::new(&parts, order);
        let power_at = |t: f64| -> f64 {
            let powers: [f64; MAX_ORDER] = std::array::from_fn(|p| t.powi(p as i32 + 1));
            let weights = if is_pade {
                products.scaled(&powers).form(order).weights
            } else {
                std::array::from_fn(|_| constant(1.0))
            };
            (0..MAX_ORDER).map(|p| weights[p].value * powers[p] * work[p]).sum()
        };
        let both = |[x, weight]: [f64; 2]| {
            0.5 * weight * (power_at(0.5 * (1.0 + x)) + power_at(0.5 * (1.0 - x)))
        };
        GAUSS.into_iter().map(both).sum()
    }
}
