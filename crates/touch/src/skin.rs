//! The whole surface of the organ, beside what may be touched of it: whether a sphere touches it at a second place, and how
//! far it reaches into the organ.

use super::around::Around;
use super::ground::normal_of;
use std::f64::consts::PI;
use viscera_mesh::{TriangleTree, cross, dot, norm, sub};

/// Triangles in a sphere beyond which none is looked for in a tick: they would take longer than the touch.
const MOST: usize = 2000;

/// Points whose distances, or weights, differ by less than this part are the same.
const SAME: f64 = 1e-9;

/// The triangles of the surface, by node.
#[derive(Clone, Debug)]
pub(super) struct Skin {
    triangles: Vec<[u32; 3]>,
    around: Around,
    tree: TriangleTree,
}

/// Marks on the triangles of a skin, so that a search allocates nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Marks {
    /// Of each triangle, when it was last found in a sphere, or reached from the first place in it.
    last: Vec<u32>,
    now: u32,
    /// Found ones that face the centre.
    facing: Vec<u32>,
    /// Reached ones whose neighbours have not been looked at.
    pending: Vec<u32>,
}

/// A sphere, where it touches the surface, and a triangle there by its nodes.
pub(super) struct Touching {
    pub center: [f64; 3],
    pub radius: f64,
    pub triangle: [u32; 3],
}

impl Skin {
    pub fn new(points: &[[f64; 3]], triangles: Vec<[u32; 3]>) -> Self {
        let around = Around::new(points.len(), &triangles);
        let tree = TriangleTree::new(points, &triangles);
        Skin { triangles, around, tree }
    }

    /// Marks for a search.
    pub fn marks(&self) -> Marks {
        let n = self.triangles.len();
        let list = || Vec::with_capacity(n);
        Marks { last: vec![0; n], now: 0, facing: list(), pending: list() }
    }

    /// Whether there is surface in the sphere that no way within the sphere leads to along the surface, and that faces its
    /// centre: behind a thin lobe the other side does not. Where more than [`MOST`] triangles are in the sphere it is not
    /// known, and none is said to be there.
    pub fn is_touched_twice(
        &self,
        points: &[[f64; 3]],
        sphere: &Touching,
        marks: &mut Marks,
    ) -> bool {
        let [found, reached] = marks.begin();
        let Marks { last, facing, pending, .. } = marks;
        let (center, radius, mut count) = (sphere.center, sphere.radius, 0);
        let are_few = self.tree.visit_within(points, &self.triangles, center, radius, |closest| {
            count += 1;
            last[closest.triangle as usize] = found;
            let corners = self.triangles[closest.triangle as usize];
            let normal = normal_of(corners.map(|node| points[node as usize]));
            if dot(normal, sub(center, closest.point)) > 0.0 {
                facing.push(closest.triangle);
            }
            count < MOST
        });
        if !are_few {
            return false;
        }
        let mut reach = |corners: [u32; 3], pending: &mut Vec<u32>| {
            for &triangle in corners.iter().flat_map(|&node| self.around.of(node)) {
                if last[triangle as usize] == found {
                    last[triangle as usize] = reached;
                    pending.push(triangle);
                }
            }
        };
        reach(sphere.triangle, pending);
        while let Some(triangle) = pending.pop() {
            reach(self.triangles[triangle as usize], pending);
        }
        facing.iter().any(|&triangle| last[triangle as usize] == found)
    }
}

impl Skin {
    /// How far a sphere reaches into the organ [m]; negative by its distance.
    pub fn overlap(&self, points: &[[f64; 3]], center: [f64; 3], radius: f64) -> f64 {
        let Some(closest) = self.tree.closest(points, &self.triangles, center) else {
            return f64::NEG_INFINITY;
        };
        let is_outside = self.is_above(points, center, closest.distance);
        if is_outside { radius - closest.distance } else { radius + closest.distance }
    }

    /// Whether a place is outside the organ: above the closest point of its surface, by the normals of all triangles that have
    /// the point, each weighted by its angle there (Baerentzen and Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005)
    /// 243).
    pub fn is_outside(&self, points: &[[f64; 3]], at: [f64; 3]) -> bool {
        let Some(closest) = self.tree.closest(points, &self.triangles, at) else { return true };
        self.is_above(points, at, closest.distance)
    }

    /// The same at this distance from the surface. Several points of it may be as close, each with triangles of its own.
    fn is_above(&self, points: &[[f64; 3]], at: [f64; 3], distance: f64) -> bool {
        let reach = distance * (1.0 + SAME);
        let mut up = 0.0;
        self.tree.visit_within(points, &self.triangles, at, reach, |near| {
            let corners = self.triangles[near.triangle as usize].map(|node| points[node as usize]);
            let (normal, away) = (normal_of(corners), sub(at, near.point));
            up += angle(&corners, near.barycentric) * dot(normal, away) / norm(normal);
            true
        });
        up > 0.0
    }
}

/// The angle of a triangle at a point of it that is a corner; on an edge half a turn.
fn angle(corners: &[[f64; 3]; 3], weights: [f64; 3]) -> f64 {
    let Some(k) = weights.iter().position(|&w| w > 1.0 - SAME) else { return PI };
    let [a, b] = [1, 2].map(|i| sub(corners[(k + i) % 3], corners[k]));
    norm(cross(a, b)).atan2(dot(a, b))
}

impl Marks {
    /// The marks of a new search.
    fn begin(&mut self) -> [u32; 2] {
        if self.now > u32::MAX - 2 {
            self.last.fill(0);
            self.now = 0;
        }
        self.now += 2;
        self.facing.clear();
        self.pending.clear();
        [self.now - 1, self.now]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 0.02;

    /// Edge of a cell [m].
    const EDGE: f64 = 2e-3;

    /// Squares of `n` by `n` cells, each spanned from a corner by two directions; their nodes are not shared.
    fn squares(of: &[[[f64; 3]; 3]], n: usize) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for [corner, along, across] in of {
            let first = points.len();
            let side = n + 1;
            for (i, k) in (0..side * side).map(|p| (p / side, p % side)) {
                let (a, b) = (EDGE * i as f64, EDGE * k as f64);
                points.push(std::array::from_fn(|x| corner[x] + a * along[x] + b * across[x]));
            }
            for (i, k) in (0..n * n).map(|cell| (cell / n, cell % n)) {
                let at = |i: usize, k: usize| (first + i * side + k) as u32;
                triangles.push([at(i, k), at(i + 1, k), at(i + 1, k + 1)]);
                triangles.push([at(i, k), at(i + 1, k + 1), at(i, k + 1)]);
            }
        }
        (points, triangles)
    }

    /// A floor below z = 0, and beside it what else there is.
    fn touched_twice(others: &[[[f64; 3]; 3]], height: f64) -> bool {
        let floor = [[-0.03, -0.03, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mut all = vec![floor];
        all.extend(others);
        let (points, triangles) = squares(&all, 30);
        let center = [0.0, 0.0, height];
        let tree = TriangleTree::new(&points, &triangles);
        let closest = tree.closest(&points, &triangles, center).unwrap();
        let triangle = triangles[closest.triangle as usize];
        let skin = Skin::new(&points, triangles);
        let mut marks = skin.marks();
        let sphere = Touching { center, radius: RADIUS, triangle };
        let found = skin.is_touched_twice(&points, &sphere, &mut marks);
        marks.now = u32::MAX - 1;
        assert_eq!(skin.is_touched_twice(&points, &sphere, &mut marks), found, "marks begin anew");
        found
    }

    #[test]
    fn a_wall_beside_the_floor_is_a_second_place() {
        // It faces the sphere, and stands free on the floor.
        let wall = |x: f64| [[x, -0.03, 0.002], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(!touched_twice(&[], 0.015), "the floor alone");
        assert!(touched_twice(&[wall(-0.018)], 0.018));
        assert!(!touched_twice(&[wall(-0.021)], 0.018), "out of reach");
    }

    #[test]
    fn a_sphere_reaches_into_the_organ_from_either_side_of_the_surface() {
        let (points, triangles) =
            squares(&[[[-0.03, -0.03, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], 30);
        let skin = Skin::new(&points, triangles);
        for (height, overlap) in [(0.03, -0.01), (0.015, 0.005), (-0.005, 0.025)] {
            let found = skin.overlap(&points, [0.001, 0.0005, height], RADIUS);
            assert!((found - overlap).abs() < 1e-12, "{height}: {found}");
        }
    }

    /// Both walls of a plate are as close there, one by an edge of two triangles, the other by one triangle.
    #[test]
    fn the_middle_between_walls_is_inside() {
        let height = 4.0 * EDGE;
        let walls = [
            [[-0.02, -0.02, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
            [[-0.02, 0.02, height], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]],
        ];
        let (points, triangles) = squares(&walls, 20);
        let skin = Skin::new(&points, triangles);
        for [x, y] in [[0.3, 0.3], [0.3, -0.3], [0.0, 0.3], [0.2, 0.1]] {
            let at = |part: f64| [x * EDGE, y * EDGE, part * height];
            for part in [0.5 - 1e-11, 0.5, 0.5 + 1e-11] {
                assert!(!skin.is_outside(&points, at(part)), "{x} {y} {part}");
            }
            assert!(skin.is_outside(&points, at(1.5)) && skin.is_outside(&points, at(-0.5)));
        }
    }

    #[test]
    fn the_back_of_what_is_touched_is_none() {
        let below = [[-0.03, -0.03, -0.002], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
        assert!(!touched_twice(&[below], 0.012));
        let above = [[-0.03, -0.03, 0.032], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
        assert!(touched_twice(&[above], 0.015), "a ceiling faces it");
    }

    /// The walls of a narrow slot, so finely meshed that there is no time to look at all of them.
    #[test]
    fn a_surface_too_fine_for_a_tick_is_not_searched() {
        let twice = |n: usize| {
            let (y, z) = ([0.0, 10.0 / n as f64, 0.0], [0.0, 0.0, 10.0 / n as f64]);
            let walls = [[[0.0; 3], y, z], [[0.001, 0.0, 0.0], z, y]];
            let (points, triangles) = squares(&walls, n);
            let triangle = triangles[0];
            let skin = Skin::new(&points, triangles);
            let sphere = Touching { center: [0.0005, 0.001, 0.001], radius: 0.1, triangle };
            skin.is_touched_twice(&points, &sphere, &mut skin.marks())
        };
        assert!(twice(10) && !twice(40));
    }

    /// A step of the floor, of one piece with it: a way within the sphere leads up only where it reaches into the corner.
    #[test]
    fn what_the_sphere_reaches_on_a_way_within_it_is_the_same_place() {
        let (mut points, triangles) =
            squares(&[[[-0.03, -0.03, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], 30);
        // What lies beyond x = 5 mm is turned up.
        for point in points.iter_mut().filter(|point| point[0] > 0.005) {
            (point[0], point[2]) = (0.005, point[0] - 0.005);
        }
        let skin = Skin::new(&points, triangles.clone());
        let twice = |center: [f64; 3]| {
            let closest = skin.tree.closest(&points, &triangles, center).unwrap();
            let triangle = triangles[closest.triangle as usize];
            let sphere = Touching { center, radius: RADIUS, triangle };
            skin.is_touched_twice(&points, &sphere, &mut skin.marks())
        };
        assert!(!twice([-0.015, 0.0, 0.018]), "the floor alone");
        assert!(twice([-0.013, 0.0, 0.018]), "floor and wall, and not the corner between them");
        assert!(!twice([-0.005, 0.0, 0.012]), "the corner, too");
    }
}
