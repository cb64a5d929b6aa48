//! A model without what lies inside: half of the bytes, and all that shows.

use super::metadata::Metadata;
use super::model::{Answers, Arrays, ReducedModel};
use crate::Error;

impl ReducedModel {
    /// The model of the surface alone, whose only nodes are those of the surface: it answers alike,
    /// but has no cells, so the full organ cannot be solved. Of a model for a range of a parameter,
    /// that of the value it is set to.
    ///
    /// # Errors
    /// A load position or a patch off the surface.
    pub fn surface_alone(&self) -> Result<ReducedModel, Error> {
        let a = &self.arrays;
        let nodes = &a.surface_nodes;
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
            patch_nodes: rows(&a.patch_nodes)?,
            interior_modes: Vec::new(),
            parameter_cells: Vec::new(),
            family: Answers::default(),
            ..a.clone()
        };
        ReducedModel::new(Metadata { parameter: None, ..self.metadata.clone() }, arrays)
    }
}
