//! Where a surface crosses itself.

use super::{Boxes, Vector, cross, dot, norm, sub};

/// A point at which an edge crosses a triangle of the same surface, farther than `allowed` from the ends of the edge and from
/// the border of the triangle.
pub fn crossing(points: &[Vector], triangles: &[[u32; 3]], allowed: f64) -> Option<Vector> {
    let boxes = Boxes::new(points, triangles);
    let mut found = None;
    for triangle in triangles {
        let corners = triangle.map(|corner| points[corner as usize]);
        boxes.each_near(&corners, 0.0, |other| {
            let other = triangles[other];
            if found.is_some() || other.iter().any(|corner| triangle.contains(corner)) {
                return;
            }
            let ends = |k: usize| [other[k], other[(k + 1) % 3]].map(|end| points[end as usize]);
            found = (0..3).find_map(|k| crossing_of(corners, ends(k), allowed));
        });
        if found.is_some() {
            break;
        }
    }
    found
}

/// Where a line between two points crosses a triangle.
fn crossing_of([a, b, c]: [Vector; 3], ends: [Vector; 2], allowed: f64) -> Option<Vector> {
    let area = cross(sub(b, a), sub(c, a));
    let heights = ends.map(|end| dot(sub(end, a), area) / norm(area));
    if heights[0] * heights[1] >= 0.0 || heights.iter().any(|height| height.abs() < allowed) {
        return None;
    }
    let part = heights[0] / (heights[0] - heights[1]);
    let x = std::array::from_fn(|i| ends[0][i] + part * (ends[1][i] - ends[0][i]));
    let is_inside = |from, to| {
        let along = sub(to, from);
        let twice = dot(cross(along, sub(x, from)), area) / norm(area);
        twice > allowed * norm(along)
    };
    (is_inside(a, b) && is_inside(b, c) && is_inside(c, a)).then_some(x)
}
