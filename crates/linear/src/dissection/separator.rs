//! Few nodes that separate a part into two halves: the best of some planes through it, made smaller node by node
//! (Fiduccia, Mattheyses, DAC 1982; Hendrickson, Rothberg, SIAM J. Sci. Comput. 20 (1998) 468).

use super::part::{Part, Side};
use super::plane::Plane;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Normals of the planes: along the axes, and half-way between two of them.
const NORMALS: [[i32; 3]; 9] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 1, 0],
    [1, -1, 0],
    [1, 0, 1],
    [1, 0, -1],
    [0, 1, 1],
    [0, 1, -1],
];

/// Of all rows at most, in one half.
const LARGEST: f64 = 0.55;

/// Passes over a separator at most, and moves in one that follow its best state without reaching a better.
const PASSES: usize = 6;
const FRUITLESS: usize = 60;

const HALVES: [Side; 2] = [Side::First, Side::Second];

impl Side {
    fn opposite(self) -> Self {
        if self == Self::First { Self::Second } else { Self::First }
    }
}

/// The side of every node of a part, no node of either half beside one of the other; none where no few nodes separate it.
pub(super) fn separated(part: &Part) -> Option<Vec<Side>> {
    let planes = NORMALS.iter().filter_map(|normal| Plane::new(part, normal));
    let plane = planes.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    let mut halves = Halves::new(part, plane.sides());
    let mut passes = 0..PASSES;
    while passes.next().is_some() && halves.improve() {}
    halves.are_both().then_some(halves.side)
}

/// A node that leaves the separator for a half, by what the separator gains; of equal ones, the first.
type Offer = (i64, Reverse<u32>, Side);

struct Halves<'a> {
    part: &'a Part,
    side: Vec<Side>,
    /// On each side.
    rows: [i64; 3],
    /// In one half, at most.
    most: i64,
    /// Rows by which the separator shrinks if a node of it goes to either half: its neighbours in the other take its place.
    gain: Vec<[i64; 2]>,
}

/// A node went to a half; the nodes pulled into the separator from the other half by moves before it.
struct Move {
    node: u32,
    to: Side,
    pulled_before: usize,
}

impl<'a> Halves<'a> {
    fn new(part: &'a Part, side: Vec<Side>) -> Self {
        let mut rows = [0; 3];
        side.iter().zip(&part.rows).for_each(|(&side, &r)| rows[side as usize] += i64::from(r));
        let most = (LARGEST * rows.iter().sum::<i64>() as f64) as i64;
        Self { part, side, rows, most, gain: vec![[0; 2]; part.len()] }
    }

    fn are_both(&self) -> bool {
        self.rows[Side::First as usize] > 0 && self.rows[Side::Second as usize] > 0
    }

    /// Rows of the separator, then those by which the halves differ.
    fn cost(&self) -> (i64, i64) {
        let [first, second, separator] = self.rows;
        (separator, (first - second).abs())
    }

    /// Moves nodes out of the separator, the most profitable first, also at a loss, and goes back to the best state.
    /// Whether that is better than before.
    fn improve(&mut self) -> bool {
        let mut offers = BinaryHeap::new();
        for node in 0..self.part.len() as u32 {
            if self.is_between(node) {
                self.weigh(node, &mut offers);
            }
        }
        let (mut best, mut kept) = (self.cost(), 0);
        let (mut moves, mut pulled) = (Vec::<Move>::new(), Vec::new());
        let mut has_moved = vec![false; self.part.len()];
        while moves.len() < kept + FRUITLESS
            && let Some((gain, Reverse(node), to)) = offers.pop()
        {
            let is_open = self.is_between(node) && !has_moved[node as usize];
            let fits = self.rows[to as usize] + self.rows_of(node) <= self.most;
            if !is_open || !fits || self.gain[node as usize][to as usize] != gain {
                continue;
            }
            has_moved[node as usize] = true;
            moves.push(Move { node, to, pulled_before: pulled.len() });
            self.go(node, to, &mut pulled, &mut offers);
            if self.cost() < best && self.are_both() {
                (best, kept) = (self.cost(), moves.len());
            }
        }
        for Move { node, to, pulled_before } in moves.drain(kept..).rev() {
            pulled.drain(pulled_before..).for_each(|other| self.put(other, to.opposite()));
            self.put(node, Side::Separator);
        }
        kept > 0
    }

    fn is_between(&self, node: u32) -> bool {
        self.side[node as usize] == Side::Separator
    }

    fn rows_of(&self, node: u32) -> i64 {
        i64::from(self.part.rows[node as usize])
    }

    /// What a node of the separator gains, offered to both halves.
    fn weigh(&mut self, node: u32, offers: &mut BinaryHeap<Offer>) {
        let mut beside = [0; 3];
        for &other in self.part.neighbours(node as usize) {
            beside[self.side[other as usize] as usize] += self.rows_of(other);
        }
        for to in HALVES {
            let gain = self.rows_of(node) - beside[to.opposite() as usize];
            self.gain[node as usize][to as usize] = gain;
            offers.push((gain, Reverse(node), to));
        }
    }

    /// A node of the separator goes to a half, and pulls its neighbours in the other into the separator.
    fn go(&mut self, node: u32, to: Side, pulled: &mut Vec<u32>, offers: &mut BinaryHeap<Offer>) {
        let (part, before) = (self.part, pulled.len());
        self.put(node, to);
        self.change(node, to.opposite(), -self.rows_of(node), offers);
        for &other in part.neighbours(node as usize) {
            if self.side[other as usize] == to.opposite() {
                self.put(other, Side::Separator);
                pulled.push(other);
            }
        }
        for &other in &pulled[before..] {
            self.change(other, to, self.rows_of(other), offers);
        }
        for &other in &pulled[before..] {
            self.weigh(other, offers);
        }
    }

    /// What the neighbours of a node in the separator gain in one half has changed.
    fn change(&mut self, node: u32, to: Side, by: i64, offers: &mut BinaryHeap<Offer>) {
        for &other in self.part.neighbours(node as usize) {
            if self.is_between(other) {
                let gain = &mut self.gain[other as usize][to as usize];
                *gain += by;
                offers.push((*gain, Reverse(other), to));
            }
        }
    }

    fn put(&mut self, node: u32, to: Side) {
        let rows = self.rows_of(node);
        let from = std::mem::replace(&mut self.side[node as usize], to);
        self.rows[from as usize] -= rows;
        self.rows[to as usize] += rows;
    }
}
