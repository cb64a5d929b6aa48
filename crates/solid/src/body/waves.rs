//! How threads add up the blocks of cells: wave by wave. The blocks of the cells of a wave are put one after the other, and
//! stay in the cache until they are gathered, each sum by one thread. The order of the sums is that of one thread, which
//! scatters them cell by cell.

use super::blocks::add_block;
use crate::threads::FEWEST;
use rayon::prelude::*;
use std::ops::Range;

/// Blocks of cells of a wave: about six megabytes.
const CACHED: usize = 80_000;

/// Sums that a thread takes at once.
const PIECE: usize = 1_024;

/// Where a cell's block goes: its number in the tangent, and whether it goes there transposed.
#[derive(Clone, Copy)]
pub(super) struct Destination {
    pub block: u32,
    pub transposed: bool,
}

pub(super) const NOWHERE: u32 = u32::MAX;

/// What the cells of all waves add to the blocks of the tangent.
pub(super) struct Waves {
    /// Tasks of a wave.
    n_tasks: usize,
    waves: Vec<Wave>,
}

/// What the cells of some tasks add.
pub(super) struct Wave {
    /// Blocks of the tangent, ascending, and where the contributions to each begin.
    blocks: Vec<u32>,
    start: Vec<u32>,
    contributions: Vec<Contribution>,
}

/// A contribution of a cell: its number among the blocks of the wave's cells, and whether it comes transposed.
#[derive(Clone, Copy)]
struct Contribution {
    of_cell: u32,
    transposed: bool,
}

impl Waves {
    /// For cells whose blocks have these destinations, so many in a task. Made by one thread: others may wait for it, and
    /// one that waits for them would meanwhile take up tasks which wait for this.
    pub fn new(destinations: &[Destination], of_task: usize) -> Self {
        let n_tasks = (CACHED / of_task).max(FEWEST);
        let waves = destinations.chunks(n_tasks * of_task).map(Wave::new).collect();
        Waves { n_tasks, waves }
    }

    /// Each wave with its tasks.
    pub fn iter(&self) -> impl Iterator<Item = (Range<usize>, &Wave)> {
        let tasks = |number: usize| number * self.n_tasks..(number + 1) * self.n_tasks;
        self.waves.iter().enumerate().map(move |(number, wave)| (tasks(number), wave))
    }

    /// Tasks of a wave, the last of which may have fewer.
    pub fn n_tasks(&self) -> usize {
        self.n_tasks
    }
}

impl Wave {
    fn new(destinations: &[Destination]) -> Self {
        let mut order: Vec<(u32, u32)> = (0u32..)
            .zip(destinations)
            .filter_map(|(of_cell, to)| (to.block != NOWHERE).then_some((to.block, of_cell)))
            .collect();
        order.sort_unstable();
        let (mut blocks, mut start) = (Vec::new(), Vec::new());
        for (at, &(block, _)) in (0u32..).zip(&order) {
            if blocks.last() != Some(&block) {
                blocks.push(block);
                start.push(at);
            }
        }
        start.push(order.len() as u32);
        let contribution = |(_, of_cell): (u32, u32)| Contribution {
            of_cell,
            transposed: destinations[of_cell as usize].transposed,
        };
        Wave { blocks, start, contributions: order.into_iter().map(contribution).collect() }
    }

    /// Adds the blocks of its cells to those of the tangent.
    pub fn gather(&self, of_cells: &[[f64; 9]], values: &mut [[f64; 9]]) {
        let mut pieces = Vec::with_capacity(self.blocks.len().div_ceil(PIECE));
        let (mut rest, mut before) = (values, 0);
        for (number, blocks) in self.blocks.chunks(PIECE).enumerate() {
            let (first, end) = (blocks[0] as usize, blocks[blocks.len() - 1] as usize + 1);
            let (own, next) = rest[first - before..].split_at_mut(end - first);
            pieces.push((number * PIECE, blocks, own));
            (rest, before) = (next, end);
        }
        pieces.into_par_iter().for_each(|(at, blocks, values)| {
            for (ends, &block) in self.start[at..].windows(2).zip(blocks) {
                let sum = &mut values[(block - blocks[0]) as usize];
                for c in &self.contributions[ends[0] as usize..ends[1] as usize] {
                    add_block(&of_cells[c.of_cell as usize], c.transposed, sum);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::element::Element;
    use crate::law::Material;
    use crate::mesh::samples::{block, noise};

    fn tangent(body: &Body, u: &[f64]) -> Vec<f64> {
        let (mut force, mut tangent) = (vec![0.0; u.len()], body.zero_tangent());
        body.internal_force_and_tangent(u, &mut force, &mut tangent);
        tangent.values().to_vec()
    }

    /// Tasks of one pool that are the first to need the waves of a body, all at once.
    #[test]
    fn tasks_that_share_a_body_add_up_the_same_tangent() {
        let (points, cells) = block([7; 3], [0.1; 3]);
        let material = Material::new("neo_hookean", vec![vec![1e3, 4e3]]).unwrap();
        let body = Body::with_element(Element::P2, points, cells, material).unwrap();
        let u: Vec<f64> = noise(body.n_dofs(), 1).iter().map(|u| 1e-4 * u).collect();
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let of_tasks: Vec<Vec<f64>> =
            pool(4).install(|| (0..16).into_par_iter().map(|_| tangent(&body, &u)).collect());
        let alone = pool(1).install(|| tangent(&body, &u));
        assert!(alone.iter().any(|&k| k != 0.0));
        assert!(of_tasks.iter().all(|found| *found == alone));
    }
}
