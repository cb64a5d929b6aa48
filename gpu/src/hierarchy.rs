//! Levels of multigrid as the caller hands them over.

use crate::Error;

/// Unknowns of a node of a coarse level.
pub(crate) const MODES: usize = 6;

/// The levels of a cycle, the finest first.
#[derive(Clone, Debug)]
pub struct Hierarchy<'a> {
    /// Levels that are smoothed, at least one.
    pub levels: Vec<Level<'a>>,
    /// The inverse of the matrix of the coarsest level.
    pub coarsest: &'a [f32],
}

/// A level; blocks are row-major.
#[derive(Clone, Copy, Debug)]
pub struct Level<'a> {
    /// Row and column of the blocks of the upper triangle; none on the finest level.
    pub pairs: &'a [[u32; 2]],
    /// Blocks of the matrix, 6x6; none on the finest level.
    pub values: &'a [f32],
    /// Inverses of the diagonal blocks, 6x6; none on the finest level.
    pub inverses: &'a [f32],
    /// Largest eigenvalue of `D^-1 A`, estimated from below.
    pub largest: f64,
    /// Where the blocks of each node start that lead to it from the level below, and the last end.
    pub starts: &'a [u32],
    /// The node below of each block.
    pub columns: &'a [u32],
    /// The blocks, 3x6 on the finest level, 6x6 on others.
    pub blocks: &'a [f32],
}

impl Hierarchy<'_> {
    /// Nodes of every level, the coarsest last.
    pub(crate) fn nodes(&self) -> Vec<usize> {
        let smoothed = self.levels.iter().map(|level| level.starts.len().saturating_sub(1));
        smoothed.chain([self.coarsest.len().isqrt() / MODES]).collect()
    }

    pub(crate) fn check(&self, n_nodes: usize) -> Result<(), Error> {
        let nodes = self.nodes();
        let wrong = |level: usize, what: &str| {
            Err(Error::Input(format!("level {level} of multigrid {what}; give {nodes:?} nodes")))
        };
        let n_last = MODES * nodes[nodes.len() - 1];
        if self.levels.is_empty() || nodes[0] != n_nodes || n_last * n_last != self.coarsest.len() {
            return wrong(0, &format!("does not fit a matrix of {n_nodes} nodes"));
        }
        for (k, level) in self.levels.iter().enumerate() {
            let (n, n_below) = (nodes[k], nodes[k + 1]);
            let rows = if k == 0 { 3 } else { MODES };
            let ascends = level.starts.is_sorted() && level.starts.first() == Some(&0);
            let end = level.starts.last().map_or(0, |&end| end as usize);
            if !ascends || end != level.columns.len() || rows * MODES * end != level.blocks.len() {
                return wrong(k, "has blocks that do not fit its rows");
            }
            if level.columns.iter().any(|&column| column as usize >= n_below) {
                return wrong(k, "leads to a node that is not there");
            }
            let is_inside = |&[row, column]: &[u32; 2]| row <= column && (column as usize) < n;
            let n_inverses = if k == 0 { 0 } else { MODES * MODES * n };
            if !level.pairs.iter().all(is_inside)
                || level.values.len() != MODES * MODES * level.pairs.len()
                || level.inverses.len() != n_inverses
            {
                return wrong(k, "has a matrix that does not fit its rows");
            }
            if !(level.largest > 0.0 && level.largest.is_finite()) {
                return wrong(k, &format!("has the largest eigenvalue {}", level.largest));
            }
        }
        Ok(())
    }
}
