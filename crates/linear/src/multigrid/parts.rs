//! Nodes in parts that threads sweep side by side. A part has blocks with the one before and the one after alone, so every
//! other part is free of the rest of them: a sweep takes those with even numbers, then those with odd ones. That is
//! Gauss-Seidel in another order of nodes, which does not depend on the number of threads.

use super::columns::Upper;
use std::ops::Range;

/// Nodes of a part, at least: some tens of microseconds.
const SMALLEST: usize = 1_500;

/// Mean distance of a node's farthest neighbour over the length of a part, at most.
const LONGEST_REACH: f64 = 1.0 / 2.0;

/// Fewest and most parts.
const FEWEST: usize = 6;
/// See [`FEWEST`].
const MOST: usize = 16;

/// The nodes of a level in parts.
pub(super) struct Parts {
    all: Vec<Part>,
}

/// Nodes that one thread sweeps, and the window of nodes with which they have blocks and none else of their turn has: their
/// own, and for a part with an odd number some of those beside it. The windows of the odd parts leave no node out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    pub nodes: Range<usize>,
    pub window: Range<usize>,
}

/// Which parts a sweep comes to.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Turn {
    Even = 0,
    Odd = 1,
}

impl Parts {
    /// All nodes in one part where threads would gain nothing, or where neighbours are numbered too far apart.
    pub fn new(pattern: &Upper) -> Self {
        let n = pattern.n();
        let reach = |column: usize| (column - pattern.rows(column)[0] as usize) as f64;
        let mean = (0..n).map(reach).sum::<f64>() / n.max(1) as f64;
        let by_reach = (LONGEST_REACH * n as f64 / mean.max(1.0)) as usize;
        let parts = Self::cut((n / SMALLEST).min(by_reach).clamp(1, MOST), pattern);
        if parts.len() < FEWEST { Self::cut(1, pattern) } else { parts }
    }

    /// So many of equal length, or fewer and longer ones where those beside a part would touch the same nodes.
    pub fn cut(count: usize, pattern: &Upper) -> Self {
        let n = pattern.n();
        let first = |column: usize| pattern.rows(column)[0] as usize;
        // The first row in which a column or one after it has a block.
        let mut lowest = vec![n; n + 1];
        (0..n).rev().for_each(|column| lowest[column] = lowest[column + 1].min(first(column)));
        let length = n.div_ceil(count.max(1));
        // Where the parts end, and where within them end the nodes that have a block with the part before.
        let (mut ends, mut coupled, mut start) = (Vec::new(), Vec::new(), 0);
        while start < n {
            let last = (start..n).rev().find(|&column| first(column) < start);
            let before = last.map_or(start, |last| last + 1);
            let enough = (start + length).min(n);
            let mut end = (enough..n).find(|&column| lowest[column] >= before).unwrap_or(n);
            if n - end < length / 2 {
                end = n;
            }
            ends.push(end);
            coupled.push(before);
            start = end;
        }
        let of = |k: usize| {
            let nodes = if k == 0 { 0 } else { ends[k - 1] }..ends[k];
            let low = if k <= 1 { 0 } else { coupled[k - 1] };
            let high = if k + 2 >= ends.len() { n } else { coupled[k + 1] };
            let window = if k.is_multiple_of(2) { nodes.clone() } else { low..high };
            Part { nodes, window }
        };
        Parts { all: (0..ends.len()).map(of).collect() }
    }

    pub fn len(&self) -> usize {
        self.all.len()
    }

    pub fn all(&self) -> &[Part] {
        &self.all
    }

    /// Those of a turn.
    pub fn of(&self, turn: Turn) -> impl Iterator<Item = &Part> {
        self.all.iter().skip(turn as usize).step_by(2)
    }

    /// What stands at the nodes of each window of a turn.
    pub fn windows<'a, T>(&self, turn: Turn, values: &'a mut [T]) -> Vec<&'a mut [T]> {
        apart(values, self.of(turn).map(|part| part.window.clone()))
    }

    /// What stands at the nodes of each part.
    pub fn split<'a, T>(&self, values: &'a mut [T]) -> Vec<&'a mut [T]> {
        apart(values, self.all.iter().map(|part| part.nodes.clone()))
    }
}

/// Ascending ranges of values, which may leave some out.
pub(super) fn apart<T>(
    mut values: &mut [T],
    ranges: impl Iterator<Item = Range<usize>>,
) -> Vec<&mut [T]> {
    let mut taken = 0;
    let own = |range: Range<usize>| {
        let (_, rest) = std::mem::take(&mut values).split_at_mut(range.start - taken);
        let (own, rest) = rest.split_at_mut(range.len());
        (values, taken) = (rest, range.end);
        own
    };
    ranges.map(own).collect()
}
