//! Commands for the device: kernels one after the other, and at the end copies of what they leave to where the
//! processor reads it.

use crate::Error;
use crate::device::{Gpu, THREADS, sentence};
use std::sync::PoisonError;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc;
use std::time::Duration;
use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, ComputePass, ComputePipeline};

/// Workgroups of a dispatch in one direction: the number that WebGPU guarantees.
const MOST_WORKGROUPS: u32 = 65_535;

/// Longest wait for another thread to pass on a result that the device has finished.
const PATIENCE: Duration = Duration::from_secs(60);

/// Bytes moved since the program started, on all devices.
static WRITTEN: AtomicU64 = AtomicU64::new(0);
static READ: AtomicU64 = AtomicU64::new(0);
static DISPATCHES: AtomicU64 = AtomicU64::new(0);

/// Bytes moved to devices since the program started, without the initial contents of buffers, and back.
pub fn traffic() -> viscera_device::Traffic {
    viscera_device::Traffic {
        written: WRITTEN.load(Relaxed),
        read: READ.load(Relaxed),
        dispatches: DISPATCHES.load(Relaxed),
    }
}

/// A compiled kernel.
#[derive(Clone)]
pub(crate) struct Kernel {
    pub name: &'static str,
    pub pipeline: ComputePipeline,
}

/// Commands that are being written.
pub(crate) struct Commands<'a> {
    gpu: &'a Gpu,
    encoder: CommandEncoder,
    /// Open while kernels follow each other: to open one takes longer than a kernel of a small body.
    pass: Option<ComputePass<'static>>,
}

impl Gpu {
    /// No commands yet.
    pub(crate) fn commands(&self) -> Commands<'_> {
        let encoder = self.device.create_command_encoder(&Default::default());
        Commands { gpu: self, encoder, pass: None }
    }

    /// Writes to a buffer, before the commands that are submitted next.
    pub(crate) fn write<T: bytemuck::Pod>(&self, buffer: &Buffer, values: &[T]) {
        self.write_from(buffer, 0, values);
    }

    /// The same from this value of the buffer on.
    pub(crate) fn write_from<T: bytemuck::Pod>(&self, buffer: &Buffer, first: usize, values: &[T]) {
        WRITTEN.fetch_add(size_of_val(values) as u64, Relaxed);
        let offset = (first * size_of::<T>()) as u64;
        self.queue.write_buffer(buffer, offset, bytemuck::cast_slice(values));
    }

    /// A buffer that the processor may read, of at least so many bytes: that of the last reading, or a larger one.
    fn staging(&self, bytes: u64) -> Buffer {
        let kept = self.staging.lock().unwrap_or_else(PoisonError::into_inner).take();
        kept.filter(|kept| kept.size() >= bytes).unwrap_or_else(|| {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("result"),
                size: bytes,
                usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })
    }
}

impl Commands<'_> {
    /// A kernel, with what it is bound to.
    pub fn dispatch(&mut self, kernel: &Kernel, group: &BindGroup, workgroups: u32) {
        DISPATCHES.fetch_add(1, Relaxed);
        let timed = self.gpu.stopwatch.as_ref().and_then(|watch| watch.start(kernel.name));
        if timed.is_some() {
            self.pass = None;
        }
        let pass = self.pass.get_or_insert_with(|| {
            let descriptor =
                wgpu::ComputePassDescriptor { label: Some(kernel.name), timestamp_writes: timed };
            self.encoder.begin_compute_pass(&descriptor).forget_lifetime()
        });
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups(workgroups, 1, 1);
    }

    /// Hands them to the device, which begins.
    pub fn submit(mut self) {
        self.pass = None;
        self.gpu.queue.submit([self.encoder.finish()]);
    }

    /// Hands them to the device, waits for them, and reads as many words of 32 bits of each buffer.
    ///
    /// # Errors
    /// A fault of the device.
    pub fn read(mut self, parts: &[(&Buffer, usize)]) -> Result<Vec<Vec<u32>>, Error> {
        self.pass = None;
        let gpu = self.gpu;
        let bytes: u64 = parts.iter().map(|(_, words)| 4 * *words as u64).sum();
        READ.fetch_add(bytes, Relaxed);
        let staging = gpu.staging(bytes.max(4));
        let mut at = 0;
        for &(buffer, words) in parts {
            self.encoder.copy_buffer_to_buffer(buffer, 0, &staging, at, 4 * words as u64);
            at += 4 * words as u64;
        }
        self.submit();
        let (sender, mapped) = mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, ..at, move |result| drop(sender.send(result)));
        let polled = gpu.device.poll(wgpu::PollType::wait_indefinitely());
        gpu.check()?;
        polled.map_err(|error| Error::Lost(sentence(&error)))?;
        // Another thread that polls the device may have taken this callback and not called it yet.
        match mapped.recv_timeout(PATIENCE) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(Error::Lost(sentence(&error))),
            Err(_) => return Err(Error::Lost("it does not respond".to_string())),
        }
        let view = staging.get_mapped_range(..at).map_err(|error| Error::Lost(sentence(&error)))?;
        let mut rest = &view[..];
        let read = parts.iter().map(|&(_, words)| {
            let (own, others) = rest.split_at(4 * words);
            rest = others;
            bytemuck::pod_collect_to_vec(own)
        });
        let read = read.collect();
        drop(view);
        staging.unmap();
        *gpu.staging.lock().unwrap_or_else(PoisonError::into_inner) = Some(staging);
        Ok(read)
    }

    /// The encoder, after the kernels so far.
    pub fn encoder(&mut self) -> &mut CommandEncoder {
        self.pass = None;
        &mut self.encoder
    }
}

/// Number of workgroups for this many threads, at most `most`: further elements are reached by a stride.
pub(crate) fn workgroups(threads: usize, most: usize) -> u32 {
    let needed = threads.div_ceil(THREADS as usize).clamp(1, most.max(1));
    needed.min(MOST_WORKGROUPS as usize) as u32
}
