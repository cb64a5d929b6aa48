//! Compression of a region: exact fields of neighbouring positions to common modes, common to all
//! members of a family too.
//!
//! The first-order fields (the Green fields of the contacts) are kept exactly as the first modes;
//! what the higher orders add to their span is ranked by a singular value decomposition and cut at
//! the tolerance, position by position. Fields are weighted by `depth^degree` and
//! the mean size of their monomial on the unit sphere, so that the norm of a column is what it
//! contributes to the field at full depth.

use super::basis::Common;
use super::columns::Columns;
use crate::error::Error;
use faer::{Mat, MatRef};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The modes of a region, and what each member of the family does with them.
#[derive(Deserialize, Serialize)]
pub(super) struct Region {
    /// Quantised modes, one run of all degrees of freedom for each.
    pub modes: Vec<i16>,
    /// Metres for one unit of a mode.
    pub scales: Vec<f32>,
    pub members: Vec<Amplitudes>,
}

/// The amplitudes of a region's positions and edges.
#[derive(Deserialize, Serialize)]
pub(super) struct Amplitudes {
    /// (terms, modes) for each position.
    pub positions: Vec<Vec<f32>>,
    /// (edge terms, modes) for each edge.
    pub edges: Vec<Vec<f32>>,
    /// Compression error of each position at full depth, worst direction, relative to the field.
    pub errors: Vec<f32>,
    /// The same of the first order alone.
    pub linear_errors: Vec<f32>,
}

/// What a region is compressed from, for one member.
pub(super) struct Exact<'a> {
    /// Exponents of the monomials, the constant left out.
    pub exponents: &'a [[u8; 3]],
    /// How many monomials of degree >= 2 the edges keep.
    pub edge_terms: usize,
    pub depth: f64,
    /// Fields of all terms, term by term: all degrees of freedom, or coordinates in an orthonormal basis.
    pub positions: Vec<MatRef<'a, f64>>,
    /// Of the terms that edges keep.
    pub edges: Vec<MatRef<'a, f64>>,
}

/// Terms of the first order.
pub(super) const FIRST_ORDER: usize = 3;
/// Part of the tolerance for first-order fields where they are not kept exactly: their error does
/// not fade as touches become shallow.
const FIRST_ORDER_SHARE: f64 = 0.2;

/// The fewest modes that leave, at every position and for every member, less than `tolerance` of
/// the field at full depth in the mean over directions; the worst direction is measured on the
/// stored form. One member alone keeps its first order exactly.
///
/// # Errors
/// A decomposition that does not converge.
pub(super) fn compress(members: &[Exact], tolerance: f64) -> Result<Region, Error> {
    let n_first = FIRST_ORDER * members[0].positions.len();
    fewest_modes(members, n_first, None, tolerance)
}

/// The same of fields given by their coordinates in the orthonormal columns of `basis`, with no
/// field that is kept exactly: a region whose fields are already a sum of modes.
///
/// # Errors
/// A decomposition that does not converge.
pub(super) fn compress_again(
    members: &[Exact],
    basis: MatRef<f64>,
    tolerance: f64,
) -> Result<Region, Error> {
    fewest_modes(members, 0, Some(basis), tolerance)
}

fn fewest_modes(
    members: &[Exact],
    n_first: usize,
    basis: Option<MatRef<f64>>,
    tolerance: f64,
) -> Result<Region, Error> {
    let columns: Vec<Columns> = members.iter().map(Exact::columns).collect();
    let common = Common::new(&columns, n_first, 0.1 * tolerance)?;
    let kept = members
        .iter()
        .enumerate()
        .fold(common.n_first(), |kept, (j, exact)| exact.modes_needed(&common, j, tolerance, kept));
    let exact_modes = common.modes(&columns, kept);
    let (modes, scales) = match basis {
        Some(basis) => quantise(&(basis * exact_modes)),
        None => quantise(&exact_modes),
    };
    let decoded = decode(&modes, &scales, basis.map_or(columns[0].n_rows(), |b| b.nrows()));
    let decoded = basis.map_or(decoded.clone(), |basis| basis.transpose() * decoded);
    let amplitudes = members.iter().zip(&columns).zip(&common.coordinates);
    let members = amplitudes.map(|((e, columns), c)| e.amplitudes(columns, c, &decoded)).collect();
    Ok(Region { modes, scales, members })
}

/// Stored modes as columns [m].
pub(super) fn decode(modes: &[i16], scales: &[f32], rows: usize) -> Mat<f64> {
    Mat::from_fn(rows, scales.len(), |i, m| f64::from(modes[m * rows + i]) * f64::from(scales[m]))
}

impl<'a> Exact<'a> {
    fn weight(&self, term: usize) -> f64 {
        let e = self.exponents[term];
        let degree: u8 = e.iter().sum();
        let odd = |k: u8| (0..k).map(|i| 2.0 * f64::from(i) + 1.0).product::<f64>();
        // Mean of n^(2e) over the unit sphere.
        let mean = e.iter().map(|&k| odd(k)).product::<f64>() / odd(degree + 1);
        self.depth.powi(i32::from(degree)) * mean.sqrt()
    }

    /// Monomials an edge keeps: those of degree >= 2 up to the edge order.
    fn edge_range(&self) -> Range<usize> {
        FIRST_ORDER..FIRST_ORDER + self.edge_terms
    }

    /// First-order fields of all positions, then higher orders of positions, then of edges.
    fn columns(&self) -> Columns<'a> {
        let (n_terms, edges) = (self.exponents.len(), self.edges.len());
        let count = n_terms * self.positions.len() + self.edge_terms * edges;
        let mut columns = Columns::new(self.positions[0].nrows(), count);
        let weights = |terms: Range<usize>| terms.map(|t| self.weight(t)).collect::<Vec<f64>>();
        for (p, &fields) in self.positions.iter().enumerate() {
            columns.add(fields, self.position_columns(p).collect(), weights(0..n_terms));
        }
        for (e, &fields) in self.edges.iter().enumerate() {
            columns.add(fields, self.edge_columns(e).collect(), weights(self.edge_range()));
        }
        columns
    }

    /// Columns of a position: its first-order ones and the range of its higher ones.
    fn position_columns(&self, position: usize) -> impl Iterator<Item = usize> {
        let high = self.exponents.len() - FIRST_ORDER;
        let n_first = FIRST_ORDER * self.positions.len();
        (FIRST_ORDER * position..FIRST_ORDER * (position + 1))
            .chain(n_first + high * position..n_first + high * (position + 1))
    }

    fn edge_columns(&self, edge: usize) -> Range<usize> {
        let high = self.exponents.len() - FIRST_ORDER;
        let start = FIRST_ORDER * self.positions.len() + high * self.positions.len();
        start + self.edge_terms * edge..start + self.edge_terms * (edge + 1)
    }

    /// Fewest modes, at least `kept`, that leave for each position and edge less than `target` of
    /// the first-order field in the mean over directions, and of the first order alone its share.
    fn modes_needed(&self, basis: &Common, member: usize, target: f64, mut kept: usize) -> usize {
        let left = |columns: &mut dyn Iterator<Item = usize>, from: usize| {
            columns.map(|c| basis.square(member, c, from)).sum::<f64>()
        };
        let first = |p: usize| FIRST_ORDER * p..FIRST_ORDER * (p + 1);
        let size: Vec<f64> = (0..self.positions.len()).map(|p| left(&mut first(p), 0)).collect();
        let mean_size = size.iter().sum::<f64>() / size.len() as f64;
        let mut keep = |columns: &dyn Fn() -> Box<dyn Iterator<Item = usize>>, limit: f64| {
            while kept < basis.rank() && left(&mut columns(), kept) > limit {
                kept += 1;
            }
        };
        for (p, &size) in size.iter().enumerate() {
            keep(&|| Box::new(self.position_columns(p)), target.powi(2) * size);
            keep(&|| Box::new(first(p)), (FIRST_ORDER_SHARE * target).powi(2) * size);
        }
        for e in 0..self.edges.len() {
            keep(&|| Box::new(self.edge_columns(e)), target.powi(2) * mean_size);
        }
        kept
    }

    /// Amplitudes from the coordinates of the columns in the modes, and what they leave.
    fn amplitudes(
        &self,
        columns: &Columns,
        coordinates: &Mat<f64>,
        decoded: &Mat<f64>,
    ) -> Amplitudes {
        let kept = decoded.ncols();
        let amplitudes = |column: usize, term: usize| -> Vec<f32> {
            let weight = self.weight(term);
            (0..kept).map(|m| (coordinates[(column, m)] / weight) as f32).collect()
        };
        let positions: Vec<Vec<f32>> = (0..self.positions.len())
            .map(|p| {
                self.position_columns(p).enumerate().flat_map(|(t, c)| amplitudes(c, t)).collect()
            })
            .collect();
        let edges = (0..self.edges.len())
            .map(|e| {
                let terms = self.edge_range();
                self.edge_columns(e).zip(terms).flat_map(|(c, t)| amplitudes(c, t)).collect()
            })
            .collect();
        let (errors, linear_errors) = self.errors(columns, decoded, &positions);
        Amplitudes { positions, edges, errors, linear_errors }
    }

    /// Compares what the stored modes give with the exact series at full depth, in the directions
    /// of a cube's faces, edges and corners: of all orders, and of the first alone.
    fn errors(
        &self,
        columns: &Columns,
        decoded: &Mat<f64>,
        positions: &[Vec<f32>],
    ) -> (Vec<f32>, Vec<f32>) {
        let kept = decoded.ncols();
        let (mut errors, mut linear_errors) = (Vec::new(), Vec::new());
        for (p, amplitudes) in positions.iter().enumerate() {
            let own: Vec<usize> = self.position_columns(p).collect();
            let terms = own.len();
            let exact = columns.copied(&own);
            let weighted = Mat::from_fn(kept, terms, |m, t| {
                f64::from(amplitudes[t * kept + m]) * self.weight(t)
            });
            let error = &exact - decoded * &weighted;
            let directions = cube_directions();
            let monomials = Mat::from_fn(terms, directions.len(), |t, d| {
                let e = self.exponents[t];
                let value: f64 = (0..3).map(|i| directions[d][i].powi(i32::from(e[i]))).product();
                value * self.depth.powi(i32::from(e.iter().sum::<u8>())) / self.weight(t)
            });
            let worst = |terms: usize| {
                let monomials = monomials.subrows(0, terms);
                let error = error.subcols(0, terms) * monomials;
                let exact = exact.subcols(0, terms) * monomials;
                let relative = |d: usize| error.col(d).norm_l2() / exact.col(d).norm_l2();
                (0..directions.len()).map(relative).fold(0.0, f64::max) as f32
            };
            errors.push(worst(terms));
            linear_errors.push(worst(FIRST_ORDER));
        }
        (errors, linear_errors)
    }
}

/// Unit vectors to the faces, edges and corners of a cube.
fn cube_directions() -> Vec<[f64; 3]> {
    let mut directions = Vec::new();
    for code in 0..27 {
        let v: [f64; 3] = std::array::from_fn(|i| f64::from(code / 3i32.pow(i as u32) % 3 - 1));
        let norm = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        if norm > 0.0 {
            directions.push(v.map(|x| x / norm));
        }
    }
    directions
}

/// Rows of 16-bit integers, each with its own scale.
fn quantise(modes: &Mat<f64>) -> (Vec<i16>, Vec<f32>) {
    let mut quantised = Vec::with_capacity(modes.nrows() * modes.ncols());
    let mut scales = Vec::with_capacity(modes.ncols());
    for m in 0..modes.ncols() {
        let column = modes.col(m);
        let scale = (column.norm_max() / f64::from(i16::MAX)).max(f64::MIN_POSITIVE) as f32;
        let scale = if scale > 0.0 { scale } else { f32::MIN_POSITIVE };
        quantised.extend(column.iter().map(|x| (x / f64::from(scale)).round() as i16));
        scales.push(scale);
    }
    (quantised, scales)
}
