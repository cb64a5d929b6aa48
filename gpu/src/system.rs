//! Linear systems on the device: a symmetric matrix of 3x3 blocks with constraints, solved by conjugate gradients with
//! the inverse diagonal blocks as preconditioner. All scalars stay on the device, which is asked only every few
//! iterations whether it has finished.

use crate::Error;
use crate::border::{Border, Mean};
use crate::buffers::{ChunkBuffers, Kernels, MOST_PARTS, Parts, Vectors};
use crate::commands::{Commands, workgroups};
use crate::device::Gpu;
use crate::driver::{Buffer, Group};
use crate::layout::{Chunk, Layout, PADDING};
use crate::solve::Pace;
use std::sync::Arc;

/// A matrix on the device, with the buffers and kernels that solve with it.
pub struct System {
    gpu: Arc<Gpu>,
    pub(crate) layout: Layout,
    pub(crate) chunks: Vec<ChunkBuffers>,
    pub(crate) kernels: Kernels,
    pub(crate) vectors: Vectors,
    /// Of even and odd iterations.
    pub(crate) update: [Group; 2],
    pub(crate) begin: Group,
    /// Number of nodes, of earlier steps and of their partial sums.
    pub(crate) of_steps: Buffer,
    /// The comparison of earlier steps, and the combination.
    pub(crate) setting_out: [Group; 2],
    pub(crate) n_update: u32,
    pub(crate) border: Option<Border>,
    /// Partial sums of products.
    pub(crate) n_product: u32,
    /// The shift of the last preparation.
    shift: Option<f64>,
    pub(crate) pace: Pace,
    /// Whether what the last solution was added to is not zero.
    pub(crate) has_start: bool,
    /// Scale of the last right-hand side.
    pub(crate) scale: f64,
    pub(crate) is_held: Vec<bool>,
}

impl System {
    /// A system whose upper triangle has blocks at `pairs` of row and column, row <= column, with the diagonal. Values
    /// will come in the same order.
    ///
    /// # Errors
    /// An invalid pattern; too little memory; a fault of the driver.
    pub fn new(gpu: &Arc<Gpu>, n_nodes: usize, pairs: &[(u32, u32)]) -> Result<Self, Error> {
        Self::with_cells(gpu, n_nodes, pairs, (&[], &[]))
    }

    /// The same, with chunks small enough for the responses of `cells` and the `products` of clusters.
    pub(crate) fn with_cells(
        gpu: &Arc<Gpu>,
        n_nodes: usize,
        pairs: &[(u32, u32)],
        (cells, products): (&[[u32; 4]], &[u32]),
    ) -> Result<Self, Error> {
        let layout = Layout::new(n_nodes, pairs, cells, products, gpu.largest_binding())?;
        let kernels = Kernels::new(gpu)?;
        let vectors = Vectors::new(gpu, n_nodes)?;
        let most = (MOST_PARTS / layout.chunks.len().max(1)).max(1);
        let groups = |chunk: &Chunk| (chunk.starts.len() - 1).clamp(1, most) as u32;
        let n_product = layout.chunks.iter().map(groups).sum();
        let (mut chunks, mut first) = (Vec::new(), 0);
        for chunk in &layout.chunks {
            let parts = Parts { first, own: groups(chunk), all: n_product };
            chunks.push(ChunkBuffers::new(gpu, &kernels, &vectors, (chunk, n_nodes), parts)?);
            first += parts.own;
        }
        let n_update = workgroups(n_nodes, MOST_PARTS);
        let size = |parity| gpu.uniform(&[n_nodes as u32, parity, n_product, n_update]);
        let bind = |kernel, parity| {
            let Vectors { xp, rs, z, w, inverse, sums, state, .. } = &vectors;
            gpu.bind(kernel, &[xp, rs, z, w, inverse, sums, state, &size(parity)])
        };
        let update = [bind(&kernels.update, 0), bind(&kernels.update, 1)];
        let begin = bind(&kernels.begin, 0);
        let of_steps = gpu.uniform(&[n_nodes as u32, 0, n_update, 0]);
        let setting_out = {
            let Vectors { steps, products, b, sums, xp, iterates, .. } = &vectors;
            let of_both = [(0, steps), (1, products), (2, b), (3, sums), (6, &of_steps)];
            let of_results = [(4, xp), (5, &iterates[0])];
            [
                gpu.bind_at(&kernels.compare, &of_both),
                gpu.bind_at(&kernels.set_out, &[&of_both[..], &of_results].concat()),
            ]
        };
        gpu.check()?;
        Ok(System {
            gpu: gpu.clone(),
            layout,
            chunks,
            kernels,
            vectors,
            update,
            begin,
            of_steps,
            setting_out,
            n_update,
            border: None,
            n_product,
            shift: None,
            pace: Pace::default(),
            has_start: false,
            scale: 1.0,
            is_held: vec![false; 3 * n_nodes],
        })
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Number of degrees of freedom.
    pub fn n_dofs(&self) -> usize {
        self.is_held.len()
    }

    /// Bytes of the matrix that a product reads: values and columns, with padding.
    pub fn matrix_bytes(&self) -> usize {
        40 * self.layout.n_places()
    }

    /// Number of chunks.
    pub fn n_chunks(&self) -> usize {
        self.chunks.len()
    }

    /// Sets the held degrees of freedom and the prescribed means, from the next [`System::load`] on.
    ///
    /// # Errors
    /// A wrong length; more than [`MOST_MEANS`] means; a mean whose degrees of freedom are all held.
    pub fn hold(&mut self, is_held: &[bool], means: &[Mean]) -> Result<(), Error> {
        if is_held.len() != self.n_dofs() {
            return Err(Error::Input(format!(
                "{} flags of what is held for {} degrees of freedom",
                is_held.len(),
                self.n_dofs()
            )));
        }
        self.is_held.copy_from_slice(is_held);
        let mut masks = vec![0u32; self.layout.n_rows()];
        for (node, &row) in self.layout.row_of.iter().enumerate() {
            masks[row as usize] = (0..3).map(|i| u32::from(is_held[3 * node + i]) << i).sum();
        }
        self.gpu.write(&self.vectors.held, &masks);
        let on = (&*self.gpu, &self.kernels, &self.vectors);
        let border = |means| Border::new(on, &self.layout.row_of, &self.is_held, means);
        self.border = (!means.is_empty()).then(|| border(means)).transpose()?;
        self.gpu.check()
    }

    /// Loads nine values for each block of the upper triangle, row-major, and adds `shift` to the diagonal.
    ///
    /// # Errors
    /// A wrong number of values; a fault of the device.
    pub fn load(&mut self, values: &[f64], shift: f64) -> Result<(), Error> {
        let (blocks, rest) = values.as_chunks::<9>();
        let chunks = self.layout.chunks.iter();
        let last = chunks.flat_map(|chunk| &chunk.source).filter(|s| **s != PADDING).max();
        if !rest.is_empty() || last.is_some_and(|&last| last as usize / 2 >= blocks.len()) {
            return Err(Error::Input(format!(
                "{} values do not fit the blocks of the pattern",
                values.len()
            )));
        }
        for (chunk, buffers) in self.layout.chunks.iter().zip(&self.chunks) {
            self.gpu.write(&buffers.values, &chunk.packed(|block| Some(&blocks[block])));
        }
        let gpu = self.gpu.clone();
        let mut commands = gpu.commands();
        self.encode_preparation(&mut commands, shift);
        commands.submit();
        self.gpu.check()
    }

    /// Computes preconditioner and border from the present values.
    pub(crate) fn encode_preparation(&mut self, commands: &mut Commands<'_>, shift: f64) {
        let is_new = self.shift.replace(shift) != Some(shift);
        for (chunk, buffers) in self.layout.chunks.iter().zip(&self.chunks) {
            let (first, count) = (chunk.rows.start as u32, chunk.rows.len() as u32);
            if is_new {
                let words = [first, count, (shift as f32).to_bits(), 0];
                self.gpu.write(&buffers.of_inverse, &words);
            }
            let n_groups = workgroups(chunk.rows.len(), usize::MAX);
            commands.dispatch(&self.kernels.invert, &buffers.inverse, n_groups);
        }
        if let Some(border) = &self.border {
            commands.dispatch(&self.kernels.prepare, &border.prepare, 1);
        }
    }

    /// `A x` on the free degrees of freedom, in single precision.
    ///
    /// # Errors
    /// A vector of the wrong length or not finite; a fault of the device.
    pub fn multiply(&mut self, x: &[f64]) -> Result<Vec<f64>, Error> {
        let size = self.scale_of(x)?;
        let placed = self.placed(x, size, false);
        self.gpu.write(&self.vectors.z, &placed);
        let mut commands = self.gpu.commands();
        self.encode_product(&mut commands, ALONE);
        let y = commands.read(&[(&self.vectors.w, x.len())])?.remove(0);
        Ok(self.in_order(bytemuck::cast_slice(&y), size))
    }

    /// The product with `z`, in `w`: of even and odd iterations, or alone.
    pub(crate) fn encode_product(&self, commands: &mut Commands<'_>, which: usize) {
        for chunk in &self.chunks {
            commands.dispatch(&self.kernels.product, &chunk.product[which], chunk.n_groups);
        }
    }
}

/// The product outside of conjugate gradients.
const ALONE: usize = 2;
