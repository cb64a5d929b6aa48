//! The graph of a symmetric matrix: for every node the others that share a block with it.

/// Neighbours of every node, from both triangles, without the node itself.
pub(super) struct Neighbours {
    start: Vec<u32>,
    node: Vec<u32>,
}

impl Neighbours {
    /// From the pairs of nodes that share a block, as often as they are given; pairs of a node with itself count for nothing.
    pub fn new(n: usize, pairs: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut start = vec![0u32; n + 1];
        let pairs = pairs.filter(|(row, column)| row != column);
        for (row, column) in pairs.clone() {
            start[row as usize + 1] += 1;
            start[column as usize + 1] += 1;
        }
        (0..n).for_each(|i| start[i + 1] += start[i]);
        let (mut next, mut node) = (start.clone(), vec![0u32; start[n] as usize]);
        let mut append = |of: u32, other: u32| {
            node[next[of as usize] as usize] = other;
            next[of as usize] += 1;
        };
        for (row, column) in pairs {
            append(column, row);
            append(row, column);
        }
        Neighbours { start, node }
    }

    /// Number of nodes.
    pub fn n(&self) -> usize {
        self.start.len() - 1
    }

    /// Those of a node.
    pub fn of(&self, node: usize) -> &[u32] {
        &self.node[self.start[node] as usize..self.start[node + 1] as usize]
    }
}
