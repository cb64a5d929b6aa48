//! The metadata of a model file, as one JSON object.

use crate::{Error, Notes};
use serde::{Deserialize, Serialize};

/// Newest version of the file format, of models whose norms have a unit of their own.
pub const FORMAT_VERSION: u32 = 4;
/// Version that all other models are written in, for readers from before there was such a unit.
const FORMAT_OF_METRES: u32 = 3;
/// The first version, without checksums. All versions from this one on are read.
pub const UNSEALED_FORMAT: u32 = 1;

/// The only units of a model file.
pub const UNITS: &str = "SI";

/// Origin, settings and measured errors of a reduced model; SI units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// Version of the file format.
    pub format_version: u32,
    /// Version of the package that wrote the file.
    pub package_version: String,
    /// Units of every array: always SI (m, N, Pa).
    pub units: String,
    /// Name of the law.
    pub law: String,
    /// Names of its parameters: the columns of the array `law_parameters`.
    pub law_parameter_names: Vec<String>,
    /// The element of the full organ; files that do not say have linear cells.
    #[serde(default = "linear")]
    pub element: String,
    /// Radius of the contact patch [m].
    pub radius: f64,
    /// Largest displacement [m] of the tool that the model is made for.
    pub depth: f64,
    /// Highest order of the series.
    pub order: usize,
    /// Highest order that is interpolated quadratically between positions.
    pub edge_order: usize,
    /// Compression error asked for: of the field at full depth, relative to it, at the worst
    /// position, root mean square over directions.
    pub tolerance: f64,
    /// Length of the bounding box's diagonal [m].
    pub diagonal: f64,
    /// Errors measured off-line.
    pub errors: Errors,
    /// Errors of interpolation of force and field, measured off-line in units of how far corners and edges disagree
    /// (root mean square over the touches tried): the scale of the estimate of every touch. Not there where orders
    /// are summed as a polynomial, and in files from before it was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpolation_shares: Option<[f64; 2]>,
    /// What the next order of the series changes, measured off-line in units of the last order and of what that changes (root
    /// mean square over the touches tried): the scale of the other part of the estimate. Not there where orders are summed
    /// as a polynomial, at order 8, which has no next one, and in files from before it was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truncation_share: Option<f64>,
    /// Whether both shares are in units that grow near a pole of the Padé form; not in files from before that was seen.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_pole_aware: bool,
    /// Unit of length [m] in `norms`: a Gram matrix of degree k is kept times `norm_length^(2 (k - 1))`. In metres it
    /// would leave single precision in small organs.
    #[serde(default = "metre", skip_serializing_if = "is_metre")]
    pub norm_length: f64,
    /// Off-line time [s].
    pub seconds: f64,
    /// The parameter of the model, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameter: Option<Parameter>,
    /// Anything the writer adds: node sets, provenance.
    pub user: Notes,
}

impl Metadata {
    /// Whether the file that was read had checksums; without them damage goes unnoticed.
    pub fn is_sealed(&self) -> bool {
        self.format_version != UNSEALED_FORMAT
    }

    /// The version of the file format that a model with such norms is written in.
    pub fn version_for(norm_length: f64) -> u32 {
        if is_metre(&norm_length) { FORMAT_OF_METRES } else { FORMAT_VERSION }
    }

    /// Refuses a format that this code does not know.
    pub(super) fn check_version(&self) -> Result<(), Error> {
        match self.format_version {
            UNSEALED_FORMAT..=FORMAT_VERSION => Ok(()),
            other => Err(Error::model_file(format!(
                "format version {other}; this version reads {UNSEALED_FORMAT} to {FORMAT_VERSION}"
            ))),
        }
    }
}

/// The unit of norms that files do not name.
fn metre() -> f64 {
    1.0
}

fn is_metre(length: &f64) -> bool {
    *length == metre()
}

/// The name of the element with linear cells.
fn linear() -> String {
    "P1".to_string()
}

/// A parameter that a model may be set to, within a range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// `radius` of the contact patch [m], or a parameter of the law.
    pub name: String,
    /// Lowest and highest value.
    pub range: [f64; 2],
    /// Whether it is interpolated over its logarithm.
    pub is_logarithmic: bool,
    /// Values that were solved, ascending.
    pub nodes: Vec<f64>,
    /// Value that the model is set to.
    pub value: f64,
}

/// Errors measured while the model was made, relative to the norm of the field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Compression at full depth: worst position, worst of the directions tried.
    pub compression: f64,
    /// Interpolation between positions at half the depth: worst of the points tried.
    pub interpolation_half_depth: f64,
    /// Interpolation between positions at full depth: worst of the points tried.
    pub interpolation: f64,
    /// Between the nodes of the parameter: worst of the values, positions and depths tried, of the force and of what of
    /// the field's error its compression does not explain.
    #[serde(default)]
    pub parameter: f64,
}
