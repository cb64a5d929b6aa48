//! The order in which the cells of a body are gone through: neighbours after each other, so that a task has few nodes and
//! blocks. Results are told in the caller's numbers whatever the order.

use super::blocks::BlockPattern;
use crate::linear::Numbering;

/// Cells that lie on average between the first and the last at a node before their order matters: those of some tasks.
const FAR: f64 = 1_000.0;

/// How much less of that is worth another order.
const BETTER: f64 = 0.5;

/// Cells in the order in which to go through them, where another than theirs is better.
pub(super) fn cell_order<const N: usize>(
    nodes: &[[u32; N]],
    pattern: &BlockPattern,
    n_points: usize,
) -> Option<Vec<u32>> {
    ordered_beyond(FAR, nodes, pattern, n_points)
}

fn ordered_beyond<const N: usize>(
    far: f64,
    nodes: &[[u32; N]],
    pattern: &BlockPattern,
    n_points: usize,
) -> Option<Vec<u32>> {
    let given = mean_span(nodes.iter(), n_points);
    if given <= far {
        return None;
    }
    let numbering = Numbering::reverse_cuthill_mckee(n_points, pattern.pairs());
    let first = |cell: u32| {
        let places = nodes[cell as usize].map(|node| numbering.place()[node as usize]);
        places.into_iter().min()
    };
    let mut order: Vec<u32> = (0..nodes.len() as u32).collect();
    order.sort_by_cached_key(|&cell| (first(cell), cell));
    let ordered = mean_span(order.iter().map(|&cell| &nodes[cell as usize]), n_points);
    (ordered < BETTER * given).then_some(order)
}

/// Mean number of cells between the first and the last at a node.
fn mean_span<'a, const N: usize>(
    cells: impl Iterator<Item = &'a [u32; N]>,
    n_points: usize,
) -> f64 {
    let mut ends = vec![None; n_points];
    for (at, &node) in
        (0u32..).zip(cells).flat_map(|(at, nodes)| nodes.iter().map(move |n| (at, n)))
    {
        let end = &mut ends[node as usize];
        *end = Some((end.map_or(at, |(first, _)| first), at));
    }
    let spans = ends.iter().flatten().map(|(first, last)| f64::from(last - first));
    spans.sum::<f64>() / n_points.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of triangles along a line, in an order of cells and nodes that leaps about.
    fn leaping(n: u32) -> Vec<[u32; 3]> {
        let node = |k: u32| k * 7 % (n + 2);
        (0..n).map(|k| k * 11 % n).map(|k| [node(k), node(k + 1), node(k + 2)]).collect()
    }

    #[test]
    fn neighbours_follow_each_other() {
        let n = 200;
        let cells = leaping(n);
        let pairs = |nodes: &[u32; 3]| {
            let [a, b, c] = *nodes;
            [[a, a], [b, b], [c, c], [a, b], [b, c], [a, c]]
        };
        let pattern = BlockPattern::new(n as usize + 2, cells.iter().flat_map(pairs));
        let order = ordered_beyond(10.0, &cells, &pattern, n as usize + 2).unwrap();
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..n));
        let ordered: Vec<[u32; 3]> = order.iter().map(|&cell| cells[cell as usize]).collect();
        assert!(mean_span(cells.iter(), n as usize + 2) > 50.0);
        assert!(mean_span(ordered.iter(), n as usize + 2) <= 2.0);
        // A good order stays.
        assert_eq!(ordered_beyond(1.0, &ordered, &pattern, n as usize + 2), None);
        assert_eq!(cell_order(&cells, &pattern, n as usize + 2), None);
    }
}
