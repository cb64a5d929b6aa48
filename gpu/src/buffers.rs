//! What conjugate gradients have on the device: kernels, vectors, and the matrix in chunks.

use crate::Error;
use crate::conjugate_gradients::Recurrence;
use crate::device::Gpu;
use crate::driver::{Buffer, Group, Kernel};
use crate::layout::Chunk;

/// Partial sums of a scalar product, over all chunks.
pub(crate) const MOST_PARTS: usize = 1024;

/// Earlier steps that a solve may set out from.
pub(crate) const MOST_STEPS: usize = 3;

/// The kernels of conjugate gradients.
pub(crate) struct Kernels {
    pub product: Kernel,
    pub magnitude: Kernel,
    /// An iteration where no means are prescribed; otherwise it is a product, an update and a projection.
    pub compare: Kernel,
    pub set_out: Kernel,
    pub start: Kernel,
    pub iterate: Kernel,
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
        let setting_out = with_sums(include_str!("kernels/setting_out.wgsl"));
        let iterate = with_sums(include_str!("kernels/iterate.wgsl"));
        Ok(Kernels {
            product: gpu.kernel(&product, "multiply")?,
            magnitude: gpu.kernel(&magnitude, "measure")?,
            compare: gpu.kernel(&setting_out, "compare_steps")?,
            set_out: gpu.kernel(&setting_out, "set_out")?,
            start: gpu.kernel(&iterate, "start")?,
            iterate: gpu.kernel(&iterate, "iterate")?,
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
    /// The right-hand side, earlier steps and their products, where no means are prescribed.
    pub b: Buffer,
    pub steps: Buffer,
    pub products: Buffer,
    /// Residual, its change and the product after even and after odd iterations.
    pub iterates: [Buffer; 2],
    /// Of iterations with means.
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
        let iterate = || gpu.zeros::<f32>("residual, its change and product", 9 * n_nodes);
        Ok(Vectors {
            xp: gpu.zeros::<f32>("solution and direction", 6 * n_nodes)?,
            start: gpu.zeros::<f32>("what the solution is added to", 3 * n_nodes)?,
            b: gpu.zeros::<f32>("right-hand side", 3 * n_nodes)?,
            steps: gpu.zeros::<f32>("earlier steps", 3 * MOST_STEPS * n_nodes)?,
            products: gpu.zeros::<f32>("products of earlier steps", 3 * MOST_STEPS * n_nodes)?,
            iterates: [iterate()?, iterate()?],
            rs: gpu.zeros::<f32>("residual and its change", 6 * n_nodes)?,
            z: gpu.zeros::<f32>("preconditioned residual", 3 * n_nodes)?,
            w: gpu.zeros::<f32>("product", 3 * n_nodes)?,
            inverse: gpu.zeros::<f32>("preconditioner", 6 * n_nodes)?,
            held: gpu.zeros::<u32>("what is held", n_nodes)?,
            sums: gpu.zeros::<f32>("partial sums", 9 * MOST_PARTS)?,
            magnitudes: gpu.zeros::<f32>("partial sums of the magnitude", MOST_PARTS)?,
            state: gpu.zeros::<Recurrence>("state", 2)?,
            running: gpu.zeros::<Recurrence>("state", 2)?,
        })
    }
}

/// Where the partial sums of a chunk are among those of all.
#[derive(Clone, Copy)]
pub(crate) struct Parts {
    pub first: u32,
    /// One for each workgroup of the chunk.
    pub own: u32,
    pub all: u32,
}

/// Buffers of a chunk.
pub(crate) struct ChunkBuffers {
    pub values: Buffer,
    pub start: Group,
    /// Of even and odd iterations.
    pub iterate: [Group; 2],
    /// In even and odd iterations with means, and alone.
    pub product: [Group; 3],
    /// Of earlier steps.
    pub step_product: [Group; MOST_STEPS],
    pub magnitude: Group,
    pub n_groups: u32,
    pub inverse: Group,
    pub of_inverse: Buffer,
}

impl ChunkBuffers {
    pub fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        vectors: &Vectors,
        (chunk, n_nodes): (&Chunk, usize),
        parts: Parts,
    ) -> Result<Self, Error> {
        let values = gpu.zeros::<f32>("blocks", 9 * chunk.columns.len())?;
        let pattern = [&chunk.starts[..], &chunk.columns].concat();
        let pattern = gpu.buffer("slices and columns", &pattern)?;
        let diagonal = gpu.buffer("diagonal", &chunk.diagonal)?;
        let Vectors { xp, start, steps, products, iterates, z, w, held, sums, .. } = vectors;
        let Vectors { inverse, magnitudes, state, running, .. } = vectors;
        let (first, n_rows) = (chunk.rows.start as u32, chunk.rows.len() as u32);
        let n_slices = chunk.starts.len() as u32 - 1;
        let of_chunk = [first, n_rows, n_slices, n_slices + 1];
        let size =
            |parity, origin| gpu.uniform(&[&of_chunk[..], &[parts.first, parity, origin]].concat());
        let product = [(0, state), (1, state), (0, running)].map(|(parity, state)| {
            let bound = [&values, &pattern, inverse, z, w, sums, state, &size(parity, 0)];
            gpu.bind(&kernels.product, &bound)
        });
        let step_product = std::array::from_fn(|which| {
            let size = size(0, (3 * which * n_nodes) as u32);
            let bound = [&values, &pattern, inverse, steps, products, sums, running, &size];
            gpu.bind(&kernels.product, &bound)
        });
        let bind = |kernel, parity: u32| {
            let of_parts = [parts.all, parts.first, parity];
            let size = gpu.uniform(&[&[n_nodes as u32], &of_chunk[..], &of_parts].concat());
            let [after, before] = if parity == 0 { [0, 1] } else { [1, 0] };
            let (before, after) = (&iterates[before], &iterates[after]);
            let bound = [&values, &pattern, inverse, before, after, xp, sums, state, &size];
            gpu.bind(kernel, &bound)
        };
        // An odd iteration comes before an even one.
        let first_iterate = bind(&kernels.start, 1);
        let iterate = [0, 1].map(|parity| bind(&kernels.iterate, parity));
        let bound = [&values, &pattern, inverse, xp, start, magnitudes, state, &size(0, 0)];
        let magnitude = gpu.bind(&kernels.magnitude, &bound);
        let of_inverse = gpu.uniform(&[first, n_rows, 0]);
        let inverse = gpu.bind(&kernels.invert, &[&values, &diagonal, held, inverse, &of_inverse]);
        let n_groups = parts.own;
        Ok(ChunkBuffers {
            values,
            start: first_iterate,
            iterate,
            product,
            step_product,
            magnitude,
            n_groups,
            inverse,
            of_inverse,
        })
    }
}
