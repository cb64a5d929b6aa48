//! Where what the cells contribute is added up: task by task at the nodes and blocks of the task, which stay in the
//! cache, and then at those of the body, in the order of the tasks. So every sum has one order, whoever makes it.

use super::batch::{Batch, Slot, pairs_of};
use super::blocks::{BlockPattern, Grouped};
use super::tasks::task;
use super::waves::{Wave, Waves};
use crate::number::{LANES, Lane};
use crate::simd::prefetch;
use crate::tensor::{Mat3, Vec3};
use crate::threads::for_parts;
use std::sync::OnceLock;

/// Nodes that a thread takes at once.
const PART: usize = 1_024;

/// Blocks that are asked for ahead of those which are added.
const AHEAD: usize = 8;

/// The nodes and blocks of tasks, and where those of their cells are among them.
pub(super) struct TaskSums<const N: usize> {
    /// By task: its nodes, ascending.
    nodes: Grouped<u32>,
    /// The most nodes, and the most blocks, of a task.
    pub most: [usize; 2],
    /// By task: its blocks of the tangent. First those that no task before it has, of which there are so many, ascending;
    /// then the others.
    blocks: Grouped<u32>,
    n_new: Vec<u32>,
    /// Blocks of the tangent that no task has.
    without_cells: Vec<u32>,
    /// By batch and lane: the places of a cell's nodes among those of its task.
    node_places: Vec<[u16; N]>,
    /// By batch, lane and pair: the places of a cell's blocks among those of its task.
    block_places: Vec<BlockPlace>,
    /// By node of the body: its places among the nodes of all tasks.
    at_nodes: Grouped<u32>,
    /// The same for the blocks, once threads have shared a tangent.
    waves: OnceLock<Waves>,
}

/// A place among the blocks of a task, and in the highest bit whether the cell's block goes there transposed.
#[derive(Clone, Copy, Default)]
pub(super) struct BlockPlace(u16);

impl BlockPlace {
    const TRANSPOSED: u16 = 1 << 15;

    fn new(place: usize, is_transposed: bool) -> Self {
        BlockPlace(place as u16 | if is_transposed { Self::TRANSPOSED } else { 0 })
    }

    #[inline(always)]
    fn place(self) -> usize {
        (self.0 & !Self::TRANSPOSED) as usize
    }

    #[inline(always)]
    fn is_transposed(self) -> bool {
        self.0 & Self::TRANSPOSED != 0
    }
}

impl<const N: usize> TaskSums<N> {
    const TASK: usize = task(N);
    const PAIRS: usize = N * (N + 1) / 2;
    /// All blocks of a task have places.
    const FITS: () = assert!(Self::TASK * LANES * Self::PAIRS <= BlockPlace::TRANSPOSED as usize);

    /// Of cells with these nodes, which are in these slots of so many batches; `pattern` must hold their pairs of nodes.
    pub fn new(
        nodes: &[[u32; N]],
        slots: &[Slot],
        n_batches: usize,
        pattern: &BlockPattern,
        n_points: usize,
    ) -> Self {
        let () = Self::FITS;
        let n_tasks = n_batches.div_ceil(Self::TASK);
        let mut of_task = vec![Vec::new(); n_tasks];
        for (cell, slot) in slots.iter().enumerate() {
            of_task[slot.batch as usize / Self::TASK].push(cell);
        }
        let mut is_new = vec![true; pattern.len()];
        let mut n_new = Vec::with_capacity(n_tasks);
        let mut node_places = vec![[0; N]; LANES * n_batches];
        let mut block_places = vec![BlockPlace::default(); LANES * n_batches * Self::PAIRS];
        let (mut all_nodes, mut all_blocks) = (Vec::new(), Vec::new());
        let (mut node_numbers, mut block_numbers) =
            (Numbers::new(n_points), Numbers::new(pattern.len()));
        let mut of_cells = Vec::new();
        for (task, cells) in (0u32..).zip(&of_task) {
            let pairs = |&cell: &usize| pairs_of(&nodes[cell]).map(|[a, b]| pattern.block(a, b));
            of_cells.clear();
            of_cells.extend(cells.iter().flat_map(pairs));
            let own_nodes = node_numbers.distinct(task, cells.iter().flat_map(|&c| nodes[c]));
            let own_blocks = block_numbers.distinct(task, of_cells.iter().copied());
            let (mut own_blocks, known): (Vec<u32>, Vec<u32>) = own_blocks
                .into_iter()
                .partition(|&block| std::mem::take(&mut is_new[block as usize]));
            n_new.push(own_blocks.len() as u32);
            own_blocks.extend(known);
            node_numbers.number(&own_nodes);
            block_numbers.number(&own_blocks);
            for (&cell, blocks) in cells.iter().zip(of_cells.chunks_exact(Self::PAIRS)) {
                let at = slots[cell].batch as usize * LANES + slots[cell].lane as usize;
                node_places[at] = nodes[cell].map(|node| node_numbers.of(node) as u16);
                let places = &mut block_places[at * Self::PAIRS..(at + 1) * Self::PAIRS];
                for ((out, [a, b]), &block) in
                    places.iter_mut().zip(pairs_of(&nodes[cell])).zip(blocks)
                {
                    *out = BlockPlace::new(block_numbers.of(block), a > b);
                }
            }
            all_nodes.extend(own_nodes.into_iter().map(|node| (task, node)));
            all_blocks.extend(own_blocks.into_iter().map(|block| (task, block)));
        }
        let nodes = Grouped::new(n_tasks, &all_nodes);
        let at_nodes: Vec<(u32, u32)> =
            all_nodes.iter().zip(0u32..).map(|(&(_, node), at)| (node, at)).collect();
        let blocks = Grouped::new(n_tasks, &all_blocks);
        let longest = |of: &Grouped<u32>| (0..n_tasks).map(|task| of.of(task).len()).max();
        TaskSums {
            most: [&nodes, &blocks].map(|of| longest(of).unwrap_or(0)),
            nodes,
            blocks,
            n_new,
            without_cells: (0u32..).zip(is_new).filter(|(_, new)| *new).map(|(b, _)| b).collect(),
            node_places,
            block_places,
            at_nodes: Grouped::new(n_points, &at_nodes),
            waves: OnceLock::new(),
        }
    }

    /// Number of nodes of the body.
    pub fn n_points(&self) -> usize {
        self.at_nodes.len()
    }

    /// Number of nodes of a task.
    pub fn n_nodes(&self, task: usize) -> usize {
        self.nodes.of(task).len()
    }

    /// Number of blocks of a task.
    pub fn n_blocks(&self, task: usize) -> usize {
        self.blocks.of(task).len()
    }

    /// The places of the blocks of a batch's cells.
    pub fn block_places(&self, batch: usize) -> &[BlockPlace] {
        &self.block_places[batch * LANES * Self::PAIRS..(batch + 1) * LANES * Self::PAIRS]
    }

    /// Sums the forces of the cells of a task at its nodes.
    pub fn sum_forces(
        &self,
        task: usize,
        batches: &[Batch<N>],
        forces: &[[Vec3<Lane>; N]],
        sums: &mut [[f64; 3]],
    ) {
        sums.fill([0.0; 3]);
        let places = self.node_places[task * Self::TASK * LANES..].chunks_exact(LANES);
        for ((batch, forces), places) in batches.iter().zip(forces).zip(places) {
            for (lane, places) in places[..batch.n_cells as usize].iter().enumerate() {
                for (force, &place) in forces.iter().zip(places) {
                    let sum = &mut sums[place as usize];
                    (0..3).for_each(|i| sum[i] += force[i][lane]);
                }
            }
        }
    }

    /// Adds the sums of a task to those of the body.
    pub fn add_forces(&self, task: usize, sums: &[[f64; 3]], nodal: &mut [[f64; 3]]) {
        for (&node, sum) in self.nodes.of(task).iter().zip(sums) {
            let out = &mut nodal[node as usize];
            (0..3).for_each(|i| out[i] += sum[i]);
        }
    }

    /// Clears the blocks of the body that no task has.
    pub fn clear_others(&self, values: &mut [[f64; 9]]) {
        self.without_cells.iter().for_each(|&block| values[block as usize] = [0.0; 9]);
    }

    /// Adds the blocks of a task to those of the body, or puts them there where no task has before.
    pub fn add_blocks(&self, task: usize, sums: &[[f64; 9]], values: &mut [[f64; 9]]) {
        let n_new = self.n_new[task] as usize;
        let ((new, known), (put, add)) =
            (self.blocks.of(task).split_at(n_new), sums.split_at(n_new));
        run_through(new, put, values, |out, sum| *out = *sum);
        run_through(known, add, values, |out, sum| {
            (0..9).for_each(|entry| out[entry] += sum[entry]);
        });
    }

    /// Parts of a run, one for each task, that are as long as it has nodes.
    pub fn nodes_by_task<'a, T>(&self, run: &'a mut [T]) -> Vec<&'a mut [T]> {
        parts(&self.nodes, 0..self.nodes.len(), run)
    }

    /// Parts of a run, one for each task of a wave, that are as long as it has blocks.
    pub fn blocks_by_task<'a, T>(&self, wave: &Wave, run: &'a mut [T]) -> Vec<&'a mut [T]> {
        parts(&self.blocks, wave.tasks.clone(), run)
    }

    /// Room for the sums of all tasks at their nodes.
    pub fn room(&self) -> Vec<[f64; 3]> {
        vec![[0.0; 3]; self.nodes.total()]
    }

    /// Adds the sums of all tasks at their nodes up to the forces on the body.
    pub fn gather_forces(&self, sums: &[[f64; 3]], nodal: &mut [[f64; 3]]) {
        for_parts(nodal, PART, |part, nodal| {
            for (k, out) in nodal.iter_mut().enumerate() {
                *out = [0.0; 3];
                for &at in self.at_nodes.of(part * PART + k) {
                    (0..3).for_each(|i| out[i] += sums[at as usize][i]);
                }
            }
        });
    }

    /// The waves in which threads add up the tangent.
    pub fn waves(&self) -> &Waves {
        self.waves.get_or_init(|| Waves::new(&self.blocks, &self.n_new))
    }
}

/// Does something with blocks of the body and those of a task, asking for the former ahead: their places are as good as
/// random.
#[inline(always)]
fn run_through(
    blocks: &[u32],
    sums: &[[f64; 9]],
    values: &mut [[f64; 9]],
    run: impl Fn(&mut [f64; 9], &[f64; 9]),
) {
    for (k, (&block, sum)) in blocks.iter().zip(sums).enumerate() {
        if let Some(&ahead) = blocks.get(k + AHEAD) {
            prefetch(&values[ahead as usize]);
        }
        run(&mut values[block as usize], sum);
    }
}

/// Adds the blocks of each cell of a batch, pair by pair, to those of its task.
pub(super) fn add_to_blocks(
    of_cells: &[Mat3<Lane>],
    n_cells: usize,
    places: &[BlockPlace],
    sums: &mut [[f64; 9]],
) {
    for (lane, places) in places.chunks_exact(of_cells.len()).take(n_cells).enumerate() {
        for (block, place) in of_cells.iter().zip(places) {
            let sum = &mut sums[place.place()];
            if place.is_transposed() {
                (0..9).for_each(|entry| sum[entry] += block[entry % 3][entry / 3][lane]);
            } else {
                (0..9).for_each(|entry| sum[entry] += block[entry / 3][entry % 3][lane]);
            }
        }
    }
}

/// Cuts a run into parts, one for each of some groups, that are as long as these.
fn parts<'a, T, I: Copy>(
    groups: &Grouped<I>,
    of: std::ops::Range<usize>,
    mut run: &'a mut [T],
) -> Vec<&'a mut [T]> {
    of.map(|group| {
        let (own, rest) = std::mem::take(&mut run).split_at_mut(groups.of(group).len());
        run = rest;
        own
    })
    .collect()
}

/// Numbers of some of many items within a task.
struct Numbers {
    /// By item: the last task that has it, and its number there.
    last: Vec<u32>,
    number: Vec<u32>,
}

impl Numbers {
    fn new(count: usize) -> Self {
        Numbers { last: vec![u32::MAX; count], number: vec![0; count] }
    }

    /// The items of a task, each once, ascending.
    fn distinct(&mut self, task: u32, items: impl Iterator<Item = u32>) -> Vec<u32> {
        let is_first = |&item: &u32| std::mem::replace(&mut self.last[item as usize], task) != task;
        let mut distinct: Vec<u32> = items.filter(is_first).collect();
        distinct.sort_unstable();
        distinct
    }

    /// Numbers items in this order.
    fn number(&mut self, items: &[u32]) {
        items.iter().zip(0u32..).for_each(|(&item, at)| self.number[item as usize] = at);
    }

    fn of(&self, item: u32) -> usize {
        self.number[item as usize] as usize
    }
}
