//! Equilibrium: find `u` with `f_int(u) = f_ext`, some of its components and weighted means
//! prescribed.

mod newton;
mod problem;
mod system;
#[cfg(test)]
mod tests;

pub use newton::{Equilibrium, Newton, Seconds, Status};
pub use problem::{PatchLoad, Problem};
pub use system::{System, patch_mean};
