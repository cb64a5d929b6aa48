//! The closest point on a triangle, and on a surface through a tree of boxes. Queries allocate nothing.

use super::{Vector, dot, sub};

/// The point of a surface closest to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Index of the triangle.
    pub triangle: u32,
    /// Weights of its three corners, each in [0, 1], sum 1.
    pub barycentric: [f64; 3],
    /// The closest point itself [m].
    pub point: [f64; 3],
    /// Its distance from the query point [m].
    pub distance: f64,
}

impl Closest {
    /// With its distance, the root of this square: one root for a query, not one for each triangle.
    fn measured(self, squared: f64) -> Self {
        Closest { distance: squared.sqrt(), ..self }
    }
}

/// Barycentric coordinates of the point of triangle `a b c` closest to `p`, by the Voronoi regions of corners and
/// edges (Ericson, Real-Time Collision Detection, 2005, section 5.1.5). Each is in [0, 1] and they sum to 1, also on a
/// triangle flattened to a segment or a point.
pub fn closest_point_on_triangle(p: [f64; 3], a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> [f64; 3] {
    let (ab, ac) = (sub(b, a), sub(c, a));
    let from_a = sub(p, a);
    let (d1, d2) = (dot(ab, from_a), dot(ac, from_a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let from_b = sub(p, b);
    let (d3, d4) = (dot(ab, from_b), dot(ac, from_b));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let area_c = d1 * d4 - d3 * d2;
    if area_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let from_c = sub(p, c);
    let (d5, d6) = (dot(ab, from_c), dot(ac, from_c));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let area_b = d5 * d2 - d1 * d6;
    if area_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let area_a = d3 * d6 - d5 * d4;
    let (to_c, to_b) = (d4 - d3, d5 - d6);
    if area_a <= 0.0 && to_c >= 0.0 && to_b >= 0.0 && to_c + to_b > 0.0 {
        let w = to_c / (to_c + to_b);
        return [0.0, 1.0 - w, w];
    }
    let total = area_a + area_b + area_c;
    if total <= 0.0 {
        return [1.0, 0.0, 0.0]; // rounding on a triangle without area, whose corners coincide to that precision
    }
    let (v, w) = (area_b / total, area_c / total);
    [(1.0 - v - w).max(0.0), v, w]
}

/// The point with the given barycentric coordinates in triangle `x`.
pub(super) fn interpolate(x: [Vector; 3], barycentric: [f64; 3]) -> Vector {
    std::array::from_fn(|k| (0..3).map(|i| barycentric[i] * x[i][k]).sum())
}

#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: Vector,
    high: Vector,
}

impl Bounds {
    const EMPTY: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    fn include(&mut self, p: Vector) {
        for k in 0..3 {
            self.low[k] = self.low[k].min(p[k]);
            self.high[k] = self.high[k].max(p[k]);
        }
    }

    fn squared_distance(&self, p: Vector) -> f64 {
        (0..3).map(|k| (self.low[k] - p[k]).max(p[k] - self.high[k]).max(0.0).powi(2)).sum()
    }
}

/// A box holding `order[start..end]`; an inner node's children follow it: the left one next, the right one at `right`.
#[derive(Clone, Debug)]
struct Node {
    bounds: Bounds,
    start: u32,
    end: u32,
    right: u32, // 0 for a leaf
    /// The first node after all that it holds.
    next: u32,
}

/// A balanced tree of boxes over triangles, split at the median centroid of the longest side.
#[derive(Clone, Debug)]
pub struct TriangleTree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

const LEAF_SIZE: usize = 4;
/// Halving a list of at most 2^32 triangles: the pending right children never outnumber the depth.
const MAX_DEPTH: usize = 33;

impl TriangleTree {
    /// Builds the tree; `triangles` index `points`.
    pub fn new(points: &[Vector], triangles: &[[u32; 3]]) -> Self {
        let centroids: Vec<Vector> = triangles
            .iter()
            .map(|triangle| interpolate(triangle.map(|i| points[i as usize]), [1.0 / 3.0; 3]))
            .collect();
        let mut tree = Self { nodes: Vec::new(), order: (0..triangles.len() as u32).collect() };
        tree.split(points, triangles, &centroids, 0, triangles.len());
        tree
    }

    fn split(
        &mut self,
        points: &[Vector],
        triangles: &[[u32; 3]],
        centroids: &[Vector],
        start: usize,
        end: usize,
    ) {
        let (mut bounds, mut spread) = (Bounds::EMPTY, Bounds::EMPTY);
        for &t in &self.order[start..end] {
            triangles[t as usize].iter().for_each(|&i| bounds.include(points[i as usize]));
            spread.include(centroids[t as usize]);
        }
        let here = self.nodes.len();
        self.nodes.push(Node { bounds, start: start as u32, end: end as u32, right: 0, next: 0 });
        if end - start > LEAF_SIZE {
            let side = sub(spread.high, spread.low);
            let axis = (0..3).max_by(|&i, &j| side[i].total_cmp(&side[j])).unwrap_or(0);
            let middle = (end - start) / 2;
            self.order[start..end].select_nth_unstable_by(middle, |&i, &j| {
                centroids[i as usize][axis].total_cmp(&centroids[j as usize][axis]).then(i.cmp(&j))
            });
            self.split(points, triangles, centroids, start, start + middle);
            self.nodes[here].right = self.nodes.len() as u32;
            self.split(points, triangles, centroids, start + middle, end);
        }
        self.nodes[here].next = self.nodes.len() as u32;
    }

    /// The closest point, without allocating; `None` when there is no triangle or the query is not finite.
    pub fn closest(&self, points: &[Vector], triangles: &[[u32; 3]], p: Vector) -> Option<Closest> {
        self.closest_within(points, triangles, p, f64::INFINITY)
    }

    /// [`TriangleTree::closest`], if it is nearer than `reach`: what is farther is not looked at.
    pub fn closest_within(
        &self,
        points: &[Vector],
        triangles: &[[u32; 3]],
        p: Vector,
        reach: f64,
    ) -> Option<Closest> {
        let mut best: Option<Closest> = None;
        let mut best_squared = reach * reach;
        let mut pending = [0u32; MAX_DEPTH];
        let mut n_pending = 1;
        while n_pending > 0 {
            n_pending -= 1;
            let mut here = pending[n_pending] as usize;
            while self.nodes[here].bounds.squared_distance(p) < best_squared {
                let node = &self.nodes[here];
                if node.right != 0 {
                    let (left, right) = (here + 1, node.right as usize);
                    let [to_left, to_right] =
                        [left, right].map(|n| self.nodes[n].bounds.squared_distance(p));
                    let (near, far) =
                        if to_left <= to_right { (left, right) } else { (right, left) };
                    pending[n_pending] = far as u32;
                    n_pending += 1;
                    here = near;
                    continue;
                }
                for (squared, closest) in self.in_leaf(node, points, triangles, p) {
                    if squared < best_squared {
                        best_squared = squared;
                        best = Some(closest);
                    }
                }
                break;
            }
        }
        best.map(|closest| closest.measured(best_squared))
    }

    /// The triangles of a leaf: their squared distances from a point, and their closest points, not measured yet.
    #[inline]
    fn in_leaf<'a>(
        &'a self,
        node: &Node,
        points: &'a [Vector],
        triangles: &'a [[u32; 3]],
        p: Vector,
    ) -> impl Iterator<Item = (f64, Closest)> + 'a {
        self.order[node.start as usize..node.end as usize].iter().map(move |&triangle| {
            let x = triangles[triangle as usize].map(|i| points[i as usize]);
            let barycentric = closest_point_on_triangle(p, x[0], x[1], x[2]);
            let point = interpolate(x, barycentric);
            let away = sub(p, point);
            (dot(away, away), Closest { triangle, barycentric, point, distance: f64::NAN })
        })
    }

    /// Visits triangles nearer to a point than `reach`, each with its closest point, as long as the visit says so; whether
    /// it has visited all. It allocates nothing. None is near a query that is not finite.
    pub fn visit_within(
        &self,
        points: &[Vector],
        triangles: &[[u32; 3]],
        p: Vector,
        reach: f64,
        mut visit: impl FnMut(Closest) -> bool,
    ) -> bool {
        let mut here = 0;
        // Nodes come in the order of a walk from left to right: one out of reach is skipped with what it holds.
        while here < self.nodes.len() {
            let node = &self.nodes[here];
            if !(node.bounds.squared_distance(p) < reach * reach) {
                here = node.next as usize;
                continue;
            }
            here += 1;
            if node.right != 0 {
                continue;
            }
            for (squared, closest) in self.in_leaf(node, points, triangles, p) {
                if squared < reach * reach && !visit(closest.measured(squared)) {
                    return false;
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::norm;
    use super::super::samples::block;
    use super::super::surface::{Surface, surface};
    use super::*;

    const A: Vector = [0.0, 0.0, 0.0];
    const B: Vector = [2.0, 0.0, 0.0];
    const C: Vector = [0.0, 2.0, 0.0];

    /// Numbers in [-1, 1) from a fixed linear congruence: reproducible without a dependency.
    fn numbers() -> impl Iterator<Item = f64> {
        let mut state = 1u64;
        std::iter::repeat_with(move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        })
    }

    #[test]
    fn every_region_of_a_triangle() {
        let cases = [
            ([-1.0, -1.0, 3.0], [1.0, 0.0, 0.0]),
            ([3.0, -0.5, 1.0], [0.0, 1.0, 0.0]),
            ([-0.5, 3.0, 1.0], [0.0, 0.0, 1.0]),
            ([1.0, -1.0, 0.0], [0.5, 0.5, 0.0]),
            ([-1.0, 0.5, 0.0], [0.75, 0.0, 0.25]),
            ([2.0, 2.0, 5.0], [0.0, 0.5, 0.5]),
            ([0.5, 0.5, -7.0], [0.5, 0.25, 0.25]),
        ];
        for (p, expected) in cases {
            assert_eq!(closest_point_on_triangle(p, A, B, C), expected, "{p:?}");
        }
    }

    #[test]
    fn flat_triangles_give_valid_weights() {
        for (a, b, c) in
            [(A, A, A), (A, B, B), (A, A, C), (A, B, [1.0, 0.0, 0.0]), ([1.0, 0.0, 0.0], A, B)]
        {
            for p in [[0.3, 0.4, 0.5], [5.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.2, 0.0, 0.0]] {
                let weights = closest_point_on_triangle(p, a, b, c);
                assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)), "{weights:?}");
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn no_sample_of_a_triangle_is_closer() {
        let mut random = numbers();
        let mut point = || -> Vector { std::array::from_fn(|_| random.next().unwrap()) };
        for _ in 0..200 {
            let [a, b, c, p] = [point(), point(), point(), point()];
            let distance =
                norm(sub(p, interpolate([a, b, c], closest_point_on_triangle(p, a, b, c))));
            for i in 0..=20 {
                for j in 0..=(20 - i) {
                    let (v, w) = (i as f64 / 20.0, j as f64 / 20.0);
                    let sample = interpolate([a, b, c], [1.0 - v - w, v, w]);
                    assert!(distance <= norm(sub(p, sample)) + 1e-12);
                }
            }
        }
    }

    #[test]
    fn the_tree_agrees_with_brute_force() {
        let (points, cells) = block([5, 4, 3], [1.0, 0.8, 0.6]);
        let triangles = surface(&points, &cells);
        let tree = Surface::new(&points, &triangles);
        let mut random = numbers();
        for _ in 0..300 {
            let p: Vector = std::array::from_fn(|_| 1.5 * random.next().unwrap());
            let found = tree.closest(p).unwrap();
            let brute = triangles
                .iter()
                .map(|triangle| {
                    let x = triangle.map(|i| points[i as usize]);
                    norm(sub(p, interpolate(x, closest_point_on_triangle(p, x[0], x[1], x[2]))))
                })
                .fold(f64::INFINITY, f64::min);
            assert!((found.distance - brute).abs() < 1e-14);
            let x = triangles[found.triangle as usize].map(|i| points[i as usize]);
            assert_eq!(found.point, interpolate(x, found.barycentric));
        }
    }

    #[test]
    fn within_a_reach_it_finds_the_same_point_or_none() {
        let (points, cells) = block([5, 4, 3], [1.0, 0.8, 0.6]);
        let triangles = surface(&points, &cells);
        let tree = TriangleTree::new(&points, &triangles);
        let mut random = numbers();
        for _ in 0..300 {
            let p: Vector = std::array::from_fn(|_| 1.5 * random.next().unwrap());
            let found = tree.closest(&points, &triangles, p).unwrap();
            let within = |reach: f64| tree.closest_within(&points, &triangles, p, reach);
            assert_eq!(within(1.001 * found.distance), Some(found));
            assert_eq!(within(2.0 * found.distance), Some(found));
            assert_eq!(within(0.999 * found.distance), None);
        }
    }

    #[test]
    fn all_triangles_within_a_reach_are_visited_once() {
        let (points, cells) = block([5, 4, 3], [1.0, 0.8, 0.6]);
        let triangles = surface(&points, &cells);
        let tree = TriangleTree::new(&points, &triangles);
        let mut random = numbers();
        for reach in [0.0, 0.1, 0.4, 5.0] {
            let p: Vector = std::array::from_fn(|_| 1.2 * random.next().unwrap());
            let distance = |triangle: &[u32; 3]| {
                let x = triangle.map(|i| points[i as usize]);
                norm(sub(p, interpolate(x, closest_point_on_triangle(p, x[0], x[1], x[2]))))
            };
            let within = (0..).zip(&triangles).filter(|(_, t)| distance(t) < reach);
            let expected: Vec<u32> = within.map(|(t, _)| t).collect();
            let mut visited = Vec::new();
            let are_all = tree.visit_within(&points, &triangles, p, reach, |closest| {
                assert_eq!(closest.distance, distance(&triangles[closest.triangle as usize]));
                visited.push(closest.triangle);
                true
            });
            assert!(are_all);
            let mut count = 0;
            let mut first = |_| {
                count += 1;
                false
            };
            assert_eq!(
                tree.visit_within(&points, &triangles, p, reach, &mut first),
                visited.is_empty()
            );
            assert_eq!(count, visited.len().min(1), "the visit ends when it says so");
            visited.sort_unstable();
            assert_eq!(visited, expected);
        }
    }

    #[test]
    fn a_query_that_is_not_finite_finds_nothing() {
        let (points, cells) = block([1, 1, 1], [1.0; 3]);
        let tree = Surface::new(&points, &surface(&points, &cells));
        assert_eq!(tree.closest([f64::NAN, 0.0, 0.0]), None);
        let triangles = surface(&points, &cells);
        let none = |_| panic!("nothing is near");
        let tree = TriangleTree::new(&points, &triangles);
        tree.visit_within(&points, &triangles, [f64::NAN, 0.0, 0.0], 1.0, none);
        assert_eq!(Surface::new(&points, &[]).closest([0.0; 3]), None);
    }
}
