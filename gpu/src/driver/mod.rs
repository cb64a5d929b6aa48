//! What stands between this crate and a graphics processor: a device, its buffers, kernels and commands. A program of its
//! own drives it through `wgpu`; in a page the page does, which has WebGPU.

#[cfg(feature = "wgpu")]
mod native;
#[cfg(not(feature = "wgpu"))]
mod page;
#[cfg(feature = "wgpu")]
mod stopwatch;

#[cfg(feature = "wgpu")]
pub(crate) use native::{Buffer, Driver, Encoder, Group, Kernel};
#[cfg(not(feature = "wgpu"))]
pub(crate) use page::{Buffer, Driver, Encoder, Group, Kernel};

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

/// How a kernel is bound to a buffer.
#[derive(Clone, Copy)]
pub(crate) enum Kind {
    /// Values, which kernels may change and the processor may read.
    Storage,
    /// A few numbers, the same for all threads.
    Uniform,
}

/// What a buffer begins with.
pub(crate) enum Contents<'a> {
    /// So many bytes of zeros.
    Zeros(u64),
    /// These bytes, a multiple of four.
    Bytes(&'a [u8]),
}
