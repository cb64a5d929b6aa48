//! Viscera's numerical core: from a tetrahedral mesh and a strain energy to a reduced model
//! that answers a touch in microseconds. Numerics only: no files, no Python, no printing.
//!
//! Layers, each using only those above it: [`number`], [`tensor`], [`law`], [`mesh`],
//! [`element`], [`body`], [`linear`], [`equilibrium`], [`series`], [`reduced`], [`pgd`].

pub mod body;
pub mod element;
pub mod equilibrium;
pub mod error;
pub mod law;
pub mod linear;
pub mod mesh;
pub mod number;
pub mod pgd;
pub mod reduced;
pub mod series;
pub mod simd;
pub mod tensor;

pub use error::Error;
