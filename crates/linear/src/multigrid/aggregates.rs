//! Nodes in aggregates, each a node and its neighbours: the unknowns of the next level (Vaněk, Mandel and Brezina,
//! Computing 56, 1996, 179, algorithm 5.1).

use crate::neighbours::Neighbours;

/// In no aggregate yet.
const FREE: u32 = u32::MAX;

/// Which nodes belong together.
pub(super) struct Aggregates {
    /// The aggregate of each node.
    pub of: Vec<u32>,
    /// The node around which each aggregate was made.
    pub root: Vec<u32>,
}

impl Aggregates {
    /// First whole neighbourhoods that touch no other, then every node that is left joins one beside it.
    pub fn new(neighbours: &Neighbours) -> Self {
        let n = neighbours.n();
        let mut of = vec![FREE; n];
        let mut root = Vec::new();
        for node in 0..n {
            let around = neighbours.of(node);
            if of[node] == FREE && around.iter().all(|&k| of[k as usize] == FREE) {
                of[node] = root.len() as u32;
                around.iter().for_each(|&k| of[k as usize] = root.len() as u32);
                root.push(node as u32);
            }
        }
        let whole = of.clone();
        for node in (0..n).filter(|&node| whole[node] == FREE) {
            // A node that touches none would have founded one.
            let joined =
                neighbours.of(node).iter().map(|&k| whole[k as usize]).find(|&a| a != FREE);
            of[node] = joined.unwrap_or(0);
        }
        Aggregates { of, root }
    }

    pub fn count(&self) -> usize {
        self.root.len()
    }
}
