//! Fewer modes for an existing model: its regions are compressed again, from the stored fields.
//!
//! The stored modes D of a region are made orthonormal, D = Q R; R times the stored amplitudes are
//! then its fields' coordinates in Q, and of them the fewest principal directions are kept, as
//! off-line (`region.rs`). Forces, stiffness and their error estimate are kept as they are.

use super::refused::refused;
use super::region::{Amplitudes, Exact, Region, compress_again, decode};
use crate::error::Error;
use faer::Mat;
use rayon::prelude::*;
use viscera_touch::{Answers, Arrays, Metadata, ReducedModel};

/// The model with the fewest modes whose fields differ from the present ones by less than
/// `tolerance` at full depth, relative to them, at the worst position, root mean square over
/// directions; the loss is added to the stored compression errors.
///
/// # Errors
/// A tolerance that is not between 0 and 1; a decomposition that does not converge.
pub fn recompressed(model: &ReducedModel, tolerance: f64) -> Result<ReducedModel, Error> {
    recompressed_while(model, tolerance, &|| true)
}

/// The same, as long as it is wanted, which is asked at each step of each region.
///
/// # Errors
/// Those of [`recompressed`]; [`Error::Cancelled`].
pub fn recompressed_while(
    model: &ReducedModel,
    tolerance: f64,
    is_wanted: &(dyn Fn() -> bool + Sync),
) -> Result<ReducedModel, Error> {
    if !(tolerance > 0.0 && tolerance < 1.0) {
        return Err(Error::input(format!(
            "tolerance = {tolerance}; it must be above 0 and below 1"
        )));
    }
    let regions = (0..model.arrays().region_start.len() as u32 - 1)
        .into_par_iter()
        .map(|region| {
            wanted(is_wanted)?;
            Stored::new(model, region).compressed(tolerance, is_wanted)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let arrays = with_modes(model, &regions, tolerance as f32);
    let mut metadata = model.metadata().clone();
    metadata.tolerance = (metadata.tolerance + tolerance).min(1.0);
    metadata.errors.compression = worst_compression(answers(&metadata, &arrays).0);
    let parameter = metadata.parameter.as_ref().map(|parameter| parameter.value);
    let mut model = ReducedModel::new(metadata, arrays).map_err(refused)?;
    if let Some(value) = parameter {
        model.set_parameter(value).map_err(refused)?;
    }
    Ok(model)
}

fn wanted(is_wanted: &(dyn Fn() -> bool + Sync)) -> Result<(), Error> {
    if is_wanted() { Ok(()) } else { Err(Error::Cancelled) }
}

/// Answers at each node of a parameter, or the only ones; and their number.
fn answers<'a>(metadata: &Metadata, arrays: &'a Arrays) -> (&'a Answers, usize) {
    match &metadata.parameter {
        Some(parameter) => (&arrays.family, parameter.nodes.len()),
        None => (&arrays.answers, 1),
    }
}

/// The arrays with other modes, and the amplitudes that belong to them.
fn with_modes(model: &ReducedModel, regions: &[Region], tolerance: f32) -> Arrays {
    let a = model.arrays();
    let mut arrays = Arrays {
        region_start: vec![0],
        mode_scale: Vec::new(),
        surface_modes: Vec::new(),
        interior_modes: Vec::new(),
        ..a.clone()
    };
    for region in regions {
        arrays.mode_scale.extend(&region.scales);
        arrays.region_start.push(arrays.mode_scale.len() as u32);
        for mode in region.modes.chunks_exact(a.points.len()) {
            let (surface, interior) = mode.split_at(3 * a.surface_nodes.len());
            arrays.surface_modes.extend(surface);
            arrays.interior_modes.extend(interior);
        }
    }
    arrays.answers = with_amplitudes(a, &a.answers, regions, 1, tolerance);
    if let (_, members @ 2..) = answers(model.metadata(), a) {
        arrays.family = with_amplitudes(a, &a.family, regions, members, tolerance);
    }
    arrays
}

/// The answers of some members, with new amplitudes and what these lose in addition.
fn with_amplitudes(
    a: &Arrays,
    answers: &Answers,
    regions: &[Region],
    members: usize,
    tolerance: f32,
) -> Answers {
    let mut all = Answers {
        position_coefficients: Vec::new(),
        edge_coefficients: Vec::new(),
        ..answers.clone()
    };
    all.linear_compression.resize(all.compression.len(), 0.0);
    for j in 0..members {
        let mut next = vec![0; regions.len()];
        for (p, &region) in a.position_region.iter().enumerate() {
            let Amplitudes { positions, errors, linear_errors, .. } =
                &regions[region as usize].members[j];
            let (k, place) = (next[region as usize], j * a.positions.len() + p);
            all.position_coefficients.extend(&positions[k]);
            // Edges may lose the tolerance where their ends lose less.
            all.compression[place] += errors[k].max(tolerance);
            all.linear_compression[place] += linear_errors[k];
            next[region as usize] += 1;
        }
        next.fill(0);
        for &region in &a.edge_region {
            let edges = &regions[region as usize].members[j].edges;
            all.edge_coefficients.extend(&edges[next[region as usize]]);
            next[region as usize] += 1;
        }
    }
    all
}

fn worst_compression(answers: &Answers) -> f64 {
    let largest = |worst: f64, &error: &f32| worst.max(f64::from(error));
    answers.compression.iter().fold(0.0, largest)
}

/// A region as it is stored.
struct Stored<'a> {
    model: &'a ReducedModel,
    region: u32,
    /// Modes as columns: surface nodes, then those inside [m].
    modes: Mat<f64>,
}

impl<'a> Stored<'a> {
    fn new(model: &'a ReducedModel, region: u32) -> Self {
        let a = model.arrays();
        let range = model.region_modes(region);
        let scales = &a.mode_scale[range.clone()];
        let part = |modes: &[i16], rows: usize| {
            decode(&modes[range.start * rows..range.end * rows], scales, rows)
        };
        let n_surface = 3 * a.surface_nodes.len();
        let surface = part(&a.surface_modes, n_surface);
        let interior = part(&a.interior_modes, a.points.len() - n_surface);
        let modes = Mat::from_fn(a.points.len(), scales.len(), |i, m| {
            if i < n_surface { surface[(i, m)] } else { interior[(i - n_surface, m)] }
        });
        Stored { model, region, modes }
    }

    fn compressed(
        &self,
        tolerance: f64,
        is_wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Region, Error> {
        let model = self.model;
        if self.modes.ncols() == 0 {
            return Err(Error::input(format!("region {} has no modes to keep", self.region)));
        }
        let orthonormal = self.modes.qr();
        wanted(is_wanted)?;
        let (basis, lengths) = (orthonormal.compute_thin_Q(), orthonormal.thin_R().to_owned());
        wanted(is_wanted)?;
        let (answers, members) = answers(model.metadata(), model.arrays());
        let a = model.arrays();
        let fields: Vec<[Vec<Mat<f64>>; 2]> = (0..members)
            .map(|j| {
                let of = |regions: &[u32], offsets: &[usize], coefficients: &[f32]| {
                    let start = j * offsets[regions.len()];
                    let ours = (0..regions.len()).filter(|&k| regions[k] == self.region);
                    let rows = ours.map(|k| start + offsets[k]..start + offsets[k + 1]);
                    rows.map(|rows| coordinates(&lengths, &coefficients[rows])).collect()
                };
                [
                    of(
                        &a.position_region,
                        model.position_offsets(),
                        &answers.position_coefficients,
                    ),
                    of(&a.edge_region, model.edge_offsets(), &answers.edge_coefficients),
                ]
            })
            .collect();
        let exact = fields.iter().map(|[positions, edges]| Exact {
            exponents: model.exponents(),
            edge_terms: model.edge_terms(),
            depth: model.metadata().depth,
            positions: positions.iter().map(Mat::as_ref).collect(),
            edges: edges.iter().map(Mat::as_ref).collect(),
        });
        wanted(is_wanted)?;
        compress_again(&exact.collect::<Vec<_>>(), basis.as_ref(), tolerance)
    }
}

/// Rows of stored amplitudes, a term each, as coordinates in the orthonormal basis.
fn coordinates(lengths: &Mat<f64>, amplitudes: &[f32]) -> Mat<f64> {
    let modes = lengths.ncols();
    lengths
        * Mat::from_fn(modes, amplitudes.len() / modes, |m, t| f64::from(amplitudes[t * modes + m]))
}
