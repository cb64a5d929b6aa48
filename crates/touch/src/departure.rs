//! How fast the full organ departs from the path that a series continues, by the direction of the touch: a thin part that
//! is pushed along itself turns aside, one that is pulled does not.

use super::interpolation::Interpolation;
use viscera_number::on_sphere;

/// Directions in which departure is known at each position.
pub const DIRECTIONS: usize = 24;

/// The directions: an even cover of the unit sphere.
pub fn directions() -> [[f64; 3]; DIRECTIONS] {
    std::array::from_fn(|k| on_sphere(k, DIRECTIONS))
}

impl Interpolation<'_> {
    /// How fast the organ departs from the path of the series at a contact, under a touch along d:
    ///   max_k (sum_a l_a b_ak) max(0, n_k . d / |d|)^2
    /// over the directions n_k, with what was measured at the corners a, `b_ak`, and their weights l_a.
    pub(super) fn departure(&self, d: [f64; 3]) -> f64 {
        let stored = &self.model.arrays.answers.departure;
        let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        if stored.is_empty() || !(square > 0.0) {
            return 0.0;
        }
        let mut departure: f64 = 0.0;
        for (k, n) in self.model.directions.iter().enumerate() {
            let corners = self.corners.iter().zip(self.weights);
            let b: f64 = corners.map(|(a, l)| l * f64::from(stored[DIRECTIONS * a + k])).sum();
            let along = (n[0] * d[0] + n[1] * d[1] + n[2] * d[2]).max(0.0);
            departure = departure.max(b * along * along);
        }
        departure / square
    }
}
