//! The nodes that carry the corners of a pair's triangles: each corner one of its own, or those of an edge.

use crate::body::ContactPair;

/// Nodes and weights in the place of each corner, in compressed rows.
pub struct Carriers {
    start: Vec<u32>,
    entries: Vec<(u32, f64)>,
}

impl Carriers {
    pub fn new(pair: &ContactPair, corners: &[u32]) -> Self {
        let (mut start, mut entries) = (vec![0], Vec::with_capacity(corners.len()));
        for &corner in corners {
            entries.extend(pair.nodes_of(corner));
            start.push(entries.len() as u32);
        }
        Carriers { start, entries }
    }

    fn of(&self, corner: u32) -> &[(u32, f64)] {
        let corner = corner as usize;
        &self.entries[self.start[corner] as usize..self.start[corner + 1] as usize]
    }

    /// A nodal field at a corner.
    pub fn mean(&self, corner: u32, u: &[f64]) -> [f64; 3] {
        let mut mean = [0.0; 3];
        for &(node, weight) in self.of(corner) {
            (0..3).for_each(|i| mean[i] += weight * u[3 * node as usize + i]);
        }
        mean
    }

    /// Adds a force on a corner to those on its nodes [N].
    pub fn add_force(&self, corner: u32, whole: [f64; 3], force: &mut [f64]) {
        for &(node, weight) in self.of(corner) {
            (0..3).for_each(|i| force[3 * node as usize + i] += weight * whole[i]);
        }
    }

    /// Calls with each pair of nodes of two corners and the product of their weights.
    pub fn each_pair(&self, [a, b]: [u32; 2], mut take: impl FnMut([u32; 2], f64)) {
        for &(row, weight) in self.of(a) {
            self.of(b).iter().for_each(|&(column, other)| take([row, column], weight * other));
        }
    }
}
