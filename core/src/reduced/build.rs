//! The off-line stage: all positions and orders solved exactly with one factorisation, compressed
//! region by region, checked between positions, and put together as a model.

use super::metadata::{Errors, FORMAT_VERSION, Metadata};
use super::model::{Arrays, ReducedModel};
use super::positions::Positions;
use super::preload;
use super::region::{Exact, Region};
use crate::body::Body;
use crate::equilibrium::patch_mean;
use crate::error::Error;
use crate::mesh::{Patch, Surface};
use crate::number::{Monomials, evaluate_monomials};
use crate::series::{TouchExpansion, TouchSeries};
use rayon::Yield;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Orders up to this one are also solved at edge midpoints.
const EDGE_ORDER: usize = 3;
/// Points between positions at which the model is checked before it is returned.
const INTERPOLATION_CHECKS: usize = 32;

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
    /// Displacement of the loaded equilibrium that touches start from, three values for each
    /// node [m]; its dead load stays. Empty: touches start from rest.
    pub preload: Vec<f64>,
    /// Kept in the metadata.
    pub user: serde_json::Value,
}

/// How far a reduction has come.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Positions solved and compressed.
    pub done: usize,
    /// All positions.
    pub total: usize,
    /// What is being done.
    pub stage: &'static str,
}

/// What a region's task returns.
struct Solved {
    region: Region,
    positions: Vec<u32>,
    edges: Vec<u32>,
    force: Vec<Vec<[f64; 3]>>,
    edge_force: Vec<Vec<[f64; 3]>>,
    compliance: Vec<[f64; 9]>,
    /// By edge of `edges`.
    cross_compliance: Vec<[f64; 9]>,
    norms: Vec<Vec<f32>>,
}

impl Reduction {
    /// Builds the model; `progress` is called from this thread and may return false to stop.
    ///
    /// # Errors
    /// Bad settings; a preload that is no stable equilibrium; a stop on request.
    pub fn run(
        &self,
        body: &Body,
        surface: &Surface,
        fixed: &[u32],
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<ReducedModel, Error> {
        let clock = Instant::now();
        preload::check(body, fixed, &self.preload)?;
        let surface = &preload::shape(surface, &self.preload);
        let diagonal = diagonal(surface.points());
        self.check(fixed, diagonal)?;
        let positions = Positions::new(surface, &self.touchable, fixed, self.radius)?;
        let expansion = preload::expansion(body, fixed, &self.preload, self.order)?;
        let solved = self.solve_regions(&expansion, &positions, progress)?;
        let metadata = Metadata {
            format_version: FORMAT_VERSION,
            package_version: env!("CARGO_PKG_VERSION").to_string(),
            units: "SI".to_string(),
            law: body.material().name().to_string(),
            law_parameter_names: body.material().names().iter().map(|n| n.to_string()).collect(),
            element: body.element().name().to_string(),
            radius: self.radius,
            depth: self.depth,
            order: self.order,
            edge_order: EDGE_ORDER.min(self.order),
            tolerance: self.tolerance,
            diagonal,
            errors: Errors {
                compression: solved
                    .iter()
                    .flat_map(|s| &s.region.errors)
                    .fold(0.0, |worst, &e| worst.max(f64::from(e))),
                ..Errors::default()
            },
            seconds: 0.0,
            user: self.user.clone(),
        };
        let preload = self.preload.clone();
        let arrays = Arrays { preload, ..assemble(body, surface, fixed, &positions, solved) };
        let mut model = ReducedModel::new(metadata, arrays)?;
        self.measure_interpolation(&expansion, &positions, &mut model, progress)?;
        model.metadata.seconds = clock.elapsed().as_secs_f64();
        Ok(model)
    }

    fn check(&self, fixed: &[u32], diagonal: f64) -> Result<(), Error> {
        if fixed.is_empty() {
            return Err(Error::input("nothing is fixed; an organ that floats cannot be pushed"));
        }
        if !(2..=8).contains(&self.order) {
            return Err(Error::input(format!("order {}; it must be between 2 and 8", self.order)));
        }
        for (name, value, limit) in [
            ("radius", self.radius, diagonal),
            ("depth", self.depth, diagonal),
            ("tolerance", self.tolerance, 1.0),
        ] {
            if !(value > 0.0 && value < limit) {
                return Err(Error::input(format!(
                    "{name} = {value}; it must be above 0 and below {limit:.4}{}",
                    if name == "tolerance" { "" } else { " m, the diagonal of the organ" }
                )));
            }
        }
        Ok(())
    }

    fn solve_regions(
        &self,
        expansion: &TouchExpansion,
        positions: &Positions,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Vec<Solved>, Error> {
        let total = positions.nodes.len();
        let stop = AtomicBool::new(false);
        let (sender, receiver) = mpsc::channel::<usize>();
        let mut solved = Ok(Vec::new());
        rayon::in_place_scope(|scope| {
            let (stop, solved) = (&stop, &mut solved);
            scope.spawn(move |_| {
                let task = |members: &Vec<u32>| {
                    if stop.load(Ordering::Relaxed) {
                        return Err(Error::Cancelled);
                    }
                    let solved = self.solve_region(expansion, positions, members);
                    // The receiver lives until this scope has ended.
                    let _ = sender.send(members.len());
                    solved
                };
                *solved = positions.regions.par_iter().map(task).collect();
            });
            let mut done = 0;
            loop {
                // A thread of the pool that waits must also work: it may be the only one.
                if let Some(Yield::Executed) = rayon::yield_now() {
                    continue;
                }
                match receiver.recv_timeout(Duration::from_millis(50)) {
                    Ok(count) => done += count,
                    Err(RecvTimeoutError::Timeout) => (),
                    Err(RecvTimeoutError::Disconnected) => break,
                }
                if !progress(Progress { done, total, stage: "solve" }) {
                    stop.store(true, Ordering::Relaxed);
                }
            }
        });
        let solved = solved?;
        if progress(Progress { done: total, total, stage: "solve" }) {
            Ok(solved)
        } else {
            Err(Error::Cancelled)
        }
    }

    fn solve_region(
        &self,
        expansion: &TouchExpansion,
        positions: &Positions,
        members: &[u32],
    ) -> Result<Solved, Error> {
        let edge_order = EDGE_ORDER.min(self.order);
        let is_ours = |edge: &&[u32; 2]| members.binary_search(&edge[0]).is_ok();
        let edges: Vec<u32> = (0u32..)
            .zip(&positions.edges)
            .filter(|(_, edge)| is_ours(edge))
            .map(|(e, _)| e)
            .collect();
        let patches: Vec<&Patch> =
            members.iter().map(|&p| &positions.patches[p as usize]).collect();
        let edge_patches: Vec<Patch> =
            edges.iter().map(|&e| positions.edge_patch(e as usize)).collect();
        let series = expansion.expand(&patches, self.order)?;
        let edge_series = expansion.expand(&edge_patches.iter().collect::<Vec<_>>(), edge_order)?;

        let table = Monomials::of(3, self.order);
        let exact = Exact {
            exponents: &table.exponents()[1..],
            edge_terms: table.up_to(edge_order) - table.up_to(1),
            depth: self.depth,
            positions: &series,
            edges: &edge_series,
        };
        let region = exact.compress(self.tolerance)?;
        let cross_compliance = edges
            .iter()
            .map(|&e| {
                let [p, q] = positions.edges[e as usize];
                let own = members.binary_search(&p).unwrap_or(0);
                cross_compliance(&series[own], &positions.patches[q as usize])
            })
            .collect();
        Ok(Solved {
            region,
            positions: members.to_vec(),
            edges,
            norms: series.iter().map(|s| gram_by_degree(s, self.order)).collect(),
            compliance: series.iter().map(|s| flat(&s.compliance)).collect(),
            cross_compliance,
            force: series.into_iter().map(|s| s.force).collect(),
            edge_force: edge_series.into_iter().map(|s| s.force[3..].to_vec()).collect(),
        })
    }

    /// Compares the model with exact series at centroids of triangles spread over the surface.
    fn measure_interpolation(
        &self,
        expansion: &TouchExpansion,
        positions: &Positions,
        model: &mut ReducedModel,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<(), Error> {
        let total = positions.nodes.len();
        let count = INTERPOLATION_CHECKS.min(positions.triangles.len());
        let triangles: Vec<usize> =
            (0..count).map(|k| k * positions.triangles.len() / count).collect();
        let errors = triangles
            .par_chunks(8)
            .map(|some| self.interpolation_errors(expansion, model, some))
            .collect::<Result<Vec<_>, _>>()?;
        if !progress(Progress { done: total, total, stage: "check" }) {
            return Err(Error::Cancelled);
        }
        for [half, full] in errors.into_iter().flatten() {
            let worst = &mut model.metadata.errors;
            worst.interpolation_half_depth = worst.interpolation_half_depth.max(half);
            worst.interpolation = worst.interpolation.max(full);
        }
        Ok(())
    }

    /// Worst field error at half and full depth along six axes, for some triangles.
    fn interpolation_errors(
        &self,
        expansion: &TouchExpansion,
        model: &ReducedModel,
        triangles: &[usize],
    ) -> Result<Vec<[f64; 2]>, Error> {
        let contacts: Vec<_> = triangles.iter().map(|&t| model.centroid(t)).collect();
        let patches: Vec<Patch> = contacts.iter().map(|c| model.patch(c)).collect();
        let series = expansion.expand(&patches.iter().collect::<Vec<_>>(), self.order)?;
        let mut workspace = vec![0.0; model.workspace_len()];
        let mut errors = Vec::new();
        for (contact, series) in contacts.iter().zip(&series) {
            let worst = [0.5, 1.0].map(|share| {
                let mut worst: f64 = 0.0;
                for axis in 0..6 {
                    let mut d = [0.0; 3];
                    d[axis / 2] = share * self.depth * if axis % 2 == 0 { 1.0 } else { -1.0 };
                    let exact = evaluate_series(series, model, d);
                    let mut field = vec![0.0; exact.len()];
                    model.displacement(contact, d, &mut workspace, &mut field);
                    let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
                    let difference =
                        square(&mut exact.iter().zip(&field).map(|(a, &b)| a - f64::from(b)));
                    let size = square(&mut exact.iter().copied());
                    worst = worst.max((difference / size).sqrt());
                }
                worst
            });
            errors.push(worst);
        }
        Ok(errors)
    }
}

fn evaluate_series(series: &TouchSeries, model: &ReducedModel, d: [f64; 3]) -> Vec<f64> {
    let mut monomials = vec![0.0; model.n_terms()];
    evaluate_monomials(&model.exponents, d, &mut monomials);
    let mut field = vec![0.0; series.displacement[0].len()];
    for (u, m) in series.displacement.iter().zip(&monomials) {
        field.iter_mut().zip(u).for_each(|(f, u)| *f += m * u);
    }
    field
}

/// `W_q G_p` from the first-order fields of p: their means over q's patch times p's compliance.
fn cross_compliance(series: &TouchSeries, patch: &Patch) -> [f64; 9] {
    let means: [[f64; 3]; 3] = std::array::from_fn(|k| patch_mean(patch, &series.displacement[k]));
    let mut out = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] = (0..3).map(|k| means[k][i] * series.compliance[k][j]).sum();
        }
    }
    out
}

/// Inner products of the fields of each degree, degree after degree.
fn gram_by_degree(series: &TouchSeries, order: usize) -> Vec<f32> {
    let table = Monomials::of(3, order);
    let mut gram = Vec::new();
    for degree in 1..=order {
        for a in table.of_degree(degree) {
            for b in table.of_degree(degree) {
                let (u, v) = (&series.displacement[a - 1], &series.displacement[b - 1]);
                gram.push(u.iter().zip(v).map(|(x, y)| x * y).sum::<f64>() as f32);
            }
        }
    }
    gram
}

fn flat(m: &[[f64; 3]; 3]) -> [f64; 9] {
    std::array::from_fn(|k| m[k / 3][k % 3])
}

fn diagonal(points: &[[f64; 3]]) -> f64 {
    let extent = |i: usize| {
        let values = points.iter().map(|p| p[i]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    };
    (0..3).map(|i| extent(i).powi(2)).sum::<f64>().sqrt()
}

/// Puts the regions' results in the order of positions and edges.
fn assemble(
    body: &Body,
    surface: &Surface,
    fixed: &[u32],
    positions: &Positions,
    solved: Vec<Solved>,
) -> Arrays {
    let n = surface.points().len();
    let surface_nodes = surface.nodes().to_vec();
    let mut is_surface = vec![false; n];
    surface_nodes.iter().for_each(|&node| is_surface[node as usize] = true);
    let (p, e) = (positions.nodes.len(), positions.edges.len());
    let mut arrays = Arrays {
        points: surface.points().iter().flatten().copied().collect(),
        cells: body.cells().iter().flatten().copied().collect(),
        fixed: fixed.to_vec(),
        law_parameters: body.material().parameters().concat(),
        surface: surface.triangles().iter().flatten().copied().collect(),
        surface_nodes,
        positions: positions.nodes.clone(),
        touchable: positions.triangles.iter().flatten().copied().collect(),
        edges: positions.edges.iter().flatten().copied().collect(),
        triangle_edges: positions.triangle_edges.iter().flatten().copied().collect(),
        patch_start: vec![0],
        region_start: vec![0],
        position_region: vec![0; p],
        edge_region: vec![0; e],
        ..Arrays::default()
    };
    for patch in &positions.patches {
        arrays.patch_nodes.extend(&patch.nodes);
        arrays.patch_weights.extend(&patch.weights);
        arrays.patch_start.push(arrays.patch_nodes.len() as u32);
    }
    let (mut by_position, mut by_edge) = (vec![(0, 0); p], vec![(0, 0); e]);
    for (r, part) in solved.iter().enumerate() {
        for (k, &position) in part.positions.iter().enumerate() {
            arrays.position_region[position as usize] = r as u32;
            by_position[position as usize] = (r, k);
        }
        for (k, &edge) in part.edges.iter().enumerate() {
            arrays.edge_region[edge as usize] = r as u32;
            by_edge[edge as usize] = (r, k);
        }
        arrays.mode_scale.extend(&part.region.scales);
        arrays.region_start.push(arrays.mode_scale.len() as u32);
        for mode in part.region.modes.chunks_exact(3 * n) {
            for (node, u) in mode.chunks_exact(3).enumerate() {
                let modes = if is_surface[node] {
                    &mut arrays.surface_modes
                } else {
                    &mut arrays.interior_modes
                };
                modes.extend(u);
            }
        }
    }
    for (r, k) in by_position {
        let part = &solved[r];
        arrays.compliance.extend(part.compliance[k]);
        arrays.force.extend(part.force[k].iter().flatten());
        arrays.norms.extend(&part.norms[k]);
        arrays.compression.push(part.region.errors[k]);
        arrays.position_coefficients.extend(&part.region.positions[k]);
    }
    for (r, k) in by_edge {
        let part = &solved[r];
        arrays.cross_compliance.extend(part.cross_compliance[k]);
        arrays.edge_force.extend(part.edge_force[k].iter().flatten());
        arrays.edge_coefficients.extend(&part.region.edges[k]);
    }
    arrays
}
