//! What conjugate gradients have on the device: kernels, vectors, and the matrix in chunks.

use crate::Error;
use crate::commands::Kernel;
use crate::conjugate_gradients::Recurrence;
use crate::device::Gpu;
use crate::layout::Chunk;
use wgpu::{BindGroup, Buffer};

/// Partial sums of a scalar product, over all chunks.
pub(crate) const MOST_PARTS: usize = 1024;

/// The kernels of conjugate gradients.
pub(crate) struct Kernels {
    pub product: Kernel,
    pub magnitude: Kernel,
    pub update: Kernel,
    pub begin: Kernel,
    pub invert: Kernel,
    pub prepare: Kernel,
    pub project: Kernel,
}

impl Kernels {
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        let (sum, state) = (include_str!("kernels/sum.wgsl"), include_str!("kernels/state.wgsl"));
        let with_sums = |source: &str| [sum, state, source].join("\n");
        let product = with_sums(include_str!("kernels/product.wgsl"));
        let magnitude = with_sums(include_str!("kernels/magnitude.wgsl"));
        let update = with_sums(include_str!("kernels/update.wgsl"));
        let border = with_sums(include_str!("kernels/border.wgsl"));
        Ok(Kernels {
            product: gpu.kernel(&product, "multiply")?,
            magnitude: gpu.kernel(&magnitude, "measure")?,
            update: gpu.kernel(&update, "update")?,
            begin: gpu.kernel(&update, "begin")?,
            invert: gpu.kernel(include_str!("kernels/invert.wgsl"), "invert")?,
            prepare: gpu.kernel(&border, "prepare")?,
            project: gpu.kernel(&border, "project")?,
        })
    }
}

/// The vectors of a solve.
pub(crate) struct Vectors {
    /// The solution; then the direction.
    pub xp: Buffer,
    /// What the solution is added to.
    pub start: Buffer,
    pub rs: Buffer,
    pub z: Buffer,
    pub w: Buffer,
    pub inverse: Buffer,
    pub held: Buffer,
    pub sums: Buffer,
    pub magnitudes: Buffer,
    pub state: Buffer,
    /// The state of an iteration that has not ended.
    pub running: Buffer,
}

impl Vectors {
    pub fn new(gpu: &Gpu, n_nodes: usize) -> Result<Self, Error> {
        Ok(Vectors {
            xp: gpu.zeros::<f32>("solution and direction", 6 * n_nodes)?,
            start: gpu.zeros::<f32>("what the solution is added to", 3 * n_nodes)?,
            rs: gpu.zeros::<f32>("residual and its change", 6 * n_nodes)?,
            z: gpu.zeros::<f32>("preconditioned residual", 3 * n_nodes)?,
            w: gpu.zeros::<f32>("product", 3 * n_nodes)?,
            inverse: gpu.zeros::<f32>("preconditioner", 6 * n_nodes)?,
            held: gpu.zeros::<u32>("what is held", n_nodes)?,
            sums: gpu.zeros::<f32>("partial sums", 5 * MOST_PARTS + 4)?,
            magnitudes: gpu.zeros::<f32>("partial sums of the magnitude", MOST_PARTS)?,
            state: gpu.zeros::<Recurrence>("state", 2)?,
            running: gpu.zeros::<Recurrence>("state", 2)?,
        })
    }
}

/// Buffers of a chunk.
pub(crate) struct ChunkBuffers {
    pub values: Buffer,
    /// In even and odd iterations, and alone.
    pub product: [BindGroup; 3],
    pub magnitude: BindGroup,
    pub n_groups: u32,
    pub inverse: BindGroup,
    pub of_inverse: Buffer,
}

impl ChunkBuffers {
    pub fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        vectors: &Vectors,
        chunk: &Chunk,
        first_part: u32,
        n_groups: u32,
    ) -> Result<Self, Error> {
        let values = gpu.zeros::<f32>("blocks", 9 * chunk.columns.len())?;
        let columns = gpu.buffer("columns", &chunk.columns)?;
        let starts = gpu.buffer("slices", &chunk.starts)?;
        let diagonal = gpu.buffer("diagonal", &chunk.diagonal)?;
        let Vectors { z, w, held, sums, inverse, .. } = vectors;
        let Vectors { xp, start, magnitudes, state, running, .. } = vectors;
        let (first, n_rows) = (chunk.rows.start as u32, chunk.rows.len() as u32);
        let size = |parity| gpu.uniform([first, n_rows, first_part, parity]);
        let of_inverse = gpu.uniform([first, n_rows, 0, 0]);
        let product = [(0, state), (1, state), (0, running)].map(|(parity, state)| {
            let bound = [&values, &columns, &starts, held, z, w, sums, &size(parity), state];
            gpu.bind(&kernels.product, &bound)
        });
        let bound = [&values, &columns, &starts, held, xp, start, magnitudes, &size(0), state];
        let magnitude = gpu.bind(&kernels.magnitude, &bound);
        let inverse = gpu.bind(&kernels.invert, &[&values, &diagonal, held, inverse, &of_inverse]);
        Ok(ChunkBuffers { values, product, magnitude, n_groups, inverse, of_inverse })
    }
}
