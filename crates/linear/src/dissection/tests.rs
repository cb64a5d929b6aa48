use super::super::graph::Graph;
use super::super::test_matrices::{Matrix, elastic_block};
use super::leaf;
use super::part::{Part, Side};
use super::plane::Plane;
use super::separator::separated;
use super::*;

fn block(nx: usize, ny: usize, nz: usize) -> Graph {
    Graph::new(&elastic_block(nx, ny, nz).pattern)
}

/// A graph of nodes with one row each.
fn of_pairs(n: usize, pairs: &[(usize, usize)]) -> Graph {
    let entries: Vec<_> = pairs.iter().map(|&(a, b)| (a, b, 1.0)).collect();
    Graph::new(&Matrix::from_entries(n, &entries).pattern)
}

fn whole(graph: &Graph) -> Part {
    let mut parts = Part::connected(graph);
    assert_eq!(parts.len(), 1);
    let mut part = parts.remove(0);
    part.place = places(&part);
    part
}

#[test]
fn every_block_is_eliminated_once() {
    for graph in [block(9, 8, 7), block(2, 2, 60), of_pairs(300, &[(0, 1), (5, 290), (5, 7)])] {
        let mut order = dissection(&graph);
        order.sort_unstable();
        assert!(order.into_iter().eq(0..graph.n as u32));
    }
}

#[test]
fn halves_are_no_neighbours_and_nearly_even() {
    for graph in [block(9, 8, 7), block(3, 3, 40), block(5, 20, 20)] {
        let part = whole(&graph);
        let side = separated(&part).unwrap();
        let count = |wanted| side.iter().filter(|&&side| side == wanted).count();
        let (first, second) = (count(Side::First), count(Side::Second));
        assert!(first.min(second) > 2 * part.len() / 5 - count(Side::Separator));
        assert!(first.max(second) <= 29 * part.len() / 50);
        for node in 0..part.len() {
            for &other in part.neighbours(node) {
                let sides = [side[node], side[other as usize]];
                assert!(sides != [Side::First, Side::Second], "{node} is beside {other}");
            }
        }
    }
}

#[test]
fn a_long_block_is_separated_by_a_layer_across_it() {
    // Cells are halved along their diagonals, so that a layer of nodes separates; there are 40 of them.
    let part = whole(&block(4, 4, 40));
    let side = separated(&part).unwrap();
    assert_eq!(side.iter().filter(|&&side| side == Side::Separator).count(), 16);
}

#[test]
fn moves_make_the_separator_of_a_plane_smaller() {
    let part = whole(&block(12, 12, 12));
    let planes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|normal| Plane::new(&part, &normal));
    let least = planes
        .into_iter()
        .flatten()
        .map(|plane| plane.sides().iter().filter(|&&side| side == Side::Separator).count());
    let refined = separated(&part).unwrap();
    let rows = refined.iter().filter(|&&side| side == Side::Separator).count();
    assert!(rows <= least.min().unwrap());
    assert!(rows <= 150, "a layer of the block has 144 nodes, the separator {rows}");
}

#[test]
fn places_tell_the_shape() {
    // Of a path, the ends are farthest apart, and the places run evenly from one to the other.
    let pairs: Vec<_> = (1..100).map(|i| (i - 1, i)).collect();
    let part = whole(&of_pairs(100, &pairs));
    let along: Vec<i32> = part.place.iter().map(|place| place[0]).collect();
    let step = along[50] - along[49];
    assert!(step != 0);
    assert!(along[3..97].windows(2).all(|pair| pair[1] - pair[0] == step), "{along:?}");
}

#[test]
fn parts_hang_together() {
    let graph = of_pairs(7, &[(0, 3), (3, 5), (1, 4), (2, 6)]);
    let nodes: Vec<_> = Part::connected(&graph).into_iter().map(|part| part.nodes).collect();
    assert_eq!(nodes, [vec![0, 3, 5], vec![1, 4], vec![2, 6]]);
}

#[test]
fn nodes_that_all_meet_are_ordered_too() {
    let pairs: Vec<_> = (0..100).flat_map(|a| (0..a).map(move |b| (b, a))).collect();
    // Each has a neighbour of its own, so that no two have the same entries, which would make them one block.
    let tails = (0..100).map(|a| (a, 100 + a));
    let pairs: Vec<_> = pairs.into_iter().chain(tails).collect();
    let graph = of_pairs(200, &pairs);
    assert!(graph.n >= 200);
    let mut order = dissection(&graph);
    order.sort_unstable();
    assert!(order.into_iter().eq(0..graph.n as u32));
}

#[test]
fn in_a_leaf_the_fewest_neighbours_come_first() {
    // A star of five: the middle meets all, its arms only the middle. Arm 4 has two more neighbours outside the leaf.
    let graph = of_pairs(7, &[(0, 1), (0, 2), (0, 3), (0, 4), (4, 5), (4, 6)]);
    assert!((0..7).all(|node| graph.size(node) == 1));
    assert_eq!(leaf::order(&graph, &[0, 1, 2, 3, 4]), [1, 2, 3, 0, 4]);
    assert!(leaf::order(&graph, &[]).is_empty());
}
