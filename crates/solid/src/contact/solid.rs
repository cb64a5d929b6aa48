//! The signed distance of a closed surface: the closest point through a tree of boxes, the sign by the angle-weighted
//! normal of the face, edge or corner it lies on (Baerentzen and Aanaes, IEEE TVCG 11, 2005).

mod walls;

use super::distance::Distance;
use crate::error::Error;
use crate::mesh::{TriangleTree, cross, dot, norm, sub};
use std::collections::BTreeMap;
use walls::check_walls;

/// A closed surface, prepared for the evaluation of distances.
#[derive(Clone, Debug)]
pub struct Solid {
    points: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    tree: TriangleTree,
    faces: Vec<[f64; 3]>,
    edges: BTreeMap<[u32; 2], [f64; 3]>,
    corners: Vec<[f64; 3]>,
    reach: f64,
}

impl Solid {
    /// Of triangles seen anticlockwise from outside.
    ///
    /// # Errors
    /// Indices out of range, points that are not finite, triangles without area, a surface that is not closed or not
    /// oriented, or inside out, or a second skin within it.
    pub fn new(points: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self, Error> {
        if let Some(k) = points.iter().position(|x| x.iter().any(|x| !x.is_finite())) {
            return Err(Error::input(format!(
                "point {k} of the shape is {:?}; it must be finite",
                points[k]
            )));
        }
        let is_known = |triangle: &[u32; 3]| triangle.iter().all(|&i| (i as usize) < points.len());
        if let Some(k) = triangles.iter().position(|triangle| !is_known(triangle)) {
            return Err(Error::input(format!(
                "triangle {k} of the shape is {:?}; there are {} points",
                triangles[k],
                points.len()
            )));
        }
        check_closed(&points, &triangles)?;
        let corners_of = |triangle: &[u32; 3]| triangle.map(|i| points[i as usize]);
        let mut faces = Vec::with_capacity(triangles.len());
        let (mut edges, mut corners) = (BTreeMap::new(), vec![[0.0; 3]; points.len()]);
        let mut volume = 0.0;
        for (k, triangle) in triangles.iter().enumerate() {
            let x = corners_of(triangle);
            let area = cross(sub(x[1], x[0]), sub(x[2], x[0]));
            let size = norm(area);
            if !(size > 0.0) {
                return Err(Error::input(format!(
                    "triangle {k} of the shape, {triangle:?}, has no area; leave it out and close the gap"
                )));
            }
            volume += dot(x[0], cross(x[1], x[2])) / 6.0;
            let normal = area.map(|a| a / size);
            faces.push(normal);
            for i in 0..3 {
                let (a, b, c) = (x[i], x[(i + 1) % 3], x[(i + 2) % 3]);
                let (ab, ac) = (sub(b, a), sub(c, a));
                let angle = norm(cross(ab, ac)).atan2(dot(ab, ac));
                add(&mut corners[triangle[i] as usize], angle, normal);
                let edge = ascending(triangle[i], triangle[(i + 1) % 3]);
                add(edges.entry(edge).or_insert([0.0; 3]), 1.0, normal);
            }
        }
        if !(volume > 0.0) {
            return Err(Error::input(format!(
                "the shape is inside out: its volume is {volume:.3e} m^3; turn its triangles around"
            )));
        }
        check_walls(&points, &triangles)?;
        let reach = points.iter().map(|x| norm(*x)).fold(0.0, f64::max);
        let tree = TriangleTree::new(&points, &triangles);
        Ok(Solid { points, triangles, tree, faces, edges, corners, reach })
    }

    /// Its smallest and largest coordinates [m].
    pub(super) fn bounds(&self) -> [[f64; 3]; 2] {
        let of = |choose: fn(f64, f64) -> f64| {
            std::array::from_fn(|i| self.points.iter().map(|x| x[i]).reduce(choose).unwrap_or(0.0))
        };
        [of(f64::min), of(f64::max)]
    }

    pub(super) fn reach(&self) -> f64 {
        self.reach
    }

    pub(super) fn distance(&self, x: [f64; 3]) -> Distance {
        let Some(closest) = self.tree.closest(&self.points, &self.triangles, x) else {
            return Distance { gap: f64::INFINITY, normal: [0.0; 3], curvature: [[0.0; 3]; 3] };
        };
        let triangle = self.triangles[closest.triangle as usize];
        let on: Vec<usize> = (0..3).filter(|&i| closest.barycentric[i] > 0.0).collect();
        let offset = sub(x, closest.point);
        let (outward, along) = match on[..] {
            [i] => (self.corners[triangle[i] as usize], None),
            [i, j] => {
                let edge = ascending(triangle[i], triangle[j]);
                let [a, b] = edge.map(|i| self.points[i as usize]);
                let (line, length) = (sub(b, a), norm(sub(b, a)));
                (self.edges[&edge], Some(line.map(|e| e / length)))
            }
            _ => {
                let normal = self.faces[closest.triangle as usize];
                return Distance { gap: dot(offset, normal), normal, curvature: [[0.0; 3]; 3] };
            }
        };
        let size = norm(outward);
        let side = if dot(offset, outward) < 0.0 { -1.0 } else { 1.0 };
        if closest.distance <= f64::EPSILON * self.reach {
            let normal = outward.map(|n| n / size);
            return Distance { gap: 0.0, normal, curvature: [[0.0; 3]; 3] };
        }
        let normal = offset.map(|w| side * w / closest.distance);
        let along = along.unwrap_or([0.0; 3]);
        let curvature = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let fixed = f64::from(i == j) - normal[i] * normal[j] - along[i] * along[j];
                side * fixed / closest.distance
            })
        });
        Distance { gap: side * closest.distance, normal, curvature }
    }
}

/// Every edge must be passed once in each direction.
fn check_closed(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<(), Error> {
    let mut directions: BTreeMap<[u32; 2], [usize; 2]> = BTreeMap::new();
    for triangle in triangles {
        for i in 0..3 {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            directions.entry(ascending(a, b)).or_default()[usize::from(a > b)] += 1;
        }
    }
    let open = directions.iter().find(|(_, count)| **count != [1, 1]);
    let place = |edge: &[u32; 2]| {
        let [[a, b, c], [d, e, f]] = edge.map(|node| points[node as usize]);
        format!("from ({a:.6}, {b:.6}, {c:.6}) to ({d:.6}, {e:.6}, {f:.6}) m")
    };
    match open {
        Some((edge, [one, other])) if one + other == 2 => Err(Error::input(format!(
            "the triangles of the shape at edge {edge:?}, {}, face opposite ways; orient them all outwards",
            place(edge)
        ))),
        Some((edge, [one, other])) => Err(Error::input(format!(
            "the shape is not closed: edge {edge:?}, {}, has {} instead of two; close its surface",
            place(edge),
            if one + other == 1 {
                "one triangle".into()
            } else {
                format!("{} triangles", one + other)
            }
        ))),
        None if triangles.is_empty() => Err(Error::input("the shape has no triangles")),
        None => Ok(()),
    }
}

fn ascending(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn add(sum: &mut [f64; 3], factor: f64, v: [f64; 3]) {
    sum.iter_mut().zip(v).for_each(|(sum, v)| *sum += factor * v);
}
