//! A part of a graph, its nodes numbered within it.

use crate::graph::{Graph, NONE};

/// Which half a node of a part is in, or that it separates them.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Side {
    First,
    Second,
    Separator,
}

/// Some nodes of a graph, and who neighbours whom among them.
pub(super) struct Part {
    /// Of the graph, ascending.
    pub nodes: Vec<u32>,
    /// Rows that each stands for.
    pub rows: Vec<u32>,
    /// Where each is in the body, by distances in the graph; empty until they are searched.
    pub place: Vec<[i32; 3]>,
    start: Vec<u32>,
    neighbour: Vec<u32>,
}

impl Part {
    /// The parts of a graph that hang together.
    pub fn connected(graph: &Graph) -> Vec<Self> {
        let (mut local, mut found) = (vec![NONE; graph.n], Vec::new());
        for first in 0..graph.n as u32 {
            if local[first as usize] != NONE {
                continue;
            }
            let mut nodes = vec![first];
            local[first as usize] = 0;
            let mut next = 0;
            while let Some(&node) = nodes.get(next) {
                for other in graph.neighbours(node) {
                    if local[other] == NONE {
                        local[other] = 0;
                        nodes.push(other as u32);
                    }
                }
                next += 1;
            }
            nodes.sort_unstable();
            nodes.iter().enumerate().for_each(|(k, &node)| local[node as usize] = k as u32);
            found.push(Self::whole(graph, nodes, &local));
        }
        found
    }

    /// Of nodes that have no neighbours but each other, where `local` numbers them.
    fn whole(graph: &Graph, nodes: Vec<u32>, local: &[u32]) -> Self {
        let (mut start, mut neighbour) = (vec![0], Vec::new());
        for &node in &nodes {
            neighbour.extend(graph.neighbours(node).map(|other| local[other]));
            start.push(neighbour.len() as u32);
        }
        let rows = nodes.iter().map(|&node| graph.size(node)).collect();
        Self { nodes, rows, place: Vec::new(), start, neighbour }
    }

    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Neighbours of a node within the part.
    pub fn neighbours(&self, node: usize) -> &[u32] {
        &self.neighbour[self.start[node] as usize..self.start[node + 1] as usize]
    }

    /// The nodes on one side, as a part of their own.
    pub fn taken(&self, side: &[Side], wanted: Side) -> Self {
        let mut local = vec![NONE; self.len()];
        let kept: Vec<usize> = (0..self.len()).filter(|&node| side[node] == wanted).collect();
        kept.iter().enumerate().for_each(|(k, &node)| local[node] = k as u32);
        let (mut start, mut neighbour) = (vec![0], Vec::new());
        for &node in &kept {
            let near = self.neighbours(node).iter().map(|&other| local[other as usize]);
            neighbour.extend(near.filter(|&other| other != NONE));
            start.push(neighbour.len() as u32);
        }
        Self {
            nodes: kept.iter().map(|&node| self.nodes[node]).collect(),
            rows: kept.iter().map(|&node| self.rows[node]).collect(),
            place: kept.iter().map(|&node| self.place[node]).collect(),
            start,
            neighbour,
        }
    }
}
