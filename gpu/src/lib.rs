//! Viscera on a graphics processor.
//!
//! Through `wgpu` (Vulkan, Metal, DX12, WebGPU), in WGSL and single precision: stresses and tangents of all cells from a law
//! that comes as a [`Program`], gathered node by node in a fixed order, with what clusters of cells and the caller add;
//! and conjugate gradients whose scalars never leave the device. The same input gives the same bits on the same device, for no sum depends on what runs first.
//!
//! Single precision bounds what a solution alone reaches. The caller forms the residual in double precision and asks
//! again: each answer corrects the last one.

mod cells;
mod clusters;
mod device;
mod error;
mod law;
mod layout;
mod library;
pub mod plan;
mod program;
mod rest;
mod system;

pub use cells::{CellBuffers, Solid, Tangent};
pub use clusters::Clusters;
pub use device::{About, Gpu, traffic};
pub use error::Error;
pub use law::Law;
pub use library::viscera_gpu;
pub use program::{Invariant, Operation, Program, Value};
pub use rest::RestBlock;
pub use system::{Ending, MOST_MEANS, Mean, Settings, Solution, System};
