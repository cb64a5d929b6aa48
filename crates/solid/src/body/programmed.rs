//! What a device needs to form the tangent of a body by itself: the law as a program, and which cells share their
//! volume ratio.

use super::{Body, averaged_part};
use crate::element::Element;
use crate::law::{Model, Program};

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

/// A body whose force a device expands in series.
pub struct ProgrammedSeries<'a> {
    /// Its cells.
    pub cells: ProgrammedCells<'a>,
    /// `s U` as a function of the volume ratio that clusters share, see [`Material::dilatation_program`].
    ///
    /// [`Material::dilatation_program`]: crate::law::Material::dilatation_program
    pub dilatation: Option<Program>,
    /// Displacement of the base state [m].
    pub base: &'a [f64],
}

impl Body {
    /// The body as a device takes it.
    ///
    /// # Errors
    /// Why it has no such form.
    pub fn programmed(&self) -> Result<ProgrammedCells<'_>, String> {
        let parts = self.averaged_parts()?;
        let program = self.material.program(&parts).map_err(of_law)?;
        let clusters = self.integrals.cluster_nodes();
        Ok(ProgrammedCells { points: &self.points, cells: &self.cells, program, clusters })
    }

    /// The body as a device takes it that expands its force in series about a displacement.
    ///
    /// # Errors
    /// Why it has no such form.
    pub fn programmed_series<'a>(
        &'a self,
        base: &'a [f64],
    ) -> Result<ProgrammedSeries<'a>, String> {
        let cells = self.programmed()?;
        if cells.program.model != Model::Energy {
            return Err("the law is no function of invariants".to_string());
        }
        let parts = self.averaged_parts()?;
        let dilatation = (!parts.is_empty()).then(|| self.material.dilatation_program(&parts));
        Ok(ProgrammedSeries { cells, dilatation: dilatation.transpose().map_err(of_law)?, base })
    }

    /// The part of the energy of dilatation that clusters have, by row; none where cells are on their own.
    fn averaged_parts(&self) -> Result<Vec<f64>, String> {
        match self.element {
            Element::P1 => Ok(Vec::new()),
            Element::P1MeanVolume => {
                let rows = 0..self.material.parameters().len();
                Ok(rows.map(|row| averaged_part(&self.material, row)).collect())
            }
            Element::P2 => Err(format!("the element is {:?}", self.element.name())),
        }
    }
}

fn of_law(why: &str) -> String {
    format!("the law {why}")
}
