//! Whether cells fit together face to face: bodies, cells that lie over their neighbours, points that hang on a face.

use super::closest::closest_point_on_triangle;
use super::surface::{FACES, sorted_faces};
use super::{Vector, norm, sub};

/// How far from a face a hanging point may be, in lengths of the face's longest edge: the rounding of single precision.
const TOUCHING: f64 = 1e-4;

const NONE: u32 = u32::MAX;

/// How cells are joined by their faces. A face is numbered `4 * cell + its place in FACES`.
pub(super) struct Joints {
    /// The face on the other side of each, or `NONE`.
    opposite: Vec<u32>,
    /// Faces that belong to one cell only.
    boundary: Vec<u32>,
    /// Cells with a face that two earlier cells share already, ascending.
    pub crowded: Vec<u32>,
}

impl Joints {
    /// Joins the cells whose faces have the same three points.
    pub fn new(cells: &[[u32; 4]]) -> Self {
        let mut joints = Self {
            opposite: vec![NONE; 4 * cells.len()],
            boundary: Vec::new(),
            crowded: Vec::new(),
        };
        for same in sorted_faces(cells).chunk_by(|a, b| a.0 == b.0) {
            if let [first, second, more @ ..] = same {
                joints.opposite[first.1 as usize] = second.1;
                joints.opposite[second.1 as usize] = first.1;
                joints.crowded.extend(more.iter().map(|face| face.1 / 4));
            } else {
                joints.boundary.push(same[0].1);
            }
        }
        joints.crowded.sort_unstable();
        joints.crowded.dedup();
        joints
    }

    /// Part of each cell, numbered from 0 in the order of their first cells, and the number of parts; and whether each
    /// cell lies over the rest of its part.
    ///
    /// Two cells that share a face must lie on different sides of it. Where they do not, one of them has been pushed
    /// through the other: the sum of the volumes exceeds the volume that the surface encloses by twice its own. Of the
    /// two kinds that this makes of a part's cells, those of the smaller volume are named.
    pub fn parts(&self, cells: &[[u32; 4]], volumes: &[f64]) -> (Vec<u32>, usize, Vec<bool>) {
        let looks_outward: Vec<bool> = (0..4 * cells.len())
            .map(|face| looks_outward(cells[face / 4], face % 4, volumes[face / 4]))
            .collect();
        let mut part = vec![NONE; cells.len()];
        let mut is_over = vec![false; cells.len()];
        let mut n_parts = 0;
        for start in 0..cells.len() {
            if part[start] != NONE {
                continue;
            }
            part[start] = n_parts;
            let mut members = vec![start];
            let mut next = 0;
            while let Some(&cell) = members.get(next) {
                next += 1;
                for face in 4 * cell..4 * cell + 4 {
                    let other = self.opposite[face];
                    let neighbour = other as usize / 4;
                    if other != NONE && part[neighbour] == NONE {
                        let is_same_side = looks_outward[face] == looks_outward[other as usize];
                        part[neighbour] = n_parts;
                        is_over[neighbour] = is_over[cell] != is_same_side;
                        members.push(neighbour);
                    }
                }
            }
            let volume_of = |over: bool| -> f64 {
                members.iter().filter(|&&c| is_over[c] == over).map(|&c| volumes[c].abs()).sum()
            };
            if volume_of(true) > volume_of(false) {
                members.iter().for_each(|&c| is_over[c] = !is_over[c]);
            }
            n_parts += 1;
        }
        (part, n_parts as usize, is_over)
    }

    /// Points of the boundary that lie on a face of which they are no corner, each with that face's cell.
    ///
    /// `body` of each point tells what is joined at all: bodies that only touch may do so anywhere.
    pub fn hanging(&self, points: &[Vector], cells: &[[u32; 4]], body: &[i32]) -> Vec<[u32; 2]> {
        let corners = |face: u32| FACES[face as usize % 4].map(|k| cells[face as usize / 4][k]);
        let mut nodes: Vec<u32> = self.boundary.iter().flat_map(|&face| corners(face)).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes.sort_by(|&a, &b| points[a as usize][0].total_cmp(&points[b as usize][0]));
        let mut found = Vec::new();
        for &face in &self.boundary {
            let cell = face / 4;
            let triangle = corners(face);
            let x = triangle.map(|i| points[i as usize]);
            let longest =
                norm(sub(x[1], x[0])).max(norm(sub(x[2], x[1]))).max(norm(sub(x[0], x[2])));
            let reach = TOUCHING * longest;
            let low: Vector = std::array::from_fn(|k| x[0][k].min(x[1][k]).min(x[2][k]) - reach);
            let high: Vector = std::array::from_fn(|k| x[0][k].max(x[1][k]).max(x[2][k]) + reach);
            let first = nodes.partition_point(|&i| points[i as usize][0] < low[0]);
            let near = nodes[first..].iter().take_while(|&&i| points[i as usize][0] <= high[0]);
            for &node in near {
                let p = points[node as usize];
                let is_outside = (1..3).any(|k| p[k] < low[k] || p[k] > high[k]);
                let is_stranger = body[node as usize] != body[triangle[0] as usize];
                if is_outside || is_stranger || cells[cell as usize].contains(&node) {
                    continue;
                }
                let weights = closest_point_on_triangle(p, x[0], x[1], x[2]);
                let foot: Vector =
                    std::array::from_fn(|k| (0..3).map(|i| weights[i] * x[i][k]).sum::<f64>());
                // A point at a corner is its double: the two lips of a cut.
                let is_double = x.iter().any(|&corner| norm(sub(p, corner)) <= reach);
                if norm(sub(p, foot)) <= reach && !is_double {
                    found.push([node, cell]);
                }
            }
        }
        found.sort_unstable();
        found.dedup_by_key(|pair| pair[0]);
        found
    }
}

/// Points at which cells of different parts meet, ascending.
pub(super) fn pinches(n_points: usize, cells: &[[u32; 4]], part: &[u32]) -> Vec<u32> {
    let mut part_of_point = vec![NONE; n_points];
    let mut found = Vec::new();
    for (cell, &mine) in cells.iter().zip(part) {
        for &i in cell {
            let seen = &mut part_of_point[i as usize];
            if *seen == NONE {
                *seen = mine;
            } else if *seen != mine {
                found.push(i);
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// Whether the ascending corners of a face run anticlockwise seen from outside its cell.
fn looks_outward(cell: [u32; 4], face: usize, volume: f64) -> bool {
    let [a, b, c] = FACES[face].map(|k| cell[k]);
    let is_ascending = usize::from(a < b) + usize::from(b < c) + usize::from(c < a) == 2;
    is_ascending == (volume > 0.0)
}

#[cfg(test)]
mod tests {
    use super::super::cell_volume;
    use super::super::samples::block;
    use super::*;

    fn volumes(points: &[Vector], cells: &[[u32; 4]]) -> Vec<f64> {
        cells.iter().map(|&cell| cell_volume(points, cell)).collect()
    }

    fn over(points: &[Vector], cells: &[[u32; 4]]) -> Vec<usize> {
        let (_, _, is_over) = Joints::new(cells).parts(cells, &volumes(points, cells));
        (0..cells.len()).filter(|&c| is_over[c]).collect()
    }

    fn hanging(points: &[Vector], cells: &[[u32; 4]]) -> Vec<[u32; 2]> {
        Joints::new(cells).hanging(points, cells, &vec![0; points.len()])
    }

    #[test]
    fn cells_listed_either_way_round_do_not_overlap() {
        let (points, mut cells) = block([3, 2, 2], [3.0, 2.0, 2.0]);
        assert_eq!(over(&points, &cells), [0; 0]);
        cells.iter_mut().step_by(3).for_each(|cell| cell.swap(1, 3));
        assert_eq!(over(&points, &cells), [0; 0]);
        assert!(hanging(&points, &cells).is_empty());
    }

    #[test]
    fn a_point_pushed_through_its_neighbours_turns_cells_over_others() {
        let (mut points, cells) = block([3, 3, 3], [3.0, 3.0, 3.0]);
        let inner = points.iter().position(|p| *p == [1.0, 1.0, 1.0]).unwrap();
        points[inner] = [2.4, 2.3, 2.2];
        let volumes = volumes(&points, &cells);
        let inverted: Vec<usize> = (0..cells.len()).filter(|&c| volumes[c] < 0.0).collect();
        assert!(!inverted.is_empty());
        assert_eq!(over(&points, &cells), inverted);
        // The surface is untouched, so what lies over the rest counts twice too often.
        let twice: f64 = inverted.iter().map(|&c| 2.0 * volumes[c].abs()).sum();
        assert!((volumes.iter().map(|v| v.abs()).sum::<f64>() - twice - 27.0).abs() < 1e-12);
    }

    #[test]
    fn a_third_cell_on_a_face_is_named() {
        let (_, mut cells) = block([1, 1, 1], [1.0; 3]);
        let is_shared =
            |other: &[u32; 4]| cells[0].iter().filter(|i| other.contains(i)).count() == 3;
        let neighbour = cells[1..].iter().find(|other| is_shared(other)).unwrap();
        let outside = cells[0].iter().position(|i| !neighbour.contains(i)).unwrap();
        let mut third = cells[0];
        third[outside] = 8;
        cells.push(third);
        assert_eq!(Joints::new(&cells).crowded, [6]);
    }

    #[test]
    fn parts_are_joined_by_faces_alone() {
        let (points, cells) = block([1, 1, 1], [1.0; 3]);
        let beyond: Vec<Vector> = points[1..].iter().map(|p| p.map(|x| -x)).collect();
        let mirrored: Vec<[u32; 4]> =
            cells.iter().map(|cell| cell.map(|i| if i == 0 { 0 } else { i + 7 })).collect();
        let points = [points, beyond].concat();
        let cells = [cells, mirrored].concat();
        let (part, n_parts, is_over) = Joints::new(&cells).parts(&cells, &volumes(&points, &cells));
        assert_eq!((part, n_parts), ([[0; 6], [1; 6]].concat(), 2));
        assert!(!is_over.contains(&true));
        assert_eq!(pinches(points.len(), &cells, &[[0; 6], [1; 6]].concat()), [0]);
    }

    #[test]
    fn a_point_in_the_middle_of_a_neighbours_edge_or_face_hangs() {
        // Two tetrahedra on one face; the upper is cut in two, or in three, the lower is not.
        let points =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.2, -1.0], [0.2, 0.2, 1.0]];
        let edge = [points.as_slice(), &[[0.5, 0.0, 0.0]]].concat();
        assert_eq!(hanging(&edge, &[[0, 2, 1, 3], [0, 5, 2, 4], [5, 1, 2, 4]]), [[5, 0]]);
        let face = [points.as_slice(), &[[0.3, 0.3, 1e-6]]].concat();
        assert_eq!(
            hanging(&face, &[[0, 2, 1, 3], [0, 1, 5, 4], [1, 2, 5, 4], [2, 0, 5, 4]]),
            [[5, 0]]
        );
    }

    #[test]
    fn bodies_that_touch_and_the_lips_of_a_cut_do_not_hang() {
        let (lower, cells) = block([1, 1, 1], [1.0; 3]);
        let upper: Vec<Vector> =
            lower.iter().map(|p| [p[0] + 0.3, p[1] + 0.2, p[2] + 1.0]).collect();
        let above: Vec<[u32; 4]> = cells.iter().map(|cell| cell.map(|i| i + 8)).collect();
        let (points, both) =
            ([lower.clone(), upper].concat(), [cells.clone(), above.clone()].concat());
        let body = [[0; 8], [1; 8]].concat();
        assert!(Joints::new(&both).hanging(&points, &both, &body).is_empty());
        assert!(!hanging(&points, &both).is_empty(), "one body would hang there");
        let lips: Vec<Vector> = lower.iter().map(|p| [p[0], p[1], p[2] + 1.0]).collect();
        assert!(hanging(&[lower, lips].concat(), &both).is_empty());
    }
}
