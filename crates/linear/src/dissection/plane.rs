//! Planes through a part: nodes in the order in which a plane reaches them, and the cut that separates most cheaply.

use super::part::{Part, Side};

/// How much more a separator costs for each part of all rows by which one half is larger than the other.
const UNEVEN: f64 = 0.5;
/// Of all rows, by which the halves differ at most.
const MOST_UNEVEN: f64 = 0.16;

/// A plane that moves through a part along a normal.
pub(super) struct Plane {
    /// Of every node, as the plane reaches them.
    rank: Vec<u32>,
    /// Least and largest rank among a node and its neighbours.
    reach: Vec<[u32; 2]>,
    /// Where it cuts: nodes of a lower rank are the first half. Those of this half that have neighbours in the other
    /// separate them.
    at: u32,
    half: Side,
    /// Rows of the separator, more for uneven halves.
    pub cost: f64,
}

impl Plane {
    /// The cheapest cut along a normal; none where no cut leaves halves that are nearly even.
    pub fn new(part: &Part, normal: &[i32; 3]) -> Option<Self> {
        let order = swept(part, normal);
        let mut rank = vec![0; part.len()];
        order.iter().enumerate().for_each(|(k, &node)| rank[node as usize] = k as u32);
        let reach: Vec<[u32; 2]> = (0..part.len())
            .map(|node| {
                let near = part.neighbours(node).iter().map(|&other| rank[other as usize]);
                near.fold([rank[node]; 2], |[low, high], r| [low.min(r), high.max(r)])
            })
            .collect();
        // Rows that come into the separator and leave it, from either half, as the plane moves on.
        let mut change = vec![[0i64; 2]; part.len() + 2];
        for (node, &[low, high]) in reach.iter().enumerate() {
            let (own, rows) = (rank[node], i64::from(part.rows[node]));
            change[own as usize + 1][0] += rows;
            change[high as usize + 1][0] -= rows;
            change[low as usize + 1][1] += rows;
            change[own as usize + 1][1] -= rows;
        }
        let all = part.rows.iter().map(|&rows| f64::from(rows)).sum::<f64>();
        let (mut below, mut separator) = (0.0, [0i64; 2]);
        let mut best: Option<(f64, u32, Side)> = None;
        for (k, &node) in order.iter().enumerate().map(|(k, node)| (k + 1, node)) {
            below += f64::from(part.rows[node as usize]);
            (0..2).for_each(|half| separator[half] += change[k][half]);
            let uneven = (2.0 * below - all).abs() / all;
            let half = if separator[0] < separator[1] { Side::First } else { Side::Second };
            let cost = separator[0].min(separator[1]) as f64 * (1.0 + UNEVEN * uneven);
            if uneven <= MOST_UNEVEN && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, k as u32, half));
            }
        }
        best.map(|(cost, at, half)| Self { rank, reach, at, half, cost })
    }

    /// The side of every node.
    pub fn sides(&self) -> Vec<Side> {
        let side = |(&rank, &[low, high]): (&u32, &[u32; 2])| {
            let half = if rank < self.at { Side::First } else { Side::Second };
            let meets = low < self.at && self.at <= high;
            if half == self.half && meets { Side::Separator } else { half }
        };
        self.rank.iter().zip(&self.reach).map(side).collect()
    }
}

/// The nodes as a plane reaches them, by counting: coordinates are small numbers.
fn swept(part: &Part, normal: &[i32; 3]) -> Vec<u32> {
    let along: Vec<i32> =
        part.place.iter().map(|place| (0..3).map(|k| place[k] * normal[k]).sum()).collect();
    let least = along.iter().copied().min().unwrap_or_default();
    let largest = along.iter().copied().max().unwrap_or_default();
    let mut next = vec![0u32; (largest - least) as usize + 2];
    along.iter().for_each(|&at| next[(at - least) as usize + 1] += 1);
    (1..next.len()).for_each(|k| next[k] += next[k - 1]);
    let mut order = vec![0; part.len()];
    for (node, &at) in along.iter().enumerate() {
        let place = &mut next[(at - least) as usize];
        order[*place as usize] = node as u32;
        *place += 1;
    }
    order
}
