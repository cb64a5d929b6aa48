//! Which triangles of one surface may touch each other.
//!
//! Some triangles that are close at rest never touch: neighbours, and the front and the back of a thin part. Triangles that face
//! each other from outside may touch, however close they are at rest. All others may touch only if they are far apart at rest.

use crate::mesh::{Sphere, cross, dot, norm, sub};

/// Cosine between the normals of two triangles below which they face each other, or face away from each other.
const OPPOSITE: f64 = -0.5;

/// Least distances at rest, over the reach, of triangles that may touch although they do not face each other from outside: of
/// two with other normals, and of two that face away from each other. A part as thick as the latter would have to be pressed
/// to a quarter before its front found its back.
const BESIDE: f64 = 2.0;
const BEHIND: f64 = 4.0;

/// How far behind each other two triangles are, over their size, that count as lying on each other: rounding of a mesh.
const ON_IT: f64 = 1e-3;

/// The triangles of a surface at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfContact {
    triangles: Vec<Triangle>,
    reach: f64,
}

#[derive(Clone, Debug, PartialEq)]
struct Triangle {
    corners: [u32; 3],
    around: Sphere,
    normal: [f64; 3],
}

impl SelfContact {
    /// For triangles with these points at rest, that are looked at within this reach [m].
    pub(super) fn new(points: &[[f64; 3]], triangles: &[[u32; 3]], reach: f64) -> Self {
        let triangles = triangles.iter().map(|&corners| Triangle::new(points, corners)).collect();
        SelfContact { triangles, reach }
    }

    /// Whether two triangles, by their numbers, may touch.
    pub fn may_touch(&self, one: u32, other: u32) -> bool {
        let [one, other] = [one, other].map(|number| &self.triangles[number as usize]);
        let apart = one.around.apart(&other.around) / self.reach;
        if apart > BEHIND {
            return true;
        }
        if one.corners.iter().any(|corner| other.corners.contains(corner)) {
            return false;
        }
        let between = sub(other.around.centre, one.around.centre);
        let is_opposite = dot(one.normal, other.normal) < OPPOSITE;
        // Triangles that lie on each other face each other: those of a cut, or of two lobes that touch.
        let on_it = -ON_IT * (one.around.radius + other.around.radius);
        match (dot(between, one.normal) > on_it, dot(between, other.normal) < -on_it) {
            (true, true) if is_opposite => true,
            (false, false) if is_opposite => false,
            _ => apart > BESIDE,
        }
    }
}

impl Triangle {
    fn new(points: &[[f64; 3]], corners: [u32; 3]) -> Self {
        let x = corners.map(|corner| points[corner as usize]);
        let area = cross(sub(x[1], x[0]), sub(x[2], x[0]));
        let size = norm(area);
        let around = Sphere::around(points, &corners);
        Triangle { corners, around, normal: area.map(|a| a / size) }
    }
}
