//! What a device needs to form the tangent of a body by itself: the law as a program, and which cells share their
//! volume ratio.

use super::{Body, averaged_part};
use crate::element::Element;
use crate::law::Program;

/// A body of linear tetrahedra as points, cells and a program.
pub struct ProgrammedCells<'a> {
    /// Points at rest [m].
    pub points: &'a [[f64; 3]],
    /// Corners of the cells, positively oriented.
    pub cells: &'a [[u32; 4]],
    /// The law of a cell without what its cluster adds.
    pub program: Program,
    /// Cells that share their volume ratio, if any do.
    pub clusters: Option<ClusterNodes>,
}

/// The clusters of cells.
pub struct ClusterNodes {
    /// The cluster of each cell.
    pub of: Vec<u32>,
    /// Where the nodes of each cluster start, and the last end.
    pub starts: Vec<u32>,
    /// Nodes of the clusters, ascending within each.
    pub nodes: Vec<u32>,
}

impl Body {
    /// The body as a device takes it.
    ///
    /// # Errors
    /// Why it has no such form.
    pub fn programmed(&self) -> Result<ProgrammedCells<'_>, String> {
        let parts = match self.element {
            Element::P1 => Vec::new(),
            Element::P1MeanVolume => {
                let rows = 0..self.material.parameters().len();
                rows.map(|row| averaged_part(&self.material, row)).collect()
            }
            Element::P2 => return Err(format!("the element is {:?}", self.element.name())),
        };
        let program = self.material.program(&parts).map_err(|why| format!("the law {why}"))?;
        let clusters = self.integrals.cluster_nodes();
        Ok(ProgrammedCells { points: &self.points, cells: &self.cells, program, clusters })
    }
}
