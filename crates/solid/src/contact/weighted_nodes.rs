//! Points that nodes carry with weights: samples of a surface, corners of its triangles.

/// Nodes and their weights, in compressed rows: one row for each point.
pub(super) struct WeightedNodes {
    start: Vec<u32>,
    entries: Vec<(u32, f64)>,
}

impl Default for WeightedNodes {
    fn default() -> Self {
        WeightedNodes { start: vec![0], entries: Vec::new() }
    }
}

impl WeightedNodes {
    /// Adds a point.
    pub fn push(&mut self, nodes: impl IntoIterator<Item = (u32, f64)>) {
        self.entries.extend(nodes);
        self.start.push(self.entries.len() as u32);
    }

    /// Nodes and weights of a point.
    pub fn of(&self, point: usize) -> &[(u32, f64)] {
        &self.entries[self.start[point] as usize..self.start[point + 1] as usize]
    }

    /// A nodal field at a point.
    pub fn mean(&self, point: usize, u: &[f64]) -> [f64; 3] {
        let mut mean = [0.0; 3];
        for &(node, weight) in self.of(point) {
            (0..3).for_each(|i| mean[i] += weight * u[3 * node as usize + i]);
        }
        mean
    }

    /// Adds a force on a point to those on its nodes [N].
    pub fn add_force(&self, point: usize, whole: [f64; 3], force: &mut [f64]) {
        for &(node, weight) in self.of(point) {
            (0..3).for_each(|i| force[3 * node as usize + i] += weight * whole[i]);
        }
    }

    /// Calls with each pair of nodes of two points and the product of their weights.
    pub fn each_pair(&self, a: usize, b: usize, mut take: impl FnMut([u32; 2], f64)) {
        for &(row, weight) in self.of(a) {
            self.of(b).iter().for_each(|&(column, other)| take([row, column], weight * other));
        }
    }
}
