//! Paper A's own model: a load of given size, normal to the surface, at any position `s`.
//!
//! The displacement is a series in the load factor `a` whose terms are sums of products,
//!   u(x, s, a) = sum_{p=1}^{N} a^p u_p(x, s),   u_p(x, s) = sum_i F_i^p(x) G_i^p(s),
//! and all orders and positions share the tangent of the rest state ([`Pgd`]). A term is built pair by
//! pair in alternating directions ([`Enrichment`]), or exactly, position by position, to compare with.

mod enrichment;
mod loads;
mod newton;
mod separated;
mod series;
#[cfg(test)]
mod tests;

pub use enrichment::Enrichment;
pub use loads::Loads;
pub use newton::{PlainNewton, Reached};
pub use separated::Separated;
pub use series::{Order, Pgd, Progress, Route};

#[cfg(test)]
use viscera_law as law;
use viscera_linear::clock;
use viscera_mesh as mesh;
use viscera_number as number;
#[cfg(test)]
use viscera_number::{tensor, unroll};
#[cfg(test)]
use viscera_solid::element;
use viscera_solid::{body, equilibrium, error, settings};
