//! The body-centred cubic lattice, whose cells have dihedral angles of 60 and 90 degrees.

use crate::vector::Point;
use rayon::prelude::*;

/// Mean length of the lattice's edges, in units of the distance between its centres: two edges of length 1 and four of
/// `sqrt(3) / 2` in every cell.
pub const MEAN_EDGE: f64 = (2.0 + 4.0 * 0.866_025_403_784_438_6) / 6.0;

/// Points and cells of the lattice over a box, those cells only that have a corner where `is_inside`. A cell joins two
/// neighbouring centres and an edge of the cubic lattice between them.
pub fn lattice(
    [low, high]: [Point; 2],
    spacing: f64,
    is_inside: impl Fn(Point) -> bool + Sync,
) -> (Vec<Point>, Vec<[u32; 4]>) {
    let n: [usize; 3] = std::array::from_fn(|k| ((high[k] - low[k]) / spacing).ceil() as usize + 2);
    // The first corner is half a step outside the box, so that its centres reach it.
    let place = |index: [usize; 3], shift: f64| -> Point {
        std::array::from_fn(|k| low[k] + (index[k] as f64 - 0.5 + shift) * spacing)
    };
    let count = n[0] * n[1] * n[2];
    let index = |i: usize| [i / (n[1] * n[2]), i / n[2] % n[1], i % n[2]];
    let flags: Vec<bool> = (0..2 * count)
        .into_par_iter()
        .map(|i| is_inside(place(index(i % count), if i < count { 0.0 } else { 0.5 })))
        .collect();
    let stride = [n[1] * n[2], n[2], 1];
    let cells: Vec<[u32; 4]> = (0..count)
        .into_par_iter()
        .flat_map_iter(|i| {
            let (at, flags) = (index(i), &flags);
            (0..3).flat_map(move |axis| {
                let (s, t) = (stride[(axis + 1) % 3], stride[(axis + 2) % 3]);
                // The face between this centre and the next along the axis.
                let fits = (0..3).all(|k| at[k] + 1 + usize::from(k == axis) < n[k]);
                let start = i + stride[axis];
                let ring = [start, start + s, start + s + t, start + t];
                let cell = move |k: usize| {
                    [count + i, count + i + stride[axis], ring[k], ring[(k + 1) % 4]]
                };
                (0..if fits { 4 } else { 0 })
                    .map(cell)
                    .filter(|cell| cell.iter().any(|&c| flags[c]))
                    .map(|cell| cell.map(|c| c as u32))
            })
        })
        .collect();
    let points = (0..2 * count)
        .into_par_iter()
        .map(|i| place(index(i % count), if i < count { 0.0 } else { 0.5 }))
        .collect();
    (points, cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::{dihedral_angles, volume6};

    #[test]
    fn cells_fill_space_and_are_turned_the_same_way() {
        let (points, cells) = lattice([[0.0; 3], [4.0, 3.0, 3.0]], 1.0, |_| true);
        let mut total = 0.0;
        for cell in cells {
            let x = cell.map(|i| points[i as usize]);
            assert!((volume6(x) - 0.5).abs() < 1e-12, "each is a twelfth of a cube");
            let mut angles = dihedral_angles(x);
            angles.sort_by(f64::total_cmp);
            assert!(angles[..4].iter().all(|a| (a - 60.0).abs() < 1e-9));
            assert!(angles[4..].iter().all(|a| (a - 90.0).abs() < 1e-9));
            total += volume6(x) / 6.0;
        }
        assert!(total > 36.0);
    }
}
