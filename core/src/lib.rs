//! Viscera's numerical core under one name: from a tetrahedral mesh and a strain energy to a reduced model that answers a
//! touch in microseconds. Numerics only: no files, no Python, no printing.
//!
//! The layers are crates, each using only those below it: [`number`], with [`tensor`] and [`simd`]; [`mesh`];
//! [`linear`], with [`clock`]; [`law`]; `viscera_solid` ([`element`], [`body`], [`contact`], [`equilibrium`]);
//! [`series`]; [`pgd`]; [`reduced`], beside `viscera_touch`, which answers touches on-line; [`galerkin`].

pub use viscera_galerkin as galerkin;
pub use viscera_law as law;
pub use viscera_linear::{self as linear, clock};
pub use viscera_mesh as mesh;
pub use viscera_number::{self as number, simd, tensor};
pub use viscera_pgd as pgd;
pub use viscera_reduction as reduced;
pub use viscera_series as series;
pub use viscera_solid::{Error, body, contact, element, equilibrium, error, settings};
