//! Solved regions, kept outside the core while others are still being solved. An interrupted or killed reduction
//! continues from them.

use super::region::Region;
use super::second_order::Forms;
use crate::error::Error;
use serde::{Deserialize, Serialize};

/// A store of finished batches of positions, each as bytes that only the core can read.
///
/// The bytes belong to one body, one [`Reduction`](super::Reduction) and one version of the core. The store must ensure
/// this, and that they are undamaged.
pub trait Batches {
    /// Batches kept by an earlier run of the same reduction; none stops this one.
    fn finished(&mut self) -> Option<Vec<Vec<u8>>>;
    /// Keeps a batch; false stops the reduction.
    fn keep(&mut self, batch: &[u8]) -> bool;
}

/// Keeps nothing.
pub(super) struct Nowhere;

impl Batches for Nowhere {
    fn finished(&mut self) -> Option<Vec<Vec<u8>>> {
        Some(Vec::new())
    }

    fn keep(&mut self, _: &[u8]) -> bool {
        true
    }
}

/// What a region's task returns.
#[derive(Deserialize, Serialize)]
pub(super) struct Solved {
    pub region: Region,
    pub positions: Vec<u32>,
    pub edges: Vec<u32>,
    /// Of each member.
    pub answers: Vec<Answered>,
}

/// The answers of one member in a region, except its fields.
#[derive(Deserialize, Serialize)]
pub(super) struct Answered {
    pub force: Vec<Vec<[f64; 3]>>,
    pub edge_force: Vec<Vec<[f64; 3]>>,
    pub compliance: Vec<[f64; 9]>,
    /// By edge.
    pub cross_compliance: Vec<[f64; 9]>,
    /// Empty if the orders are summed as a polynomial.
    pub sketches: Vec<Vec<f32>>,
    pub norms: Vec<Vec<f32>>,
    pub forms: Forms,
}

impl Solved {
    /// Whether single precision holds everything that is kept in it.
    pub(super) fn is_finite(&self) -> bool {
        let kept = self.answers.iter().flat_map(|own| own.sketches.iter().chain(&own.norms));
        let modes =
            self.region.members.iter().flat_map(|own| own.positions.iter().chain(&own.edges));
        kept.chain(modes).flatten().all(|value| value.is_finite())
    }

    pub(super) fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        postcard::to_stdvec(self)
            .map_err(|error| Error::input(format!("a finished batch could not be kept: {error}")))
    }

    /// The batch and the number of its region; none if the bytes belong to none of the `regions`.
    pub(super) fn from_bytes(bytes: &[u8], regions: &[Vec<u32>]) -> Option<(usize, Solved)> {
        let solved: Solved = postcard::from_bytes(bytes).ok()?;
        let region = regions.iter().position(|region| *region == solved.positions)?;
        Some((region, solved))
    }
}
