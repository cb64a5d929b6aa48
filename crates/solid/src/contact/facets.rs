//! The gap between a point and a surface of triangles that moves, with its derivatives by the point and by the corners.

use super::entry::Way;
use crate::body::SelfContact;
use crate::mesh::{
    Closest, Sphere, TriangleTree, closest_point_on_triangle, cross, dot, norm, sub,
};
use std::cell::OnceCell;
use std::collections::HashMap;

/// Distance, relative to the size of the surface, below which its direction is rounding.
const ON_IT: f64 = 1e-12;

/// A surface of triangles and what is around its edges and corners.
pub(super) struct Facets {
    triangles: Vec<[u32; 3]>,
    /// The two triangles at each edge; one at the border of a surface that is not closed.
    edges: HashMap<[u32; 2], Vec<u32>>,
    /// The triangles around each corner.
    around: HashMap<u32, Vec<u32>>,
}

/// The surface in a place.
pub(super) struct Placed<'a> {
    facets: &'a Facets,
    points: &'a [[f64; 3]],
    /// Made when they are needed.
    tree: OnceCell<TriangleTree>,
    spheres: OnceCell<Vec<Sphere>>,
    size: f64,
}

/// Which triangles of a surface a point may touch.
#[derive(Clone, Copy)]
pub(super) enum Candidates<'a> {
    All,
    /// Those that the triangle of the point may touch, and the pairs of it and these that are near.
    Near {
        rule: &'a SelfContact,
        triangle: u32,
        pairs: &'a [[u32; 2]],
    },
}

impl Candidates<'_> {
    fn may_touch(&self, other: u32) -> bool {
        match self {
            Candidates::All => true,
            Candidates::Near { rule, triangle, .. } => rule.may_touch(*triangle, other),
        }
    }
}

/// The gap at a point: its signed distance `g` from the closest point `y = sum_j b_j y_j` of the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gap {
    /// `g`, negative inside [m].
    pub gap: f64,
    /// Its derivative by the point, of length 1; that by a corner is `-b_j` times it.
    pub normal: [f64; 3],
    /// The triangle and the weights `b` of its corners.
    pub triangle: usize,
    pub weights: [f64; 3],
    /// Gradients of `b` in the plane of the triangle [1/m], zero where the closest point is on an edge or a corner.
    pub slopes: [[f64; 3]; 3],
}

impl Facets {
    pub fn new(triangles: Vec<[u32; 3]>) -> Self {
        let mut edges: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
        let mut around: HashMap<u32, Vec<u32>> = HashMap::new();
        for (number, triangle) in (0u32..).zip(&triangles) {
            for i in 0..3 {
                let ends = ascending(triangle[i], triangle[(i + 1) % 3]);
                edges.entry(ends).or_default().push(number);
                around.entry(triangle[i]).or_default().push(number);
            }
        }
        Facets { triangles, edges, around }
    }

    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The triangles around a corner; none if it is of another surface.
    pub fn around(&self, corner: u32) -> &[u32] {
        self.around.get(&corner).map_or(&[], Vec::as_slice)
    }

    /// The surface with its corners at these points.
    pub fn at<'a>(&'a self, points: &'a [[f64; 3]]) -> Placed<'a> {
        let size = self.around.keys().map(|&node| norm(points[node as usize])).fold(0.0, f64::max);
        Placed { facets: self, points, tree: OnceCell::new(), spheres: OnceCell::new(), size }
    }

    /// Whether the surface ends at an edge.
    fn is_border(&self, edge: [u32; 2]) -> bool {
        self.edges[&edge].len() != 2
    }
}

impl Placed<'_> {
    /// The gap at a point to what it may touch; none farther than `reach` away, or where the closest point is on the border of
    /// that.
    pub fn gap(&self, x: [f64; 3], reach: f64, candidates: Candidates) -> Option<Gap> {
        self.gap_to(x, self.closest(x, reach, candidates)?, candidates)
    }

    /// The gap at a point to the closest point of what it may touch; none where that is on the border.
    pub fn gap_to(&self, x: [f64; 3], closest: Closest, candidates: Candidates) -> Option<Gap> {
        let (triangle, weights) = (closest.triangle as usize, closest.barycentric);
        let nodes = self.facets.triangles[triangle];
        let on: Vec<u32> = (0..3).filter(|&i| weights[i] > 0.0).map(|i| nodes[i]).collect();
        let offset = sub(x, closest.point);
        let outward = match on[..] {
            [corner] => self.corner_normal(corner, candidates)?,
            [a, b] => self.edge_normal(ascending(a, b), candidates)?,
            _ => {
                let normal = self.normal(triangle);
                let slopes = self.slopes(triangle, normal);
                return Some(Gap { gap: dot(offset, normal), normal, triangle, weights, slopes });
            }
        };
        let slopes = [[0.0; 3]; 3];
        if closest.distance <= ON_IT * self.size {
            let normal = outward.map(|n| n / norm(outward));
            return Some(Gap { gap: dot(offset, normal), normal, triangle, weights, slopes });
        }
        let gap = closest.distance.copysign(dot(offset, outward));
        Some(Gap { gap, normal: offset.map(|w| w / gap), triangle, weights, slopes })
    }

    /// The triangle that looks towards the point of a gap most, of those that share the closest point.
    pub fn facing(&self, gap: &Gap) -> usize {
        let nodes = self.facets.triangles[gap.triangle];
        let on: Vec<u32> = (0..3).filter(|&i| gap.weights[i] > 0.0).map(|i| nodes[i]).collect();
        let Some(&first) = on.first() else { return gap.triangle };
        let around = self.facets.around(first).iter().map(|&triangle| triangle as usize);
        let shares = |triangle: &usize| {
            on.iter().all(|node| self.facets.triangles[*triangle].contains(node))
        };
        let towards = |triangle: usize| dot(self.normal(triangle), gap.normal);
        let best = around.filter(shares).max_by(|&a, &b| towards(a).total_cmp(&towards(b)));
        best.unwrap_or(gap.triangle)
    }

    /// The gap of a point behind a triangle: on its inner side, at most `reach` away, and with its projection on it.
    pub fn behind(&self, triangle: usize, x: [f64; 3], reach: f64) -> Option<Gap> {
        let (corners, normal) = (self.corners(triangle), self.normal(triangle));
        let slopes = self.slopes(triangle, normal);
        let gap = dot(sub(x, corners[0]), normal);
        let weights: [f64; 3] =
            std::array::from_fn(|i| dot(sub(x, corners[(i + 1) % 3]), slopes[i]));
        let is_on_it = weights.iter().all(|weight| *weight >= 0.0);
        let is_behind = is_on_it && gap < 0.0 && gap > -reach;
        is_behind.then_some(Gap { gap, normal, triangle, weights, slopes })
    }

    /// The closest point to a point of what it may touch; none if it is farther away than `reach`.
    pub fn closest(&self, x: [f64; 3], reach: f64, candidates: Candidates) -> Option<Closest> {
        match candidates {
            Candidates::All => {
                let triangles = &self.facets.triangles;
                let tree = self.tree.get_or_init(|| TriangleTree::new(self.points, triangles));
                tree.closest_within(self.points, triangles, x, reach)
            }
            Candidates::Near { pairs, .. } => self.closest_among(pairs, x, reach),
        }
    }

    /// The closest point on the second triangles of pairs, if it is nearer than `reach`.
    fn closest_among(&self, pairs: &[[u32; 2]], x: [f64; 3], reach: f64) -> Option<Closest> {
        let triangles = self.facets.triangles.iter();
        let spheres = self
            .spheres
            .get_or_init(|| triangles.map(|t| Sphere::around(self.points, t)).collect());
        let (mut best, mut nearest) = (None, reach);
        for &[_, triangle] in pairs {
            if spheres[triangle as usize].distance(x) < nearest {
                let closest = self.closest_on(triangle, x);
                if closest.distance < nearest {
                    (best, nearest) = (Some(closest), closest.distance);
                }
            }
        }
        best
    }

    fn closest_on(&self, triangle: u32, x: [f64; 3]) -> Closest {
        let corners @ [a, b, c] = self.corners(triangle as usize);
        let barycentric = closest_point_on_triangle(x, a, b, c);
        let at = |i: usize| (0..3).map(|k| barycentric[k] * corners[k][i]).sum();
        let point = std::array::from_fn(at);
        Closest { triangle, barycentric, point, distance: norm(sub(x, point)) }
    }

    /// How much of a straight way lies behind the surface [m]: from where it comes in, or from its start, to where it goes out,
    /// or to its end. None of a way that does not cross the surface.
    pub fn behind_along(&self, way: Way) -> f64 {
        let all = 0..self.facets.triangles.len();
        let mut crossings: Vec<_> =
            all.filter_map(|triangle| self.crossing(triangle, way)).collect();
        crossings.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        let starts_behind = crossings.first().is_some_and(|(_, is_inward)| !is_inward);
        let (mut since, mut behind) = (starts_behind.then_some(0.0), 0.0);
        for (part, is_inward) in crossings {
            match is_inward {
                true => since = since.or(Some(part)),
                false => behind += since.take().map_or(0.0, |since| part - since),
            }
        }
        (behind + since.map_or(0.0, |since| 1.0 - since)) * norm(sub(way[1], way[0]))
    }

    /// The part of a way at which it crosses a triangle, and whether inwards.
    fn crossing(&self, triangle: usize, [from, to]: Way) -> Option<(f64, bool)> {
        let corners @ [a, b, c] = self.corners(triangle);
        let (along, doubled) = (sub(to, from), cross(sub(b, a), sub(c, a)));
        let speed = dot(along, doubled);
        let part = dot(sub(a, from), doubled) / speed;
        let at: [f64; 3] = std::array::from_fn(|i| from[i] + part * along[i]);
        let is_within = |i: usize| {
            let (start, end) = (corners[i], corners[(i + 1) % 3]);
            dot(cross(sub(end, start), sub(at, start)), doubled) >= -ON_IT * dot(doubled, doubled)
        };
        let is_on_way = (0.0..=1.0).contains(&part);
        (is_on_way && (0..3).all(is_within)).then_some((part, speed < 0.0))
    }

    /// The middle of a triangle.
    pub fn centre(&self, triangle: usize) -> [f64; 3] {
        let corners = self.corners(triangle);
        std::array::from_fn(|i| corners.iter().map(|x| x[i]).sum::<f64>() / 3.0)
    }

    fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.facets.triangles[triangle].map(|node| self.points[node as usize])
    }

    pub fn normal(&self, triangle: usize) -> [f64; 3] {
        let [a, b, c] = self.corners(triangle);
        let area = cross(sub(b, a), sub(c, a));
        let size = norm(area);
        area.map(|n| n / size)
    }

    fn slopes(&self, triangle: usize, normal: [f64; 3]) -> [[f64; 3]; 3] {
        let x = self.corners(triangle);
        let doubled = norm(cross(sub(x[1], x[0]), sub(x[2], x[0])));
        std::array::from_fn(|i| {
            let opposite = sub(x[(i + 2) % 3], x[(i + 1) % 3]);
            cross(normal, opposite).map(|s| s / doubled)
        })
    }

    fn edge_normal(&self, edge: [u32; 2], candidates: Candidates) -> Option<[f64; 3]> {
        match self.facets.edges[&edge][..] {
            [one, other] if candidates.may_touch(one) && candidates.may_touch(other) => {
                Some(sum(self.normal(one as usize), self.normal(other as usize)))
            }
            _ => None,
        }
    }

    /// The normal of a corner, weighted by the angles around it.
    fn corner_normal(&self, corner: u32, candidates: Candidates) -> Option<[f64; 3]> {
        let mut whole = [0.0; 3];
        for &triangle in &self.facets.around[&corner] {
            if !candidates.may_touch(triangle) {
                return None;
            }
            let nodes = self.facets.triangles[triangle as usize];
            let i = nodes.iter().position(|&node| node == corner)?;
            let others = [nodes[(i + 1) % 3], nodes[(i + 2) % 3]];
            if others.iter().any(|&other| self.facets.is_border(ascending(corner, other))) {
                return None;
            }
            let [along, across] =
                others.map(|other| sub(self.points[other as usize], self.points[corner as usize]));
            let angle = norm(cross(along, across)).atan2(dot(along, across));
            whole = sum(whole, self.normal(triangle as usize).map(|n| angle * n));
        }
        Some(whole)
    }
}

fn ascending(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn sum(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + b[i])
}
