//! The asymptotic numerical method: equilibrium as power series that share one tangent operator.
//!
//! Along a load path ([`Continuation`], paper A with its vector Pade form) and in the displacement of a
//! contact ([`TouchExpansion`]).

mod path;
mod touch;

pub use crate::number::Pade;
pub use path::{Continuation, Expansion, Parameter};
pub use touch::{Fields, SeriesDevice, TouchExpansion, TouchSeries};

#[cfg(test)]
use viscera_law as law;
use viscera_linear as linear;
use viscera_mesh as mesh;
use viscera_number::{self as number, tensor, unroll};
use viscera_solid::{body, equilibrium, error};
