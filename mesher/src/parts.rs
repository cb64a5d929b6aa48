//! Pieces too small to be parts.

use crate::field::Field;
use crate::improve::faces;
use crate::quality::volume6;
use crate::vector::Point;

/// A piece of an owner with fewer cells than this (two cubes of the lattice) is given to a neighbour.
const FEWEST: usize = 24;
/// A separate part of the mesh is dropped if it has less than this share of each of its labels.
const LEAST_SHARE: f64 = 0.05;

/// Gives small pieces to the neighbour with which they share most faces, and parts that hold little of any label to the
/// outside. Returns the volume of each label that was dropped with the latter [m^3], and how many these were.
pub fn tidy(
    field: &Field,
    points: &[Point],
    cells: &[[u32; 4]],
    owner: &mut [usize],
) -> (Vec<f64>, usize) {
    let faces = faces(cells);
    let pairs: Vec<[usize; 2]> = faces
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|same| same.len() == 2)
        .map(|same| [same[0].1 as usize, same[1].1 as usize])
        .collect();
    let outside = field.outside();
    merge_crumbs(&pairs, owner, faces.len(), cells.len(), outside);

    let part = components(cells.len(), &pairs, |a, b| owner[a] != outside && owner[b] != outside);
    let mut total = vec![0.0; outside];
    let mut held = std::collections::BTreeMap::new();
    for (c, cell) in cells.iter().enumerate().filter(|(c, _)| owner[*c] != outside) {
        let volume = volume6(cell.map(|i| points[i as usize])).abs() / 6.0;
        total[owner[c]] += volume;
        held.entry(part[c]).or_insert_with(|| vec![0.0; outside])[owner[c]] += volume;
    }
    let mut dropped = vec![0.0; outside];
    held.retain(|_, volumes| {
        let is_small = volumes.iter().zip(&total).all(|(v, t)| *v < LEAST_SHARE * t.max(1e-300));
        if is_small {
            dropped.iter_mut().zip(volumes).for_each(|(sum, volume)| *sum += *volume);
        }
        is_small
    });
    for c in 0..cells.len() {
        if owner[c] != outside && held.contains_key(&part[c]) {
            owner[c] = outside;
        }
    }
    (dropped, held.len())
}

fn merge_crumbs(
    pairs: &[[usize; 2]],
    owner: &mut [usize],
    n_faces: usize,
    n_cells: usize,
    outside: usize,
) {
    debug_assert_eq!(n_faces, 4 * n_cells);
    let piece = components(n_cells, pairs, |a, b| owner[a] == owner[b]);
    let mut size = vec![0; n_cells];
    let mut open = vec![4_usize; n_cells];
    for &p in &piece {
        size[p] += 1;
    }
    let mut neighbours = std::collections::BTreeMap::new();
    for &[a, b] in pairs {
        open[a] -= 1;
        open[b] -= 1;
        for (mine, other) in [(a, b), (b, a)] {
            if owner[a] != owner[b] && size[piece[mine]] < FEWEST {
                *neighbours
                    .entry(piece[mine])
                    .or_insert_with(|| vec![0; outside + 1])
                    .get_mut(owner[other])
                    .unwrap_or(&mut 0) += 1;
            }
        }
    }
    // The rim of what is outside is no crumb.
    let mut is_rim = vec![false; n_cells];
    for c in 0..n_cells {
        is_rim[piece[c]] |= open[c] > 0 && owner[c] == outside;
    }
    for c in 0..n_cells {
        if let (false, Some(count)) = (is_rim[piece[c]], neighbours.get(&piece[c])) {
            let most = (0..=outside).rev().max_by_key(|&o| count[o]);
            owner[c] = most.unwrap_or(owner[c]);
        }
    }
}

/// For each cell the first cell of its component, cells being joined across the faces where `is_joint`.
fn components(
    n_cells: usize,
    pairs: &[[usize; 2]],
    is_joint: impl Fn(usize, usize) -> bool,
) -> Vec<usize> {
    let mut root: Vec<usize> = (0..n_cells).collect();
    let find = |root: &mut Vec<usize>, mut c: usize| {
        while root[c] != c {
            root[c] = root[root[c]];
            c = root[c];
        }
        c
    };
    for &[a, b] in pairs {
        if is_joint(a, b) {
            let (a, b) = (find(&mut root, a), find(&mut root, b));
            root[a.max(b)] = a.min(b);
        }
    }
    (0..n_cells).map(|c| find(&mut root, c)).collect()
}
