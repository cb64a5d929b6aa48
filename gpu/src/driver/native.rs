//! The driver of a program of its own: `wgpu`, on Vulkan, Metal or DX12.

use super::stopwatch::Stopwatch;
use super::{About, Contents, Kind};
use crate::Error;
use std::borrow::Cow;
use std::sync::mpsc;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use wgpu::{BufferUsages, CommandEncoder, ComputePass, ComputePipeline, Features};

pub use wgpu::{BindGroup as Group, Buffer};

/// Longest wait for another thread to pass on a result that the device has finished.
const PATIENCE: Duration = Duration::from_secs(60);

/// A device with its queue.
pub struct Driver {
    device: wgpu::Device,
    queue: wgpu::Queue,
    stopwatch: Option<Stopwatch>,
    fault: Arc<Mutex<Option<Error>>>,
    /// Where the last result was read.
    staging: Mutex<Option<Buffer>>,
}

/// A compiled kernel.
#[derive(Clone)]
pub struct Kernel {
    name: &'static str,
    pipeline: ComputePipeline,
}

/// Commands that are being written.
pub struct Encoder<'a> {
    driver: &'a Driver,
    encoder: CommandEncoder,
    /// Open while kernels follow each other: to open one takes longer than a kernel of a small body.
    pass: Option<ComputePass<'static>>,
}

impl Driver {
    /// The fastest device of this machine, facts about it, and its largest binding [bytes]; with a clock of its own if
    /// that is asked for.
    pub fn open(is_timed: bool) -> Result<(Self, About, u64), Error> {
        let features = if is_timed { Features::TIMESTAMP_QUERY } else { Features::empty() };
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
        let stopwatch = is_timed.then(|| Stopwatch::new(&device, &queue));
        Ok((Driver { device, queue, stopwatch, fault, staging: Mutex::default() }, about, largest))
    }

    /// The first fault that the device has reported, if any.
    pub fn fault(&self) -> Option<Error> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub fn destroy(&self) {
        note(&self.fault, Error::Lost("it was shut down".to_string()));
        self.device.destroy();
    }

    pub fn buffer(&self, label: &str, kind: Kind, contents: Contents<'_>) -> Buffer {
        let usage = BufferUsages::COPY_DST
            | match kind {
                Kind::Storage => BufferUsages::STORAGE | BufferUsages::COPY_SRC,
                Kind::Uniform => BufferUsages::UNIFORM,
            };
        let size = match contents {
            Contents::Zeros(size) => size,
            Contents::Bytes(bytes) => bytes.len() as u64,
        };
        let label = Some(label);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label,
            size,
            usage,
            mapped_at_creation: false,
        });
        // Not mapped at its creation: if the device was lost meanwhile, wgpu would panic.
        if let Contents::Bytes(bytes) = contents {
            self.write(&buffer, 0, bytes);
        }
        buffer
    }

    /// Writes from this byte on, before the commands that are submitted next.
    pub fn write(&self, buffer: &Buffer, offset: u64, bytes: &[u8]) {
        self.queue.write_buffer(buffer, offset, bytes);
    }

    /// One entry point of a kernel source.
    pub fn kernel(&self, source: &str, entry: &'static str) -> Kernel {
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
        Kernel { name: entry, pipeline }
    }

    pub fn bind(&self, kernel: &Kernel, buffers: &[(u32, &Buffer)]) -> Group {
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

    pub fn encoder(&self) -> Encoder<'_> {
        let encoder = self.device.create_command_encoder(&Default::default());
        Encoder { driver: self, encoder, pass: None }
    }

    /// The kernels since the last call, with the time that each took [s]; none without a clock.
    pub fn times(&self) -> Result<Vec<(&'static str, f64)>, Error> {
        let Some(stopwatch) = &self.stopwatch else { return Ok(Vec::new()) };
        let names = stopwatch.take();
        if names.is_empty() {
            return Ok(Vec::new());
        }
        let mut commands = self.encoder();
        let resolved = stopwatch.resolve(&mut commands.encoder, names.len());
        let words = commands.read(&[(resolved, 4 * names.len())])?.remove(0);
        let ticks: Vec<[u64; 2]> = bytemuck::pod_collect_to_vec(&words);
        let seconds = ticks.into_iter().map(|ticks| stopwatch.seconds(ticks));
        Ok(names.into_iter().zip(seconds).collect())
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

impl Encoder<'_> {
    pub fn dispatch(&mut self, kernel: &Kernel, group: &Group, workgroups: u32) {
        let Kernel { name, pipeline } = kernel;
        let timed = self.driver.stopwatch.as_ref().and_then(|watch| watch.start(name));
        if timed.is_some() {
            self.pass = None;
        }
        let pass = self.pass.get_or_insert_with(|| {
            let descriptor =
                wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes: timed };
            self.encoder.begin_compute_pass(&descriptor).forget_lifetime()
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups(workgroups, 1, 1);
    }

    pub fn submit(mut self) {
        self.pass = None;
        self.driver.queue.submit([self.encoder.finish()]);
    }

    /// Submits, waits, and reads as many words of 32 bits of each buffer.
    pub fn read(mut self, parts: &[(&Buffer, usize)]) -> Result<Vec<Vec<u32>>, Error> {
        self.pass = None;
        let driver = self.driver;
        let bytes: u64 = parts.iter().map(|(_, words)| 4 * *words as u64).sum();
        let staging = driver.staging(bytes.max(4));
        let mut at = 0;
        for &(buffer, words) in parts {
            self.encoder.copy_buffer_to_buffer(buffer, 0, &staging, at, 4 * words as u64);
            at += 4 * words as u64;
        }
        self.submit();
        let (sender, mapped) = mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, ..at, move |result| drop(sender.send(result)));
        let polled = driver.device.poll(wgpu::PollType::wait_indefinitely());
        driver.fault().map_or(Ok(()), Err)?;
        // A device that is lost from here on has told why before what it was asked for fails.
        let lost = |why: String| driver.fault().unwrap_or(Error::Lost(why));
        polled.map_err(|error| lost(sentence(&error)))?;
        // Another thread that polls the device may have taken this callback and not called it yet.
        match mapped.recv_timeout(PATIENCE) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(lost(sentence(&error))),
            Err(_) => return Err(lost("it does not respond".to_string())),
        }
        let view = staging.get_mapped_range(..at).map_err(|error| lost(sentence(&error)))?;
        let mut rest = &view[..];
        let read = parts.iter().map(|&(_, words)| {
            let (own, others) = rest.split_at(4 * words);
            rest = others;
            bytemuck::pod_collect_to_vec(own)
        });
        let read = read.collect();
        drop(view);
        staging.unmap();
        *driver.staging.lock().unwrap_or_else(PoisonError::into_inner) = Some(staging);
        Ok(read)
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

fn sentence(error: &dyn std::error::Error) -> String {
    let inner = error.source().map_or(String::new(), |source| format!(": {source}"));
    first_line(&format!("{error}{inner}"))
}

fn first_line(text: &str) -> String {
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines.join(" ").trim_end_matches('.').to_string()
}
