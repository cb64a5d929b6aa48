//! The places on a face where it may touch: corners, middles of edges and centres of its triangular parts, with the
//! weights 1/20, 2/15 and 9/20 of a rule exact to the third degree, so that a uniform pressure gives the nodal forces of
//! the element, linear or quadratic. A face is cut into as many parts as a tool needs that fits between its corners.

use std::collections::BTreeMap;

const CORNER: f64 = 1.0 / 20.0;
const MIDDLE: f64 = 2.0 / 15.0;
const CENTRE: f64 = 9.0 / 20.0;

/// Most parts of an edge, in powers of two.
const MOST: u32 = 8;

/// Barycentric coordinates are counted in these parts of one.
pub const UNITS: u32 = 6 * MOST;

/// Most parts of all faces together; a tool may fit between the places on a larger surface.
const AFFORDABLE: usize = 100_000;

/// A place on a face.
pub struct Place {
    /// Barycentric coordinates, in [`UNITS`].
    pub at: [u32; 3],
    /// Its share of the area.
    pub weight: f64,
}

/// The places on a face whose edges have so many parts.
pub fn places(parts: u32) -> Vec<Place> {
    let unit = UNITS / parts;
    let corner = |i: u32, j: u32| [unit * i, unit * j, unit * (parts - i - j)];
    let mut weights = BTreeMap::new();
    for i in 0..parts {
        for j in 0..parts - i {
            add_part(&mut weights, [corner(i, j), corner(i + 1, j), corner(i, j + 1)]);
            if i + j + 1 < parts {
                add_part(&mut weights, [corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]);
            }
        }
    }
    let whole = f64::from(parts * parts);
    weights.into_iter().map(|(at, weight)| Place { at, weight: weight / whole }).collect()
}

fn add_part(weights: &mut BTreeMap<[u32; 3], f64>, corners: [[u32; 3]; 3]) {
    let mut add = |at: [u32; 3], weight| *weights.entry(at).or_insert(0.0) += weight;
    for i in 0..3 {
        let [a, b] = [corners[i], corners[(i + 1) % 3]];
        add(a, CORNER);
        add(std::array::from_fn(|k| (a[k] + b[k]) / 2), MIDDLE);
    }
    add(std::array::from_fn(|k| corners.iter().map(|corner| corner[k]).sum::<u32>() / 3), CENTRE);
}

/// How many parts the edges of each face have, so that places are at most `spacing` apart [m], as far as that can be
/// afforded, by the longest edge of each [m].
pub fn parts(longest: &[f64], mut spacing: f64) -> Vec<u32> {
    loop {
        let parts: Vec<u32> = longest.iter().map(|edge| parts_of(*edge, spacing)).collect();
        let whole: usize = parts.iter().map(|&n| (n * n) as usize).sum();
        if whole <= AFFORDABLE.max(longest.len()) {
            return parts;
        }
        spacing = spacing.max(longest.iter().copied().fold(0.0, f64::max) / f64::from(2 * MOST));
        spacing *= 2.0;
    }
}

/// Between the middle of an edge's part and its end lies half of it.
fn parts_of(edge: f64, spacing: f64) -> u32 {
    let enough = |parts: &u32| edge <= f64::from(2 * parts) * spacing;
    (0..=MOST.ilog2()).map(|k| 1 << k).find(enough).unwrap_or(MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrals over the triangle of `a^i b^j`, `i! j! 2! / (i + j + 2)!` of its area.
    #[test]
    fn every_rule_is_exact_to_the_third_degree() {
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        for n in [1, 2, 4, 8] {
            for (i, j) in [(0, 0), (1, 0), (2, 0), (1, 1), (3, 0), (2, 1)] {
                let value = |place: &Place| {
                    let [a, b, _] = place.at.map(|k| f64::from(k) / f64::from(UNITS));
                    place.weight * a.powi(i as i32) * b.powi(j as i32)
                };
                let found: f64 = places(n).iter().map(value).sum();
                let exact = 2.0 * factorial(i) * factorial(j) / factorial(i + j + 2);
                assert!((found - exact).abs() < 1e-14, "{n} {i} {j}: {found} {exact}");
            }
            assert!(places(n).iter().all(|place| place.at.iter().sum::<u32>() == UNITS));
        }
    }

    #[test]
    fn faces_have_the_parts_that_the_spacing_asks_for() {
        let longest = [1.0, 2.0, 40.0];
        assert_eq!(parts(&longest, f64::INFINITY), [1, 1, 1]);
        assert_eq!(parts(&longest, 0.5), [1, 2, 8]);
        assert_eq!(parts(&longest, 0.0), [8, 8, 8]);
    }

    #[test]
    fn a_large_surface_has_no_more_parts_than_can_be_afforded() {
        let whole = |n: usize, spacing: f64| -> usize {
            parts(&vec![1.0; n], spacing).iter().map(|&n| (n * n) as usize).sum()
        };
        assert_eq!(whole(1500, 0.0), 1500 * 64);
        assert_eq!(whole(2000, 0.0), 2000 * 16);
        assert_eq!(whole(2000, 1e-6), 2000 * 16);
        assert_eq!(whole(120_000, 0.0), 120_000);
    }
}
