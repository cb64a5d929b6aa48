//! The linear tetrahedron: constant deformation gradient, one quadrature point (four give the
//! same and cost four times as much, because the gradient is constant).

use super::Shape;
use crate::tensor::{cofactor, determinant};

/// Rest geometry of one tetrahedron.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
    /// Gradients of the barycentric coordinates 1, 2 and 3 [1/m]; that of coordinate 0 is minus their sum.
    pub gradients: [[f64; 3]; 3],
    /// Volume [m^3], positive for the orientation `(x1-x0) x (x2-x0) . (x3-x0) > 0`.
    pub volume: f64,
}

impl Geometry {
    /// From its four vertices.
    pub fn new(x: [[f64; 3]; 4]) -> Self {
        let edges: [[f64; 3]; 3] =
            std::array::from_fn(|a| std::array::from_fn(|i| x[a + 1][i] - x[0][i]));
        let cofactor = cofactor(&edges);
        let determinant = determinant(&edges, &cofactor);
        let gradients = cofactor.map(|row| row.map(|entry| entry / determinant));
        Geometry { gradients, volume: determinant / 6.0 }
    }
}

/// Linear shape functions: the barycentric coordinates.
pub struct Tet4;

const SLOPES: [[f64; 3]; 4] =
    [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Shape<4> for Tet4 {
    const POINTS: usize = 1;
    const LOADS: [f64; 4] = [0.25; 4];

    #[inline(always)]
    fn slopes(_point: usize) -> &'static [[f64; 3]; 4] {
        &SLOPES
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::dot;

    const X: [[f64; 3]; 4] = [[0.1, 0.2, 0.0], [1.3, 0.1, 0.2], [0.2, 1.1, -0.1], [0.3, 0.4, 0.9]];

    #[test]
    fn barycentric_coordinates_are_nodal() {
        let tet = Geometry::new(X);
        for a in 0..3 {
            for b in 0..4 {
                let along: [f64; 3] = std::array::from_fn(|i| X[b][i] - X[(b + 1) % 4][i]);
                let expected = (a + 1 == b) as i32 - (a + 1 == (b + 1) % 4) as i32;
                assert!((dot(&tet.gradients[a], &along) - expected as f64).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn the_unit_tetrahedron_has_a_sixth() {
        let unit = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!((Geometry::new(unit).volume - 1.0 / 6.0).abs() < 1e-16);
        let flipped = [unit[0], unit[2], unit[1], unit[3]];
        assert!(Geometry::new(flipped).volume < 0.0);
    }
}
