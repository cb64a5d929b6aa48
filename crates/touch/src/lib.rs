//! The on-line evaluator: a reduced model, read from its file and checked, answers a touch in microseconds.
//!
//! An answer is a polynomial in the tool's displacement, or its Padé form, interpolated over the surface triangle
//! touched. It takes memory that the caller owns and a fixed number of operations: no allocation, no lock, no system
//! call, no panic. Nothing here depends on finite elements; `viscera_core::reduced` makes the models.

mod around;
mod arrays;
mod balance;
mod check;
mod checksum;
mod combine;
mod contact;
mod departure;
mod energy;
mod error;
mod estimates;
mod evaluate;
mod family;
mod felt;
mod fields;
mod file;
mod forms;
mod ground;
mod interpolation;
mod metadata;
mod model;
mod notes;
mod places;
mod press;
mod probe;
mod probe_group;
mod resummation;
mod return_mapping;
mod skin;
mod supports;
mod surface;
mod walk;
mod worth;

pub use arrays::{Answers, Arrays};
pub use contact::Contact;
pub use departure::{DIRECTIONS, directions};
pub use error::Error;
pub use estimates::truncation_share;
pub use evaluate::{Answer, Trust, allowance};
pub use felt::{Beside, Decisive, Felt, Grip};
pub use file::{View, to_bytes};
pub use forms::{Cubic, N_CUBIC, cubic_index};
pub use metadata::{Errors, FORMAT_VERSION, Metadata, Parameter, UNITS};
pub use model::ReducedModel;
pub use notes::Notes;
pub use places::Places;
pub use press::CONTACT_ERROR;
pub use probe::{Coupling, Probe, RADII, TOLERANCE};
pub use probe_group::ProbeGroup;
pub use resummation::{MAX_ORDER, SKETCH, pade_weights};
