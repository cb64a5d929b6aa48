//! Nodes in slabs that nothing couples, and the separators between them, which come last: sweeps through a triangle then go
//! through all slabs at once, and through all separators at once after or before them.
//!
//! One-way dissection (George, SIAM J. Numer. Anal. 17, 1980, 740) along an order in which neighbours stand close
//! together: it is cut into equal parts, and the nodes of a part that have neighbours in the one before form a separator.
//! What is done in which order does not depend on the number of threads.

use super::neighbours::Neighbours;
use std::ops::Range;

/// Most slabs; each further try has half as many.
const SLABS: usize = 16;

/// Part of the nodes that separators may have.
const BETWEEN: f64 = 0.25;

/// Ranges of nodes, slabs first, from which on separators follow: the first one stands between the first two slabs.
#[derive(Clone, Debug, PartialEq)]
pub struct Dissection {
    slabs: Vec<Range<usize>>,
    separators: Vec<Range<usize>>,
}

impl Dissection {
    /// One slab of `n` nodes.
    pub fn whole(n: usize) -> Self {
        Dissection { slabs: vec![0..n; 1], separators: Vec::new() }
    }

    /// Of the nodes in an order, given as the node at each place and the place of each node; and their new order: that of
    /// before, but for the separators.
    pub(super) fn along(order: &[u32], place: &[u32], neighbours: &Neighbours) -> (Self, Vec<u32>) {
        let mut count = SLABS;
        while count > 1 {
            if let Some(found) = Self::in_parts(count, order, place, neighbours) {
                return found;
            }
            count /= 2;
        }
        (Self::whole(order.len()), order.to_vec())
    }

    /// Of so many parts; none if more than neighbouring ones are coupled, or if separators have too many nodes.
    fn in_parts(
        count: usize,
        order: &[u32],
        place: &[u32],
        neighbours: &Neighbours,
    ) -> Option<(Self, Vec<u32>)> {
        let n = order.len();
        let part = |node: u32| count * place[node as usize] as usize / n;
        let couples = |node: u32, other: u32| part(other) < part(node);
        let is_between =
            |node: u32| neighbours.of(node as usize).iter().any(|&other| couples(node, other));
        let is_between: Vec<bool> = (0..n as u32).map(is_between).collect();
        let n_between = is_between.iter().filter(|between| **between).count();
        if n_between as f64 > BETWEEN * n as f64 {
            return None;
        }
        // A separator knows the two slabs beside it, and no other separator.
        let is_sound = |node: u32| {
            neighbours
                .of(node as usize)
                .iter()
                .filter(|&&other| couples(node, other))
                .all(|&other| part(node) - part(other) == 1 && !is_between[other as usize])
        };
        if !(0..n as u32).all(is_sound) {
            return None;
        }
        let mut found = Vec::with_capacity(n);
        let mut append = |(number, between): (usize, bool)| {
            let [first, end] = [number, number + 1].map(|number| (n * number).div_ceil(count));
            let start = found.len();
            found.extend(
                order[first..end].iter().filter(|node| is_between[**node as usize] == between),
            );
            start..found.len()
        };
        let slabs = (0..count).map(|number| (number, false)).map(&mut append).collect();
        let separators = (1..count).map(|number| (number, true)).map(&mut append).collect();
        Some((Dissection { slabs, separators }, found))
    }

    /// Number of nodes.
    pub fn n(&self) -> usize {
        self.separators.last().or(self.slabs.last()).map_or(0, |last| last.end)
    }

    /// Ranges of nodes between which there are no blocks.
    pub fn slabs(&self) -> &[Range<usize>] {
        &self.slabs
    }

    /// What stands between slabs.
    pub fn separators(&self) -> &[Range<usize>] {
        &self.separators
    }

    /// Where the separators begin.
    pub fn n_in_slabs(&self) -> usize {
        self.slabs.last().map_or(0, |last| last.end)
    }

    /// Separators beside a slab.
    pub fn beside(&self, slab: usize) -> &[Range<usize>] {
        &self.separators[slab.saturating_sub(1)..self.separators.len().min(slab + 1)]
    }

    /// All nodes from one end to the other, each separator between its slabs.
    pub(super) fn across(&self) -> impl Iterator<Item = usize> + Clone {
        let of_slab = |(k, slab): (usize, &Range<usize>)| {
            slab.clone().chain(self.separators.get(k).cloned().unwrap_or_default())
        };
        self.slabs.iter().enumerate().flat_map(of_slab)
    }

    /// Runs through all slabs, each with its own part of what there is of every node of a slab.
    pub(super) fn for_slabs<T: Split>(&self, items: T, run: &(impl Fn(usize, T) + Sync)) {
        for_ranges(0, &self.slabs, items, run);
    }

    /// Runs through all separators, each with its own part of what there is of every node of a separator.
    pub(super) fn for_separators<T: Split>(&self, items: T, run: &(impl Fn(usize, T) + Sync)) {
        if !self.separators.is_empty() {
            for_ranges(0, &self.separators, items, run);
        }
    }
}

/// Something of every node of a range, which can be cut in two.
pub(super) trait Split: Sized + Send {
    /// That of the first nodes, and the rest.
    fn split(self, nodes: usize) -> (Self, Self);
}

impl<T: Send> Split for &mut [T] {
    fn split(self, nodes: usize) -> (Self, Self) {
        self.split_at_mut(nodes)
    }
}

impl<A: Split, B: Split> Split for (A, B) {
    fn split(self, nodes: usize) -> (Self, Self) {
        let ((a, c), (b, d)) = (self.0.split(nodes), self.1.split(nodes));
        ((a, b), (c, d))
    }
}

/// Ranges that follow each other, the first with this number.
fn for_ranges<T: Split>(
    number: usize,
    ranges: &[Range<usize>],
    items: T,
    run: &(impl Fn(usize, T) + Sync),
) {
    if ranges.len() == 1 {
        return run(number, items);
    }
    let (left, right) = ranges.split_at(ranges.len() / 2);
    let (of_left, of_right) = items.split(right[0].start - left[0].start);
    let run_left = || for_ranges(number, left, of_left, run);
    let run_right = || for_ranges(number + left.len(), right, of_right, run);
    rayon::join(run_left, run_right);
}
