//! A model without what lies inside, or with some of it: half of the bytes, and all that shows.

use super::arrays::{Answers, Arrays};
use super::metadata::Metadata;
use super::model::ReducedModel;
use crate::Error;

impl ReducedModel {
    /// The model whose only nodes are those of the surface and some inside, all of them its `surface_nodes`: it
    /// answers alike, but has no cells, so the full organ cannot be solved. Of a model for a range of a parameter,
    /// that of the value it is set to.
    ///
    /// # Errors
    /// A load position or a patch off the surface; a node inside that the organ does not have.
    pub fn surface_alone(&self, inside: &[u32]) -> Result<ReducedModel, Error> {
        let a = &self.arrays;
        let mut nodes: Vec<u32> = a.surface_nodes.iter().chain(inside).copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        if let Some(node) = nodes.last().filter(|&&node| node as usize >= self.n_points()) {
            return Err(Error::input(format!(
                "node {node} inside; the organ has {} points",
                self.n_points()
            )));
        }
        let row = |node: &u32| match nodes.binary_search(node) {
            Ok(row) => Ok(row as u32),
            Err(_) => Err(Error::ModelFile(format!("node {node} is not among surface_nodes"))),
        };
        let rows = |of: &[u32]| of.iter().map(row).collect::<Result<Vec<u32>, Error>>();
        let points = nodes.iter().flat_map(|&n| &a.points[3 * n as usize..3 * n as usize + 3]);
        // Without cells one row of parameters says it; many rows belong to the cells.
        let is_uniform = a.law_parameters.len() == self.metadata.law_parameter_names.len();
        let arrays = Arrays {
            points: points.copied().collect(),
            preload: Vec::new(),
            cells: Vec::new(),
            fixed: a.fixed.iter().filter_map(|node| row(node).ok()).collect(),
            law_parameters: if is_uniform { a.law_parameters.clone() } else { Vec::new() },
            surface: rows(&a.surface)?,
            surface_nodes: (0..nodes.len() as u32).collect(),
            positions: rows(&a.positions)?,
            surface_modes: self.modes_at(&nodes),
            patch_nodes: rows(&a.patch_nodes)?,
            // What holds the full organ, which is not there any more.
            tie_start: Vec::new(),
            tie_nodes: Vec::new(),
            tie_weights: Vec::new(),
            tie_stiffness: Vec::new(),
            interior_modes: Vec::new(),
            parameter_cells: Vec::new(),
            family: Answers::default(),
            ..a.clone()
        };
        ReducedModel::new(Metadata { parameter: None, ..self.metadata.clone() }, arrays)
    }

    /// The stored modes (M, nodes, 3) at some nodes, ascending.
    pub(super) fn modes_at(&self, nodes: &[u32]) -> Vec<i16> {
        let a = &self.arrays;
        let (surface, interior) = (&a.surface_nodes, &self.interior_nodes);
        let mut modes = Vec::with_capacity(3 * nodes.len() * self.n_modes());
        for mode in 0..self.n_modes() {
            for node in nodes {
                let (all, row) = match surface.binary_search(node) {
                    Ok(row) => (&a.surface_modes, mode * surface.len() + row),
                    Err(_) => {
                        let row = interior.partition_point(|other| other < node);
                        (&a.interior_modes, mode * interior.len() + row)
                    }
                };
                modes.extend(&all[3 * row..3 * row + 3]);
            }
        }
        modes
    }
}
