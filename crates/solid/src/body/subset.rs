//! Sampling units of a body as a separate body, for energies that are summed over some units with weights.
//!
//! A unit is the smallest part with an energy of its own: a cell, or a cluster of cells that share their change of
//! volume.

use super::Body;
use super::partition::Partition;
use super::ties::Ties;
use crate::element::Geometry;
use std::collections::HashMap;

/// Some units of a body.
pub struct WeightedSubset {
    /// Their energy is that of the units in the whole, times their weights.
    pub body: Body,
    /// By node of this body: the node of the whole.
    pub nodes: Vec<u32>,
    /// By node of this body: the first unit that has it, in the order they were asked for.
    pub units: Vec<u32>,
}

/// How nodes of several units are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SharedNodes {
    /// The units share them.
    Merged,
    /// Every unit has its own, so that the force on a node is that of one unit.
    Duplicated,
}

impl Body {
    /// Number of units.
    pub fn n_sampling_units(&self) -> usize {
        self.integrals.n_units()
    }

    /// Some units with their weights, which are positive.
    pub fn subset(&self, units: &[usize], weights: &[f64], shared: SharedNodes) -> WeightedSubset {
        let mut corners = Corners::new(shared);
        let (mut cells, mut geometry) = (Vec::new(), Vec::new());
        let (mut origin, mut unit_of) = (Vec::new(), Vec::new());
        for (number, (&unit, &weight)) in (0u32..).zip(units.iter().zip(weights)) {
            for cell in self.integrals.cells_of(unit) {
                cells.push(self.cells[cell].map(|node| corners.of(number, node)));
                let whole = self.geometry[cell];
                geometry.push(Geometry { volume: weight * whole.volume, ..whole });
                origin.push(cell);
                unit_of.push(number);
            }
        }
        let points = corners.nodes.iter().map(|&node| self.points[node as usize]).collect();
        // Ties belong to no unit.
        let parts = (self.material.of_cells(&origin), Ties::default());
        let partition = |cells: &[[u32; 4]], _: &_| Partition::given(cells, unit_of, units.len());
        let body = Body::assemble(self.element, points, cells, geometry, parts, partition);
        let (mut nodes, mut first) = (corners.nodes, corners.units);
        for &[a, b] in &body.edges {
            nodes.push(self.midpoint(nodes[a as usize], nodes[b as usize]));
            first.push(first[a as usize].max(first[b as usize]));
        }
        WeightedSubset { body, nodes, units: first }
    }

    /// The node in the middle of an edge.
    fn midpoint(&self, a: u32, b: u32) -> u32 {
        let edge = self.edges.binary_search(&[a.min(b), a.max(b)]);
        (self.n_corners() + edge.expect("an edge of one of its cells")) as u32
    }
}

/// The corners of units, numbered as they come.
struct Corners {
    shared: SharedNodes,
    number: HashMap<(u32, u32), u32>,
    nodes: Vec<u32>,
    units: Vec<u32>,
}

impl Corners {
    fn new(shared: SharedNodes) -> Self {
        Corners { shared, number: HashMap::new(), nodes: Vec::new(), units: Vec::new() }
    }

    fn of(&mut self, unit: u32, node: u32) -> u32 {
        let side = if self.shared == SharedNodes::Duplicated { unit } else { 0 };
        *self.number.entry((side, node)).or_insert_with(|| {
            self.nodes.push(node);
            self.units.push(unit);
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

    /// Displacements of the nodes of a subset.
    fn there(subset: &WeightedSubset, u: &[f64]) -> Vec<f64> {
        subset
            .nodes
            .iter()
            .flat_map(|&node| (0..3).map(move |i| u[3 * node as usize + i]))
            .collect()
    }

    #[test]
    fn all_units_together_are_the_body() {
        for body in bodies() {
            let u: Vec<f64> = noise(body.n_dofs(), 2).iter().map(|x| 5e-4 * x).collect();
            let mut whole = vec![0.0; body.n_dofs()];
            let energy = body.internal_force(&u, &mut whole);
            let all: Vec<usize> = (0..body.n_sampling_units()).collect();
            for shared in [SharedNodes::Merged, SharedNodes::Duplicated] {
                let subset = body.subset(&all, &vec![1.0; all.len()], shared);
                let mut force = vec![0.0; subset.body.n_dofs()];
                let of_units = subset.body.internal_force(&there(&subset, &u), &mut force);
                assert!((of_units - energy).abs() < 1e-12 * energy);
                for (dof, f) in force.iter().enumerate() {
                    whole[3 * subset.nodes[dof / 3] as usize + dof % 3] -= f;
                }
                let left = whole.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
                let most = force.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
                assert!(left < 1e-12 * most, "{:?}, {shared:?}: {left} of {most}", body.element());
                body.internal_force(&u, &mut whole);
            }
        }
    }

    #[test]
    fn every_unit_counts_as_often_as_its_weight_says() {
        for body in bodies() {
            let u: Vec<f64> = noise(body.n_dofs(), 3).iter().map(|x| 5e-4 * x).collect();
            let energy = |units: &[usize], weights: &[f64], shared| {
                let subset = body.subset(units, weights, shared);
                assert_eq!(subset.body.n_sampling_units(), units.len());
                subset.body.energy(&there(&subset, &u))
            };
            let (units, weights) = ([5, 0, 2], [3.0, 0.5, 40.0]);
            for shared in [SharedNodes::Merged, SharedNodes::Duplicated] {
                let together = energy(&units, &weights, shared);
                let single = |k: usize| weights[k] * energy(&units[k..=k], &[1.0], shared);
                let sum: f64 = (0..3).map(single).sum();
                assert!((together - sum).abs() < 1e-12 * sum, "{:?}, {shared:?}", body.element());
            }
        }
    }

    #[test]
    fn a_duplicated_node_belongs_to_one_unit() {
        for body in bodies() {
            let units: Vec<usize> = (0..body.n_sampling_units()).step_by(2).collect();
            let subset = body.subset(&units, &vec![1.0; units.len()], SharedNodes::Duplicated);
            let mut forces = vec![0.0; subset.body.n_dofs()];
            let u: Vec<f64> = noise(body.n_dofs(), 4).iter().map(|x| 5e-4 * x).collect();
            subset.body.internal_force(&there(&subset, &u), &mut forces);
            for (number, &unit) in (0u32..).zip(&units) {
                let alone = body.subset(&[unit], &[1.0], SharedNodes::Duplicated);
                let mut force = vec![0.0; alone.body.n_dofs()];
                alone.body.internal_force(&there(&alone, &u), &mut force);
                let norm = |force: &mut dyn Iterator<Item = f64>| force.map(|f| f * f).sum::<f64>();
                let own = &mut forces
                    .iter()
                    .enumerate()
                    .filter(|(dof, _)| subset.units[dof / 3] == number)
                    .map(|(_, f)| *f);
                let (own, alone) = (norm(own), norm(&mut force.iter().copied()));
                assert!((own - alone).abs() < 1e-12 * alone, "{:?}", body.element());
            }
        }
    }
}
