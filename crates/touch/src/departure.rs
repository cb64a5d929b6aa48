//! How fast the full organ departs from the path that a series continues, by the direction of the touch: a thin part that
//! is pushed along itself turns aside, one that is pulled does not.

use viscera_number::on_sphere;

/// Directions in which departure is known at each position.
pub const DIRECTIONS: usize = 24;

/// The directions: an even cover of the unit sphere.
pub fn directions() -> [[f64; 3]; DIRECTIONS] {
    std::array::from_fn(|k| on_sphere(k, DIRECTIONS))
}

/// The departure under a touch along d, of that in each direction, `b_k`:
///   max_k b_k max(0, n_k . d / |d|)^2.
pub(super) fn along(
    d: [f64; 3],
    directions: &[[f64; 3]; DIRECTIONS],
    b: impl Fn(usize) -> f64,
) -> f64 {
    let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let shares = directions.iter().enumerate().map(|(k, n)| {
        let along = (n[0] * d[0] + n[1] * d[1] + n[2] * d[2]).max(0.0);
        b(k) * along * along
    });
    if square > 0.0 { shares.fold(0.0, f64::max) / square } else { 0.0 }
}
