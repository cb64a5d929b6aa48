//! Which triangles of one surface may touch each other.
//!
//! Near each other in the tissue are triangles that never touch: neighbours, and the front and the back of a thin part. They
//! look at each other through the tissue, or past each other. What looks at each other from outside may touch, however
//! close it is at rest; so may all that is far apart.

use crate::mesh::{Sphere, cross, dot, norm, sub};

/// Cosine between the normals of two triangles below which they look at each other, or away from each other.
const OPPOSITE: f64 = -0.5;

/// How far apart at rest triangles may touch which do not look at each other from outside, over the reach: two that look
/// past each other, and two that look away from each other. A part as thick as the latter would have to be pressed to a
/// quarter before its back was found at its front.
const BESIDE: f64 = 2.0;
const BEHIND: f64 = 4.0;

/// How far behind each other triangles lie on each other, over their size: rounding of a mesh.
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
        // What lies on each other looks at each other: of a cut, or of two lobes that touch.
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
