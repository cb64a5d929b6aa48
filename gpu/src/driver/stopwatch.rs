//! How long kernels take by the device's own clock. Only benchmarks ask for it, since every kernel is then a pass of its
//! own.

use std::sync::{Mutex, PoisonError};
use wgpu::{
    Buffer, BufferUsages, CommandEncoder, ComputePassTimestampWrites, Device, QuerySet, Queue,
};

/// Timestamps of a set, a start and an end for each kernel: the number that WebGPU guarantees.
const MOST: usize = 4096;

/// Starts and ends of kernels.
pub(crate) struct Stopwatch {
    queries: QuerySet,
    resolved: Buffer,
    /// Nanoseconds of a tick.
    period: f32,
    /// The kernels that have been timed.
    names: Mutex<Vec<&'static str>>,
}

impl Stopwatch {
    /// On a device with the feature `TIMESTAMP_QUERY`.
    pub fn new(device: &Device, queue: &Queue) -> Self {
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("stopwatch"),
            ty: wgpu::QueryType::Timestamp,
            count: MOST as u32,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: 8 * MOST as u64,
            usage: BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let period = queue.get_timestamp_period();
        Stopwatch { queries, resolved, period, names: Mutex::default() }
    }

    /// Where the next kernel notes its start and end, while there is room.
    pub fn start(&self, name: &'static str) -> Option<ComputePassTimestampWrites<'_>> {
        let mut names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        let first = 2 * names.len();
        (first < MOST).then(|| {
            names.push(name);
            ComputePassTimestampWrites {
                query_set: &self.queries,
                beginning_of_pass_write_index: Some(first as u32),
                end_of_pass_write_index: Some(first as u32 + 1),
            }
        })
    }

    /// The kernels that have been timed since the last call.
    pub fn take(&self) -> Vec<&'static str> {
        std::mem::take(&mut *self.names.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Writes the timestamps of so many kernels where they can be read: two words of 32 bits each.
    pub fn resolve(&self, encoder: &mut CommandEncoder, n_kernels: usize) -> &Buffer {
        encoder.resolve_query_set(&self.queries, 0..2 * n_kernels as u32, &self.resolved, 0);
        &self.resolved
    }

    /// The time between a start and an end [s].
    pub fn seconds(&self, [start, end]: [u64; 2]) -> f64 {
        1e-9 * f64::from(self.period) * end.saturating_sub(start) as f64
    }
}
