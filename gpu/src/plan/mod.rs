//! A performance estimate without a device: bytes and operations of the kernels, counted from their source and from the
//! layout of a mesh, and the least time that they take at a given bandwidth and speed.

mod series;

use crate::layout::{Layout, OF_CELL};
use crate::{Error, Solid};
pub use series::SeriesPlan;

/// Bytes and operations of one pass of a kernel over a whole body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// Name of the kernel.
    pub kernel: &'static str,
    /// Bytes read and written. A vector that neighbours share is counted once.
    pub bytes: f64,
    /// Additions and multiplications.
    pub operations: f64,
    /// Dispatches.
    pub dispatches: usize,
}

/// A device as its data sheet describes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// Name.
    pub name: &'static str,
    /// Bandwidth of its memory [bytes/s].
    pub bandwidth: f64,
    /// Operations in single precision [1/s].
    pub speed: f64,
    /// Assumed overhead of a dispatch [s].
    pub per_dispatch: f64,
}

/// The work of one body.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of cells.
    pub cells: usize,
    /// Number of chunks.
    pub chunks: usize,
    /// Places divided by blocks: 1 without padding.
    pub padding: f64,
    /// Evaluations divided by cells: 1 if no cell is in two chunks.
    pub repeated: f64,
    /// Passes of each frame: evaluation of the cells, summation, inversion of the diagonal, the product for the initial
    /// guess, and the estimate of rounding.
    pub assembly: [Work; 5],
    /// Passes of each iteration, where no means are prescribed.
    pub iteration: [Work; 1],
}

impl Plan {
    /// The estimate for a body on a device with this largest binding [bytes].
    ///
    /// # Errors
    /// As [`crate::System::new`], except faults of the device.
    pub fn new(
        solid: &Solid<'_>,
        pairs: &[(u32, u32)],
        largest_binding: u64,
    ) -> Result<Self, Error> {
        let (nodes, cells) = (solid.points.len(), solid.cells.len());
        let layout = Layout::new(nodes, pairs, solid.cells, &[], largest_binding)?;
        let (places, chunks) = (layout.n_places() as f64, layout.chunks.len());
        let responses = layout.chunks.iter().map(|chunk| chunk.cells.len()).sum::<usize>() as f64;
        let blocks = pairs.iter().map(|(a, b)| if a == b { 1.0 } else { 2.0 }).sum::<f64>();
        let (n, m) = (nodes as f64, cells as f64);
        let parameters = if solid.parameters.len() == 1 { 0 } else { solid.law.n_parameters() };
        let of_law = solid.law.operations(solid.parameters) as f64;
        let work =
            |kernel, bytes, operations, dispatches| Work { kernel, bytes, operations, dispatches };
        let of_cell = (16 + 40 + 48 + 4 * parameters + 4 * OF_CELL) as f64;
        Ok(Plan {
            nodes,
            cells,
            chunks,
            padding: places / blocks,
            repeated: responses / m,
            assembly: [
                // Kinematics 530, ten blocks of 205, forces 72, and the operations of the law.
                work("respond_all", of_cell * responses, (2650.0 + of_law) * responses, chunks),
                // Sixteen blocks per cell; starts and sums per place.
                work("gather_blocks", 16.0 * 40.0 * m + 40.0 * places, 144.0 * m, chunks),
                work("invert", 84.0 * n, 60.0 * n, chunks),
                work("multiply", 40.0 * places + 28.0 * n, 18.0 * places + 6.0 * n, chunks),
                work("measure", 40.0 * places + 28.0 * n, 27.0 * places, chunks),
            ],
            iteration: [
                // Read r, s, w, x, p and six of the inverse; write r, s, w, x, p. Every place computes z anew.
                work("iterate", 40.0 * places + 144.0 * n, 45.0 * places + 60.0 * n, chunks),
            ],
        })
    }

    /// Dispatches of a frame.
    pub fn dispatches(&self, iterations: usize) -> usize {
        let count = |work: &[Work]| work.iter().map(|work| work.dispatches).sum::<usize>();
        // Comparison of the earlier steps, their combination, and the start.
        count(&self.assembly) + 2 + self.chunks + iterations * count(&self.iteration)
    }

    /// Lower bound of the time of a frame: roofline plus dispatches [s].
    pub fn frame(&self, iterations: usize, sheet: &Sheet) -> f64 {
        let of = |work: &[Work]| work.iter().map(|work| sheet.roofline(work)).sum::<f64>();
        of(&self.assembly)
            + iterations as f64 * of(&self.iteration)
            + self.dispatches(iterations) as f64 * sheet.per_dispatch
    }
}

impl Sheet {
    /// Roofline: the larger of the times of memory and of arithmetic [s].
    pub fn roofline(&self, work: &Work) -> f64 {
        (work.bytes / self.bandwidth).max(work.operations / self.speed)
    }
}
