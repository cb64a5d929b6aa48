//! Settings of a reduction, and its progress.

use crate::body::Body;
use crate::series::SeriesDevice;
use std::sync::Arc;
use viscera_touch::{Notes, Parameter};

/// The largest estimate of a square that is kept in metres; single precision ends at 3e38.
const LARGEST_IN_METRES: f64 = 1e22;

/// Settings of a reduction.
#[derive(Clone, Debug)]
pub struct Reduction {
    /// Nodes of the touchable surface.
    pub touchable: Vec<u32>,
    /// Radius of the contact patch [m].
    pub radius: f64,
    /// Largest displacement of the tool [m].
    pub depth: f64,
    /// Highest order of the series, 2 to 8.
    pub order: usize,
    /// Compression error of the field at full depth, relative to it, at the worst position, root
    /// mean square over directions.
    pub tolerance: f64,
    /// Whether the orders are summed in their Padé form, from order 3 on, or as a polynomial.
    pub pade: bool,
    /// What the regions in progress may take [bytes]: their fields, and the blocks of positions that are being expanded.
    /// The body with its factor and the modes that are finished come on top.
    pub memory: f64,
    /// Displacement of the loaded equilibrium that touches start from, three values for each
    /// node [m]; its dead load stays. Empty: touches start from rest.
    pub preload: Vec<f64>,
    /// Where the internal force is expanded, if not on the processor.
    pub device: Option<Arc<SeriesDevice>>,
    /// Kept in the metadata.
    pub user: Notes,
}

impl Reduction {
    /// Unit of length [m] of the norms: metres, unless a square of the highest order P may then leave single precision.
    /// It is about `radius^(-2 (P - 1))`, and larger where the series converges less far than that.
    pub(super) fn norm_length(&self) -> f64 {
        let largest = self.radius.powi(-2 * (self.order as i32 - 1));
        if largest < LARGEST_IN_METRES { 1.0 } else { self.radius }
    }
}

/// The organ and the radius of the contact patch at one value of a parameter.
#[derive(Clone, Copy)]
pub struct Member<'a> {
    /// Mesh and law; the mesh is the same for all.
    pub body: &'a Body,
    /// Radius of the contact patch [m].
    pub radius: f64,
}

/// A range of a parameter that one model covers.
pub struct Family<'a> {
    /// The parameter, its nodes, and the value of the organ that is reduced.
    pub parameter: Parameter,
    /// Cells whose law it changes; none for all.
    pub cells: Vec<u32>,
    /// At each node.
    pub members: Vec<Member<'a>>,
    /// At other values, where the model is measured.
    pub unseen: Vec<(f64, Member<'a>)>,
}

/// Progress of a reduction.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Positions solved and compressed.
    pub done: usize,
    /// All positions.
    pub total: usize,
    /// What is being done.
    pub stage: &'static str,
}
