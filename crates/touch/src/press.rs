//! A sphere pressed into the surface along a normal, and what of its motion the patch of a model follows.

use super::evaluate::Answer;
use super::model::ReducedModel;
use viscera_mesh::{cross, dot, norm};
use viscera_number::tensor::{Mat3, mul_vector};

/// Of the radius of the contact that Hertz predicts, and the squared edges of the mesh that a contact has at least.
/// Both are fitted to the paths of `benchmarks/probe.py tuning`.
const SHARE: f64 = 0.65;
const GRAIN: f64 = 6.0;
/// Error of the force, relative to its norm, that comes from the patch in place of the contact, where that is as wide
/// as the mesh can show; fitted as the share is.
pub const CONTACT_ERROR: f64 = 0.25;
/// Error of the force where Hertz's contact is as narrow as an edge of the mesh, relative to its norm; it grows as the
/// contact shrinks. Below it are 95 of 100 poses, those at a support
/// left out, of 200 paths of `benchmarks/probe.py tuning`.
const UNRESOLVED: f64 = 0.45;

/// A sphere pressed into the surface along a normal.
pub(super) struct Press {
    pub normal: [f64; 3],
    /// Part of the motion of the sphere that the patch follows, and its derivative.
    share: f64,
    slope: f64,
    depth: f64,
    /// Error of the force, relative to its norm, that comes from the patch in place of the contact.
    pub error: f64,
}

impl Press {
    pub fn new(model: &ReducedModel, radius: f64, entered: f64, normal: [f64; 3]) -> Self {
        let per = SHARE / model.metadata.radius;
        let disc = (radius * entered + GRAIN * model.edge_length.powi(2)).sqrt();
        let (share, slope) = match per * disc {
            share if share < 1.0 => (share, share + 0.5 * per * radius * entered / disc),
            _ => (1.0, 1.0),
        };
        let unresolved = UNRESOLVED * model.edge_length / (radius * entered).sqrt();
        let error = CONTACT_ERROR.max(unresolved);
        Press { normal, share, slope, depth: share * entered, error }
    }

    pub fn displacement(&self, drag: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.share * drag[i] - self.depth * self.normal[i])
    }

    pub fn along(&self, v: [f64; 3]) -> [f64; 3] {
        let up = dot(v, self.normal);
        std::array::from_fn(|i| v[i] - up * self.normal[i])
    }

    /// The change of the drag that takes an excess from the force along the surface.
    pub fn slip(&self, stiffness: &Mat3<f64>, excess: [f64; 3]) -> [f64; 3] {
        // Two directions along the surface.
        let flat =
            (0..3).fold(0, |k, i| if self.normal[i].abs() < self.normal[k].abs() { i } else { k });
        let axis: [f64; 3] = std::array::from_fn(|i| if i == flat { 1.0 } else { 0.0 });
        let first = cross(self.normal, axis);
        let first = first.map(|x| x / norm(first));
        let plane = [first, cross(self.normal, first)];
        let k: [[f64; 2]; 2] = std::array::from_fn(|i| {
            std::array::from_fn(|j| self.share * dot(plane[i], mul_vector(stiffness, &plane[j])))
        });
        let e = plane.map(|axis| dot(axis, excess));
        let determinant = k[0][0] * k[1][1] - k[0][1] * k[1][0];
        // Tissue near an instability does not say where to slip to.
        if !(k[0][0] > 0.0 && determinant > 0.0) {
            return [0.0; 3];
        }
        let a = (k[1][1] * e[0] - k[0][1] * e[1]) / determinant;
        let b = (k[0][0] * e[1] - k[1][0] * e[0]) / determinant;
        std::array::from_fn(|i| a * plane[0][i] + b * plane[1][i])
    }

    pub fn stiffness(&self, answer: &Answer, sticks: bool) -> [f64; 2] {
        let k: &Mat3<f64> = &answer.stiffness;
        let normal = dot(self.normal, mul_vector(k, &self.normal));
        let along = 0.5 * (k[0][0] + k[1][1] + k[2][2] - normal);
        let share = if sticks { self.share } else { 0.0 };
        [(self.slope * normal).max(0.0), (share * along).max(0.0)]
    }
}
