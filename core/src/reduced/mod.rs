//! The reduced model: every touch of a surface, solved off-line, answered on-line in microseconds.
//!
//! Off-line ([`Reduction`]): for every position of the touchable surface the series of
//! `crate::series` is solved exactly, and only then compressed (truncating inside the recursion is
//! ruinous: each order is built from all lower ones). On-line ([`ReducedModel`]): a polynomial in the tool's displacement,
//! interpolated over the surface triangle touched. `model.rs`, `file.rs`, `evaluate.rs` and what it uses know
//! nothing of finite elements.

#[cfg(feature = "solvers")]
mod assemble;
#[cfg(feature = "solvers")]
mod attend;
#[cfg(feature = "solvers")]
mod basis;
#[cfg(feature = "solvers")]
mod batch;
#[cfg(feature = "solvers")]
mod build;
mod check;
mod checksum;
mod combine;
mod evaluate;
mod family;
#[cfg(feature = "solvers")]
mod fields;
mod file;
mod interpolation;
#[cfg(feature = "solvers")]
mod measure;
mod metadata;
mod model;
#[cfg(feature = "solvers")]
mod positions;
#[cfg(feature = "solvers")]
mod preload;
#[cfg(feature = "solvers")]
mod recompress;
#[cfg(feature = "solvers")]
mod region;
mod resummation;
#[cfg(feature = "solvers")]
mod solve;
mod surface;
#[cfg(all(test, feature = "solvers"))]
mod tests;

#[cfg(feature = "solvers")]
pub use batch::Batches;
#[cfg(feature = "solvers")]
pub use build::{Family, Member, Progress, Reduction};
pub use evaluate::{Contact, Response, Trust, allowance};
pub use file::View;
pub use metadata::{Errors, Metadata, Parameter};
pub use model::{Answers, Arrays, ReducedModel};
