//! What conjugate gradients have on the device: kernels, vectors, and the matrix in chunks.

use crate::Error;
use crate::conjugate_gradients::Recurrence;
use crate::device::{Gpu, THREADS};
use crate::layout::Chunk;
use wgpu::{BindGroup, Buffer, ComputePipeline};

/// Partial sums of a scalar product, over all chunks.
pub(crate) const MOST_PARTS: usize = 1024;

/// The kernels of conjugate gradients.
pub(crate) struct Kernels {
    pub product: ComputePipeline,
    pub magnitude: ComputePipeline,
    pub update: ComputePipeline,
    pub begin: ComputePipeline,
    pub invert: ComputePipeline,
    pub prepare: ComputePipeline,
    pub project: ComputePipeline,
}

impl Kernels {
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        let sum = include_str!("kernels/sum.wgsl");
        let with_sums = |source: &str| format!("{sum}\n{source}");
        let product = with_sums(include_str!("kernels/product.wgsl"));
        let update = with_sums(include_str!("kernels/update.wgsl"));
        let border = with_sums(include_str!("kernels/border.wgsl"));
        Ok(Kernels {
            product: gpu.kernel(&product, "multiply")?,
            magnitude: gpu.kernel(include_str!("kernels/magnitude.wgsl"), "measure")?,
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
    pub xp: Buffer,
    pub rs: Buffer,
    pub z: Buffer,
    pub w: Buffer,
    pub inverse: Buffer,
    pub held: Buffer,
    pub sums: Buffer,
    pub state: Buffer,
}

impl Vectors {
    pub fn new(gpu: &Gpu, n_nodes: usize) -> Result<Self, Error> {
        Ok(Vectors {
            xp: gpu.zeros::<f32>("solution and direction", 6 * n_nodes)?,
            rs: gpu.zeros::<f32>("residual and its change", 6 * n_nodes)?,
            z: gpu.zeros::<f32>("preconditioned residual", 3 * n_nodes)?,
            w: gpu.zeros::<f32>("product", 3 * n_nodes)?,
            inverse: gpu.zeros::<f32>("preconditioner", 6 * n_nodes)?,
            held: gpu.zeros::<u32>("what is held", n_nodes)?,
            sums: gpu.zeros::<f32>("partial sums", 5 * MOST_PARTS + 4)?,
            state: gpu.zeros::<Recurrence>("state", 2)?,
        })
    }
}

/// Buffers of a chunk.
pub(crate) struct ChunkBuffers {
    pub values: Buffer,
    pub product: BindGroup,
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
        let (first, n_rows) = (chunk.rows.start as u32, chunk.rows.len() as u32);
        let size = gpu.uniform([first, n_rows, first_part, THREADS]);
        let of_inverse = gpu.uniform([first, n_rows, 0, 0]);
        let product =
            gpu.bind(&kernels.product, &[&values, &columns, &starts, held, z, w, sums, &size]);
        let magnitude =
            gpu.bind(&kernels.magnitude, &[&values, &columns, &starts, held, z, w, &size]);
        let inverse = gpu.bind(&kernels.invert, &[&values, &diagonal, held, inverse, &of_inverse]);
        Ok(ChunkBuffers { values, product, magnitude, n_groups, inverse, of_inverse })
    }
}
