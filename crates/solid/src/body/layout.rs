//! The cells and nodes over which the integrals of a body are made.

use super::ties::Ties;
use crate::element::Geometry;
use crate::law::Material;

/// The corners of the cells, with their geometry, and the edges with nodes in their middle, which come after the corners.
pub(super) struct Layout<'a> {
    pub cells: &'a [[u32; 4]],
    pub edges: &'a [[u32; 2]],
    pub n_corners: usize,
    pub geometry: &'a [Geometry],
    pub material: &'a Material,
    /// Their pairs of nodes are in the pattern too.
    pub ties: &'a Ties,
}

impl Layout<'_> {
    /// Number of corners and midpoints.
    pub fn n_nodes(&self) -> usize {
        self.n_corners + self.edges.len()
    }
}
