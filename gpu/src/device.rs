//! The device: how it is opened and lost, buffers within its limits, kernels and results.

use crate::Error;
use bytemuck::Pod;
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Duration;
use wgpu::util::DeviceExt;
use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, ComputePipeline};

/// Threads of a workgroup, in every kernel.
pub(crate) const THREADS: u32 = 128;

/// Workgroups of a dispatch in one direction: the number that WebGPU guarantees.
const MOST_WORKGROUPS: u32 = 65_535;

/// Longest wait for another thread to pass on a result that the device has finished.
const PATIENCE: Duration = Duration::from_secs(60);

/// Bytes moved since the program started, on all devices.
static WRITTEN: AtomicU64 = AtomicU64::new(0);
static READ: AtomicU64 = AtomicU64::new(0);
static DISPATCHES: AtomicU64 = AtomicU64::new(0);
static TOUCHED: AtomicU64 = AtomicU64::new(0);

/// Bytes moved to devices since the program started, without the initial contents of buffers, and back.
pub fn traffic() -> viscera_device::Traffic {
    viscera_device::Traffic {
        written: WRITTEN.load(Relaxed),
        read: READ.load(Relaxed),
        dispatches: DISPATCHES.load(Relaxed),
        touched: TOUCHED.load(Relaxed),
    }
}

/// Notes what iterations read and wrote on the device.
pub(crate) fn note_touched(bytes: usize) {
    TOUCHED.fetch_add(bytes as u64, Relaxed);
}

/// A graphics processor, or a software renderer in its place.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    about: About,
    largest_binding: u64,
    fault: Arc<Mutex<Option<Error>>>,
    /// Compiled kernels by source and entry point.
    kernels: Mutex<HashMap<(String, String), ComputePipeline>>,
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

    /// The same, with bindings limited to this many bytes, as on a smaller device.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_with(largest_binding: u64) -> Result<Self, Error> {
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
        let request = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
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
        let (largest_binding, kernels) = (largest.min(largest_binding), Mutex::default());
        Ok(Gpu { device, queue, about, largest_binding, fault, kernels })
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

    /// A uniform: a few numbers for a kernel.
    pub(crate) fn uniform<T: Pod>(&self, words: T) -> Buffer {
        self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("uniform"),
            contents: bytemuck::bytes_of(&words),
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

    pub(crate) fn write<T: Pod>(&self, buffer: &Buffer, values: &[T]) {
        WRITTEN.fetch_add(size_of_val(values) as u64, Relaxed);
        self.queue.write_buffer(buffer, 0, bytemuck::cast_slice(values));
    }

    /// One entry point of a kernel source, compiled on first use.
    pub(crate) fn kernel(&self, source: &str, entry: &str) -> Result<ComputePipeline, Error> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (source.to_string(), entry.to_string());
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
        kernels.insert(key, pipeline.clone());
        Ok(pipeline)
    }

    /// Binds the buffers of a kernel, in the order of its bindings.
    pub(crate) fn bind(&self, kernel: &ComputePipeline, buffers: &[&Buffer]) -> BindGroup {
        let bound: Vec<_> = (0..).zip(buffers.iter().copied()).collect();
        self.bind_at(kernel, &bound)
    }

    /// The same by binding number, for a kernel that does not use all of them.
    pub(crate) fn bind_at(
        &self,
        kernel: &ComputePipeline,
        buffers: &[(u32, &Buffer)],
    ) -> BindGroup {
        let entries: Vec<_> = buffers
            .iter()
            .map(|&(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &kernel.get_bind_group_layout(0),
            entries: &entries,
        })
    }

    pub(crate) fn encoder(&self) -> CommandEncoder {
        self.device.create_command_encoder(&Default::default())
    }

    pub(crate) fn submit(&self, encoder: CommandEncoder) {
        self.queue.submit([encoder.finish()]);
    }

    /// Submits commands, waits for them, and reads a buffer.
    pub(crate) fn read<T: Pod>(
        &self,
        mut encoder: CommandEncoder,
        buffer: &Buffer,
        count: usize,
    ) -> Result<Vec<T>, Error> {
        let bytes = (count * size_of::<T>()) as u64;
        READ.fetch_add(bytes, Relaxed);
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let descriptor = wgpu::BufferDescriptor {
            label: Some("result"),
            size: bytes,
            usage,
            mapped_at_creation: false,
        };
        let staging = self.device.create_buffer(&descriptor);
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
        self.submit(encoder);
        let (sender, mapped) = mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
        let polled = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        polled.map_err(|error| Error::Lost(sentence(&error)))?;
        // Another thread that polls the device may have taken this callback and not called it yet.
        match mapped.recv_timeout(PATIENCE) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(Error::Lost(sentence(&error))),
            Err(_) => return Err(Error::Lost("it does not respond".to_string())),
        }
        let view = staging.get_mapped_range(..).map_err(|error| Error::Lost(sentence(&error)))?;
        Ok(bytemuck::pod_collect_to_vec(&view))
    }
}

/// Number of workgroups for this many threads, at most `most`: further elements are reached by a stride.
pub(crate) fn workgroups(threads: usize, most: usize) -> u32 {
    let needed = threads.div_ceil(THREADS as usize).clamp(1, most.max(1));
    needed.min(MOST_WORKGROUPS as usize) as u32
}

/// Adds a kernel to the commands.
pub(crate) fn dispatch(
    encoder: &mut CommandEncoder,
    kernel: &ComputePipeline,
    group: &BindGroup,
    workgroups: u32,
) {
    DISPATCHES.fetch_add(1, Relaxed);
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(kernel);
    pass.set_bind_group(0, group, &[]);
    pass.dispatch_workgroups(workgroups, 1, 1);
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

fn sentence(error: &dyn std::error::Error) -> String {
    let inner = error.source().map_or(String::new(), |source| format!(": {source}"));
    first_line(&format!("{error}{inner}"))
}

fn first_line(text: &str) -> String {
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines.join(" ").trim_end_matches('.').to_string()
}
