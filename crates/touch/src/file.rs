//! Model file: safetensors bytes with the metadata as one JSON string (docs/model-file.md).

use super::arrays::Arrays;
use super::checksum::Checksums;
use super::departure::DIRECTIONS;
use super::forms::N_CUBIC;
use super::metadata::Metadata;
use super::model::ReducedModel;
use super::resummation::SKETCH;
use crate::Error;
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};

/// Key of the metadata string in the file's header.
const METADATA_KEY: &str = "viscera";
/// Whether an array is optional: written, and required, only if it is not empty.
fn is_optional(name: &str) -> bool {
    let optional = [
        "preload",
        "edge_energy",
        "triangle_energy",
        "sketch",
        "linear_compression",
        "departure",
        "parameter_cells",
    ];
    optional.contains(&name) || name.starts_with("family_") || name.starts_with("tie_")
}

/// A number type with a fixed little-endian form.
trait Stored: Copy {
    const DTYPE: Dtype;
    const SIZE: usize;
    fn read(bytes: &[u8]) -> Self;
    fn write(self, out: &mut Vec<u8>);
}

macro_rules! stored {
    ($($type:ty, $dtype:ident;)*) => {$(
        impl Stored for $type {
            const DTYPE: Dtype = Dtype::$dtype;
            const SIZE: usize = size_of::<$type>();
            fn read(bytes: &[u8]) -> Self {
                let mut buffer = [0; size_of::<$type>()];
                buffer.copy_from_slice(bytes);
                <$type>::from_le_bytes(buffer)
            }
            fn write(self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
stored! { f64, F64; f32, F32; u32, U32; i16, I16; }

/// Applies a macro to every array: its name, where it is, and the number of its columns.
macro_rules! for_each_array {
    ($apply:ident) => {
        $apply!("points", points, 3);
        $apply!("preload", preload, 3);
        $apply!("cells", cells, 4);
        $apply!("fixed", fixed, 1);
        $apply!("tie_start", tie_start, 1);
        $apply!("tie_nodes", tie_nodes, 1);
        $apply!("tie_weights", tie_weights, 1);
        $apply!("tie_stiffness", tie_stiffness, 9);
        $apply!("law_parameters", law_parameters, 1);
        $apply!("surface", surface, 3);
        $apply!("surface_nodes", surface_nodes, 1);
        $apply!("positions", positions, 1);
        $apply!("touchable", touchable, 3);
        $apply!("edges", edges, 2);
        $apply!("triangle_edges", triangle_edges, 3);
        $apply!("patch_start", patch_start, 1);
        $apply!("patch_nodes", patch_nodes, 1);
        $apply!("patch_weights", patch_weights, 1);
        $apply!("compliance", answers.compliance, 9);
        $apply!("cross_compliance", answers.cross_compliance, 9);
        $apply!("force", answers.force, 3);
        $apply!("edge_force", answers.edge_force, 3);
        $apply!("edge_energy", answers.edge_energy, N_CUBIC);
        $apply!("triangle_energy", answers.triangle_energy, N_CUBIC);
        $apply!("sketch", answers.sketch, SKETCH);
        $apply!("norms", answers.norms, 1);
        $apply!("compression", answers.compression, 1);
        $apply!("linear_compression", answers.linear_compression, 1);
        $apply!("departure", answers.departure, DIRECTIONS);
        $apply!("position_region", position_region, 1);
        $apply!("edge_region", edge_region, 1);
        $apply!("region_start", region_start, 1);
        $apply!("mode_scale", mode_scale, 1);
        $apply!("surface_modes", surface_modes, 3);
        $apply!("interior_modes", interior_modes, 3);
        $apply!("position_coefficients", answers.position_coefficients, 1);
        $apply!("edge_coefficients", answers.edge_coefficients, 1);
        $apply!("parameter_cells", parameter_cells, 1);
        $apply!("family_compliance", family.compliance, 9);
        $apply!("family_cross_compliance", family.cross_compliance, 9);
        $apply!("family_force", family.force, 3);
        $apply!("family_edge_force", family.edge_force, 3);
        $apply!("family_edge_energy", family.edge_energy, N_CUBIC);
        $apply!("family_triangle_energy", family.triangle_energy, N_CUBIC);
        $apply!("family_sketch", family.sketch, SKETCH);
        $apply!("family_norms", family.norms, 1);
        $apply!("family_compression", family.compression, 1);
        $apply!("family_linear_compression", family.linear_compression, 1);
        $apply!("family_departure", family.departure, DIRECTIONS);
        $apply!("family_position_coefficients", family.position_coefficients, 1);
        $apply!("family_edge_coefficients", family.edge_coefficients, 1);
    };
}

/// A view of an array with its number of columns.
pub enum View<'a> {
    /// Double precision.
    F64(&'a [f64], usize),
    /// Single precision.
    F32(&'a [f32], usize),
    /// Indices.
    U32(&'a [u32], usize),
    /// Quantised modes.
    I16(&'a [i16], usize),
}

macro_rules! view {
    ($($type:ty, $variant:ident;)*) => {$(
        impl<'a> From<(&'a [$type], usize)> for View<'a> {
            fn from((values, columns): (&'a [$type], usize)) -> Self {
                View::$variant(values, columns)
            }
        }
    )*};
}
view! { f64, F64; f32, F32; u32, U32; i16, I16; }

impl ReducedModel {
    /// An array by its name in the file.
    pub fn array(&self, wanted: &str) -> Option<View<'_>> {
        macro_rules! find {
            ($name:literal, $($place:ident).+, $columns:expr) => {
                if wanted == $name {
                    return Some((&self.arrays.$($place).+[..], $columns).into());
                }
            };
        }
        for_each_array!(find);
        None
    }

    /// The model file, in the present format and with checksums, whatever it was read from.
    ///
    /// # Errors
    /// Metadata that cannot be written as JSON.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        to_bytes(&self.metadata, &self.arrays)
    }

    /// Reads a model file, checking everything before anything is used.
    ///
    /// # Errors
    /// [`Error::ModelFile`]: cut short, not a safetensors file, a checksum that differs, an array
    /// missing, of another type or of a wrong shape, an index out of range, a value that is not
    /// finite.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let tensors = SafeTensors::deserialize(bytes).map_err(broken)?;
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(broken)?;
        let text =
            header.metadata().as_ref().and_then(|map| map.get(METADATA_KEY)).ok_or_else(|| {
                Error::ModelFile(format!("its header has no {METADATA_KEY:?} entry"))
            })?;
        let metadata: Metadata = serde_json::from_str(text)
            .map_err(|e| Error::ModelFile(format!("metadata is damaged: {e}")))?;
        metadata.check_version()?;
        if metadata.is_sealed() || Checksums::are_in(text) {
            Checksums::read(text)?.check(&tensors)?;
        }
        let mut arrays = Arrays::default();
        macro_rules! decode {
            ($name:literal, $($place:ident).+, $columns:expr) => {
                arrays.$($place).+ = decode(&tensors, $name, $columns)?;
            };
        }
        for_each_array!(decode);
        ReducedModel::new(metadata, arrays)
    }
}

/// The model file of metadata and arrays that have not been checked; reading checks them.
///
/// # Errors
/// Metadata that cannot be written as JSON.
pub fn to_bytes(metadata: &Metadata, arrays: &Arrays) -> Result<Vec<u8>, Error> {
    let mut encoded: Vec<(&str, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
    macro_rules! encode {
        ($name:literal, $($place:ident).+, $columns:expr) => {
            if !arrays.$($place).+.is_empty() || !is_optional($name) {
                encoded.push(encode($name, &arrays.$($place).+, $columns));
            }
        };
    }
    for_each_array!(encode);
    let mut checksums = Checksums::default();
    let views = encoded
        .iter()
        .map(|(name, dtype, shape, bytes)| {
            checksums.add(name, bytes);
            Ok((*name, TensorView::new(*dtype, shape.clone(), bytes).map_err(broken)?))
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let format_version = Metadata::version_for(metadata.norm_length);
    let metadata = Metadata { format_version, ..metadata.clone() };
    let text = serde_json::to_string(&metadata)
        .map_err(|e| Error::ModelFile(format!("metadata cannot be written: {e}")))?;
    let header = [(METADATA_KEY.to_string(), checksums.sealed(&text))].into_iter().collect();
    serialize(views, Some(header)).map_err(broken)
}

fn encode<'a, T: Stored>(
    name: &'a str,
    values: &[T],
    columns: usize,
) -> (&'a str, Dtype, Vec<usize>, Vec<u8>) {
    let mut bytes = Vec::with_capacity(T::SIZE * values.len());
    values.iter().for_each(|v| v.write(&mut bytes));
    let shape =
        if columns == 1 { vec![values.len()] } else { vec![values.len() / columns, columns] };
    (name, T::DTYPE, shape, bytes)
}

fn decode<T: Stored>(tensors: &SafeTensors, name: &str, columns: usize) -> Result<Vec<T>, Error> {
    let tensor = match tensors.tensor(name) {
        Ok(tensor) => tensor,
        Err(_) if is_optional(name) => return Ok(Vec::new()),
        Err(_) => return Err(Error::ModelFile(format!("array {name} is missing"))),
    };
    if tensor.dtype() != T::DTYPE {
        return Err(Error::ModelFile(format!(
            "array {name} holds {:?} instead of {:?}",
            tensor.dtype(),
            T::DTYPE
        )));
    }
    let expected = if columns == 1 { 1 } else { 2 };
    if tensor.shape().len() != expected || tensor.shape()[1..] != [columns][..expected - 1] {
        return Err(Error::ModelFile(format!(
            "array {name} has shape {:?}; it needs {expected} axes{}",
            tensor.shape(),
            if columns == 1 { String::new() } else { format!(" and {columns} columns") }
        )));
    }
    Ok(tensor.data().chunks_exact(T::SIZE).map(T::read).collect())
}

fn broken(error: safetensors::SafeTensorError) -> Error {
    Error::ModelFile(format!("{error}; it may be cut short or of another kind"))
}
