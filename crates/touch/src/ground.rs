//! What a walk on the touchable surface looks up: the triangles around each position, normals, and where it ends.

use super::around::Around;
use viscera_mesh::{cross, norm, sub};

/// What a walk looks up, made once for a model.
#[derive(Clone, Debug)]
pub(super) struct Ground {
    /// The touchable triangles around each position.
    pub(super) around: Around,
    /// Mean outward normal at each position, weighted by area.
    pub(super) normals: Vec<[f64; 3]>,
    /// Whether the touchable surface ends at the edge from corner k of a triangle to the next.
    pub(super) is_border: Vec<[bool; 3]>,
}

impl Ground {
    pub(super) fn new(positions: &[[f64; 3]], triangles: &[[u32; 3]], edges: &[u32]) -> Self {
        let mut normals = vec![[0.0; 3]; positions.len()];
        for corners in triangles {
            let normal = normal_of(corners.map(|p| positions[p as usize]));
            for p in corners.map(|p| p as usize) {
                normals[p] = std::array::from_fn(|i| normals[p][i] + normal[i]);
            }
        }
        let mut sides = vec![0u8; edges.iter().max().map_or(0, |&edge| edge as usize + 1)];
        edges
            .iter()
            .for_each(|&edge| sides[edge as usize] = sides[edge as usize].saturating_add(1));
        let ends = |edge: &u32| sides[*edge as usize] == 1;
        let is_border =
            edges.chunks_exact(3).map(|e| [ends(&e[0]), ends(&e[1]), ends(&e[2])]).collect();
        let around = Around::new(positions.len(), triangles);
        Ground { around, normals: normals.into_iter().map(unit).collect(), is_border }
    }
}

/// Twice the area times the outward normal.
pub(super) fn normal_of(x: [[f64; 3]; 3]) -> [f64; 3] {
    cross(sub(x[1], x[0]), sub(x[2], x[0]))
}

/// A vector of length one; of no length, the first axis.
pub(super) fn unit(v: [f64; 3]) -> [f64; 3] {
    let size = norm(v);
    if size > 0.0 { v.map(|x| x / size) } else { [1.0, 0.0, 0.0] }
}
