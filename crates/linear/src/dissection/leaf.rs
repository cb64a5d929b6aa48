//! The order of the last few nodes: minimum degree, in which what is eliminated after all of them counts.

use crate::graph::Graph;

/// Nodes at most: they are the bits of a word.
pub(super) const LARGEST: usize = 64;

/// A set of nodes: those of the leaf, and words of those around it.
struct Near {
    within: u64,
    around: Vec<u64>,
}

impl Near {
    fn degree(&self) -> u32 {
        self.within.count_ones() + self.around.iter().map(|word| word.count_ones()).sum::<u32>()
    }
}

/// These nodes, ascending and at most [`LARGEST`], in elimination order; all their other neighbours come later.
pub(super) fn order(graph: &Graph, nodes: &[u32]) -> Vec<u32> {
    let mut near = neighbours(graph, nodes);
    let mut left = u64::MAX.checked_shr((LARGEST - nodes.len()) as u32).unwrap_or(0);
    let mut order = Vec::with_capacity(nodes.len());
    while let Some(next) = bits(left).min_by_key(|&node| near[node].degree()) {
        order.push(nodes[next]);
        left &= !(1 << next);
        let Near { within, around } =
            std::mem::replace(&mut near[next], Near { within: 0, around: Vec::new() });
        for other in bits(within) {
            let met = &mut near[other];
            met.within = (met.within | within) & !(1 << next) & !(1 << other);
            met.around.iter_mut().zip(&around).for_each(|(word, new)| *word |= new);
        }
    }
    order
}

/// The neighbours of every node of a leaf.
fn neighbours(graph: &Graph, nodes: &[u32]) -> Vec<Near> {
    let within = |other: usize| nodes.binary_search(&(other as u32));
    let mut around: Vec<usize> = nodes.iter().flat_map(|&node| graph.neighbours(node)).collect();
    around.sort_unstable();
    around.dedup();
    around.retain(|&other| within(other).is_err());
    let near = |&node: &u32| {
        let mut near = Near { within: 0, around: vec![0; around.len().div_ceil(64)] };
        for other in graph.neighbours(node) {
            if let Ok(bit) = within(other) {
                near.within |= 1 << bit;
            } else if let Ok(bit) = around.binary_search(&other) {
                near.around[bit / 64] |= 1 << (bit % 64);
            }
        }
        near
    };
    nodes.iter().map(near).collect()
}

/// The bits of a word that are set, ascending.
fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros();
        word &= word.wrapping_sub(1);
        (bit < 64).then_some(bit as usize)
    })
}
