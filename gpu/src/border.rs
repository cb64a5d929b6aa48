//! Prescribed means on the device: the projections that keep them, around a preconditioner.

use crate::Error;
use crate::device::{Gpu, dispatch};
use crate::layout::Layout;
use crate::system::Vectors;
use wgpu::{BindGroup, Buffer, CommandEncoder, ComputePipeline};

/// Largest number of prescribed means.
pub const MOST_MEANS: usize = 48;

/// A prescribed weighted mean: degrees of freedom and weights.
pub type Mean = Vec<(u32, f64)>;

/// Prescribed means.
pub(crate) struct Border {
    kernels: [ComputePipeline; 3],
    prepare: BindGroup,
    /// After the start and odd iterations, after even ones.
    project: [BindGroup; 2],
    nodes: Buffer,
    weights: Buffer,
    influence: Buffer,
    schur: Buffer,
    size: [u32; 2],
}

/// Takes what a result changes of the means away.
pub(crate) struct Closing {
    kernel: ComputePipeline,
    group: BindGroup,
}

impl Border {
    /// For these means of what is not held; none without any.
    ///
    /// # Errors
    /// More than [`MOST_MEANS`]; one whose degrees of freedom are all held; too little memory.
    pub fn new(
        gpu: &Gpu,
        layout: &Layout,
        is_held: &[bool],
        vectors: &Vectors,
        means: &[Mean],
    ) -> Result<Option<Self>, Error> {
        if means.is_empty() {
            return Ok(None);
        }
        if means.len() > MOST_MEANS {
            return Err(Error::Limit(format!(
                "{} means are held; the kernels take {MOST_MEANS}, three for each patch",
                means.len()
            )));
        }
        let mut nodes: Vec<u32> = means.iter().flatten().map(|&(dof, _)| dof / 3).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut weights = vec![0.0f32; means.len() * 3 * nodes.len()];
        for (k, mean) in means.iter().enumerate() {
            for &(dof, weight) in mean.iter().filter(|(dof, _)| !is_held[*dof as usize]) {
                let n = nodes.partition_point(|&node| node < dof / 3);
                weights[3 * (k * nodes.len() + n) + dof as usize % 3] = weight as f32;
            }
            if weights[3 * k * nodes.len()..3 * (k + 1) * nodes.len()].iter().all(|&w| w == 0.0) {
                return Err(Error::Input(format!("mean {k} has no free degree of freedom")));
            }
        }
        let rows: Vec<u32> = nodes.iter().map(|&node| layout.row_of[node as usize]).collect();
        let size = [rows.len() as u32, means.len() as u32];
        let nodes = gpu.buffer("nodes of means", &rows)?;
        let influence = gpu.zeros::<f32>("influence of means", weights.len())?;
        let weights = gpu.buffer("weights of means", &weights)?;
        let schur = gpu.zeros::<f32>("means", 2 * means.len() * means.len())?;
        let source =
            [include_str!("kernels/sum.wgsl"), include_str!("kernels/border.wgsl")].join("\n");
        let kernel = |entry| gpu.kernel(&source, entry);
        let kernels = [kernel("prepare")?, kernel("project")?, kernel("close")?];
        let uniform = |parity| gpu.uniform([size[0], size[1], parity, 0]);
        let Vectors { z, rs, sums, inverse, .. } = vectors;
        let of_prepare = [
            (0, inverse),
            (1, &nodes),
            (2, &weights),
            (3, &influence),
            (4, &schur),
            (8, &uniform(0)),
        ];
        let prepare = gpu.bind_at(&kernels[0], &of_prepare);
        let project = [0, 1].map(|parity| {
            let buffers = [&nodes, &weights, &influence, &schur, z, rs, sums, &uniform(parity)];
            let bound: Vec<_> = (1..).zip(buffers).collect();
            gpu.bind_at(&kernels[1], &bound)
        });
        Ok(Some(Border { kernels, prepare, project, nodes, weights, influence, schur, size }))
    }

    /// For the present inverse blocks.
    pub fn encode_preparation(&self, encoder: &mut CommandEncoder) {
        dispatch(encoder, &self.kernels[0], &self.prepare, 1);
    }

    /// Projects the residual and what the inverse blocks make of it; mends the partial sums of this parity.
    pub fn encode_projection(&self, encoder: &mut CommandEncoder, parity: usize) {
        dispatch(encoder, &self.kernels[1], &self.project[parity], 1);
    }

    /// For what another preconditioner leaves in `z`.
    pub fn closing(&self, gpu: &Gpu, z: &Buffer) -> Closing {
        let Border { kernels, nodes, weights, influence, schur, size, .. } = self;
        let size = gpu.uniform([size[0], size[1], 0, 0]);
        let buffers = [nodes, weights, influence, schur, z];
        let bound: Vec<_> = (1..).zip(buffers).chain([(8, &size)]).collect();
        Closing { kernel: kernels[2].clone(), group: gpu.bind_at(&kernels[2], &bound) }
    }
}

impl Closing {
    pub fn encode(&self, encoder: &mut CommandEncoder) {
        dispatch(encoder, &self.kernel, &self.group, 1);
    }
}
