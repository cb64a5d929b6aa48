//! The linear tetrahedron: constant deformation gradient, one quadrature point (four give the
//! same and cost four times as much, because the gradient is constant).

use crate::tensor::{cofactor, determinant};

/// Reference geometry of one linear tetrahedron.
#[derive(Clone, Copy, Debug)]
pub struct Tet4 {
    /// Gradients of the four shape functions [1/m].
    pub gradients: [[f64; 3]; 4],
    /// Volume [m^3], positive for the orientation `(x1-x0) x (x2-x0) . (x3-x0) > 0`.
    pub volume: f64,
}

impl Tet4 {
    /// From its four vertices.
    pub fn new(x: [[f64; 3]; 4]) -> Self {
        let edges: [[f64; 3]; 3] =
            std::array::from_fn(|a| std::array::from_fn(|i| x[a + 1][i] - x[0][i]));
        // Rows of the cofactor over the determinant: gradients of shape functions 1, 2, 3.
        let cofactor = cofactor(&edges);
        let determinant = determinant(&edges, &cofactor);
        let mut gradients = [[0.0; 3]; 4];
        for a in 0..3 {
            for i in 0..3 {
                gradients[a + 1][i] = cofactor[a][i] / determinant;
                gradients[0][i] -= gradients[a + 1][i];
            }
        }
        Tet4 { gradients, volume: determinant / 6.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::dot;

    const X: [[f64; 3]; 4] = [[0.1, 0.2, 0.0], [1.3, 0.1, 0.2], [0.2, 1.1, -0.1], [0.3, 0.4, 0.9]];

    #[test]
    fn shape_functions_are_nodal_and_sum_to_one() {
        let tet = Tet4::new(X);
        for a in 0..4 {
            for b in 0..4 {
                let along: [f64; 3] = std::array::from_fn(|i| X[b][i] - X[(b + 1) % 4][i]);
                let expected = (a == b) as i32 - (a == (b + 1) % 4) as i32;
                assert!((dot(&tet.gradients[a], &along) - expected as f64).abs() < 1e-14);
            }
        }
        for i in 0..3 {
            assert!(tet.gradients.iter().map(|g| g[i]).sum::<f64>().abs() < 1e-15);
        }
    }

    #[test]
    fn the_unit_tetrahedron_has_a_sixth() {
        let unit = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!((Tet4::new(unit).volume - 1.0 / 6.0).abs() < 1e-16);
        let flipped = [unit[0], unit[2], unit[1], unit[3]];
        assert!(Tet4::new(flipped).volume < 0.0);
    }
}
