//! Surfaces on which a node stays, and the projection onto them.

use crate::field::{Field, Plane};
use crate::vector::{Point, add, cross, dot, norm, scale};

/// A smooth surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constraint {
    /// Where two owners have equal scores.
    Between(usize, usize),
    /// Where the image ends.
    On(Plane),
}

impl Constraint {
    /// Whether it is a plane.
    pub fn is_flat(&self) -> bool {
        matches!(self, Constraint::On(_))
    }

    fn value(&self, field: &Field, x: Point) -> (f64, Point) {
        match *self {
            Constraint::Between(a, b) => field.difference(a, b, x),
            Constraint::On(plane) => (plane.distance(x), plane.normal),
        }
    }
}

/// Limits of the projection by Newton's method: number of steps, their largest length, and the length of the last one,
/// in edges.
const STEPS: usize = 8;
const LONGEST: f64 = 0.3;
const SHORTEST: f64 = 1e-3;

/// The place near `x` that lies on all the surfaces, of which there are at most three; none if Newton's method of
/// least steps does not get there.
pub fn project(field: &Field, surfaces: &[Constraint], x: Point, edge: f64) -> Option<Point> {
    let mut x = x;
    for _ in 0..STEPS {
        let mut normals = [[0.0; 3]; 3];
        let mut distances = [0.0; 3];
        for (i, surface) in surfaces.iter().enumerate() {
            let (value, gradient) = surface.value(field, x);
            let slope = norm(gradient);
            if !(slope * edge > 1e-3) {
                return None; // the field is flat here: the surface is far
            }
            (normals[i], distances[i]) = (scale(gradient, 1.0 / slope), value / slope);
        }
        let step = least_step(&normals[..surfaces.len()], &distances[..surfaces.len()])?;
        let length = norm(step);
        let share = (LONGEST * edge / length.max(1e-300)).min(1.0);
        x = add(x, scale(step, share));
        if length < SHORTEST * edge {
            return Some(x);
        }
    }
    None
}

/// The shortest step to all the planes with the given normals and distances: `N step = -d`.
fn least_step(normals: &[Point], d: &[f64]) -> Option<Point> {
    match *normals {
        [n] => Some(scale(n, -d[0])),
        [n, m] => {
            let c = dot(n, m);
            let det = 1.0 - c * c;
            let (a, b) = ((c * d[1] - d[0]) / det, (c * d[0] - d[1]) / det);
            (det > 1e-2).then(|| add(scale(n, a), scale(m, b)))
        }
        [n, m, k] => {
            let det = dot(n, cross(m, k));
            let parts = [(cross(m, k), d[0]), (cross(k, n), d[1]), (cross(n, m), d[2])];
            let step = parts.into_iter().fold([0.0; 3], |sum, (v, d)| add(sum, scale(v, -d / det)));
            (det.abs() > 1e-2).then_some(step)
        }
        _ => Some([0.0; 3]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_step_reaches_every_plane() {
        let normals = [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.6, 0.8]];
        let distances = [0.3, -0.2, 0.5];
        for count in 1..=3 {
            let step =
                least_step(&normals[..count], &distances[..count]).expect("they are independent");
            for (normal, distance) in normals.iter().zip(distances).take(count) {
                assert!((dot(*normal, step) + distance).abs() < 1e-14);
            }
        }
        assert_eq!(least_step(&[normals[0], normals[0]], &[0.1, 0.2]), None, "parallel planes");
    }
}
