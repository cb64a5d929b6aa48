//! The touchable surface as a probe walks on it: from triangle to triangle, and where it ends.

use super::contact::Contact;
use super::ground::{normal_of, unit};
use super::model::ReducedModel;
use viscera_mesh::{closest_point_on_triangle, dot, norm, sub};

/// Triangles that one walk may cross. A probe moves by a quarter of its radius in a tick.
const STEPS: usize = 24;

impl ReducedModel {
    /// The touchable point closest to `to` that is reached downhill from a triangle: a probe at a thin lobe stays on
    /// the side that it touches.
    pub(super) fn walk(&self, from: usize, to: [f64; 3]) -> Contact {
        let mut best = self.on_triangle(from, to);
        for _ in 0..STEPS {
            let here = best.triangle;
            for corner in self.triangles[here] {
                for &triangle in self.ground.around.of(corner) {
                    let other = self.on_triangle(triangle as usize, to);
                    if other.distance < best.distance {
                        best = other;
                    }
                }
            }
            if best.triangle == here {
                break;
            }
        }
        best
    }

    /// Outward normal at a contact, continuous over the surface.
    pub(super) fn normal(&self, contact: &Contact) -> [f64; 3] {
        let normals = self.triangles[contact.triangle].map(|p| self.ground.normals[p as usize]);
        unit(std::array::from_fn(|i| (0..3).map(|k| contact.weights[k] * normals[k][i]).sum()))
    }

    /// How far a point lies beyond the end of the touchable surface, if it ends at the contact closest to the point [m].
    pub(super) fn overhang(&self, contact: &Contact, point: [f64; 3]) -> f64 {
        let ends = self.ground.is_border[contact.triangle];
        if !(0..3).any(|k| ends[k] && contact.weights[(k + 2) % 3] <= 0.0) {
            return 0.0;
        }
        let corners = self.triangles[contact.triangle].map(|p| self.positions[p as usize]);
        let (normal, away) = (unit(normal_of(corners)), sub(point, contact.point));
        let above = dot(away, normal);
        norm(std::array::from_fn(|i| away[i] - above * normal[i]))
    }

    fn on_triangle(&self, triangle: usize, to: [f64; 3]) -> Contact {
        let x = self.triangles[triangle].map(|p| self.positions[p as usize]);
        let weights = closest_point_on_triangle(to, x[0], x[1], x[2]);
        let point = std::array::from_fn(|i| (0..3).map(|k| weights[k] * x[k][i]).sum());
        Contact { triangle, weights, point, distance: norm(sub(to, point)) }
    }
}
