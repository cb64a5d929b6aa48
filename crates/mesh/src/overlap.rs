//! Where two surfaces lie on each other: the common pieces of their triangles, over which integrals of an interface
//! between meshes that do not match are exact (Puso and Laursen, Comput. Methods Appl. Mech. Eng. 193, 2004, 601).

use super::{Boxes, Vector, cross, dot, norm, sub};

/// Cosine between the normals of two triangles that count as facing each other.
const FACING: f64 = -0.5;
/// Pieces smaller than this part of their triangle are rounding.
const SMALLEST: f64 = 1e-12;

/// A triangle that two triangles have in common.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// The triangle of the first surface and that of the second.
    pub triangles: [u32; 2],
    /// By corner of the piece: its barycentric coordinates in each of the two triangles.
    pub corners: [[[f64; 3]; 2]; 3],
    /// Area [m^2], in the plane of the first triangle.
    pub area: f64,
    /// How deep the second triangle is behind the first there, at most [m]; negative in front. As deep as a body is thick,
    /// it is the far side of the body that faces it.
    pub depth: f64,
}

/// The pieces that two surfaces have in common: the triangles of the second are projected to the planes of those of the
/// first that they face and that are at most `reach` away. All indices must be in range, all triangles have an area.
pub fn overlap(
    points: &[Vector],
    first: &[[u32; 3]],
    second: &[[u32; 3]],
    reach: f64,
) -> Vec<Piece> {
    let boxes = Boxes::new(points, second);
    let mut near = Vec::new();
    for (number, triangle) in (0u32..).zip(first) {
        let start = near.len();
        let corners = triangle.map(|node| points[node as usize]);
        boxes.each_near(&corners, reach, |other| near.push([number, other as u32]));
        near[start..].sort_unstable();
    }
    overlap_of(points, first, second, &near, reach)
}

/// [`overlap`] of these pairs of a triangle of the first and one of the second surface, those of one triangle together.
pub fn overlap_of(
    points: &[Vector],
    first: &[[u32; 3]],
    second: &[[u32; 3]],
    pairs: &[[u32; 2]],
    reach: f64,
) -> Vec<Piece> {
    let corners = |triangle: &[u32; 3]| triangle.map(|node| points[node as usize]);
    let mut pieces = Vec::new();
    for pairs in pairs.chunk_by(|one, other| one[0] == other[0]) {
        let plane = Plane::new(corners(&first[pairs[0][0] as usize]));
        for &pair in pairs {
            plane.add_pieces(pair, corners(&second[pair[1] as usize]), reach, &mut pieces);
        }
    }
    pieces
}

/// A triangle with axes in its plane.
struct Plane {
    corners: [Vector; 3],
    axes: [Vector; 2],
    normal: Vector,
    /// The corners in these axes, anticlockwise.
    flat: [[f64; 2]; 3],
    area: f64,
}

impl Plane {
    fn new(corners: [Vector; 3]) -> Self {
        let [a, b, c] = corners;
        let (along, doubled) = (sub(b, a), cross(sub(b, a), sub(c, a)));
        let (length, size) = (norm(along), norm(doubled));
        let (along, normal) = (along.map(|x| x / length), doubled.map(|x| x / size));
        let axes = [along, cross(normal, along)];
        let flat = corners.map(|x| axes.map(|axis| dot(axis, sub(x, a))));
        Plane { corners, axes, normal, flat, area: 0.5 * size }
    }

    fn add_pieces(
        &self,
        triangles: [u32; 2],
        other: [Vector; 3],
        reach: f64,
        pieces: &mut Vec<Piece>,
    ) {
        let facing = cross(sub(other[1], other[0]), sub(other[2], other[0]));
        if dot(facing, self.normal) > FACING * norm(facing) {
            return;
        }
        let shadow = other.map(|x| self.axes.map(|axis| dot(axis, sub(x, self.corners[0]))));
        let mut polygon = shadow.to_vec();
        for k in 0..3 {
            polygon = clipped(&polygon, self.flat[k], self.flat[(k + 1) % 3]);
        }
        for k in 1..polygon.len().saturating_sub(1) {
            let flat = [polygon[0], polygon[k], polygon[k + 1]];
            let area = 0.5 * doubled(flat).abs();
            let corners = flat.map(|x| [barycentric(self.flat, x), barycentric(shadow, x)]);
            let ways = corners.map(|[own, its]| {
                let at = |x: [Vector; 3], w: [f64; 3]| -> Vector {
                    std::array::from_fn(|i| (0..3).map(|k| w[k] * x[k][i]).sum())
                };
                sub(at(self.corners, own), at(other, its))
            });
            let is_near = ways.iter().all(|&way| norm(way) <= reach);
            if area > SMALLEST * self.area && is_near {
                let depth =
                    ways.map(|way| dot(way, self.normal)).into_iter().fold(f64::MIN, f64::max);
                pieces.push(Piece { triangles, corners, area, depth });
            }
        }
    }
}

/// The part of a polygon on the left of a line (Sutherland and Hodgman, Commun. ACM 17, 1974, 32).
fn clipped(polygon: &[[f64; 2]], from: [f64; 2], to: [f64; 2]) -> Vec<[f64; 2]> {
    let side = |x: [f64; 2]| doubled([from, to, x]);
    let mut inside = Vec::with_capacity(polygon.len() + 1);
    for (k, &x) in polygon.iter().enumerate() {
        let next = polygon[(k + 1) % polygon.len()];
        let (here, there) = (side(x), side(next));
        if here >= 0.0 {
            inside.push(x);
        }
        if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
            let part = here / (here - there);
            inside.push(std::array::from_fn(|i| x[i] + part * (next[i] - x[i])));
        }
    }
    inside
}

/// Twice the area of a triangle, positive if its corners go round anticlockwise.
fn doubled([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn barycentric(triangle: [[f64; 2]; 3], x: [f64; 2]) -> [f64; 3] {
    let [a, b, c] = triangle;
    let whole = doubled(triangle);
    [doubled([x, b, c]) / whole, doubled([a, x, c]) / whole, doubled([a, b, x]) / whole]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of side 1 at a height in n x n x 2 triangles, seen from above or from below; its first point is `first`.
    fn square(n: usize, height: f64, is_up: bool, first: u32) -> (Vec<Vector>, Vec<[u32; 3]>) {
        let points = (0..=n)
            .flat_map(|j| (0..=n).map(move |i| [i as f64 / n as f64, j as f64 / n as f64, height]));
        let (mut triangles, row) = (Vec::new(), n as u32 + 1);
        for corner in (0..n as u32).flat_map(|j| (0..n as u32).map(move |i| first + i + row * j)) {
            let (a, b, c, d) = (corner, corner + 1, corner + row + 1, corner + row);
            triangles
                .extend([[a, b, c], [a, c, d]].map(|t| if is_up { t } else { [t[0], t[2], t[1]] }));
        }
        (points.collect(), triangles)
    }

    fn both(gap: f64, is_up: bool) -> (Vec<Vector>, [Vec<[u32; 3]>; 2]) {
        let (mut points, first) = square(3, 0.0, true, 0);
        let (others, second) = square(5, gap, is_up, points.len() as u32);
        points.extend(others);
        (points, [first, second])
    }

    #[test]
    fn the_pieces_cover_the_common_area_and_lie_where_they_say() {
        for gap in [0.0, 0.01, -0.01] {
            let (points, [first, second]) = both(gap, false);
            let pieces = overlap(&points, &first, &second, 0.02);
            let area: f64 = pieces.iter().map(|piece| piece.area).sum();
            assert!((area - 1.0).abs() < 1e-12, "{area}");
            for piece in &pieces {
                let [a, b] = piece.triangles;
                for corner in piece.corners {
                    let at = |t: [u32; 3], w: [f64; 3]| -> Vector {
                        std::array::from_fn(|i| {
                            (0..3).map(|k| w[k] * points[t[k] as usize][i]).sum()
                        })
                    };
                    let way =
                        sub(at(first[a as usize], corner[0]), at(second[b as usize], corner[1]));
                    assert!((way[2] + gap).abs() < 1e-12 && way[0].abs() + way[1].abs() < 1e-12);
                    assert!(corner.iter().flatten().all(|w| (-1e-9..1.0 + 1e-9).contains(w)));
                }
                assert!((piece.depth + gap).abs() < 1e-12, "{}", piece.depth);
            }
        }
    }

    #[test]
    fn surfaces_apart_or_facing_the_same_way_have_nothing_in_common() {
        let (points, [first, second]) = both(0.05, false);
        assert!(overlap(&points, &first, &second, 0.02).is_empty());
        let (points, [first, second]) = both(0.0, true);
        assert!(overlap(&points, &first, &second, 0.02).is_empty());
    }
}
