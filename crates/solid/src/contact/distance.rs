//! The distance of a point from a shape.

use crate::tensor::Mat3;

/// The distance of a point from a shape, negative inside.
#[derive(Clone, Copy, Debug)]
pub struct Distance {
    /// The distance [m].
    pub gap: f64,
    /// Its gradient, of length 1.
    pub normal: [f64; 3],
    /// Its second derivative [1/m].
    pub curvature: Mat3<f64>,
}
