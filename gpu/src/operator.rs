//! Matrices of blocks between two levels of a cycle, or of one coarse level: rows in slices of 32, in chunks whose
//! buffers fit into one binding each. The pattern stays; the numbers may be renewed.

use crate::Error;
use crate::device::Gpu;
use crate::layout::SLICE;
use std::ops::Range;
use wgpu::Buffer;

/// A place without a block.
const PADDING: u32 = u32::MAX;

/// A matrix of blocks on the device.
pub(crate) struct Operator {
    /// Rows and columns of a block.
    shape: [usize; 2],
    pub chunks: Vec<OperatorChunk>,
}

/// Consecutive rows with buffers of their own.
pub(crate) struct OperatorChunk {
    pub rows: Range<usize>,
    pub values: Buffer,
    pub columns: Buffer,
    pub starts: Buffer,
    /// For each place, what the caller calls its block.
    source: Vec<u32>,
}

impl Operator {
    /// Room for blocks of this shape; `rows` gives column and source of each block, row by row.
    pub fn new(gpu: &Gpu, shape: [usize; 2], rows: &[Vec<(u32, u32)>]) -> Result<Self, Error> {
        let bytes_of = |slice: &[Vec<(u32, u32)>]| {
            let width = slice.iter().map(Vec::len).max().unwrap_or(0);
            4 * shape[0] * shape[1] * SLICE * width
        };
        let (mut chunks, mut first) = (Vec::new(), 0);
        while first < rows.len() {
            let (mut end, mut bytes) = (first, 0);
            for slice in rows[first..].chunks(SLICE) {
                bytes += bytes_of(slice);
                if end > first && bytes as u64 > gpu.largest_binding() {
                    break;
                }
                end += slice.len();
            }
            chunks.push(OperatorChunk::new(gpu, shape, first..end, &rows[first..end])?);
            first = end;
        }
        Ok(Operator { shape, chunks })
    }

    /// Renews all numbers: entry of row and column of the block that the caller calls so.
    pub fn write(&self, gpu: &Gpu, entry: impl Fn(u32, usize, usize) -> f32) {
        let [n_rows, n_columns] = self.shape;
        for chunk in &self.chunks {
            let mut packed = vec![0.0f32; n_rows * n_columns * chunk.source.len()];
            for (place, &source) in chunk.source.iter().enumerate().filter(|(_, s)| **s != PADDING)
            {
                let at = n_rows * n_columns * SLICE * (place / SLICE) + place % SLICE;
                for i in 0..n_rows {
                    for k in 0..n_columns {
                        packed[at + SLICE * (n_columns * i + k)] = entry(source, i, k);
                    }
                }
            }
            gpu.write(&chunk.values, &packed);
        }
    }

    /// Bytes of values and columns, with padding.
    pub fn bytes(&self) -> usize {
        let places = self.chunks.iter().map(|chunk| chunk.source.len()).sum::<usize>();
        4 * (self.shape[0] * self.shape[1] + 1) * places
    }
}

impl OperatorChunk {
    fn new(
        gpu: &Gpu,
        shape: [usize; 2],
        range: Range<usize>,
        rows: &[Vec<(u32, u32)>],
    ) -> Result<Self, Error> {
        let (mut starts, mut columns, mut source) = (vec![0u32], Vec::new(), Vec::new());
        for slice in rows.chunks(SLICE) {
            let width = slice.iter().map(Vec::len).max().unwrap_or(0);
            let first = columns.len();
            columns.resize(first + SLICE * width, 0u32);
            source.resize(columns.len(), PADDING);
            for (lane, row) in slice.iter().enumerate() {
                for (k, &(column, block)) in row.iter().enumerate() {
                    columns[first + SLICE * k + lane] = column;
                    source[first + SLICE * k + lane] = block;
                }
            }
            starts.push((columns.len() / SLICE) as u32);
        }
        Ok(OperatorChunk {
            rows: range,
            values: gpu.zeros::<f32>("blocks of multigrid", shape[0] * shape[1] * columns.len())?,
            columns: gpu.buffer("columns of multigrid", &columns)?,
            starts: gpu.buffer("slices of multigrid", &starts)?,
            source,
        })
    }
}
