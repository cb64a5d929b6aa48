//! How good a tetrahedron is: its dihedral angles.

use crate::vector::{Point, cross, dot, norm, sub};

/// Six times the volume, positive where `(b - a) x (c - a) . (d - a) > 0`.
pub fn volume6([a, b, c, d]: [Point; 4]) -> f64 {
    dot(cross(sub(b, a), sub(c, a)), sub(d, a))
}

/// The smallest sine of a dihedral angle, with the sign of the volume: what smoothing makes larger, since it is small
/// for angles near 0 and near 180 degrees (Klingner and Shewchuk, 2007). A regular tetrahedron has 0.943.
pub fn min_sine(x: [Point; 4]) -> f64 {
    let [a, b, c, d] = x;
    let volume = volume6(x);
    // Twice the areas of the faces opposite each corner.
    let area = [
        norm(cross(sub(c, b), sub(d, b))),
        norm(cross(sub(c, a), sub(d, a))),
        norm(cross(sub(b, a), sub(d, a))),
        norm(cross(sub(b, a), sub(c, a))),
    ];
    let mut least = f64::INFINITY;
    for (i, j) in EDGES {
        // The angle at edge (i, j) is between the faces opposite the other two corners: sin = 3/2 V l / (A_k A_l).
        let (k, l) = opposite(i, j);
        let sine = volume.abs() * norm(sub(x[j], x[i])) / (area[k] * area[l]);
        least = least.min(sine);
    }
    if least.is_nan() { -1.0 } else { least.copysign(volume) }
}

/// The six dihedral angles [degrees], at the edges in the order of [`EDGES`].
pub fn dihedral_angles(x: [Point; 4]) -> [f64; 6] {
    EDGES.map(|(i, j)| {
        let (k, l) = opposite(i, j);
        let edge = sub(x[j], x[i]);
        let (n, m) = (cross(edge, sub(x[k], x[i])), cross(edge, sub(x[l], x[i])));
        norm(cross(n, m)).atan2(dot(n, m)).to_degrees()
    })
}

/// Ends of the edges of a tetrahedron.
pub const EDGES: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// Corners of the faces, outward; face `i` is opposite corner `i`.
pub const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

fn opposite(i: usize, j: usize) -> (usize, usize) {
    let mut rest = (0..4).filter(|&k| k != i && k != j);
    (rest.next().unwrap_or(0), rest.next().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const REGULAR: [Point; 4] =
        [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];

    #[test]
    fn angles_of_the_regular_tetrahedron() {
        let angle = (1.0_f64 / 3.0).acos().to_degrees();
        assert!(dihedral_angles(REGULAR).iter().all(|a| (a - angle).abs() < 1e-12));
        assert!((min_sine(REGULAR).abs() - angle.to_radians().sin()).abs() < 1e-14);
    }

    #[test]
    fn the_least_sine_is_that_of_the_angles() {
        let x = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 1.3, 0.1], [0.3, 0.2, 0.4]];
        let least =
            dihedral_angles(x).map(|a| a.to_radians().sin()).into_iter().fold(1.0, f64::min);
        assert!((min_sine(x) - least).abs() < 1e-14);
        assert!((min_sine([x[0], x[2], x[1], x[3]]) + least).abs() < 1e-14, "inverted");
    }

    #[test]
    fn faces_look_outward() {
        let x = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(volume6(x) > 0.0);
        for (corner, face) in FACES.into_iter().enumerate() {
            let [a, b, c] = face.map(|k| x[k]);
            assert!(dot(cross(sub(b, a), sub(c, a)), sub(x[corner], a)) < 0.0);
        }
    }
}
