//! The body-centred cubic lattice, graded over an octree.
//!
//! Centres of neighbouring leaves and the edges between them make cells of the lattice, whose dihedral angles are 60
//! and 90 degrees. Where the side of the leaves changes, cells are halved, quartered, or become half pyramids, as in
//! Labelle and Shewchuk (2007): leaves that share a corner differ by a factor of two at most, so these four shapes are
//! all, and no angle is below 45 degrees. The paper keeps the leaves at the surface equal. Here they grade across it,
//! since a vessel ends where it leaves the organ. No bound then holds for the cells that are cut there. They are few,
//! and the improvement that follows every cut is measured by its worst angle. Of the alternatives, bisection of a coarse
//! lattice (Maubach) makes the same shapes, but keeps halved cells where the lattice is even; Cleaver's smoothed octree
//! loses the regular inside.

use crate::vector::Point;
use rayon::prelude::*;
use std::collections::HashSet;

/// Mean length of the lattice's edges, in units of the distance between its centres: two edges of length 1 and four of
/// `sqrt(3) / 2` in every cell.
pub const MEAN_EDGE: f64 = (2.0 + 4.0 * 0.866_025_403_784_438_6) / 6.0;
/// Largest number of leaves, and of half sides of the finest ones along an axis.
const MOST_LEAVES: usize = 1 << 27;
const LONGEST: f64 = 2_097_152.0;

/// Points, and cells that fill a box.
pub struct Lattice {
    pub points: Vec<Point>,
    /// Side of the smallest leaf at each point [m].
    pub spacing: Vec<f64>,
    pub cells: Vec<[u32; 4]>,
}

/// Place in units of half the finest side.
type Place = [i32; 3];

/// Cubes are numbered along the axes, in sides of their level; level 0 is the finest. A cube of a level is a leaf if its
/// parent is split, and itself is not.
struct Octree {
    /// Number of the coarsest cubes along each axis.
    n: [i32; 3],
    /// Cubes of each level that are split.
    split: Vec<HashSet<Place>>,
    low: Point,
    /// Side of the finest cubes [m].
    side: f64,
}

impl Lattice {
    /// The lattice over a box, of cubes with the side `spacing * 2^levels` that are split `levels` times at most. Kept are
    /// the cells of those leaves at which `is_near`. None if they would be too many.
    ///
    /// `is_coarse(x, side)`: whether the cube around `x` must be split.
    pub fn new(
        bounds: [Point; 2],
        spacing: f64,
        levels: usize,
        is_coarse: impl Fn(Point, f64) -> bool + Sync,
        is_near: impl Fn(Point) -> bool + Sync,
    ) -> Option<Self> {
        let mut tree = Octree::roots(bounds, spacing, levels)?;
        tree.refine(is_coarse)?;
        tree.balance();
        let cells: Vec<([u64; 4], usize)> = tree
            .leaves()
            .into_par_iter()
            .filter(|&(level, cube)| tree.around(level, cube).any(|x| is_near(tree.place(x))))
            .flat_map_iter(|(level, cube)| {
                let cells = tree.cells(level, cube);
                cells.into_iter().map(move |cell| (cell.map(key), level))
            })
            .collect();
        let mut keys: Vec<u64> = cells.par_iter().flat_map_iter(|cell| cell.0).collect();
        keys.par_sort_unstable();
        keys.dedup();
        let numbered = |cell: [u64; 4]| {
            cell.map(|corner| keys.partition_point(|&other| other < corner) as u32)
        };
        let (cells, level): (Vec<[u32; 4]>, Vec<usize>) =
            cells.into_par_iter().map(|(cell, level)| (numbered(cell), level)).unzip();
        let mut least = vec![levels; keys.len()];
        for (cell, level) in cells.iter().zip(level) {
            for &i in cell {
                least[i as usize] = least[i as usize].min(level);
            }
        }
        let spacing = least.into_iter().map(|level| tree.side_of(level)).collect();
        Some(Lattice {
            points: keys.into_iter().map(|key| tree.place(unkeyed(key))).collect(),
            spacing,
            cells,
        })
    }
}

impl Octree {
    fn roots([low, high]: [Point; 2], side: f64, levels: usize) -> Option<Self> {
        let root = side * (1_u64 << levels) as f64;
        // The first corner is half a side outside the box, so that the centres reach it.
        let count: Point = std::array::from_fn(|k| ((high[k] - low[k]) / root).ceil() + 1.0);
        let is_fine = count.iter().any(|&n| !(n * 2.0 * root / side < LONGEST));
        if is_fine || !(count.iter().product::<f64>() < MOST_LEAVES as f64) {
            return None;
        }
        let split = vec![HashSet::new(); levels + 1];
        let low = low.map(|x| x - 0.5 * root);
        Some(Octree { n: count.map(|n| n as i32), split, low, side })
    }

    fn top(&self) -> usize {
        self.split.len() - 1
    }

    fn side_of(&self, level: usize) -> f64 {
        self.side * (1_u64 << level) as f64
    }

    fn place(&self, x: Place) -> Point {
        std::array::from_fn(|k| self.low[k] + 0.5 * f64::from(x[k]) * self.side)
    }

    fn middle(level: usize, cube: Place) -> Place {
        cube.map(|i| (2 * i + 1) << level)
    }

    fn holds(&self, level: usize, cube: Place) -> bool {
        (0..3).all(|k| cube[k] >= 0 && cube[k] < self.n[k] << (self.top() - level))
    }

    /// Whether a cube is a leaf or split, not a part of a leaf.
    fn exists(&self, level: usize, cube: Place) -> bool {
        level == self.top() || self.split[level + 1].contains(&cube.map(|i| i >> 1))
    }

    fn coarsest(&self) -> impl ParallelIterator<Item = Place> + use<> {
        let [nx, ny, nz] = self.n;
        (0..nx)
            .into_par_iter()
            .flat_map_iter(move |i| (0..ny).flat_map(move |j| (0..nz).map(move |k| [i, j, k])))
    }

    fn refine(&mut self, is_coarse: impl Fn(Point, f64) -> bool + Sync) -> Option<()> {
        for level in (1..=self.top()).rev() {
            let side = self.side_of(level);
            let is_split = |cube: &Place| is_coarse(self.place(Self::middle(level, *cube)), side);
            let found: HashSet<Place> = if level == self.top() {
                self.coarsest().filter(is_split).collect()
            } else {
                let parents: Vec<Place> = self.split[level + 1].iter().copied().collect();
                parents.into_par_iter().flat_map_iter(children).filter(is_split).collect()
            };
            if found.len() > MOST_LEAVES / 8 {
                return None;
            }
            self.split[level] = found;
        }
        Some(())
    }

    /// Splits cubes until leaves that share a corner differ by one level at most.
    fn balance(&mut self) {
        for level in 1..self.top() {
            let around: Vec<Place> = self.split[level]
                .iter()
                .flat_map(|&cube| {
                    (0..27).map(move |i| add(cube, [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1]))
                })
                .filter(|&cube| self.holds(level, cube))
                .collect();
            self.split[level + 1].extend(around.into_iter().map(|cube| cube.map(|i| i >> 1)));
        }
    }

    /// Levels and cubes of the leaves, in the order of the coarsest cubes.
    fn leaves(&self) -> Vec<(usize, Place)> {
        let mut leaves: Vec<(usize, Place)> =
            self.coarsest().map(|cube| (self.top(), cube)).collect();
        for level in (1..=self.top()).rev() {
            let halved = |(at, cube): (usize, Place)| {
                let is_split = at == level && self.split[level].contains(&cube);
                if is_split {
                    children(cube).map(|c| (level - 1, c)).collect()
                } else {
                    vec![(at, cube)]
                }
            };
            leaves = leaves.into_par_iter().flat_map_iter(halved).collect();
        }
        leaves
    }

    /// Places of which the cells of a leaf have their corners.
    fn around(&self, level: usize, cube: Place) -> impl Iterator<Item = Place> + use<> {
        let (half, middle) = (1 << level, Self::middle(level, cube));
        let inside = (0..27).map(move |i| [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1]);
        let beyond = (0..6).map(|i| unit(i / 2, 4 * (i as i32 % 2) - 2));
        inside.chain(beyond).map(move |step| add(middle, step.map(|s| s * half)))
    }

    /// The cells between the middle of a leaf and its faces; those between two leaves of a level belong to the lower one.
    fn cells(&self, level: usize, cube: Place) -> Vec<[Place; 4]> {
        let (side, middle) = (2 << level, Self::middle(level, cube));
        let is_split = |cube: Place| self.split[level].contains(&cube);
        let mut cells = Vec::with_capacity(12);
        for (axis, is_upper) in (0..6).map(|i| (i / 2, i % 2 == 0)) {
            let across = add(cube, unit(axis, if is_upper { 1 } else { -1 }));
            if !self.holds(level, across) {
                continue;
            }
            let (s, t) = (unit((axis + 1) % 3, 1), unit((axis + 2) % 3, 1));
            let start = if is_upper { across } else { cube };
            // Corners of the face, and the cubes beyond the edges that start there.
            let ring = [start, add(start, s), add(add(start, s), t), add(start, t)];
            let ring = ring.map(|corner| corner.map(|i| i * side));
            let beyond = [t.map(|i| -i), s, t, s.map(|i| -i)];
            let next = |k: usize| ring[(k + 1) % 4];
            let half = |k: usize| std::array::from_fn(|i| (ring[k][i] + next(k)[i]) / 2);
            let mut face: Vec<[Place; 3]> = Vec::with_capacity(8);
            if is_split(across) {
                let centre = std::array::from_fn(|i| (ring[0][i] + ring[2][i]) / 2);
                face.extend(
                    (0..4).flat_map(|k| [[centre, ring[k], half(k)], [centre, half(k), next(k)]]),
                );
            } else if self.exists(level, across) {
                let other = Self::middle(level, across);
                for k in (0..4).filter(|_| is_upper) {
                    if is_split(add(cube, beyond[k])) || is_split(add(across, beyond[k])) {
                        face.extend([[other, ring[k], half(k)], [other, half(k), next(k)]]);
                    } else {
                        face.push([other, ring[k], next(k)]);
                    }
                }
            } else {
                // The diagonal starts in the middle of the larger leaf's face.
                let is_odd = |k: &usize| (0..3).all(|i| i == axis || ring[*k][i] / side % 2 == 1);
                let k = (0..4).find(is_odd).unwrap_or(0);
                let [a, b, c, d] = [k, k + 1, k + 2, k + 3].map(|k| ring[k % 4]);
                face.extend([[a, b, c], [a, c, d]]);
            }
            let turned = |[a, b, c]: [Place; 3]| {
                if is_upper { [middle, a, b, c] } else { [middle, a, c, b] }
            };
            cells.extend(face.into_iter().map(turned));
        }
        cells
    }
}

fn children(cube: Place) -> impl Iterator<Item = Place> {
    (0..8).map(move |i| add(cube.map(|k| 2 * k), [i >> 2, i >> 1 & 1, i & 1]))
}

fn add(a: Place, b: Place) -> Place {
    std::array::from_fn(|k| a[k] + b[k])
}

fn unit(axis: usize, length: i32) -> Place {
    std::array::from_fn(|k| if k == axis { length } else { 0 })
}

/// A number of a place: corners of the finest leaves come before their middles.
fn key([x, y, z]: Place) -> u64 {
    let [x, y, z] = [x, y, z].map(|i| i as u64);
    (x & 1) << 63 | x << 42 | y << 21 | z
}

fn unkeyed(key: u64) -> Place {
    [42, 21, 0].map(|shift| (key >> shift & 0x1f_ffff) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::{FACES, dihedral_angles, volume6};
    use crate::vector::{norm, sub};
    use std::collections::HashMap;

    #[test]
    fn cells_of_an_even_lattice_fill_space_and_are_turned_the_same_way() {
        let box_ = [[0.0; 3], [4.0, 3.0, 3.0]];
        let lattice = Lattice::new(box_, 1.0, 0, |_, _| true, |_| true).expect("few cells");
        let mut total = 0.0;
        for cell in lattice.cells {
            let x = cell.map(|i| lattice.points[i as usize]);
            assert!((volume6(x) - 0.5).abs() < 1e-12, "each is a twelfth of a cube");
            let mut angles = dihedral_angles(x);
            angles.sort_by(f64::total_cmp);
            assert!(angles[..4].iter().all(|a| (a - 60.0).abs() < 1e-9));
            assert!(angles[4..].iter().all(|a| (a - 90.0).abs() < 1e-9));
            total += volume6(x) / 6.0;
        }
        assert!(total > 36.0);
    }

    #[test]
    fn graded_cells_conform_and_keep_their_angles() {
        // Towards a point that is the corner of no cube, through four levels.
        let point = [3.1, 9.3, 5.7];
        let is_coarse = |x: Point, side: f64| norm(sub(x, point)) < 1.2 * side;
        let bounds = [[0.0; 3], [16.0; 3]];
        let lattice = Lattice::new(bounds, 0.5, 3, is_coarse, |_| true).expect("few cells");
        let mut faces: HashMap<[u32; 3], usize> = HashMap::new();
        for &cell in &lattice.cells {
            let x = cell.map(|i| lattice.points[i as usize]);
            assert!(volume6(x) > 0.0);
            let angles = dihedral_angles(x);
            assert!(angles.iter().all(|a| (44.999..120.001).contains(a)), "{angles:?}");
            for face in FACES {
                let mut face = face.map(|k| cell[k]);
                face.sort_unstable();
                *faces.entry(face).or_default() += 1;
            }
        }
        let is_inside =
            |i: &u32| lattice.points[*i as usize].iter().all(|&x| x > 0.01 && x < 15.99);
        for (face, count) in faces {
            assert!(count == 2 || count == 1 && !face.iter().any(is_inside), "{face:?}: {count}");
        }
        let sides: HashSet<u64> = lattice.spacing.iter().map(|s| s.to_bits()).collect();
        assert_eq!(sides.len(), 4, "all levels are there");
    }
}
