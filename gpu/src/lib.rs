//! Viscera on a graphics processor.
//!
//! It uses WGSL in single precision, through `wgpu` (Vulkan, Metal, DX12) or the WebGPU of a page. Kernels evaluate
//! stresses and tangents of all cells from a law that is given as a [`Program`], and sum them node by node in a fixed
//! order, with blocks of clusters and of the caller. Conjugate gradients keep their scalars on the device. On one device
//! the same input gives the same bits, since no sum depends on the order in which threads run.
//!
//! Single precision limits the accuracy of one solution. The caller computes the residual in double precision and
//! solves again: each solution corrects the last one.

mod border;
mod buffers;
mod cells;
mod clusters;
mod commands;
mod conjugate_gradients;
mod device;
mod driver;
mod error;
mod gathered;
mod law;
mod layout;
mod library;
pub mod plan;
mod program;
mod rest;
mod series;
mod solve;
mod system;
mod tangent;
mod vectors;

pub use border::{MOST_MEANS, Mean};
pub use cells::{CellBuffers, Solid};
pub use clusters::Clusters;
pub use commands::traffic;
pub use conjugate_gradients::{Ending, Settings, Solution};
pub use device::Gpu;
pub use driver::About;
pub use error::Error;
pub use law::Law;
pub use library::viscera_gpu;
pub use program::{Invariant, Operation, Program, Value};
pub use rest::RestBlock;
pub use series::{Dilatation, SERIES_LANES, SeriesBuffers};
pub use system::System;
pub use tangent::Tangent;
