//! A case stepped in real time for a page: the organ under one or two laws, with the same hands and the same gravity.
//!
//! The page sends one JSON object for each frame it wants, and gets the frame as little-endian float32: `[bodies, then
//! for each: force x y z [N], residual, part of the step taken, unstable (0 or 1), milliseconds, relative change of
//! volume, settled (0 or 1), cells at a bound, Newton iterations, force x y z of the second hand [N], displacement of
//! the surface nodes (3 s) [m], and where it is asked for their von Mises stress (s) [Pa]]`. A frame iterates until it
//! has settled or its 8 ms are spent; two bodies share this time. A force that has not settled cannot be relied on. A
//! request that cannot be read is answered by a sentence, and changes nothing.
//!
//! ```json
//! {"laws": ["NeoHookean", "Linear"]}   the laws, one or two; both start from rest
//! {"release": true}                    let go
//! {"grab": [x, y, z]}                  take hold of the surface at a point at rest [m]
//! {"move": [x, y, z]}                  displacement of the hand [m]
//! {"second": {"grab": ..., ...}}       the same words for a second hand
//! {"gravity": [x, y, z]}               acceleration [m/s^2]
//! {"stress": true}                     frames carry the stress from now on
//! {}                                   another frame
//! ```
//!
//! The entries of a request are carried out in this order. `viscera view` steps on its server through the Python
//! extension, and small organs in the page itself through `bindings/wasm`: both run what is here.

mod case;
mod request;
mod specimen;
mod stage;
mod stress;
#[cfg(test)]
mod tests;

pub use case::{About, Case};
pub use stage::Live;
pub use viscera_core::equilibrium::OnDevice;
