//! Prescribed weighted means: the border of the matrix on the device.

use crate::Error;
use crate::buffers::{Kernels, Vectors};
use crate::device::Gpu;
use crate::driver::Group;

/// Largest number of prescribed means.
pub const MOST_MEANS: usize = 48;

/// A prescribed weighted mean: degrees of freedom and weights.
pub type Mean = Vec<(u32, f64)>;

/// Prescribed means on the device.
pub(crate) struct Border {
    pub prepare: Group,
    /// After the start and odd iterations, after even ones.
    pub project: [Group; 2],
}

impl Border {
    /// Of these means, over the degrees of freedom that are not held.
    ///
    /// # Errors
    /// More than [`MOST_MEANS`] means; a mean whose degrees of freedom are all held; too little memory.
    pub fn new(
        (gpu, kernels, vectors): (&Gpu, &Kernels, &Vectors),
        row_of: &[u32],
        is_held: &[bool],
        means: &[Mean],
    ) -> Result<Self, Error> {
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
        let rows: Vec<u32> = nodes.iter().map(|&node| row_of[node as usize]).collect();
        let nodes = gpu.buffer("nodes of means", &rows)?;
        let influence = gpu.zeros::<f32>("influence of means", weights.len())?;
        let weights = gpu.buffer("weights of means", &weights)?;
        let schur = gpu.zeros::<f32>("means", 2 * means.len() * means.len())?;
        let size = |parity| gpu.uniform(&[rows.len() as u32, means.len() as u32, parity, 0]);
        let Vectors { z, rs, sums, inverse, .. } = vectors;
        let of_prepare =
            [(0, inverse), (1, &nodes), (2, &weights), (3, &influence), (4, &schur), (8, &size(0))];
        let project = |parity| {
            let buffers = [&nodes, &weights, &influence, &schur, z, rs, sums, &size(parity)];
            let bound: Vec<_> = (1..).zip(buffers).collect();
            gpu.bind_at(&kernels.project, &bound)
        };
        let prepare = gpu.bind_at(&kernels.prepare, &of_prepare);
        Ok(Border { prepare, project: [project(0), project(1)] })
    }
}
