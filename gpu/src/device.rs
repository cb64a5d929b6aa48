//! The device: how it is opened and lost, buffers within its limits, and kernels.

use crate::Error;
use crate::commands::Kernel;
use crate::stopwatch::Stopwatch;
use bytemuck::Pod;
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::util::DeviceExt;
use wgpu::{BindGroup, Buffer, BufferUsages, Features};

/// Threads of a workgroup, in every kernel.
pub(crate) const THREADS: u32 = 128;

/// A graphics processor, or a software renderer in its place.
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    about: About,
    largest_binding: u64,
    fault: Arc<Mutex<Option<Error>>>,
    /// Compiled kernels by source and entry point.
    kernels: Mutex<HashMap<(String, &'static str), Kernel>>,
    /// Where the last result was read.
    pub(crate) staging: Mutex<Option<Buffer>>,
    pub(crate) stopwatch: Option<Stopwatch>,
}

/// Facts about a device.
#[derive(Clone, Debug, PartialEq)]
pub struct About {
    /// Name.
    pub name: String,
    /// Driver.
    pub driver: String,
    /// Interface of the driver, such as "vulkan".
    pub backend: String,
    /// Whether it is a software renderer on the processor.
    pub is_software: bool,
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
    pub fn open_timed() -> Result<Self, Error> {
        Self::opened(u64::MAX, Features::TIMESTAMP_QUERY)
    }

    /// The same, with bindings limited to this many bytes, as on a smaller device.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_with(largest_binding: u64) -> Result<Self, Error> {
        Self::opened(largest_binding, Features::empty())
    }

    fn opened(largest_binding: u64, features: Features) -> Result<Self, Error> {
        let descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        let instance = wgpu::Instance::new(descriptor);
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))
            .map_err(|error| Error::Missing(sentence(&error)))?;
        let limits = wgpu::Limits {
            max_storage_buffer_binding_size: adapter.limits().max_storage_buffer_binding_size,
            max_buffer_size: adapter.limits().max_buffer_size,
            ..wgpu::Limits::default()
        };
        let largest = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let request = wgpu::DeviceDescriptor {
            required_limits: limits,
            required_features: features,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&request))
            .map_err(|error| Error::Refused(sentence(&error)))?;
        let fault = Arc::new(Mutex::new(None));
        let seen = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error| note(&seen, fault_of(&error))));
        let seen = fault.clone();
        device.set_device_lost_callback(move |_, why| note(&seen, Error::Lost(first_line(&why))));
        let info = adapter.get_info();
        let about = About {
            is_software: info.device_type == wgpu::DeviceType::Cpu,
            name: info.name,
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_string(),
            backend: info.backend.to_string(),
        };
        let stopwatch =
            features.contains(Features::TIMESTAMP_QUERY).then(|| Stopwatch::new(&device, &queue));
        Ok(Gpu {
            device,
            queue,
            about,
            largest_binding: largest.min(largest_binding),
            fault,
            kernels: Mutex::default(),
            staging: Mutex::default(),
            stopwatch,
        })
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
        note(&self.fault, Error::Lost("it was shut down".to_string()));
        self.device.destroy();
    }

    /// Fails with the first fault that the device has reported, if any.
    ///
    /// # Errors
    /// That fault.
    pub fn check(&self) -> Result<(), Error> {
        match &*self.fault.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(fault) => Err(fault.clone()),
            None => Ok(()),
        }
    }

    /// A buffer of zeros; errors call it `what`.
    pub(crate) fn zeros<T: Pod>(&self, what: &str, count: usize) -> Result<Buffer, Error> {
        let bytes = self.fitting::<T>(what, count)?;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let descriptor = wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes,
            usage,
            mapped_at_creation: false,
        };
        let buffer = self.device.create_buffer(&descriptor);
        self.check()?;
        Ok(buffer)
    }

    /// A buffer of these values; errors call it `what`.
    pub(crate) fn buffer<T: Pod>(&self, what: &str, values: &[T]) -> Result<Buffer, Error> {
        self.fitting::<T>(what, values.len())?;
        let least = [0u8; 16];
        let contents = bytemuck::cast_slice(values);
        let descriptor = wgpu::util::BufferInitDescriptor {
            label: Some(what),
            contents: if contents.is_empty() { &least } else { contents },
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
        };
        let buffer = self.device.create_buffer_init(&descriptor);
        self.check()?;
        Ok(buffer)
    }

    /// A uniform: numbers for a kernel, filled up to whole vectors of four.
    pub(crate) fn uniform(&self, words: &[u32]) -> Buffer {
        let mut words = words.to_vec();
        words.resize(words.len().next_multiple_of(4), 0);
        self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("uniform"),
            contents: bytemuck::cast_slice(&words),
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        })
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
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(entry),
            source: wgpu::ShaderSource::Wgsl(Cow::Borrowed(source)),
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        });
        self.check()?;
        let kernel = Kernel { name: entry, pipeline };
        kernels.insert(key, kernel.clone());
        Ok(kernel)
    }

    /// Binds the buffers of a kernel, in the order of its bindings.
    pub(crate) fn bind(&self, kernel: &Kernel, buffers: &[&Buffer]) -> BindGroup {
        let bound: Vec<_> = (0..).zip(buffers.iter().copied()).collect();
        self.bind_at(kernel, &bound)
    }

    /// The same by binding number, for a kernel that does not use all of them.
    pub(crate) fn bind_at(&self, kernel: &Kernel, buffers: &[(u32, &Buffer)]) -> BindGroup {
        let entries: Vec<_> = buffers
            .iter()
            .map(|&(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &kernel.pipeline.get_bind_group_layout(0),
            entries: &entries,
        })
    }
}

fn note(fault: &Mutex<Option<Error>>, error: Error) {
    fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
}

fn fault_of(error: &wgpu::Error) -> Error {
    match error {
        wgpu::Error::OutOfMemory { .. } => Error::Memory("what was asked of it".to_string()),
        other => Error::Refused(sentence(other)),
    }
}

pub(crate) fn sentence(error: &dyn std::error::Error) -> String {
    let inner = error.source().map_or(String::new(), |source| format!(": {source}"));
    first_line(&format!("{error}{inner}"))
}

fn first_line(text: &str) -> String {
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines.join(" ").trim_end_matches('.').to_string()
}
