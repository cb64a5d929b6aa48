//! One surface that may touch itself: which of its triangles are near each other.

use crate::body::SelfContact;
use crate::contact::facets::Candidates;
use crate::mesh::{Boxes, Sphere, cross, dot, norm, sub};

/// How much farther than the reach triangles are listed, over the reach: the list serves until they have moved half as far.
const MARGIN: f64 = 1.0;

/// A surface that may touch itself.
pub(super) struct Own {
    rule: SelfContact,
    reach: f64,
    /// Pairs of triangles that may touch and are near each other, each pair both ways, in the order of the first.
    near: Vec<[u32; 2]>,
    /// Where those of each triangle start, and where the last ones end.
    starts: Vec<usize>,
    /// The places of the corners for which they were listed.
    listed: Vec<[f64; 3]>,
}

impl Own {
    pub fn new(rule: SelfContact, reach: f64) -> Self {
        Own { rule, reach, near: Vec::new(), starts: Vec::new(), listed: Vec::new() }
    }

    /// What a point on a triangle may touch.
    pub fn candidates(&self, triangle: u32) -> Candidates<'_> {
        let near = self.starts[triangle as usize]..self.starts[triangle as usize + 1];
        Candidates::Near { rule: &self.rule, triangle, pairs: &self.near[near] }
    }

    /// Lists what is near at these places, if the surface has moved so far that it may be something else.
    pub fn list(&mut self, triangles: &[[u32; 3]], places: &[[f64; 3]]) {
        if self.slack(places) >= 0.0 {
            return;
        }
        let boxes = Boxes::new(places, triangles);
        let spheres: Vec<Sphere> = triangles.iter().map(|t| Sphere::around(places, t)).collect();
        let far = (1.0 + MARGIN) * self.reach;
        self.near.clear();
        self.starts.clear();
        self.starts.push(0);
        for (one, triangle) in (0u32..).zip(triangles) {
            let start = self.near.len();
            let corners = triangle.map(|corner| places[corner as usize]);
            boxes.each_near(&corners, far, |other| {
                let apart = spheres[one as usize].apart(&spheres[other]);
                if apart <= far && self.rule.may_touch(one, other as u32) {
                    self.near.push([one, other as u32]);
                }
            });
            self.near[start..].sort_unstable();
            self.starts.push(self.near.len());
        }
        self.listed.clear();
        self.listed.extend_from_slice(places);
    }

    /// How far apart what is not listed is at these places, at least [m].
    pub fn apart(&self, places: &[[f64; 3]]) -> f64 {
        self.reach + 2.0 * self.slack(places)
    }

    /// How far each corner may move from these places before the list may lack something [m]; negative if it may already.
    fn slack(&self, places: &[[f64; 3]]) -> f64 {
        if self.listed.is_empty() {
            return f64::NEG_INFINITY;
        }
        let moved = places.iter().zip(&self.listed).map(|(x, y)| norm(sub(*x, *y)));
        0.5 * MARGIN * self.reach - moved.fold(0.0, f64::max)
    }

    /// Whether nothing that may touch is near.
    pub fn is_apart(&self) -> bool {
        self.near.is_empty()
    }

    /// The pairs of triangles that are near each other, in the order of the first.
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.near
    }

    /// The triangles that something is near to, ascending.
    pub fn near(&self) -> Vec<u32> {
        self.near.chunk_by(|a, b| a[0] == b[0]).map(|pairs| pairs[0][0]).collect()
    }
}

/// A point at which an edge crosses a triangle of the same surface, farther than `allowed` from the ends of the edge and from
/// the border of the triangle.
pub(super) fn crossing(
    triangles: &[[u32; 3]],
    points: &[[f64; 3]],
    allowed: f64,
) -> Option<[f64; 3]> {
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
fn crossing_of([a, b, c]: [[f64; 3]; 3], ends: [[f64; 3]; 2], allowed: f64) -> Option<[f64; 3]> {
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
