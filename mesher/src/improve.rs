//! Moves nodes, each on the surfaces that it belongs to, so that the worst angles around it become better.

use crate::constraint::{Constraint, project};
use crate::field::Field;
use crate::quality::{FACES, min_sine};
use crate::stars::Stars;
use crate::surface::BEYOND;
use crate::vector::{Point, add, cross, norm, scale, sub};
use crate::{Error, Step};
use rayon::prelude::*;

/// Nodes around cells whose angles are all better than this (sine of 40 degrees) stay.
const GOOD: f64 = 0.64;
/// First step of a node, in edges, and by how much each sweep shortens it.
const STEP: f64 = 0.15;
const SHRINK: f64 = 0.88;
/// Around worse cells than this (sine of 14 degrees) a node may leave its surfaces, unless they are flat.
const ROUGH: f64 = 0.25;
/// Steps of a sweep between which it can be ended.
pub const STEPS_PER_SWEEP: usize = 4;
/// Sine of the angle below which a cell outside counts.
const FLAT: f64 = 0.1;
/// A node may leave its surface's cells this good at least when it goes back to the surface.
const KEPT: f64 = 0.25;

/// A mesh whose nodes move.
pub struct Improving<'a> {
    pub field: &'a Field,
    pub points: Vec<Point>,
    /// Distance between the lattice's centres at each node [m].
    spacing: &'a [f64],
    pub cells: &'a [[u32; 4]],
    owner: &'a [usize],
    stars: Stars,
    /// Surfaces of each node; none inside, more than three where it must stay.
    surfaces: Vec<Vec<Constraint>>,
    /// Nodes in classes: no cell holds two of the same.
    classes: Vec<Vec<u32>>,
}

/// Bits of the owners that meet at each node, the outside and what is beyond the image included.
pub fn meeting(n_points: usize, interfaces: &[Interface]) -> Vec<u64> {
    let mut bits = vec![0; n_points];
    for face in interfaces {
        for i in face.nodes {
            bits[i as usize] |= (4 << face.owner) | face.other.map_or(BEYOND, |other| 4 << other);
        }
    }
    bits
}

/// A face between two owners.
pub struct Interface {
    pub nodes: [u32; 3],
    pub owner: usize,
    /// The outside is the number of labels; none if the image ends.
    pub other: Option<usize>,
}

/// The faces between owners, and the outer ones.
pub fn interfaces(
    on: &[u64],
    cells: &[[u32; 4]],
    owner: &[usize],
    outside: usize,
) -> Vec<Interface> {
    let faces = faces(cells);
    let between = |same: &[([u32; 3], u32)]| {
        let (nodes, owner) = (same[0].0, same.iter().map(|face| owner[face.1 as usize]));
        let owner: Vec<usize> = owner.collect();
        let is_beyond = nodes.iter().all(|&i| on[i as usize] & BEYOND != 0);
        match owner[..] {
            [owner] if is_beyond && owner != outside => {
                Some(Interface { nodes, owner, other: None })
            }
            [owner, other] if owner != other => {
                Some(Interface { nodes, owner, other: Some(other) })
            }
            _ => None,
        }
    };
    faces.chunk_by(|a, b| a.0 == b.0).filter_map(between).collect()
}

/// The faces of all cells with ascending corners, sorted, each with its cell.
pub fn faces(cells: &[[u32; 4]]) -> Vec<([u32; 3], u32)> {
    let mut faces: Vec<([u32; 3], u32)> = cells
        .par_iter()
        .enumerate()
        .flat_map_iter(|(c, cell)| {
            FACES.iter().map(move |f| {
                let mut face = f.map(|k| cell[k]);
                face.sort_unstable();
                (face, c as u32)
            })
        })
        .collect();
    faces.par_sort_unstable();
    faces
}

impl<'a> Improving<'a> {
    pub fn new(
        field: &'a Field,
        spacing: &'a [f64],
        points: Vec<Point>,
        meeting: &[u64],
        cells: &'a [[u32; 4]],
        owner: &'a [usize],
    ) -> Self {
        let stars = Stars::new(points.len(), cells.iter());
        let places = points.iter().zip(spacing).zip(meeting);
        let surfaces =
            places.map(|((&x, &spacing), &bits)| surfaces(field, spacing, x, bits)).collect();
        let classes = classes(points.len(), cells, &stars);
        Improving { field, points, spacing, cells, owner, stars, surfaces, classes }
    }

    /// One round over all nodes that have a bad cell, in [`STEPS_PER_SWEEP`] steps.
    pub fn sweep(&mut self, round: i32, step: Step) -> Result<(), Error> {
        let size = STEP * SHRINK.powi(round);
        let quality: Vec<f64> = (0..self.cells.len())
            .into_par_iter()
            .map(|c| self.quality(c, self.corners(self.cells[c])))
            .collect();
        let n_classes = self.classes.len();
        for class in 0..n_classes {
            let until = |class: usize| class * STEPS_PER_SWEEP / n_classes;
            for _ in until(class)..until(class + 1) {
                step()?;
            }
            let moved: Vec<(u32, Point)> = self.classes[class]
                .par_iter()
                .filter(|&&node| self.stars.of(node).iter().any(|&c| quality[c as usize] < GOOD))
                .filter_map(|&node| Some((node, self.better(node, size)?)))
                .collect();
            for (node, place) in moved {
                self.points[node as usize] = place;
            }
        }
        Ok(())
    }

    /// Brings every node back to its surfaces, as far as its cells allow.
    pub fn return_to_surfaces(&mut self) {
        for class in 0..self.classes.len() {
            let moved: Vec<(u32, Point)> = self.classes[class]
                .par_iter()
                .filter_map(|&node| Some((node, self.returned(node)?)))
                .collect();
            for (node, place) in moved {
                self.points[node as usize] = place;
            }
        }
    }

    fn returned(&self, node: u32) -> Option<Point> {
        let surfaces = &self.surfaces[node as usize];
        if surfaces.is_empty() || surfaces.len() > 3 {
            return None;
        }
        let old = self.points[node as usize];
        let spacing = self.spacing[node as usize];
        let place = project(self.field, surfaces, old, spacing)?;
        let step = sub(place, old);
        if norm(step) > 0.5 * spacing {
            return None;
        }
        let least = self.worst(node, old, f64::NEG_INFINITY)?.min(KEPT);
        [1.0, 0.5, 0.25]
            .into_iter()
            .map(|share| add(old, scale(step, share)))
            .find(|&x| self.worst(node, x, least).is_some_and(|worst| worst >= least))
    }

    /// Cells outside only keep surfaces apart; they are good as long as they are not flat.
    fn quality(&self, c: usize, corners: [Point; 4]) -> f64 {
        let sine = min_sine(corners);
        if self.owner[c] == self.field.outside() && sine >= FLAT { 1.0 } else { sine }
    }

    fn corners(&self, cell: [u32; 4]) -> [Point; 4] {
        cell.map(|i| self.points[i as usize])
    }

    /// The worst quality around a node if it were at `x`; none if that is below `least`.
    fn worst(&self, node: u32, x: Point, least: f64) -> Option<f64> {
        let mut worst = f64::INFINITY;
        for &c in self.stars.of(node) {
            let cell = self.cells[c as usize];
            let corners = cell.map(|i| if i == node { x } else { self.points[i as usize] });
            worst = worst.min(self.quality(c as usize, corners));
            if worst < least {
                return None;
            }
        }
        Some(worst)
    }

    /// A place where the worst cell around the node is better, if one of a few is; `size` of the steps in spacings.
    fn better(&self, node: u32, size: f64) -> Option<Point> {
        let old = self.points[node as usize];
        let mut best = (self.worst(node, old, f64::NEG_INFINITY)?, None);
        let is_rough = best.0 < ROUGH;
        let held =
            self.surfaces[node as usize].iter().filter(|surface| !is_rough || surface.is_flat());
        let surfaces: Vec<Constraint> = held.copied().collect();
        if surfaces.len() > 2 {
            return None;
        }
        let spacing = self.spacing[node as usize];
        for step in self.steps(node, size * spacing) {
            let mut place = add(old, step);
            if !surfaces.is_empty() {
                match project(self.field, &surfaces, place, spacing) {
                    Some(on) if norm(sub(on, place)) < 0.5 * spacing => place = on,
                    _ => continue,
                }
            }
            if let Some(worst) = self.worst(node, place, best.0 + 1e-9) {
                best = (worst, Some(place));
            }
        }
        best.1
    }

    /// Steps to try: the corners of an icosahedron, towards the middle of the neighbours, away from the opposite face of
    /// the worst cell.
    fn steps(&self, node: u32, size: f64) -> Vec<Point> {
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let unit = size / 1.0_f64.hypot(golden);
        let mut steps = Vec::with_capacity(17);
        for (s, t) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let (s, t) = (s * unit, t * golden * unit);
            steps.extend([[0.0, s, t], [t, 0.0, s], [s, t, 0.0]]);
        }
        let old = self.points[node as usize];
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        let (mut least, mut away) = (f64::INFINITY, [0.0; 3]);
        for &c in self.stars.of(node) {
            let cell = self.cells[c as usize];
            let worst = self.quality(c as usize, self.corners(cell));
            for (k, &i) in cell.iter().enumerate() {
                if i != node {
                    sum = add(sum, sub(self.points[i as usize], old));
                    count += 1.0;
                } else if worst < least {
                    least = worst;
                    let [p, q, r] = FACES[k].map(|k| self.points[cell[k] as usize]);
                    let normal = cross(sub(q, p), sub(r, p)); // outward, so away from the node
                    away = scale(normal, -size / norm(normal).max(1e-300));
                }
            }
        }
        let toward = scale(sum, 1.0 / count);
        steps.extend([0.25, 0.5, 1.0].map(|share| scale(toward, share)));
        steps.extend([away, scale(away, 0.3)]);
        steps
    }
}

fn surfaces(field: &Field, spacing: f64, x: Point, bits: u64) -> Vec<Constraint> {
    let owners: Vec<usize> = (0..=field.outside()).filter(|l| bits & (4 << l) != 0).collect();
    let pairs = owners.iter().skip(1).map(|&other| Constraint::Between(owners[0], other));
    let near = field.planes.iter().filter(|plane| plane.distance(x).abs() < 1e-2 * spacing);
    let planes = near.filter(|_| bits & BEYOND != 0).map(|&plane| Constraint::On(plane));
    planes.chain(pairs).collect()
}

/// Greedy colouring by ascending index: the same for any number of threads.
fn classes(n_points: usize, cells: &[[u32; 4]], stars: &Stars) -> Vec<Vec<u32>> {
    let mut colour = vec![u8::MAX; n_points];
    let mut classes: Vec<Vec<u32>> = Vec::new();
    for node in 0..n_points as u32 {
        let mut taken = [false; 256];
        for &c in stars.of(node) {
            for &i in &cells[c as usize] {
                taken[usize::from(colour[i as usize])] = true;
            }
        }
        let free = taken.iter().position(|&is_taken| !is_taken).unwrap_or(255);
        if free == classes.len() {
            classes.push(Vec::new());
        }
        classes[free].push(node);
        colour[node as usize] = free as u8;
    }
    classes
}
