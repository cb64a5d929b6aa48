//! What another machine needs to run a cycle with a smoother of its own: the levels in single precision.

use super::prolongation::{MODES, Prolongation};
use super::{Coarsest, Level, Multigrid};
use crate::{FactorError, Factorization};

/// Unknowns of a coarsest level up to which the inverse of its matrix is small enough to be multiplied with.
const MOST_COARSEST: usize = 2048;

/// The levels of a cycle, the finest first, and what solves the last one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hierarchy {
    /// Levels that are smoothed.
    pub levels: Vec<HierarchyLevel>,
    /// The inverse of the matrix of the coarsest level, row by row.
    pub coarsest: Vec<f32>,
}

/// A level that is smoothed. Blocks are row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HierarchyLevel {
    /// Row and column of each block of the matrix's upper triangle; none on the finest level, whose matrix the other
    /// machine has.
    pub pairs: Vec<(u32, u32)>,
    /// Blocks of the matrix, 6x6.
    pub values: Vec<f32>,
    /// Inverses of the diagonal blocks, 6x6, zero where a row has no unknown; none on the finest level.
    pub inverses: Vec<f32>,
    /// Largest eigenvalue of `D⁻¹ A`, estimated from below.
    pub largest: f64,
    /// Where the blocks of each node start that lead to it from the level below, and the last end.
    pub starts: Vec<u32>,
    /// The node below of each block.
    pub columns: Vec<u32>,
    /// The blocks, 3x6 on the finest level, 6x6 on others.
    pub blocks: Vec<f32>,
}

impl Multigrid {
    /// The cycle of the matrix that was taken over last; none where the coarsest level is too large for the inverse of
    /// its matrix.
    ///
    /// # Errors
    /// No matrix was taken over.
    pub fn hierarchy(&self) -> Result<Option<Hierarchy>, FactorError> {
        let Some(coarsest) = self.coarsest.inverse()? else { return Ok(None) };
        let finest = HierarchyLevel {
            largest: self.finest.largest,
            ..self.finest.prolongation.exported(HierarchyLevel::default())
        };
        let coarse = self.coarse.iter().map(Level::exported);
        Ok(Some(Hierarchy { levels: [finest].into_iter().chain(coarse).collect(), coarsest }))
    }
}

impl Level<6, 8> {
    fn exported(&self) -> HierarchyLevel {
        let Level { smoother, prolongation, largest, .. } = self;
        prolongation.exported(HierarchyLevel {
            pairs: smoother.pattern.pairs().collect(),
            values: smoother.values().collect(),
            inverses: smoother.inverses().collect(),
            largest: *largest,
            ..HierarchyLevel::default()
        })
    }
}

impl<const B: usize> Prolongation<B> {
    fn exported(&self, level: HierarchyLevel) -> HierarchyLevel {
        let (starts, columns, blocks) = self.parts();
        HierarchyLevel {
            starts: starts.to_vec(),
            columns: columns.to_vec(),
            blocks: blocks.iter().flatten().flat_map(|row| &row[..MODES]).copied().collect(),
            ..level
        }
    }
}

impl Coarsest {
    fn inverse(&self) -> Result<Option<Vec<f32>>, FactorError> {
        let n = self.pattern.n;
        if n > MOST_COARSEST {
            return Ok(None);
        }
        let mut columns = vec![0.0; n * n];
        (0..n).for_each(|k| columns[n * k + k] = 1.0);
        self.factor.solve(&mut columns, n)?;
        Ok(Some(columns.into_iter().map(|entry| entry as f32).collect()))
    }
}
