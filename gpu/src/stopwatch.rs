//! How long kernels take by the device's own clock. Only benchmarks ask for it, since every kernel is then a pass of its
//! own.

use crate::Error;
use crate::device::Gpu;
use std::sync::{Mutex, PoisonError};
use wgpu::{Buffer, BufferUsages, ComputePassTimestampWrites, Device, QuerySet, Queue};

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
}

impl Gpu {
    /// The kernels since the last call, in their order, with the time that each took [s]; the first 2048 of them. None on a
    /// device that was not opened by [`Gpu::open_timed`].
    ///
    /// # Errors
    /// A fault of the device.
    pub fn times(&self) -> Result<Vec<(&'static str, f64)>, Error> {
        let Some(Stopwatch { queries, resolved, period, names }) = &self.stopwatch else {
            return Ok(Vec::new());
        };
        let names = std::mem::take(&mut *names.lock().unwrap_or_else(PoisonError::into_inner));
        if names.is_empty() {
            return Ok(Vec::new());
        }
        let count = 2 * names.len();
        let mut commands = self.commands();
        commands.encoder().resolve_query_set(queries, 0..count as u32, resolved, 0);
        let words = commands.read(&[(resolved, 2 * count)])?.remove(0);
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&words);
        let seconds = |k: usize| {
            1e-9 * f64::from(*period) * ticks[2 * k + 1].saturating_sub(ticks[2 * k]) as f64
        };
        Ok(names.into_iter().enumerate().map(|(k, name)| (name, seconds(k))).collect())
    }
}
