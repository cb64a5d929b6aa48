//! Bodies of tetrahedra: [`element`]s, the energies, forces and tangents of a [`body`], rigid tools in [`contact`] with
//! it, and its [`equilibrium`] by Newton's method, in statics and frame by frame. Numerics only: no files, no Python,
//! no printing.

pub mod body;
pub mod contact;
pub mod element;
pub mod equilibrium;
pub mod error;
pub mod settings;

pub use error::Error;

use viscera_law as law;
use viscera_linear::{self as linear, clock, threads};
use viscera_mesh as mesh;
use viscera_number::{self as number, simd, tensor, unroll};
