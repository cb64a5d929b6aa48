//! The cells of a mesh in clusters around edges: five or six cells each, about as many clusters as nodes.
//!
//! A cluster is to change its volume as a whole, so it must not reach from one tissue into another.

use super::blocks::Grouped;
use super::cells::tissues;
use crate::law::Material;
use crate::mesh::{EDGES, FACES};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Fewer cells than this around an edge make no cluster of their own, and join others.
const SMALLEST: usize = 4;
/// No cluster yet.
const FREE: u32 = u32::MAX;

/// A partition of the cells in clusters.
pub(super) struct Partition {
    /// The cluster of each cell.
    pub of: Vec<u32>,
    /// By cluster: its cells.
    pub cells: Grouped<u32>,
    /// By cluster: the nodes of its cells, ascending.
    pub nodes: Grouped<u32>,
}

impl Partition {
    /// Repeatedly takes the edge with the most free cells of one kind around it. Cells that are left over join the
    /// smallest cluster across a face.
    pub fn new(cells: &[[u32; 4]], material: &Material) -> Self {
        let kind = kinds(cells.len(), material);
        let (mut of, mut size) = around_edges(cells, &kind);
        let neighbours = neighbours(cells);
        let mut left: Vec<usize> = (0..cells.len()).filter(|&cell| of[cell] == FREE).collect();
        while !left.is_empty() {
            let before = left.len();
            left.retain(|&cell| {
                let clusters = neighbours.of(cell).iter().map(|&n| n as usize);
                let ours = clusters.filter(|&n| of[n] != FREE && kind[n] == kind[cell]);
                let smallest = ours.map(|n| of[n]).min_by_key(|&c| (size[c as usize], c));
                if let Some(cluster) = smallest {
                    of[cell] = cluster;
                    size[cluster as usize] += 1;
                }
                smallest.is_none()
            });
            if left.len() == before {
                // An island of its kind: its first cell begins a cluster.
                of[left.remove(0)] = size.len() as u32;
                size.push(1);
            }
        }
        let count = size.len();
        Self::given(cells, of, count)
    }

    /// `count` clusters; `of` says which one each cell is in.
    pub fn given(cells: &[[u32; 4]], of: Vec<u32>, count: usize) -> Self {
        let by_cluster: Vec<(u32, u32)> = (0u32..).zip(&of).map(|(cell, &c)| (c, cell)).collect();
        let mut nodes: Vec<(u32, u32)> =
            of.iter().zip(cells).flat_map(|(&c, nodes)| nodes.map(|n| (c, n))).collect();
        nodes.sort_unstable();
        nodes.dedup();
        Partition {
            cells: Grouped::new(count, &by_cluster),
            nodes: Grouped::new(count, &nodes),
            of,
        }
    }

    /// The pairs of nodes that a cluster couples.
    pub fn pairs(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        (0..self.nodes.len()).flat_map(|cluster| {
            let nodes = self.nodes.of(cluster);
            nodes.iter().enumerate().flat_map(|(k, &b)| nodes[..=k].iter().map(move |&a| [a, b]))
        })
    }
}

/// Tissues whose moduli lie in the same octaves are of one kind.
fn kinds(n_cells: usize, material: &Material) -> Vec<[i32; 2]> {
    let mut kind = vec![[0; 2]; n_cells];
    for tissue in tissues(n_cells, material) {
        let moduli = material.moduli_of_cell(tissue[0]);
        let octaves = moduli.map(|modulus| modulus.log2().round() as i32);
        tissue.into_iter().for_each(|cell| kind[cell] = octaves);
    }
    kind
}

/// The clusters, and their sizes, that the cells around single edges make.
fn around_edges(cells: &[[u32; 4]], kind: &[[i32; 2]]) -> (Vec<u32>, Vec<usize>) {
    let mut around = Vec::with_capacity(6 * cells.len());
    for (cell, nodes) in (0u32..).zip(cells) {
        let ends = EDGES.map(|[a, b]| [nodes[a].min(nodes[b]), nodes[a].max(nodes[b])]);
        around.extend(ends.map(|ends| (ends, kind[cell as usize], cell)));
    }
    around.sort_unstable();
    let groups: Vec<_> = around.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();
    let mut heap: BinaryHeap<(usize, Reverse<usize>)> =
        groups.iter().enumerate().map(|(k, group)| (group.len(), Reverse(k))).collect();
    let (mut of, mut size) = (vec![FREE; cells.len()], Vec::new());
    while let Some((count, Reverse(k))) = heap.pop() {
        let is_free = |entry: &&([u32; 2], [i32; 2], u32)| of[entry.2 as usize] == FREE;
        let free: Vec<u32> = groups[k].iter().filter(is_free).map(|entry| entry.2).collect();
        if free.len() < SMALLEST {
            continue;
        }
        if free.len() < count {
            heap.push((free.len(), Reverse(k))); // others have taken cells since it was counted
            continue;
        }
        free.iter().for_each(|&cell| of[cell as usize] = size.len() as u32);
        size.push(free.len());
    }
    (of, size)
}

/// The cells across the faces of each cell.
fn neighbours(cells: &[[u32; 4]]) -> Grouped<u32> {
    let mut faces = Vec::with_capacity(4 * cells.len());
    for (cell, nodes) in (0u32..).zip(cells) {
        faces.extend(FACES.map(|face| {
            let mut key = face.map(|a| nodes[a]);
            key.sort_unstable();
            (key, cell)
        }));
    }
    faces.sort_unstable();
    let shared = faces.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    let pairs: Vec<(u32, u32)> =
        shared.flat_map(|pair| [(pair[0].1, pair[1].1), (pair[1].1, pair[0].1)]).collect();
    Grouped::new(cells.len(), &pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::samples::block;

    fn material(rows: Vec<Vec<f64>>) -> Material {
        Material::new("neo_hookean", rows).unwrap()
    }

    #[test]
    fn every_cell_is_in_one_cluster_of_some() {
        let (_, cells) = block([4, 3, 5], [1.0; 3]);
        let partition = Partition::new(&cells, &material(vec![vec![1.0, 10.0]]));
        let sizes: Vec<usize> =
            (0..partition.cells.len()).map(|c| partition.cells.of(c).len()).collect();
        assert_eq!(sizes.iter().sum::<usize>(), cells.len());
        assert!(sizes.iter().all(|&size| (SMALLEST..=12).contains(&size)), "{sizes:?}");
        let mean = cells.len() as f64 / sizes.len() as f64;
        assert!((4.5..7.0).contains(&mean), "{mean} cells in a cluster");
    }

    #[test]
    fn clusters_respect_tissues() {
        let (_, cells) = block([3, 3, 3], [1.0; 3]);
        let stiffness = |cell: usize| if cell % 7 < 3 { 1.0 } else { 10.0 };
        let rows = (0..cells.len()).map(|cell| vec![stiffness(cell), 10.0 * stiffness(cell)]);
        let partition = Partition::new(&cells, &material(rows.collect()));
        for cluster in 0..partition.cells.len() {
            let members = partition.cells.of(cluster);
            let first = stiffness(members[0] as usize);
            assert!(members.iter().all(|&cell| stiffness(cell as usize) == first));
        }
    }
}
