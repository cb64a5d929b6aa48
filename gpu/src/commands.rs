//! Commands for the device: kernels one after the other, and at the end copies of what they leave to where the
//! processor reads it.

use crate::Error;
use crate::device::{Gpu, THREADS};
use crate::driver::{Buffer, Encoder, Group, Kernel};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Workgroups of a dispatch in one direction: the number that WebGPU guarantees.
const MOST_WORKGROUPS: u32 = 65_535;

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

/// Commands that are being written.
pub(crate) struct Commands<'a>(Encoder<'a>);

impl Gpu {
    /// No commands yet.
    pub(crate) fn commands(&self) -> Commands<'_> {
        Commands(self.driver.encoder())
    }

    /// Writes to a buffer, before the commands that are submitted next.
    pub(crate) fn write<T: bytemuck::Pod>(&self, buffer: &Buffer, values: &[T]) {
        self.write_from(buffer, 0, values);
    }

    /// The same from this value of the buffer on.
    pub(crate) fn write_from<T: bytemuck::Pod>(&self, buffer: &Buffer, first: usize, values: &[T]) {
        WRITTEN.fetch_add(size_of_val(values) as u64, Relaxed);
        let offset = (first * size_of::<T>()) as u64;
        self.driver.write(buffer, offset, bytemuck::cast_slice(values));
    }
}

impl Commands<'_> {
    /// A kernel, with what it is bound to.
    pub fn dispatch(&mut self, kernel: &Kernel, group: &Group, workgroups: u32) {
        DISPATCHES.fetch_add(1, Relaxed);
        self.0.dispatch(kernel, group, workgroups);
    }

    /// Hands them to the device, which begins.
    pub fn submit(self) {
        self.0.submit();
    }

    /// Hands them to the device, waits for them, and reads as many words of 32 bits of each buffer.
    ///
    /// # Errors
    /// A fault of the device.
    pub fn read(self, parts: &[(&Buffer, usize)]) -> Result<Vec<Vec<u32>>, Error> {
        READ.fetch_add(parts.iter().map(|(_, words)| 4 * *words as u64).sum(), Relaxed);
        self.0.read(parts)
    }
}

/// Number of workgroups for this many threads, at most `most`: further elements are reached by a stride.
pub(crate) fn workgroups(threads: usize, most: usize) -> u32 {
    let needed = threads.div_ceil(THREADS as usize).clamp(1, most.max(1));
    needed.min(MOST_WORKGROUPS as usize) as u32
}
