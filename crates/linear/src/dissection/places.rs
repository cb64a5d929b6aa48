//! Where the nodes of a graph are, by its distances alone.
//!
//! Of nodes far apart two are as good as the ends of an axis: the difference of a node's distances to them is its
//! coordinate along it.

use super::part::Part;
use crate::graph::NONE;

/// Coordinates are told in so many parts of an edge,
const FINE: i32 = 16;
/// and are so often those of their surroundings' mean.
const SMOOTHED: usize = 2;

/// Coordinates of every node, from three pairs of far-apart nodes of a part that hangs together.
pub(super) fn places(part: &Part) -> Vec<[i32; 3]> {
    let mut nearest = vec![NONE; part.len()];
    let mut from = farthest(&distances(part, 0));
    let ends: [Vec<u32>; 6] = std::array::from_fn(|_| {
        let distance = distances(part, from);
        nearest.iter_mut().zip(&distance).for_each(|(least, &d)| *least = d.min(*least));
        from = farthest(&nearest);
        distance
    });
    let along =
        |axis: usize, node: usize| ends[2 * axis][node] as i32 - ends[2 * axis + 1][node] as i32;
    let mut place: Vec<[i32; 3]> =
        (0..part.len()).map(|node| std::array::from_fn(|axis| FINE * along(axis, node))).collect();
    for _ in 0..SMOOTHED {
        place = smoothed(part, &place);
    }
    place
}

/// The mean of every node's place and its neighbours'.
fn smoothed(part: &Part, place: &[[i32; 3]]) -> Vec<[i32; 3]> {
    let mean = |node: usize| {
        let near = part.neighbours(node);
        let sum = near.iter().fold(place[node].map(i64::from), |sum, &other| {
            std::array::from_fn(|axis| sum[axis] + i64::from(place[other as usize][axis]))
        });
        sum.map(|sum| (sum / (near.len() as i64 + 1)) as i32)
    };
    (0..part.len()).map(mean).collect()
}

/// Edges between a node and every other.
fn distances(part: &Part, from: usize) -> Vec<u32> {
    let mut distance = vec![NONE; part.len()];
    let mut reached = Vec::with_capacity(part.len());
    distance[from] = 0;
    reached.push(from as u32);
    let mut next = 0;
    while let Some(&node) = reached.get(next) {
        let further = distance[node as usize] + 1;
        for &other in part.neighbours(node as usize) {
            if distance[other as usize] == NONE {
                distance[other as usize] = further;
                reached.push(other);
            }
        }
        next += 1;
    }
    distance
}

/// The first of the nodes at the largest distance.
fn farthest(distance: &[u32]) -> usize {
    let largest = distance.iter().max();
    distance.iter().position(|d| Some(d) == largest).unwrap_or_default()
}
