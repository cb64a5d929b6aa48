//! Several touches at once: equilibrium in the span of what the series knows of each, on a few weighted cells.
//!
//! When tools take hold ([`Galerkin::grasp`]) the fields of their series and of their coupling become a basis, if
//! wanted with what some snapshots of the whole body have beyond them; and few cells get the weights `w_e >= 0` that integrate its forces best (energy-conserving sampling and weighting, Farhat,
//! Avery, Chapman and Cortial, IJNME 98 (2014) 625). On-line ([`Grasp::solve`]) the reduced energy
//!   W(q) = sum_e w_e V_e psi(F_e(q))   under   A q = d
//! is minimised by Newton's method: forces are its gradient, tangents symmetric, whatever the weights.

mod basis;
mod cells;
mod coupling;
mod factor;
mod forces;
mod grasp;
mod guesses;
mod hold;
mod lessons;
mod model;
mod nnls;
mod origin;
mod panels;
mod pieces;
mod sample;
mod sampled;
mod secants;
mod sketch;
mod snapshots;
mod solver;
mod starts;
mod subspace;
#[cfg(test)]
mod tests;
mod training;

pub use grasp::{Grasp, Solution};
pub use hold::{Assessment, Hold, Trust};
pub use model::{Galerkin, Sampling};
pub use solver::Status;
