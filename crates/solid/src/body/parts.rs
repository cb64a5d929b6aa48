//! The parts of a body that cells connect: its organs, whatever ties them together.

use super::Body;

/// Label of the connected part of each node.
pub(crate) fn part_of_nodes(body: &Body) -> Vec<u32> {
    let n = body.points().len();
    let mut parent: Vec<u32> = (0..n as u32).collect();
    fn root(parent: &mut [u32], mut node: u32) -> u32 {
        while parent[node as usize] != node {
            parent[node as usize] = parent[parent[node as usize] as usize];
            node = parent[node as usize];
        }
        node
    }
    let mut join = |a: u32, b: u32| {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[b as usize] = a;
    };
    body.cells().iter().for_each(|cell| cell[1..].iter().for_each(|&node| join(cell[0], node)));
    (body.n_corners() as u32..).zip(body.edges()).for_each(|(middle, edge)| join(edge[0], middle));
    let mut label = vec![u32::MAX; n];
    let mut labels = Vec::with_capacity(n);
    let mut parts = 0;
    for node in 0..n as u32 {
        let root = root(&mut parent, node) as usize;
        if label[root] == u32::MAX {
            label[root] = parts;
            parts += 1;
        }
        labels.push(label[root]);
    }
    labels
}
