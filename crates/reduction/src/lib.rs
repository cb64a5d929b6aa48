//! The reduced model: every touch of a surface, solved off-line, answered on-line in microseconds.
//!
//! Off-line ([`Reduction`]): for every position of the touchable surface the series of `viscera_series` is solved
//! exactly, and only then compressed. Truncation inside the recursion would spoil the result, since each order is built
//! from all lower ones. The result answers touches on-line in the crate `viscera_touch`, whose names this module
//! exports too.

mod assemble;
mod attend;
mod basis;
mod batch;
mod build;
mod columns;
mod comparison;
mod correction;
mod departure;
mod measure;
mod memory;
mod positions;
mod preload;
mod recompress;
mod refused;
mod region;
mod rest;
mod second_order;
mod settings;
mod solve;
#[cfg(test)]
mod tests;

pub use batch::Batches;

pub use recompress::{recompressed, recompressed_while};
pub use refused::refused;
pub use settings::{Family, Member, Progress, Reduction};
pub use viscera_touch::{
    Answer, Answers, Arrays, Beside, CONTACT_ERROR, Contact, Coupling, Decisive, Errors, Felt,
    Grip, Metadata, Notes, Parameter, Probe, ProbeGroup, RADII, ReducedModel, TOLERANCE, Trust,
    View, allowance,
};

#[cfg(test)]
use viscera_law as law;
use viscera_linear::{self as linear, clock};
use viscera_mesh as mesh;
use viscera_number as number;
use viscera_series as series;
#[cfg(test)]
use viscera_solid::element;
use viscera_solid::{body, equilibrium, error};
