//! Several touches at once: equilibrium in the span of the series fields of all contacts, on a few weighted cells.
//!
//! When tools take hold ([`Galerkin::grasp`]), the fields of their series and of their coupling become a basis. If
//! wanted, snapshots of the whole body add what these fields do not contain. A few cells get weights `w_e >= 0` that
//! integrate the forces best (energy-conserving sampling and weighting, Farhat, Avery, Chapman and Cortial, IJNME 98
//! (2014) 625). On-line ([`HyperReducedModel::solve`]) the reduced energy
//!   W(q) = sum_e w_e V_e psi(F_e(q))   under   A q = d
//! is minimised by Newton's method. Forces are its gradient and tangents are symmetric for any weights.

mod background;
mod balance;
mod basis;
mod broyden;
mod cells;
mod contacts;
mod coupling;
mod factor;
mod forces;
mod guesses;
mod hyper_reduced;
mod load_steps;
mod model;
mod newton;
mod nnls;
mod origin;
mod panels;
mod reduced_energy;
mod sampled;
mod sketch;
mod snapshots;
mod solution;
mod solvers;
mod starts;
mod subspace;
#[cfg(test)]
mod tests;
mod trained;
mod training;
mod units;
mod weighted_cells;

pub use balance::UNBALANCED;
pub use contacts::ReducedContacts;
pub use hyper_reduced::{Asked, HyperReducedModel};
pub use model::{Galerkin, Sampling};
pub use newton::ReducedStatus;
pub use solution::{Assessment, Solution, Trust};

use viscera_law as law;
use viscera_linear::{self as linear, clock, threads};
use viscera_mesh as mesh;
use viscera_number::{self as number, simd, tensor, unroll};
use viscera_reduction as reduced;
use viscera_solid::{body, element, equilibrium, error};
