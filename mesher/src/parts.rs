//! Pieces too small to be parts.

use crate::field::{Field, NONE};
use crate::improve::faces;
use crate::quality::volume6;
use crate::vector::{Point, mean};
use std::collections::{BTreeMap, BTreeSet};

/// A piece of an owner with fewer cells than this (two cubes of the lattice) is given to a neighbour.
const FEWEST: usize = 24;
/// A separate part of the mesh is dropped if it has less than this share of each of its labels.
const LEAST_SHARE: f64 = 0.05;

/// Gives small pieces to the neighbour with which they share most faces, and parts that hold little of any label to the
/// outside. Returns the volume of each label's voxels that was dropped with the latter [m^3], and how many these were.
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
    let mut held = BTreeMap::new();
    for (c, cell) in cells.iter().enumerate().filter(|(c, _)| owner[*c] != outside) {
        let volume = volume6(cell.map(|i| points[i as usize])).abs() / 6.0;
        total[owner[c]] += volume;
        held.entry(part[c]).or_insert_with(|| vec![0.0; outside])[owner[c]] += volume;
    }
    held.retain(|_, volumes| is_small(volumes, &total));
    let mut places: BTreeMap<usize, Vec<Point>> = BTreeMap::new();
    for c in 0..cells.len() {
        if owner[c] != outside && held.contains_key(&part[c]) {
            owner[c] = outside;
            let middle = mean(cells[c].map(|i| points[i as usize]));
            places.entry(part[c]).or_default().push(middle);
        }
    }
    // Both go by the numbers of the parts.
    (in_voxels(field, held.values().zip(places.values())), places.len())
}

fn is_small(volumes: &[f64], total: &[f64]) -> bool {
    volumes.iter().zip(total).all(|(v, t)| *v < LEAST_SHARE * t.max(1e-300))
}

/// Volume of each label's voxels in parts of the mesh, which are given by their own volumes and places in them: what is
/// left is to have the volume of the other voxels. A part that the voxels join to a large one counts as it is.
fn in_voxels<'a>(
    field: &Field,
    parts: impl Iterator<Item = (&'a Vec<f64>, &'a Vec<Point>)>,
) -> Vec<f64> {
    let mut pieces = Pieces { field, number: Vec::new(), volumes: Vec::new() };
    let mut found = BTreeSet::new();
    let mut sum = vec![0.0; field.outside()];
    let mut add = |volumes: &[f64]| sum.iter_mut().zip(volumes).for_each(|(s, v)| *s += v);
    for (volumes, places) in parts {
        let mut here: BTreeSet<usize> = places.iter().filter_map(|&x| pieces.at(x)).collect();
        here.retain(|&piece| is_small(&pieces.volumes[piece], &field.volumes));
        if here.is_empty() {
            add(volumes);
        }
        found.extend(here);
    }
    found.into_iter().for_each(|piece| add(&pieces.volumes[piece]));
    sum
}

/// Connected voxels, as far as they were asked for.
struct Pieces<'a> {
    field: &'a Field,
    /// One more than the piece of each voxel; 0 while that is not known.
    number: Vec<u32>,
    /// Volume of each label in each piece [m^3].
    volumes: Vec<Vec<f64>>,
}

impl Pieces<'_> {
    /// The piece at a place.
    fn at(&mut self, x: Point) -> Option<usize> {
        let voxel = self.field.voxel(x);
        if self.field.held[voxel] == NONE {
            return None;
        }
        self.number.resize(self.field.held.len(), 0);
        if self.number[voxel] == 0 {
            self.fill(voxel);
        }
        Some(self.number[voxel] as usize - 1)
    }

    /// Numbers the voxels that are joined to one by faces, edges or corners.
    fn fill(&mut self, start: usize) {
        let [nx, ny, nz] = self.field.dims;
        let mut volumes = vec![0.0; self.field.outside()];
        let number = self.volumes.len() as u32 + 1;
        self.number[start] = number;
        let mut open = vec![start];
        while let Some(voxel) = open.pop() {
            volumes[usize::from(self.field.held[voxel])] += self.field.voxel_volume;
            let around = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
            for i in around(voxel / (ny * nz), nx) {
                for j in around(voxel / nz % ny, ny) {
                    for k in around(voxel % nz, nz) {
                        let next = (i * ny + j) * nz + k;
                        if self.field.held[next] != NONE && self.number[next] == 0 {
                            self.number[next] = number;
                            open.push(next);
                        }
                    }
                }
            }
        }
        self.volumes.push(volumes);
    }
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
