//! Tetrahedral meshes as plain arrays: points `[[f64; 3]]` [m] and cells `[[u32; 4]]`.
//!
//! A cell is positively oriented when `(x1 - x0) x (x2 - x0) . (x3 - x0) > 0`. This module knows topology and
//! shape only: the boundary surface, facts about a mesh, contact patches on a surface; nothing of materials.

mod closest;
mod patch;
mod report;
mod surface;

pub use closest::{Closest, TriangleTree, closest_point_on_triangle};
pub use patch::Patch;
pub use report::{Report, cell_volume, index_out_of_range, inspect};
pub use surface::{Surface, surface};

/// A point or a vector of three components.
pub(crate) type Vector = [f64; 3];

pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
pub(crate) mod samples {
    //! Small meshes that the tests of this module share.

    /// A block of `n[0] x n[1] x n[2]` hexahedra of the given sizes, each cut in six positively oriented tetrahedra.
    pub fn block(n: [usize; 3], size: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
        let index = |i: usize, j: usize, k: usize| ((k * (n[1] + 1) + j) * (n[0] + 1) + i) as u32;
        let mut points = Vec::new();
        for k in 0..=n[2] {
            for j in 0..=n[1] {
                for i in 0..=n[0] {
                    let place = |c: usize, a: usize| size[a] * c as f64 / n[a] as f64;
                    points.push([place(i, 0), place(j, 1), place(k, 2)]);
                }
            }
        }
        // Kuhn's subdivision: one tetrahedron per order of the three axes, along the diagonal of the cube.
        let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        let mut cells = Vec::new();
        for k in 0..n[2] {
            for j in 0..n[1] {
                for i in 0..n[0] {
                    for (o, order) in orders.iter().enumerate() {
                        let mut corner = [i, j, k];
                        let mut cell = [index(i, j, k); 4];
                        for (step, &axis) in order.iter().enumerate() {
                            corner[axis] += 1;
                            cell[step + 1] = index(corner[0], corner[1], corner[2]);
                        }
                        if o >= 3 {
                            cell.swap(2, 3);
                        }
                        cells.push(cell);
                    }
                }
            }
        }
        (points, cells)
    }
}
