//! Pieces of the mesh too small to be parts, and pieces of the labels that the mesh does not hold.

use crate::field::Field;
use crate::improve::faces;
use crate::pieces::is_small;
use crate::quality::volume6;
use crate::vector::{Point, add, mean, scale};
use std::collections::{BTreeMap, BTreeSet};

/// A piece of an owner with fewer cells than this (two cubes of the lattice) is given to a neighbour.
const FEWEST: usize = 24;

/// Pieces of the labels that the mesh lacks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lost {
    /// Volume of each label in them [m^3].
    pub volumes: Vec<f64>,
    /// How many they are.
    pub count: usize,
}

impl Lost {
    fn add(&mut self, volumes: &[f64]) {
        self.volumes.iter_mut().zip(volumes).for_each(|(sum, v)| *sum += v);
    }
}

/// A separate part of the mesh that is small.
struct Scrap {
    /// Volume of each label [m^3].
    volumes: Vec<f64>,
    /// The pieces of the labels in which it lies.
    pieces: BTreeSet<usize>,
}

/// Gives small pieces to the neighbour with which they share most faces, and parts that hold little of any label to the
/// outside. Returns what this drops of stray voxels, and what the mesh misses of others since its cells are too large.
pub fn tidy(field: &Field, points: &[Point], cells: &[[u32; 4]], owner: &mut [usize]) -> [Lost; 2] {
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
    let mut scraps = BTreeMap::new();
    for (c, cell) in cells.iter().enumerate().filter(|(c, _)| owner[*c] != outside) {
        let volume = volume6(cell.map(|i| points[i as usize])).abs() / 6.0;
        total[owner[c]] += volume;
        let new = || Scrap { volumes: vec![0.0; outside], pieces: BTreeSet::new() };
        scraps.entry(part[c]).or_insert_with(new).volumes[owner[c]] += volume;
    }
    scraps.retain(|_, scrap| is_small(&scrap.volumes, &total));
    let mut is_held = vec![false; field.pieces.label.len()];
    for (c, cell) in cells.iter().enumerate().filter(|(c, _)| owner[*c] != outside) {
        let corners = cell.map(|i| points[i as usize]);
        let found = samples(corners).into_iter().filter_map(|x| field.pieces.at(field.voxel(x)));
        let own = found.filter(|&piece| field.pieces.label[piece] == owner[c]);
        match scraps.get_mut(&part[c]) {
            Some(scrap) => scrap.pieces.extend(own),
            None => own.for_each(|piece| is_held[piece] = true),
        }
    }
    for c in 0..cells.len() {
        if owner[c] != outside && scraps.contains_key(&part[c]) {
            owner[c] = outside;
        }
    }
    lost(field, &is_held, scraps.values())
}

/// What is dropped and what is missed, by the pieces that the mesh holds: what is left is to have the volume of these. A
/// scrap in a piece that is held counts as it is.
fn lost<'a>(field: &Field, is_held: &[bool], scraps: impl Iterator<Item = &'a Scrap>) -> [Lost; 2] {
    let pieces = &field.pieces;
    let none = Lost { volumes: vec![0.0; field.outside()], count: 0 };
    let [mut dropped, mut missed] = [none.clone(), none];
    for scrap in scraps.filter(|scrap| scrap.pieces.iter().all(|&piece| is_held[piece])) {
        dropped.add(&scrap.volumes);
        dropped.count += 1;
    }
    let mut bodies = BTreeSet::new();
    for piece in (0..is_held.len()).filter(|&piece| !is_held[piece]) {
        let lost = if pieces.is_stray[piece] { &mut dropped } else { &mut missed };
        lost.volumes[pieces.label[piece]] += pieces.volume[piece];
        lost.count += usize::from(!pieces.is_stray[piece] || bodies.insert(pieces.body[piece]));
    }
    [dropped, missed]
}

/// Places in a cell: its middle, and those halfway to its corners.
fn samples(corners: [Point; 4]) -> [Point; 5] {
    let centre = mean(corners);
    let half = corners.map(|x| scale(add(x, centre), 0.5));
    [centre, half[0], half[1], half[2], half[3]]
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
    let mut neighbours = BTreeMap::new();
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
