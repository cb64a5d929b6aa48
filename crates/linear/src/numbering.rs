//! Nodes numbered so that neighbours stand close together: what conjugate gradients read next is then in the cache, and an
//! incomplete factor, which drops what would couple distant nodes, drops less.
//!
//! Reverse Cuthill-McKee (Cuthill and McKee, Proc. 24th ACM National Conf., 1969, 157) from a node at an end of the graph
//! (Gibbs, Poole and Stockmeyer, SIAM J. Numer. Anal. 13, 1976, 236).

use super::neighbours::Neighbours;

/// Searches for a node farther out, at most.
const SEARCHES: usize = 5;

const UNSEEN: u32 = u32::MAX;

/// An order of nodes, and the length of the graph that it was made for.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbering {
    /// The node at each place.
    order: Vec<u32>,
    /// The place of each node.
    place: Vec<u32>,
    n_levels: usize,
}

impl Numbering {
    /// Of `n` nodes, from the pairs of nodes that share a block; a pair given twice counts as two neighbours.
    pub fn reverse_cuthill_mckee(
        n: usize,
        pairs: impl Iterator<Item = (u32, u32)> + Clone,
    ) -> Self {
        let neighbours = Neighbours::new(n, pairs);
        let mut search = Search { neighbours: &neighbours, level: vec![UNSEEN; n] };
        let (mut order, mut n_levels) = (Vec::with_capacity(n), 0);
        for node in 0..n as u32 {
            if search.level[node as usize] == UNSEEN {
                let part = search.starting_at_an_end(node);
                n_levels = n_levels.max(part.n_levels);
                order.extend(part.nodes);
            }
        }
        order.reverse();
        let mut place = vec![0; n];
        (0u32..).zip(&order).for_each(|(at, &node)| place[node as usize] = at);
        Numbering { order, place, n_levels }
    }

    /// The node at each place.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The place of each node.
    pub fn place(&self) -> &[u32] {
        &self.place
    }

    /// Layers of neighbours from one end of the graph to the other, of its longest part.
    pub fn n_levels(&self) -> usize {
        self.n_levels
    }

    /// Mean distance of the nodes of a pair, as they were numbered and as they are here.
    pub fn distances(&self, pairs: impl Iterator<Item = (u32, u32)>) -> [f64; 2] {
        let (mut sums, mut count) = ([0.0; 2], 0.0f64);
        for (a, b) in pairs {
            let places = [self.place[a as usize], self.place[b as usize]];
            sums[0] += f64::from(a.abs_diff(b));
            sums[1] += f64::from(places[0].abs_diff(places[1]));
            count += 1.0;
        }
        sums.map(|sum| sum / count.max(1.0))
    }

    /// What stands at three numbers a node, in this order.
    pub fn gather<T: Copy>(&self, given: &[T], out: &mut [T]) {
        let (given, _) = given.as_chunks::<3>();
        let (out, _) = out.as_chunks_mut::<3>();
        out.iter_mut().zip(&self.order).for_each(|(out, &node)| *out = given[node as usize]);
    }

    /// Back from this order.
    pub fn scatter<T: Copy>(&self, ordered: &[T], out: &mut [T]) {
        let (ordered, _) = ordered.as_chunks::<3>();
        let (out, _) = out.as_chunks_mut::<3>();
        self.order.iter().zip(ordered).for_each(|(&node, values)| out[node as usize] = *values);
    }
}

/// A breadth-first search.
struct Search<'a> {
    neighbours: &'a Neighbours,
    /// Distance of every node from the start, where it was reached.
    level: Vec<u32>,
}

/// The nodes of a connected part in the order in which a search met them.
struct Found {
    nodes: Vec<u32>,
    n_levels: usize,
}

impl Search<'_> {
    /// From a node at an end of the part that `node` belongs to, by which the part has as many levels as may be.
    fn starting_at_an_end(&mut self, node: u32) -> Found {
        let mut found = self.from(node);
        for _ in 0..SEARCHES {
            let last = found.n_levels as u32 - 1;
            let is_last = |node: &&u32| self.level[**node as usize] == last;
            let degree = |node: &&u32| (self.neighbours.of(**node as usize).len(), **node);
            let Some(&end) = found.nodes.iter().filter(is_last).min_by_key(degree) else { break };
            found.nodes.iter().for_each(|&node| self.level[node as usize] = UNSEEN);
            let n_levels = found.n_levels;
            found = self.from(end);
            if found.n_levels <= n_levels {
                break;
            }
        }
        found
    }

    /// Level by level, among the neighbours of a node those of few neighbours first.
    fn from(&mut self, start: u32) -> Found {
        let mut nodes = vec![start];
        self.level[start as usize] = 0;
        let (mut at, mut around) = (0, Vec::new());
        while let Some(&node) = nodes.get(at) {
            at += 1;
            let next = self.level[node as usize] + 1;
            around.clear();
            for &other in self.neighbours.of(node as usize) {
                if self.level[other as usize] == UNSEEN {
                    self.level[other as usize] = next;
                    around.push(other);
                }
            }
            around.sort_unstable_by_key(|&k| (self.neighbours.of(k as usize).len(), k));
            nodes.extend_from_slice(&around);
        }
        let n_levels = nodes.last().map_or(0, |&node| self.level[node as usize] as usize + 1);
        Found { nodes, n_levels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of a grid of `a` by `b` nodes whose numbers are scattered.
    fn scattered_grid(a: u32, b: u32) -> Vec<(u32, u32)> {
        let n = a * b;
        let number = move |i: u32, k: u32| (i * b + k) * 37 % n;
        let along = (0..a - 1).flat_map(move |i| (0..b).map(move |k| [(i, k), (i + 1, k)]));
        let across = (0..a).flat_map(move |i| (0..b - 1).map(move |k| [(i, k), (i, k + 1)]));
        let pair = move |[(i, k), (j, l)]: [(u32, u32); 2]| (number(i, k), number(j, l));
        along.chain(across).map(pair).collect()
    }

    #[test]
    fn a_strip_has_a_band_as_wide_as_itself() {
        let pairs = scattered_grid(100, 6);
        let numbering = Numbering::reverse_cuthill_mckee(600, pairs.iter().copied());
        let mut sorted = numbering.order().to_vec();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..600));
        let place = |node: u32| numbering.place()[node as usize];
        assert!((0..600).all(|k| place(numbering.order()[k]) == k as u32));
        assert!(pairs.iter().all(|&(a, b)| place(a).abs_diff(place(b)) <= 7));
        assert_eq!(numbering.n_levels(), 100 + 6 - 1);
        let [given, ordered] = numbering.distances(pairs.iter().copied());
        assert!(given > 100.0 && ordered < 7.0, "{given} {ordered}");
    }

    #[test]
    fn parts_that_nothing_joins_follow_each_other() {
        let numbering = Numbering::reverse_cuthill_mckee(7, [(0, 4), (4, 2), (1, 5)].into_iter());
        let mut parts = [vec![], vec![]];
        for (at, node) in numbering.order().iter().enumerate() {
            match node {
                0 | 2 | 4 => parts[0].push(at),
                1 | 5 => parts[1].push(at),
                _ => {}
            }
        }
        assert!(parts.iter().all(|part| part.windows(2).all(|pair| pair[1] == pair[0] + 1)));
        assert_eq!(numbering.n_levels(), 3);
    }

    #[test]
    fn comes_back_from_its_order() {
        let numbering = Numbering::reverse_cuthill_mckee(12, scattered_grid(4, 3).iter().copied());
        let given: Vec<f64> = (0..36).map(f64::from).collect();
        let (mut ordered, mut back) = (vec![0.0; 36], vec![0.0; 36]);
        numbering.gather(&given, &mut ordered);
        numbering.scatter(&ordered, &mut back);
        assert_ne!(ordered, given);
        assert_eq!(back, given);
    }
}
