//! Viscera's numerical core: from a tetrahedral mesh and a strain energy to a reduced model
//! that answers a touch in microseconds. Numerics only: no files, no Python, no printing.
//!
//! Layers, each using only those above it: [`element`], [`body`], [`contact`], [`equilibrium`], [`series`], [`reduced`], [`galerkin`],
//! [`pgd`]; beside them [`error`], which any of them may use. Below them lie crates, given on here under short names:
//! [`number`], with [`tensor`] and [`simd`]; [`mesh`]; [`linear`], with [`clock`]; [`law`]; and `viscera_touch`, which
//! answers touches on-line.

pub mod body;
pub mod contact;
pub mod element;
pub mod equilibrium;
pub mod error;
pub mod galerkin;
pub mod pgd;
pub mod reduced;
pub mod series;

pub use error::Error;
pub use viscera_law as law;
use viscera_linear::threads;
pub use viscera_linear::{self as linear, clock};
pub use viscera_mesh as mesh;
use viscera_number::unroll;
pub use viscera_number::{self as number, simd, tensor};
