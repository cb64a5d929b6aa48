//! The plan on paper: bytes that the kernels move and operations that they do, counted from their text and from where
//! the blocks of a mesh stand, and what that takes on a device of given bandwidth and speed. No device is asked.

use crate::layout::{Layout, OF_CELL};
use crate::{Error, Solid};

/// Bytes and operations of one run of a kernel over a whole body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// Name of the kernel.
    pub kernel: &'static str,
    /// Bytes read and written, a vector that neighbours share counted once.
    pub bytes: f64,
    /// Additions and multiplications.
    pub operations: f64,
    /// Dispatches.
    pub dispatches: usize,
}

/// A device by its maker's data sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// Name.
    pub name: &'static str,
    /// Bandwidth of its memory [bytes/s].
    pub bandwidth: f64,
    /// Operations in single precision [1/s].
    pub speed: f64,
    /// What is assumed that each dispatch costs beside its work [s].
    pub per_dispatch: f64,
}

/// The work of one body.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of cells.
    pub cells: usize,
    /// Runs of rows with buffers of their own.
    pub chunks: usize,
    /// Places of blocks over blocks: 1 without padding.
    pub padding: f64,
    /// Responses over cells: 1 where no cell stands in two chunks.
    pub repeated: f64,
    /// Once a frame: responses of cells, gathered, and the diagonal inverted; the product that the guess needs, and the
    /// magnitude of rounding.
    pub assembly: [Work; 5],
    /// Once an iteration.
    pub iteration: [Work; 2],
}

impl Plan {
    /// Of a body on a device that binds so many bytes at once.
    ///
    /// # Errors
    /// Those of [`crate::System::new`] that need no device.
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
                // Kinematics 530, ten blocks of 205, forces 72; and the law's own.
                work("respond", of_cell * responses, (2650.0 + of_law) * responses, chunks),
                // Sixteen blocks a cell; starts and sums a place.
                work("gather blocks", 16.0 * 40.0 * m + 40.0 * places, 144.0 * m, chunks),
                work("invert", 84.0 * n, 60.0 * n, chunks),
                work("guess", 40.0 * places + 28.0 * n, 18.0 * places + 6.0 * n, chunks),
                work("magnitude", 40.0 * places + 28.0 * n, 27.0 * places, chunks),
            ],
            iteration: [
                work("product", 40.0 * places + 28.0 * n, 18.0 * places + 6.0 * n, chunks),
                // Read z, w, x, p, r, s and six of the inverse; write x, p, r, s, z.
                work("update", 156.0 * n, 51.0 * n, 1),
            ],
        })
    }

    /// Dispatches of a frame.
    pub fn dispatches(&self, iterations: usize) -> usize {
        let count = |work: &[Work]| work.iter().map(|work| work.dispatches).sum::<usize>();
        count(&self.assembly) + 1 + iterations * count(&self.iteration)
    }

    /// Least time of a frame by the roofline and by its dispatches [s].
    pub fn frame(&self, iterations: usize, sheet: &Sheet) -> f64 {
        let of = |work: &[Work]| work.iter().map(|work| sheet.roofline(work)).sum::<f64>();
        of(&self.assembly)
            + iterations as f64 * of(&self.iteration)
            + self.dispatches(iterations) as f64 * sheet.per_dispatch
    }
}

impl Sheet {
    /// The larger of what memory and arithmetic take [s].
    pub fn roofline(&self, work: &Work) -> f64 {
        (work.bytes / self.bandwidth).max(work.operations / self.speed)
    }
}
