//! Facts about a mesh, without judgement: volumes, shape quality, bad cells, loose points, connected parts.

use super::conformity::{Joints, pinches};
use super::{Vector, cross, dot, sub};

/// A cell whose mean ratio is below this is flat to rounding: it has no usable shape gradients.
const DEGENERATE_QUALITY: f64 = 1e-6;

/// What [`inspect`] finds.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Sum of the signed cell volumes [m^3].
    pub volume: f64,
    /// Signed volume of each cell [m^3], negative where it is inverted.
    pub cell_volumes: Vec<f64>,
    /// Mean ratio `12 (3 |V|)^(2/3) / sum of squared edge lengths` of each cell: 1 for the regular tetrahedron,
    /// 0 for a flat one.
    pub quality: Vec<f64>,
    /// Cells of negative volume.
    pub inverted: Vec<u32>,
    /// Cells of zero volume, to rounding.
    pub degenerate: Vec<u32>,
    /// Cells on the same four points as an earlier cell.
    pub duplicate: Vec<u32>,
    /// Points that belong to no cell.
    pub loose_points: Vec<u32>,
    /// Cells that lie over their neighbours, of which they share a face and its side; sought only where no cell is
    /// degenerate or duplicate.
    pub overlapping: Vec<u32>,
    /// Cells with a face that two earlier cells share already, sought likewise.
    pub crowded: Vec<u32>,
    /// Points that lie on a face of which they are no corner, each with the cell of that face.
    pub hanging: Vec<[u32; 2]>,
    /// Body of each point, numbered from 0 in the order of their first points; -1 for a loose point. Two cells are of
    /// one body when they share a point.
    pub body: Vec<i32>,
    /// Part of each cell, numbered from 0 in the order of their first cells. Two cells are of one part when they share a
    /// face: the parts of a body meet at points and edges only, and move there as on hinges.
    pub part: Vec<u32>,
    /// Number of parts.
    pub n_parts: usize,
    /// Points at which parts meet.
    pub pinches: Vec<u32>,
}

/// The first cell that names a point beyond `n_points`, with the index it names.
pub fn index_out_of_range(n_points: usize, cells: &[[u32; 4]]) -> Option<(usize, u32)> {
    cells
        .iter()
        .enumerate()
        .find_map(|(c, cell)| Some(c).zip(cell.iter().copied().find(|&i| i as usize >= n_points)))
}

/// Signed volume of one cell, `(x1 - x0) x (x2 - x0) . (x3 - x0) / 6` [m^3].
pub fn cell_volume(points: &[[f64; 3]], cell: [u32; 4]) -> f64 {
    let x = cell.map(|i| points[i as usize]);
    dot(cross(sub(x[1], x[0]), sub(x[2], x[0])), sub(x[3], x[0])) / 6.0
}

/// Looks at every point and cell once. All indices must be in range, see [`index_out_of_range`].
pub fn inspect(points: &[[f64; 3]], cells: &[[u32; 4]]) -> Report {
    let cell_volumes: Vec<f64> = cells.iter().map(|&cell| cell_volume(points, cell)).collect();
    let quality: Vec<f64> = cells
        .iter()
        .zip(&cell_volumes)
        .map(|(cell, &volume)| mean_ratio(cell.map(|i| points[i as usize]), volume))
        .collect();
    // A NaN quality must count as degenerate, so the comparison is written the other way round.
    let is_degenerate = |c: usize| !quality[c].is_finite() || quality[c] < DEGENERATE_QUALITY;
    let body = bodies(points.len(), cells);
    let joints = Joints::new(cells);
    let (part, n_parts, is_over) = joints.parts(cells, &cell_volumes);
    let among_cells = |claim: &dyn Fn(usize) -> bool| -> Vec<u32> {
        (0..cells.len()).filter(|&c| claim(c)).map(|c| c as u32).collect()
    };
    let (degenerate, duplicate) = (among_cells(&is_degenerate), duplicates(cells));
    let is_clear = degenerate.is_empty() && duplicate.is_empty(); // a flat cell has no sides
    Report {
        volume: cell_volumes.iter().sum(),
        inverted: among_cells(&|c| cell_volumes[c] < 0.0 && !is_degenerate(c)),
        overlapping: if is_clear { among_cells(&|c| is_over[c]) } else { Vec::new() },
        crowded: if is_clear { joints.crowded.clone() } else { Vec::new() },
        hanging: joints.hanging(points, cells, &body),
        loose_points: (0..points.len()).filter(|&i| body[i] < 0).map(|i| i as u32).collect(),
        pinches: pinches(points.len(), cells, &part),
        degenerate,
        duplicate,
        cell_volumes,
        quality,
        body,
        part,
        n_parts,
    }
}

fn mean_ratio(x: [Vector; 4], volume: f64) -> f64 {
    let mut squared_edges = 0.0;
    for i in 0..4 {
        for j in 0..i {
            let edge = sub(x[i], x[j]);
            squared_edges += dot(edge, edge);
        }
    }
    if squared_edges == 0.0 {
        0.0
    } else {
        12.0 * (3.0 * volume.abs()).cbrt().powi(2) / squared_edges
    }
}

fn duplicates(cells: &[[u32; 4]]) -> Vec<u32> {
    let mut keys: Vec<([u32; 4], u32)> = Vec::with_capacity(cells.len());
    for (c, &cell) in cells.iter().enumerate() {
        let mut key = cell;
        key.sort_unstable();
        keys.push((key, c as u32));
    }
    keys.sort_unstable();
    let mut later: Vec<u32> =
        keys.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1).collect();
    later.sort_unstable();
    later
}

/// Bodies by union-find over the points.
fn bodies(n_points: usize, cells: &[[u32; 4]]) -> Vec<i32> {
    let mut parent: Vec<usize> = (0..n_points).collect();
    let mut is_used = vec![false; n_points];
    for cell in cells {
        let first = root(&mut parent, cell[0] as usize);
        for &i in cell {
            is_used[i as usize] = true;
            let other = root(&mut parent, i as usize);
            parent[other] = first;
        }
    }
    let mut label_of_root = vec![-1; n_points];
    let mut n_bodies = 0;
    let mut body = vec![-1; n_points];
    for i in (0..n_points).filter(|&i| is_used[i]) {
        let r = root(&mut parent, i);
        if label_of_root[r] < 0 {
            label_of_root[r] = n_bodies;
            n_bodies += 1;
        }
        body[i] = label_of_root[r];
    }
    body
}

/// Root of a point, halving the path on the way.
fn root(parent: &mut [usize], mut i: usize) -> usize {
    while parent[i] != i {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    i
}

#[cfg(test)]
mod tests {
    use super::super::samples::block;
    use super::*;

    #[test]
    fn a_block_is_sound() {
        let (points, cells) = block([2, 3, 1], [2.0, 3.0, 0.5]);
        let report = inspect(&points, &cells);
        assert!((report.volume - 3.0).abs() < 1e-14);
        assert!(report.cell_volumes.iter().all(|&v| v > 0.0));
        assert!(report.quality.iter().all(|&q| q > 0.1 && q < 1.0));
        assert_eq!((report.n_parts, report.inverted.len(), report.degenerate.len()), (1, 0, 0));
        assert!(report.duplicate.is_empty() && report.loose_points.is_empty());
    }

    #[test]
    fn the_regular_tetrahedron_has_quality_one() {
        let points = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let report = inspect(&points, &[[0, 1, 2, 3]]);
        assert!((report.quality[0] - 1.0).abs() < 1e-14);
        assert!((report.volume.abs() - 8.0 / 3.0).abs() < 1e-14);
    }

    #[test]
    fn bad_cells_are_named() {
        let (mut points, mut cells) = block([1, 1, 1], [1.0, 1.0, 1.0]);
        cells[2].swap(0, 1);
        cells.push([cells[4][1], cells[4][0], cells[4][3], cells[4][2]]);
        cells.push([0, 1, 3, 3]);
        cells.push([0, 1, 2, 3]);
        points.push([9.0, 9.0, 9.0]);
        let report = inspect(&points, &cells);
        assert_eq!(report.inverted, [2]);
        assert_eq!(report.duplicate, [6]);
        assert_eq!(report.degenerate, [7, 8], "a repeated point, and four corners of one face");
        assert_eq!(report.loose_points, [8]);
        assert_eq!(report.body[8], -1);
    }

    #[test]
    fn degenerate_does_not_depend_on_the_unit() {
        for unit in [1e-6, 1.0, 1e6] {
            let points = [
                [0.0; 3],
                [unit, 0.0, 0.0],
                [0.0, unit, 0.0],
                [0.3 * unit, 0.3 * unit, 1e-12 * unit],
            ];
            assert_eq!(inspect(&points, &[[0, 1, 2, 3]]).degenerate, [0]);
        }
    }

    #[test]
    fn a_non_finite_cell_is_degenerate() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, f64::NAN]];
        assert_eq!(inspect(&points, &[[0, 1, 2, 3]]).degenerate, [0]);
    }

    #[test]
    fn two_parts_are_told_apart() {
        let (points, cells) = block([1, 1, 1], [1.0, 1.0, 1.0]);
        let far: Vec<Vector> = points.iter().map(|p| [p[0] + 5.0, p[1], p[2]]).collect();
        let shifted: Vec<[u32; 4]> = cells.iter().map(|cell| cell.map(|i| i + 8)).collect();
        let report = inspect(&[points, far].concat(), &[cells, shifted].concat());
        assert_eq!(report.n_parts, 2);
        assert_eq!(report.part, [[0; 6], [1; 6]].concat());
        assert_eq!(report.body, [[0; 8], [1; 8]].concat());
        assert!(report.pinches.is_empty());
    }

    #[test]
    fn an_index_out_of_range_is_found() {
        assert_eq!(index_out_of_range(4, &[[0, 1, 2, 3], [0, 1, 7, 3]]), Some((1, 7)));
        assert_eq!(index_out_of_range(8, &[[0, 1, 7, 3]]), None);
    }
}
