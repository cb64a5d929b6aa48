//! Viscera's numerical core: from a tetrahedral mesh and a strain energy to a reduced model
//! that answers a touch in microseconds. Numerics only: no files, no Python, no printing.
//!
//! Layers, each using only those above it: [`number`], [`tensor`], [`law`], [`mesh`],
//! [`element`], [`body`], [`linear`], [`equilibrium`], [`series`], [`reduced`], [`galerkin`], [`pgd`];
//! beside them [`error`], [`simd`], [`clock`] and `threads`, which any of them may use.
//!
//! Without the feature `solvers` only what answers a touch on-line is compiled: a page needs no more.

#[cfg(feature = "solvers")]
pub mod body;
#[cfg(feature = "solvers")]
pub mod clock;
pub mod element;
#[cfg(feature = "solvers")]
pub mod equilibrium;
pub mod error;
#[cfg(feature = "solvers")]
pub mod galerkin;
#[cfg(feature = "solvers")]
pub mod law;
#[cfg(feature = "solvers")]
pub mod linear;
pub mod mesh;
pub mod number;
#[cfg(feature = "solvers")]
pub mod pgd;
pub mod reduced;
#[cfg(feature = "solvers")]
pub mod series;
pub mod simd;
pub mod tensor;
#[cfg(feature = "solvers")]
mod threads;
mod unroll;

pub use error::Error;
