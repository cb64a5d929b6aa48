//! Tetrahedral meshes as plain arrays: points `[[f64; 3]]` [m] and cells `[[u32; 4]]`.
//!
//! A cell is positively oriented when `(x1 - x0) x (x2 - x0) . (x3 - x0) > 0`. This crate is about topology and shape
//! only: the boundary surface, facts about a mesh, contact patches on a surface. It has no materials.

mod boxes;
mod closest;
mod conformity;
mod crossing;
mod locate;
mod overlap;
mod patch;
mod quadratic;
mod report;
pub mod samples;
mod sphere;
mod surface;

pub use boxes::Boxes;
pub use closest::{Closest, TriangleTree, closest_point_on_triangle};
pub use crossing::crossing;
pub use locate::{Located, Locator};
pub use overlap::{Piece, overlap, overlap_of};
pub use patch::{NoPatch, Patch};
pub use quadratic::{EDGES, edges, quadratic_cells, quadratic_surface, with_midpoints};
pub use report::{Report, cell_volume, index_out_of_range, inspect};
pub use sphere::Sphere;
pub use surface::{FACES, Surface, surface};

/// A point or a vector of three components.
pub type Vector = [f64; 3];

/// `a - b`.
#[inline]
pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a . b`.
#[inline]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a x b`.
#[inline]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `|a|`.
#[inline]
pub fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// Length of the diagonal of the box around points.
pub fn diagonal(points: &[Vector]) -> f64 {
    let extent = |i: usize| {
        let values = points.iter().map(|p| p[i]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    };
    norm(std::array::from_fn(extent))
}
