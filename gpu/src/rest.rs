//! The parts of a tangent beside that of the law: a factor, and blocks that are added. They are kept until replaced.

use crate::commands::{Commands, workgroups};
use crate::device::Gpu;
use crate::driver::{Buffer, Group, Kernel};
use crate::{Error, System};
use std::collections::HashMap;

/// A block of the upper triangle to add to a tangent: row, column and entries, row-major. Equal places are summed.
pub type RestBlock = (u32, u32, [f64; 9]);

/// The blocks that are added to the tangent of a body.
pub(crate) struct Rest {
    kernel: Kernel,
    /// Buffers of each chunk, made on first use.
    chunks: Vec<ChunkRest>,
    is_empty: bool,
}

/// The buffer of a chunk, as large as the values of its matrix.
struct ChunkRest {
    values: Buffer,
    size: Buffer,
    n_values: usize,
    commands: Group,
}

impl Rest {
    /// Adds nothing yet.
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        Ok(Rest {
            kernel: gpu.kernel(include_str!("kernels/rest.wgsl"), "add_rest")?,
            chunks: Vec::new(),
            is_empty: true,
        })
    }

    /// Replaces the blocks to add.
    pub fn take(&mut self, gpu: &Gpu, system: &System, rest: &[RestBlock]) -> Result<(), Error> {
        let mut blocks: HashMap<usize, [f64; 9]> = HashMap::with_capacity(rest.len());
        for (row, column, block) in rest {
            let number = system.layout.block(*row, *column).ok_or_else(|| {
                Error::Input(format!(
                    "block ({row}, {column}) cannot be added: it is not in the pattern"
                ))
            })?;
            let sum = blocks.entry(number).or_insert([0.0; 9]);
            sum.iter_mut().zip(block).for_each(|(sum, more)| *sum += more);
        }
        self.is_empty = rest.is_empty();
        if self.is_empty && self.chunks.is_empty() {
            return Ok(());
        }
        self.make_room(gpu, system)?;
        for (chunk, own) in system.layout.chunks.iter().zip(&self.chunks) {
            gpu.write(&own.values, &chunk.packed(|number| blocks.get(&number)));
        }
        Ok(())
    }

    /// Multiplies the matrix by a factor and adds the blocks.
    pub fn encode(
        &mut self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        system: &System,
        factor: f64,
    ) -> Result<(), Error> {
        if self.is_empty && factor == 1.0 {
            return Ok(());
        }
        self.make_room(gpu, system)?;
        for own in &self.chunks {
            gpu.write(&own.size, &[own.n_values as u32, (factor as f32).to_bits(), 0, 0]);
            let groups = workgroups(own.n_values, usize::MAX);
            commands.dispatch(&self.kernel, &own.commands, groups);
        }
        Ok(())
    }

    fn make_room(&mut self, gpu: &Gpu, system: &System) -> Result<(), Error> {
        if self.chunks.is_empty() {
            let of_chunks = system.layout.chunks.iter().zip(&system.chunks);
            let made = of_chunks.map(|(chunk, buffers)| {
                let n_values = 9 * chunk.columns.len();
                let values = gpu.zeros::<f32>("what is added to the tangent", n_values)?;
                let size = gpu.uniform(&[0; 4]);
                let commands = gpu.bind(&self.kernel, &[&buffers.values, &values, &size]);
                Ok(ChunkRest { values, size, n_values, commands })
            });
            self.chunks = made.collect::<Result<_, Error>>()?;
        }
        Ok(())
    }
}
