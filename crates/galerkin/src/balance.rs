//! What the stress of an answer leaves unbalanced: an estimate of its error.

use super::model::Galerkin;
use super::origin::Origin;
use crate::error::Error;
use crate::number::dot;
use crate::tensor::{Mat3, cross};

/// Above it the pressure of an answer is not to be relied on; as in Python (python/viscera/reduced/shape.py).
pub const UNBALANCED: f64 = 0.15;

impl Galerkin {
    /// Estimated error of stress and pressure, relative to their norm, where touches at these points of the touchable
    /// surface [m] have displaced the nodes by `u` [m]:
    ///   (sum_n |f_n(u_0 + u) - f_n(u_0)|^2)^1/2 / (sum_c,a |V_c P_c grad N_a|^2)^1/2,
    /// the nodal forces over nodes that are neither held nor touched, and those of every cell alone on its corners.
    /// Infinite where the law has no stress.
    ///
    /// # Errors
    /// A point off the touchable surface.
    pub fn stress_error_estimate(&self, points: &[[f64; 3]], u: &[f64]) -> Result<f64, Error> {
        let origin = &self.origin;
        let mut left = vec![0.0; u.len()];
        origin.internal_force(u, &mut left);
        for (k, &point) in points.iter().enumerate() {
            let touched = self.model.patch(&self.contact(k, point)?).nodes;
            touched.iter().for_each(|&n| left[3 * n as usize..][..3].fill(0.0));
        }
        origin.fixed.iter().for_each(|&dof| left[dof as usize] = 0.0);
        let (left, size) = (dot(&left, &left).sqrt(), size_of_corner_forces(origin, u));
        Ok(match left / size {
            _ if size == 0.0 => 0.0,
            part if part.is_finite() => part,
            _ => f64::INFINITY,
        })
    }
}

/// `(sum_c,a |V_c P_c grad N_a|^2)^1/2` over the corners of all cells, with the mean stress of each.
fn size_of_corner_forces(origin: &Origin, u: &[f64]) -> f64 {
    let (body, moved) = (&origin.body, origin.moved(u));
    let points = body.quadrature_points(&moved);
    let of_cell = points.len() / body.cells().len();
    let squares = body.cells().iter().zip(points.chunks_exact(of_cell)).map(|(cell, points)| {
        let weighted_slopes = weighted_slopes(cell.map(|n| body.points()[n as usize]));
        let mean: Mat3<f64> = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                points.iter().map(|point| point.stress[i][j]).sum::<f64>() / of_cell as f64
            })
        });
        let forces = weighted_slopes.iter().flat_map(|slope| mean.map(|row| dot(&row, slope)));
        forces.map(|f| f * f).sum::<f64>()
    });
    squares.sum::<f64>().sqrt()
}

/// `V grad N_a` of a tetrahedron: a third of the area vector of the face across.
fn weighted_slopes([a, b, c, d]: [[f64; 3]; 4]) -> [[f64; 3]; 4] {
    let edge = |to: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| to[i] - a[i]) };
    let (b, c, d) = (edge(b), edge(c), edge(d));
    let across = |x: [f64; 3], y: [f64; 3]| cross(&x, &y).map(|z| z / 6.0);
    let others = [across(c, d), across(d, b), across(b, c)];
    let first = std::array::from_fn(|i| -others.iter().map(|slope| slope[i]).sum::<f64>());
    [first, others[0], others[1], others[2]]
}
