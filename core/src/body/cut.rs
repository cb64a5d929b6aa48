//! Pieces of a body as a body of their own, for energies that are summed over some of them with weights.
//!
//! A piece is the least that has an energy to itself: a cell, or a cluster of cells that share their change of volume.

use super::partition::Partition;
use super::{Assembly, Body};
use crate::element::Geometry;
use std::collections::HashMap;

/// Some pieces of a body.
pub struct Cut {
    /// Their energy is that of the pieces in the whole, times their weights.
    pub body: Body,
    /// By node of this body: the node of the whole.
    pub nodes: Vec<u32>,
    /// By node of this body: the first piece that has it, in the order they were asked for.
    pub pieces: Vec<u32>,
}

/// What becomes of nodes that several pieces have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seams {
    /// The pieces share them.
    Kept,
    /// Every piece has its own, so that the force on a node is that of one piece.
    Opened,
}

impl Body {
    /// Number of pieces.
    pub fn n_pieces(&self) -> usize {
        match &*self.assembly {
            Assembly::P1(_) | Assembly::P2(_) => self.cells.len(),
            Assembly::P1MeanVolume(_, clusters) => clusters.volume.len(),
        }
    }

    /// Some pieces, each of which counts `weights` times, a positive number.
    pub fn cut(&self, pieces: &[usize], weights: &[f64], seams: Seams) -> Cut {
        let mut corners = Corners::new(seams);
        let (mut cells, mut geometry) = (Vec::new(), Vec::new());
        let (mut origin, mut piece_of) = (Vec::new(), Vec::new());
        for (number, (&piece, &weight)) in (0u32..).zip(pieces.iter().zip(weights)) {
            for cell in self.cells_of(piece) {
                cells.push(self.cells[cell].map(|node| corners.of(number, node)));
                let whole = self.geometry[cell];
                geometry.push(Geometry { volume: weight * whole.volume, ..whole });
                origin.push(cell);
                piece_of.push(number);
            }
        }
        let points = corners.nodes.iter().map(|&node| self.points[node as usize]).collect();
        let material = self.material.of_cells(&origin);
        let partition = |cells: &[[u32; 4]], _: &_| Partition::given(cells, piece_of, pieces.len());
        let body = Body::assemble(self.element, points, cells, geometry, material, partition);
        let (mut nodes, mut first) = (corners.nodes, corners.pieces);
        for &[a, b] in &body.edges {
            nodes.push(self.midpoint(nodes[a as usize], nodes[b as usize]));
            first.push(first[a as usize].max(first[b as usize]));
        }
        Cut { body, nodes, pieces: first }
    }

    fn cells_of(&self, piece: usize) -> Vec<usize> {
        match &*self.assembly {
            Assembly::P1(_) | Assembly::P2(_) => vec![piece],
            Assembly::P1MeanVolume(_, clusters) => {
                clusters.members.of(piece).iter().map(|member| member.cell as usize).collect()
            }
        }
    }

    /// The node in the middle of an edge.
    fn midpoint(&self, a: u32, b: u32) -> u32 {
        let edge = self.edges.binary_search(&[a.min(b), a.max(b)]);
        (self.n_corners() + edge.expect("an edge of one of its cells")) as u32
    }
}

/// The corners of pieces, numbered as they come.
struct Corners {
    seams: Seams,
    number: HashMap<(u32, u32), u32>,
    nodes: Vec<u32>,
    pieces: Vec<u32>,
}

impl Corners {
    fn new(seams: Seams) -> Self {
        Corners { seams, number: HashMap::new(), nodes: Vec::new(), pieces: Vec::new() }
    }

    fn of(&mut self, piece: u32, node: u32) -> u32 {
        let side = if self.seams == Seams::Opened { piece } else { 0 };
        *self.number.entry((side, node)).or_insert_with(|| {
            self.nodes.push(node);
            self.pieces.push(piece);
            self.nodes.len() as u32 - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Element;
    use crate::law::samples::per_cell;
    use crate::mesh::samples::{block, noise};

    /// Bodies of every element whose cells all differ.
    fn bodies() -> impl Iterator<Item = Body> {
        let (mut points, cells) = block([2; 3], [0.03, 0.04, 0.05]);
        let shifts = noise(3 * points.len(), 1);
        for (x, shift) in points.as_flattened_mut().iter_mut().zip(shifts) {
            *x += 1e-3 * shift;
        }
        let law = per_cell("neo_hookean", cells.len());
        Element::ALL.into_iter().map(move |element| {
            Body::with_element(element, points.clone(), cells.clone(), law.clone()).unwrap()
        })
    }

    /// Displacements of the nodes of a cut.
    fn there(cut: &Cut, u: &[f64]) -> Vec<f64> {
        cut.nodes.iter().flat_map(|&node| (0..3).map(move |i| u[3 * node as usize + i])).collect()
    }

    #[test]
    fn all_pieces_together_are_the_body() {
        for body in bodies() {
            let u: Vec<f64> = noise(body.n_dofs(), 2).iter().map(|x| 5e-4 * x).collect();
            let mut whole = vec![0.0; body.n_dofs()];
            let energy = body.internal_force(&u, &mut whole);
            let all: Vec<usize> = (0..body.n_pieces()).collect();
            for seams in [Seams::Kept, Seams::Opened] {
                let cut = body.cut(&all, &vec![1.0; all.len()], seams);
                let mut force = vec![0.0; cut.body.n_dofs()];
                let of_pieces = cut.body.internal_force(&there(&cut, &u), &mut force);
                assert!((of_pieces - energy).abs() < 1e-12 * energy);
                for (dof, f) in force.iter().enumerate() {
                    whole[3 * cut.nodes[dof / 3] as usize + dof % 3] -= f;
                }
                let left = whole.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
                let most = force.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
                assert!(left < 1e-12 * most, "{:?}, {seams:?}: {left} of {most}", body.element());
                body.internal_force(&u, &mut whole);
            }
        }
    }

    #[test]
    fn every_piece_counts_as_often_as_its_weight_says() {
        for body in bodies() {
            let u: Vec<f64> = noise(body.n_dofs(), 3).iter().map(|x| 5e-4 * x).collect();
            let energy = |pieces: &[usize], weights: &[f64], seams| {
                let cut = body.cut(pieces, weights, seams);
                assert_eq!(cut.body.n_pieces(), pieces.len());
                cut.body.energy(&there(&cut, &u))
            };
            let (pieces, weights) = ([5, 0, 2], [3.0, 0.5, 40.0]);
            for seams in [Seams::Kept, Seams::Opened] {
                let together = energy(&pieces, &weights, seams);
                let single = |k: usize| weights[k] * energy(&pieces[k..=k], &[1.0], seams);
                let sum: f64 = (0..3).map(single).sum();
                assert!((together - sum).abs() < 1e-12 * sum, "{:?}, {seams:?}", body.element());
            }
        }
    }

    #[test]
    fn a_node_of_opened_seams_belongs_to_one_piece() {
        for body in bodies() {
            let pieces: Vec<usize> = (0..body.n_pieces()).step_by(2).collect();
            let cut = body.cut(&pieces, &vec![1.0; pieces.len()], Seams::Opened);
            let mut forces = vec![0.0; cut.body.n_dofs()];
            let u: Vec<f64> = noise(body.n_dofs(), 4).iter().map(|x| 5e-4 * x).collect();
            cut.body.internal_force(&there(&cut, &u), &mut forces);
            for (number, &piece) in (0u32..).zip(&pieces) {
                let alone = body.cut(&[piece], &[1.0], Seams::Opened);
                let mut force = vec![0.0; alone.body.n_dofs()];
                alone.body.internal_force(&there(&alone, &u), &mut force);
                let norm = |force: &mut dyn Iterator<Item = f64>| force.map(|f| f * f).sum::<f64>();
                let own = &mut forces
                    .iter()
                    .enumerate()
                    .filter(|(dof, _)| cut.pieces[dof / 3] == number)
                    .map(|(_, f)| *f);
                let (own, alone) = (norm(own), norm(&mut force.iter().copied()));
                assert!((own - alone).abs() < 1e-12 * alone, "{:?}", body.element());
            }
        }
    }
}
