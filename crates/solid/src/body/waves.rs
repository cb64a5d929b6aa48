//! How threads add up a tangent: wave by wave. The blocks of the tasks of a wave are put one after the other, and stay in
//! the cache until they are gathered, each sum by one thread. The order of the sums is that of one thread, which adds
//! task after task.

use super::blocks::Grouped;
use rayon::prelude::*;
use std::ops::Range;

/// Blocks of the tasks of a wave: about two megabytes.
const CACHED: usize = 32_000;

/// Sums that a thread takes at once.
const PIECE: usize = 1_024;

/// What the tasks of all waves add to the blocks of the tangent.
pub(super) struct Waves {
    waves: Vec<Wave>,
}

/// What some tasks add.
pub(super) struct Wave {
    pub tasks: Range<usize>,
    /// Number of blocks of all its tasks.
    pub n_blocks: usize,
    sums: Vec<Sum>,
    /// Places among the blocks of the tasks.
    contributions: Vec<u32>,
}

/// A block of the tangent to which a wave adds.
#[derive(Clone, Copy)]
struct Sum {
    block: u32,
    /// Where its contributions begin.
    start: u32,
    /// Whether no wave before has added to it.
    is_new: bool,
}

impl Waves {
    /// Of tasks with these blocks, of which so many are in no task before. Made by one thread: others may wait for it,
    /// and one that waits for them would meanwhile take up tasks which wait for this.
    pub fn new(of_tasks: &Grouped<u32>, n_new: &[u32]) -> Self {
        let (mut waves, mut first) = (Vec::new(), 0);
        while first < of_tasks.len() {
            let begin = of_tasks.range(first).start;
            let fits = |&task: &usize| of_tasks.range(task).end - begin <= CACHED;
            let end = (first + 1..of_tasks.len()).take_while(fits).last().unwrap_or(first) + 1;
            waves.push(Wave::new(of_tasks, n_new, first..end));
            first = end;
        }
        Waves { waves }
    }

    pub fn iter(&self) -> impl Iterator<Item = &Wave> {
        self.waves.iter()
    }
}

impl Wave {
    fn new(of_tasks: &Grouped<u32>, n_new: &[u32], tasks: Range<usize>) -> Self {
        let of_task = |task: usize| {
            let n_new = n_new[task] as usize;
            of_tasks.of(task).iter().enumerate().map(move |(k, &block)| (block, k < n_new))
        };
        let blocks = tasks.clone().flat_map(of_task).zip(0u32..);
        let mut order: Vec<(u32, u32, bool)> =
            blocks.map(|((block, is_new), place)| (block, place, is_new)).collect();
        order.sort_unstable();
        let mut sums: Vec<Sum> = Vec::new();
        for (start, &(block, _, is_new)) in (0u32..).zip(&order) {
            if sums.last().is_none_or(|last| last.block != block) {
                sums.push(Sum { block, start, is_new });
            }
        }
        let contributions = order.iter().map(|&(_, place, _)| place).collect();
        Wave { tasks, n_blocks: order.len(), sums, contributions }
    }

    /// Adds the blocks of its tasks to those of the tangent.
    pub fn gather(&self, of_tasks: &[[f64; 9]], values: &mut [[f64; 9]]) {
        let mut pieces = Vec::with_capacity(self.sums.len().div_ceil(PIECE));
        let (mut rest, mut before) = (values, 0);
        for (number, sums) in self.sums.chunks(PIECE).enumerate() {
            let (first, end) = (sums[0].block as usize, sums[sums.len() - 1].block as usize + 1);
            let (own, next) = rest[first - before..].split_at_mut(end - first);
            pieces.push((number * PIECE, sums, own));
            (rest, before) = (next, end);
        }
        pieces.into_par_iter().for_each(|(at, sums, values)| {
            let next = self.sums.get(at + sums.len());
            let end = next.map_or(self.contributions.len(), |next| next.start as usize);
            let ends = sums[1..].iter().map(|sum| sum.start as usize).chain([end]);
            for (sum, end) in sums.iter().zip(ends) {
                let out = &mut values[(sum.block - sums[0].block) as usize];
                let mut total = if sum.is_new { [0.0; 9] } else { *out };
                for &place in &self.contributions[sum.start as usize..end] {
                    let contribution = &of_tasks[place as usize];
                    (0..9).for_each(|entry| total[entry] += contribution[entry]);
                }
                *out = total;
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

    /// Forces, and forces with the tangent.
    fn evaluated(body: &Body, u: &[f64]) -> [Vec<f64>; 3] {
        let (mut alone, mut force) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        let mut tangent = body.zero_tangent();
        body.internal_force(u, &mut alone);
        body.internal_force_and_tangent(u, &mut force, &mut tangent);
        [alone, force, tangent.values().to_vec()]
    }

    /// Tasks of one pool that are the first to need the waves of a body, all at once.
    #[test]
    fn tasks_that_share_a_body_find_the_same_sums() {
        let (points, cells) = block([8; 3], [0.1; 3]);
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for element in Element::ALL {
            let law = Material::new("neo_hookean", vec![vec![1e3, 4e3]]).unwrap();
            let body = Body::with_element(element, points.clone(), cells.clone(), law).unwrap();
            let u: Vec<f64> = noise(body.n_dofs(), 1).iter().map(|u| 1e-4 * u).collect();
            let by_tasks = || (0..8).into_par_iter().map(|_| evaluated(&body, &u)).collect();
            let of_tasks: Vec<[Vec<f64>; 3]> = pool(3).install(by_tasks);
            assert!(pool(3).install(|| body.is_shared()), "a body that threads share");
            let alone = pool(1).install(|| evaluated(&body, &u));
            assert!(alone.iter().all(|sums| sums.iter().any(|&x| x != 0.0)));
            assert!(of_tasks.iter().all(|found| *found == alone), "{element:?}");
        }
    }
}
