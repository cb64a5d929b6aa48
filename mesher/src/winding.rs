//! The generalised winding number of a triangle soup: how often it winds around a point, even if it has holes or
//! overlaps itself (Jacobson, Kavan and Sorkine-Hornung, 2013). Far triangles count as one dipole (Barill et al.,
//! 2018).

use crate::vector::{Point, add, cross, dot, norm, scale, sub};
use rayon::prelude::*;
use std::f64::consts::PI;

/// A group of triangles counts as a dipole from this many of its radii on: the error is below 2e-2.
const FAR: f64 = 3.0;
const LEAF: usize = 8;

/// Triangles in a hierarchy.
pub struct Winding {
    triangles: Vec<[Point; 3]>,
    groups: Vec<Group>,
}

struct Group {
    middle: Point,
    radius: f64,
    /// Sum of the area vectors.
    area: Point,
    content: Content,
}

enum Content {
    Triangles(std::ops::Range<usize>),
    Groups([usize; 2]),
}

impl Winding {
    /// The hierarchy of some triangles; those with an index out of range are left out.
    pub fn new(points: &[Point], triangles: &[[u32; 3]]) -> Self {
        let corners = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| points.get(i as usize).copied());
            Some([a?, b?, c?])
        };
        let mut soup = Winding {
            triangles: triangles.iter().filter_map(corners).collect(),
            groups: Vec::new(),
        };
        soup.group(0..soup.triangles.len());
        soup
    }

    /// Builds the group of a range of triangles, and returns its number.
    fn group(&mut self, range: std::ops::Range<usize>) -> usize {
        let held = &mut self.triangles[range.clone()];
        let weight = |t: &[Point; 3]| norm(area(t)).max(1e-300);
        let total: f64 = held.iter().map(weight).sum();
        let sum = held.iter().fold([0.0; 3], |sum, t| add(sum, scale(centre(t), weight(t))));
        let middle = scale(sum, 1.0 / total.max(1e-300));
        let radius = held.iter().flatten().map(|&x| norm(sub(x, middle))).fold(0.0, f64::max);
        let whole = held.iter().fold([0.0; 3], |sum, t| add(sum, area(t)));
        let number = self.groups.len();
        let content = Content::Triangles(range.clone());
        if range.len() > LEAF {
            let spread = |axis: usize| {
                let along = held.iter().map(|t| centre(t)[axis]);
                along.clone().fold(f64::NEG_INFINITY, f64::max)
                    - along.fold(f64::INFINITY, f64::min)
            };
            let axis = (0..3).max_by(|&i, &j| spread(i).total_cmp(&spread(j))).unwrap_or(0);
            let half = range.len() / 2;
            held.select_nth_unstable_by(half, |s, t| centre(s)[axis].total_cmp(&centre(t)[axis]));
            self.groups.push(Group { middle, radius, area: whole, content });
            let parts = [range.start..range.start + half, range.start + half..range.end];
            let parts = parts.map(|part| self.group(part));
            self.groups[number].content = Content::Groups(parts);
        } else {
            self.groups.push(Group { middle, radius, area: whole, content });
        }
        number
    }

    /// The winding number of a place: 1 inside a closed surface whose triangles look outward, 0 outside.
    pub fn number(&self, x: Point) -> f64 {
        let mut open = vec![0];
        let mut angle = 0.0;
        while let Some(group) = open.pop() {
            let Group { middle, radius, area, content } = &self.groups[group];
            let offset = sub(*middle, x);
            let distance = norm(offset);
            if distance > FAR * radius {
                angle += dot(*area, offset) / distance.powi(3);
                continue;
            }
            match content {
                Content::Groups(parts) => open.extend(parts),
                Content::Triangles(range) => {
                    angle += self.triangles[range.clone()]
                        .iter()
                        .map(|t| solid_angle(t, x))
                        .sum::<f64>();
                }
            }
        }
        angle / (4.0 * PI)
    }

    /// The winding numbers of the voxels of a grid, in the order of [`crate::Labels`]; none if `watch(done, total)`
    /// wants no more.
    pub fn on_grid(
        &self,
        dims: [usize; 3],
        affine: &[[f64; 4]; 3],
        mut watch: impl FnMut(usize, usize) -> bool,
    ) -> Option<Vec<f32>> {
        let [nx, ny, nz] = dims;
        let mut numbers = Vec::with_capacity(nx * ny * nz);
        for i in 0..nx {
            if !watch(i, nx) {
                return None;
            }
            let slab = (0..ny * nz).into_par_iter().map(|within| {
                let index = [i, within / nz, within % nz].map(|k| k as f64);
                let place = affine.map(|row| dot([row[0], row[1], row[2]], index) + row[3]);
                self.number(place) as f32
            });
            numbers.par_extend(slab);
        }
        Some(numbers)
    }
}

fn area([a, b, c]: &[Point; 3]) -> Point {
    scale(cross(sub(*b, *a), sub(*c, *a)), 0.5)
}

fn centre([a, b, c]: &[Point; 3]) -> Point {
    scale(add(*a, add(*b, *c)), 1.0 / 3.0)
}

/// Of a triangle, positive where it looks away from `x` (van Oosterom and Strackee, 1983).
fn solid_angle(triangle: &[Point; 3], x: Point) -> f64 {
    let [a, b, c] = triangle.map(|corner| sub(corner, x));
    let [la, lb, lc] = [a, b, c].map(norm);
    let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    2.0 * dot(a, cross(b, c)).atan2(below)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of side 2 around the origin, without its last `holes` triangles, each face cut into `n` by `n` squares.
    fn cube(n: usize, holes: usize) -> Winding {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                for i in 0..n * n {
                    let first = points.len() as u32;
                    for (s, t) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                        let mut x = [0.0; 3];
                        x[axis] = sign;
                        x[(axis + 1) % 3] = sign * (2.0 * (i / n + s) as f64 / n as f64 - 1.0);
                        x[(axis + 2) % 3] = 2.0 * (i % n + t) as f64 / n as f64 - 1.0;
                        points.push(x);
                    }
                    triangles
                        .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
                }
            }
        }
        triangles.truncate(triangles.len() - holes);
        Winding::new(&points, &triangles)
    }

    #[test]
    fn a_closed_surface_winds_once_round_its_inside() {
        let cube = cube(12, 0);
        for (x, expected) in
            [([0.0; 3], 1.0), ([0.9, -0.95, 0.9], 1.0), ([1.05, 0.0, 0.0], 0.0), ([4.0; 3], 0.0)]
        {
            assert!((cube.number(x) - expected).abs() < 2e-2, "{}", cube.number(x));
        }
    }

    #[test]
    fn dipoles_are_close_to_all_triangles() {
        let cube = cube(12, 30);
        for x in [[0.3, 0.2, 0.8], [0.1, 0.1, 1.4], [2.0, 0.5, 0.1]] {
            let all: f64 = cube.triangles.iter().map(|t| solid_angle(t, x)).sum();
            assert!((cube.number(x) - all / (4.0 * PI)).abs() < 1e-2);
        }
    }

    #[test]
    fn a_hole_changes_little_away_from_it() {
        let cube = cube(12, 2);
        assert!((cube.number([0.0; 3]) - 1.0).abs() < 0.02);
        assert!(cube.number([0.0, 0.0, 1.3]).abs() < 0.05);
    }
}
