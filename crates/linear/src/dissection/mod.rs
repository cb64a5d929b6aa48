//! Nested dissection (George, SIAM J. Numer. Anal. 10 (1973) 345): few nodes separate a body into two halves, which are
//! dissected in turn; the halves are eliminated first, what separates them last.
//!
//! The graph of a mesh has a shape, which its distances tell ([`places`]). Planes through it are tried as separators, and
//! the best is made smaller node by node ([`separator`]). So few nodes are left in the end that their order is found by
//! minimum degree ([`leaf`]).

mod leaf;
mod part;
mod places;
mod plane;
mod separator;

use super::graph::Graph;
use crate::threads::each;
use leaf::LARGEST;
use part::{Part, Side};
use places::places;
use separator::separated;

/// Nodes from which the two halves are dissected on two threads.
const SHARED_FROM: usize = 2000;

/// The blocks of the graph in elimination order.
pub(super) fn dissection(graph: &Graph) -> Vec<u32> {
    let mut order = vec![0; graph.n];
    let mut left = &mut order[..];
    for mut part in Part::connected(graph) {
        part.place = places(&part);
        let (own, others) = left.split_at_mut(part.len());
        dissect(graph, part, own);
        left = others;
    }
    order
}

/// Writes the blocks of a part in elimination order.
fn dissect(graph: &Graph, part: Part, order: &mut [u32]) {
    if part.len() <= LARGEST {
        return order.copy_from_slice(&leaf::order(graph, &part.nodes));
    }
    let Some(side) = separated(&part) else {
        return order.copy_from_slice(&part.nodes); // each with nearly all others: any order fills it
    };
    let halves = [Side::First, Side::Second].map(|half| part.taken(&side, half));
    let between = part.nodes.iter().zip(&side).filter(|&(_, &side)| side == Side::Separator);
    let (of_first, rest) = order.split_at_mut(halves[0].len());
    let (of_second, last) = rest.split_at_mut(halves[1].len());
    last.iter_mut().zip(between).for_each(|(place, (&node, _))| *place = node);
    let is_long = part.len() >= SHARED_FROM;
    drop((part, side));
    let tasks: Vec<_> = halves.into_iter().zip([of_first, of_second]).collect();
    let run = |(half, order): (Part, &mut [u32])| dissect(graph, half, order);
    if is_long {
        each(tasks, run);
    } else {
        tasks.into_iter().for_each(run);
    }
}

#[cfg(test)]
mod tests;
