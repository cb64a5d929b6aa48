//! The device: how it is opened and lost, buffers within its limits, and kernels.

use crate::Error;
use crate::driver::{About, Buffer, Contents, Driver, Group, Kernel, Kind};
use bytemuck::Pod;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Threads of a workgroup, in every kernel.
pub(crate) const THREADS: u32 = 128;

/// A graphics processor, or a software renderer in its place.
pub struct Gpu {
    pub(crate) driver: Driver,
    about: About,
    largest_binding: u64,
    /// Compiled kernels by source and entry point.
    kernels: Mutex<HashMap<(String, &'static str), Kernel>>,
}

impl Gpu {
    /// Opens the fastest device of this machine; a software renderer only if there is no other.
    ///
    /// # Errors
    /// [`Error::Missing`], or [`Error::Refused`] by the driver.
    pub fn open() -> Result<Self, Error> {
        Self::open_with(u64::MAX)
    }

    /// The same with a clock on the device, for [`Gpu::times`].
    ///
    /// # Errors
    /// As [`Gpu::open`]; a device without a clock is refused.
    #[cfg(feature = "wgpu")]
    pub fn open_timed() -> Result<Self, Error> {
        Self::opened(u64::MAX, true)
    }

    /// The same, with bindings limited to this many bytes, as on a smaller device.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_with(largest_binding: u64) -> Result<Self, Error> {
        Self::opened(largest_binding, false)
    }

    fn opened(largest_binding: u64, is_timed: bool) -> Result<Self, Error> {
        let (driver, about, largest) = Driver::open(is_timed)?;
        let largest_binding = largest.min(largest_binding);
        Ok(Gpu { driver, about, largest_binding, kernels: Mutex::default() })
    }

    /// Facts about the device.
    pub fn about(&self) -> &About {
        &self.about
    }

    /// Largest binding of a buffer [bytes].
    pub fn largest_binding(&self) -> u64 {
        self.largest_binding
    }

    /// Shuts the device down. Every later call fails with [`Error::Lost`].
    pub fn destroy(&self) {
        self.driver.destroy();
    }

    /// Fails with the first fault that the device has reported, if any.
    ///
    /// # Errors
    /// That fault.
    pub fn check(&self) -> Result<(), Error> {
        self.driver.fault().map_or(Ok(()), Err)
    }

    /// The kernels since the last call, in their order, with the time that each took [s]; the first 2048 of them. None on a
    /// device that was not opened by [`Gpu::open_timed`].
    ///
    /// # Errors
    /// A fault of the device.
    #[cfg(feature = "wgpu")]
    pub fn times(&self) -> Result<Vec<(&'static str, f64)>, Error> {
        self.driver.times()
    }

    /// A buffer of zeros; errors call it `what`.
    pub(crate) fn zeros<T: Pod>(&self, what: &str, count: usize) -> Result<Buffer, Error> {
        let bytes = self.fitting::<T>(what, count)?;
        let buffer = self.driver.buffer(what, Kind::Storage, Contents::Zeros(bytes));
        self.check()?;
        Ok(buffer)
    }

    /// A buffer of these values; errors call it `what`.
    pub(crate) fn buffer<T: Pod>(&self, what: &str, values: &[T]) -> Result<Buffer, Error> {
        self.fitting::<T>(what, values.len())?;
        let least = [0u8; 16];
        let contents = bytemuck::cast_slice(values);
        let contents = if contents.is_empty() { &least } else { contents };
        let buffer = self.driver.buffer(what, Kind::Storage, Contents::Bytes(contents));
        self.check()?;
        Ok(buffer)
    }

    /// A uniform: numbers for a kernel, filled up to whole vectors of four.
    pub(crate) fn uniform(&self, words: &[u32]) -> Buffer {
        let mut words = words.to_vec();
        words.resize(words.len().next_multiple_of(4), 0);
        let contents = Contents::Bytes(bytemuck::cast_slice(&words));
        self.driver.buffer("uniform", Kind::Uniform, contents)
    }

    /// Size of a buffer [bytes], at least the smallest that can be bound.
    fn fitting<T: Pod>(&self, what: &str, count: usize) -> Result<u64, Error> {
        let bytes = (count * size_of::<T>()).next_multiple_of(16).max(16) as u64;
        if bytes > self.largest_binding {
            return Err(Error::Limit(format!(
                "{what}: {bytes} bytes, and the graphics processor {} binds at most {}",
                self.about.name, self.largest_binding
            )));
        }
        Ok(bytes)
    }

    /// One entry point of a kernel source, compiled on first use.
    pub(crate) fn kernel(&self, source: &str, entry: &'static str) -> Result<Kernel, Error> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (source.to_string(), entry);
        if let Some(kernel) = kernels.get(&key) {
            self.check()?;
            return Ok(kernel.clone());
        }
        let kernel = self.driver.kernel(source, entry);
        self.check()?;
        kernels.insert(key, kernel.clone());
        Ok(kernel)
    }

    /// Binds the buffers of a kernel, in the order of its bindings.
    pub(crate) fn bind(&self, kernel: &Kernel, buffers: &[&Buffer]) -> Group {
        let bound: Vec<_> = (0..).zip(buffers.iter().copied()).collect();
        self.bind_at(kernel, &bound)
    }

    /// The same by binding number, for a kernel that does not use all of them.
    pub(crate) fn bind_at(&self, kernel: &Kernel, buffers: &[(u32, &Buffer)]) -> Group {
        self.driver.bind(kernel, buffers)
    }
}
