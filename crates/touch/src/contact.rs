//! Where a tool touches.

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
