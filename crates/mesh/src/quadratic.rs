//! The quadratic mesh over a linear one: straight-sided ten-node tetrahedra.
//!
//! A midpoint belongs to an edge, and is numbered after the corner points in the order of [`edges`]; so the linear mesh
//! alone determines it.

/// Local ends of the six edges of a cell; node `4 + k` of the ten-node cell lies on edge `k` (the order of VTK).
pub const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];

/// The edges of a mesh, lower node first, ascending.
pub fn edges(cells: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let ends = |cell: &[u32; 4], [a, b]: [usize; 2]| ascending(cell[a], cell[b]);
    let mut edges: Vec<[u32; 2]> =
        cells.iter().flat_map(|cell| EDGES.map(|edge| ends(cell, edge))).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Corners and edge midpoints of every cell. All edges of the cells must be in `edges`.
pub fn quadratic_cells(n_corners: usize, cells: &[[u32; 4]], edges: &[[u32; 2]]) -> Vec<[u32; 10]> {
    let node = |cell: &[u32; 4], k: usize| {
        if k < 4 {
            return cell[k];
        }
        let [a, b] = EDGES[k - 4];
        midpoint(n_corners, edges, cell[a], cell[b])
    };
    cells.iter().map(|cell| std::array::from_fn(|k| node(cell, k))).collect()
}

/// Corner points, then midpoints.
pub fn with_midpoints(points: &[[f64; 3]], edges: &[[u32; 2]]) -> Vec<[f64; 3]> {
    let middle = |&[a, b]: &[u32; 2]| {
        std::array::from_fn(|i| 0.5 * (points[a as usize][i] + points[b as usize][i]))
    };
    points.iter().copied().chain(edges.iter().map(middle)).collect()
}

/// Every triangle as four, with the midpoints as corners. All edges of the triangles must be in `edges`.
pub fn quadratic_surface(
    n_corners: usize,
    triangles: &[[u32; 3]],
    edges: &[[u32; 2]],
) -> Vec<[u32; 3]> {
    let split = |&[a, b, c]: &[u32; 3]| {
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| midpoint(n_corners, edges, p, q));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    triangles.iter().flat_map(split).collect()
}

fn midpoint(n_corners: usize, edges: &[[u32; 2]], a: u32, b: u32) -> u32 {
    // An edge that is not listed would be a fault of this crate, never of a mesh.
    let k = edges.binary_search(&ascending(a, b)).expect("edges of the same mesh");
    (n_corners + k) as u32
}

fn ascending(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::super::samples::block;
    use super::super::{Surface, surface};
    use super::*;

    #[test]
    fn a_refined_block_has_the_points_of_its_edges() {
        let (points, cells) = block([2, 1, 1], [2.0, 1.0, 1.0]);
        let edges = edges(&cells);
        let all = with_midpoints(&points, &edges);
        assert_eq!(
            all.len(),
            5 * 3 * 3,
            "midpoints of a block's edges, diagonals included, are half a step apart"
        );
        for (cell, nodes) in cells.iter().zip(quadratic_cells(points.len(), &cells, &edges)) {
            assert_eq!(cell, &nodes[..4]);
            for (k, [a, b]) in EDGES.into_iter().enumerate() {
                for i in 0..3 {
                    let middle = 0.5 * (points[cell[a] as usize][i] + points[cell[b] as usize][i]);
                    assert_eq!(all[nodes[4 + k] as usize][i], middle);
                }
            }
        }
    }

    #[test]
    fn a_split_surface_keeps_area_and_orientation() {
        let (points, cells) = block([2, 2, 1], [2.0, 1.0, 0.5]);
        let (triangles, edges) = (surface(&points, &cells), edges(&cells));
        let fine = quadratic_surface(points.len(), &triangles, &edges);
        assert_eq!(fine.len(), 4 * triangles.len());
        let fine = Surface::new(&with_midpoints(&points, &edges), &fine);
        let coarse = Surface::new(&points, &triangles);
        let area = |s: &Surface| s.lumped_areas().iter().sum::<f64>();
        assert!((area(&fine) - area(&coarse)).abs() < 1e-14);
        for &node in coarse.nodes() {
            let (a, b) = (fine.normals()[node as usize], coarse.normals()[node as usize]);
            (0..3).for_each(|i| assert!((a[i] - b[i]).abs() < 1e-14));
        }
    }
}
