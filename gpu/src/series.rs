//! Force along series of displacements: the right-hand sides of the asymptotic numerical method on the device.
//!
//! A series in one variable `t` is `u = u_0 + t u_1 + t^2 u_2 + ...`, about the base state `u_0`, the same for all. For the
//! coefficients below degree p the device returns the coefficient of degree p of the internal force, as it is with
//! `u_p = 0`. Lower degrees of what the law computes are not kept between degrees: to compute them again is cheaper than
//! to store them for every cell.

mod source;

use crate::Error;
use crate::cells::{Solid, geometry};
use crate::clusters::Clusters;
use crate::commands::workgroups;
use crate::device::Gpu;
use crate::driver::{Buffer, Kernel};
use crate::gathered::Gathered;
use crate::law::{ELEMENTARY, Law};
use crate::program::Program;
use std::sync::Arc;
pub use viscera_device::SERIES_LANES;

/// Highest degree, that of a reduced model.
const MOST_DEGREES: usize = 8;

/// What the forces of the cells may take on a device that binds more [bytes].
const MOST_BYTES: u64 = 256 << 20;

/// The energy of dilatation of the cells of clusters.
#[derive(Clone, Copy, Debug)]
pub struct Dilatation<'a> {
    /// `s U(J)`, or a function of `I1` where the ratio is `(I1 - 1) / 2`.
    pub energy: &'a Program,
    /// One row of parameters for all cells, or one row per cell.
    pub parameters: &'a [Vec<f64>],
}

/// A body whose force is expanded in series.
pub struct SeriesBuffers {
    gpu: Arc<Gpu>,
    sources: Sources,
    base: Buffer,
    cells: Buffer,
    geometry: Buffer,
    parameters: Buffer,
    starts: Buffer,
    parts: Buffer,
    clusters: Option<ClusterBuffers>,
    n_cells: usize,
    n_nodes: usize,
    /// By degree, those that were needed.
    kernels: [Option<Kernels>; MOST_DEGREES + 1],
    room: Option<Room>,
}

/// The kernels of a degree, and whether they read parameters.
#[derive(Clone)]
struct Kernels {
    stresses: (Kernel, bool),
    ratios: Option<Kernel>,
    pressures: Option<(Kernel, bool)>,
    gather: Kernel,
}

/// The part of the kernels' source that is of the law.
struct Sources {
    energy: Program,
    rows: Vec<Vec<f64>>,
    dilatation: Option<(Program, usize)>,
}

struct ClusterBuffers {
    of: Buffer,
    starts: Buffer,
    members: Buffer,
    /// The part of the cluster's volume that each member has.
    parts: Buffer,
    parameters: Buffer,
    count: usize,
}

/// Memory for some groups of series, up to a degree.
struct Room {
    groups: usize,
    degree: usize,
    displacement: Buffer,
    response: Buffer,
    force: Buffer,
    ratios: Buffer,
    pressures: Buffer,
}

impl SeriesBuffers {
    /// A body about a base state; `dilatation` where cells share their volume ratio.
    ///
    /// # Errors
    /// [`Error::Input`] if the body is not sound, or its law has no energy; too little memory; a fault of the driver.
    pub fn new(
        gpu: &Arc<Gpu>,
        solid: &Solid<'_>,
        dilatation: Option<Dilatation<'_>>,
        base: &[f64],
    ) -> Result<Self, Error> {
        solid.check()?;
        let (n_cells, n_nodes) = (solid.cells.len(), solid.points.len());
        let energy = energy_of(solid.law)?;
        if base.len() != 3 * n_nodes || !base.iter().all(|u| u.is_finite()) {
            return Err(Error::Input(format!(
                "a base state of {} values for {n_nodes} nodes; it takes three finite ones for each",
                base.len()
            )));
        }
        if dilatation.is_some() != solid.clusters.is_some() {
            return Err(Error::Input("clusters go with an energy of dilatation".to_string()));
        }
        let clusters = solid.clusters.zip(dilatation);
        let clusters = clusters.map(|(c, d)| ClusterBuffers::new(gpu, solid, c, d)).transpose()?;
        let shapes = solid.cells.iter().flat_map(|&cell| geometry(solid.points, cell));
        let shapes: Vec<f32> = shapes.map(|x| x as f32).collect();
        let corners: Vec<u32> = solid.cells.as_flattened().to_vec();
        let at_nodes = Gathered::by_number(n_nodes, &corners);
        let base: Vec<f32> = base.iter().map(|&u| u as f32).collect();
        let n_parameters = solid.law.n_parameters();
        Ok(SeriesBuffers {
            gpu: gpu.clone(),
            base: gpu.buffer("base state", &base)?,
            cells: gpu.buffer("cells", solid.cells)?,
            geometry: gpu.buffer("shapes of cells", &shapes)?,
            parameters: gpu.buffer("parameters", &flat(solid.parameters, n_parameters))?,
            starts: gpu.buffer("cells of nodes", &at_nodes.starts)?,
            parts: gpu.buffer("cells of nodes", &at_nodes.parts)?,
            sources: Sources {
                energy: energy.clone(),
                rows: solid.parameters.to_vec(),
                dilatation: dilatation
                    .map(|d| (d.energy.clone(), stride(d.parameters, d.energy.n_parameters()))),
            },
            clusters,
            n_cells,
            n_nodes,
            kernels: Default::default(),
            room: None,
        })
    }

    /// Writes `N_p` of groups of [`SERIES_LANES`] series, over all degrees of freedom. `displacement` holds
    /// `u_1 ... u_(p-1)` of each group.
    ///
    /// # Errors
    /// Runs of the wrong length, or not finite; too little memory; a fault of the device.
    pub fn force(
        &mut self,
        degree: usize,
        displacement: &[f32],
        force: &mut [f32],
    ) -> Result<(), Error> {
        let run = 3 * self.n_nodes * SERIES_LANES;
        let is_sound = (2..=MOST_DEGREES).contains(&degree)
            && force.len().is_multiple_of(run)
            && displacement.len() == (degree - 1) * force.len();
        if !is_sound {
            return Err(Error::Input(format!(
                "{} displacements and {} forces of degree {degree} for {} nodes",
                displacement.len(),
                force.len(),
                self.n_nodes
            )));
        }
        let groups = (force.len() / run).min(self.groups_at_once());
        self.make_room(degree, groups)?;
        if self.kernels[degree].is_none() {
            self.kernels[degree] = Some(self.sources.kernels(&self.gpu, degree + 1)?);
        }
        let parts = displacement.chunks((degree - 1) * run * groups);
        for (displacement, force) in parts.zip(force.chunks_mut(run * groups)) {
            self.expand(degree, displacement, force)?;
        }
        if force.iter().all(|f| f.is_finite()) {
            return Ok(());
        }
        Err(Error::Input(format!(
            "coefficients of degree {degree} that single precision cannot hold"
        )))
    }

    /// Groups whose buffers the device binds at any degree, at least one.
    fn groups_at_once(&self) -> usize {
        let values = (12 * self.n_cells).max(3 * (MOST_DEGREES - 1) * self.n_nodes);
        let bytes = (4 * SERIES_LANES * values) as u64;
        (self.gpu.largest_binding().min(MOST_BYTES) / bytes).max(1) as usize
    }

    fn make_room(&mut self, degree: usize, groups: usize) -> Result<(), Error> {
        let (degree, groups) = match &self.room {
            Some(room) if room.degree >= degree && room.groups >= groups => return Ok(()),
            Some(room) => (degree.max(room.degree), groups.max(room.groups)),
            None => (degree, groups),
        };
        self.room = None; // its memory is free before the next takes some
        let zeros = |what, values| self.gpu.zeros::<f32>(what, SERIES_LANES * groups * values);
        let count = self.clusters.as_ref().map_or(0, |clusters| clusters.count);
        let ratios = if count > 0 { (degree + 1) * self.n_cells } else { 0 };
        self.room = Some(Room {
            groups,
            degree,
            displacement: zeros("series of displacements", 3 * (degree - 1) * self.n_nodes)?,
            response: zeros("forces of cells", 12 * self.n_cells)?,
            force: zeros("forces", 3 * self.n_nodes)?,
            ratios: zeros("volume ratios of cells", ratios)?,
            pressures: zeros("pressures of clusters", (degree + 1) * count)?,
        });
        Ok(())
    }

    /// A pass: as many groups as there is room for.
    fn expand(&self, degree: usize, displacement: &[f32], force: &mut [f32]) -> Result<(), Error> {
        let (Some(room), Some(kernels)) = (&self.room, &self.kernels[degree]) else {
            unreachable!("made by the caller")
        };
        let (gpu, groups) = (&self.gpu, force.len() / (3 * self.n_nodes * SERIES_LANES));
        let count = self.clusters.as_ref().map_or(0, |clusters| clusters.count);
        let size = [self.n_cells, self.n_nodes, groups, count].map(|n| n as u32);
        let size = gpu.uniform(&size);
        gpu.write(&room.displacement, displacement);
        let mut commands = gpu.commands();
        let mut dispatch = |kernel: &Kernel, bound: &[(u32, &Buffer)], each: usize| {
            let workgroups = workgroups(SERIES_LANES * groups * each, usize::MAX);
            commands.dispatch(kernel, &gpu.bind_at(kernel, bound), workgroups);
        };
        let of_cells =
            [(0, &room.displacement), (1, &self.base), (2, &self.cells), (3, &self.geometry)];
        let mut around = [&of_cells[..], &[(5, &room.response), (6, &size)]].concat();
        if let (Some(clusters), Some(ratios), Some((pressures, reads_parameters))) =
            (&self.clusters, &kernels.ratios, &kernels.pressures)
        {
            let bound = [&of_cells[..], &[(5, &room.ratios), (6, &size)]].concat();
            dispatch(ratios, &bound, self.n_cells);
            let ClusterBuffers { starts, members, parts, .. } = clusters;
            let mut bound = vec![(0, &room.ratios), (1, starts), (2, members), (3, parts)];
            bound.extend(reads_parameters.then_some((4, &clusters.parameters)));
            bound.extend([(5, &room.pressures), (6, &size)]);
            dispatch(pressures, &bound, count);
            around.extend([(7, &room.pressures), (8, &clusters.of)]);
        }
        let (stresses, reads_parameters) = &kernels.stresses;
        around.extend(reads_parameters.then_some((4, &self.parameters)));
        dispatch(stresses, &around, self.n_cells);
        let bound = [&room.response, &self.starts, &self.parts, &room.force, &size];
        let bound: Vec<_> = (0..).zip(bound).collect();
        dispatch(&kernels.gather, &bound, 3 * self.n_nodes);
        let found = commands.read(&[(&room.force, force.len())])?.remove(0);
        force.copy_from_slice(bytemuck::cast_slice(&found));
        Ok(())
    }
}

/// The kernel that expands the forces of cells which do not share their volume ratio, with `n` coefficients.
pub(crate) fn source_of_stresses(law: &Law, rows: &[Vec<f64>], n: usize) -> Result<String, Error> {
    Ok(Sources { energy: energy_of(law)?.clone(), rows: rows.to_vec(), dilatation: None }
        .stresses(n))
}

/// What a series is of.
fn energy_of(law: &Law) -> Result<&Program, Error> {
    match law {
        Law::Energy(energy) => Ok(energy),
        _ => Err(Error::Input("a law without an energy has no series".to_string())),
    }
}

/// WGSL of the pressure around a cell.
const ALONE: &str = "fn pressure_of(at: Place) -> Series { return constant(0.0); }";
const IN_CLUSTERS: &str = include_str!("kernels/series_shared.wgsl");
const CELLS: &str = include_str!("kernels/series.wgsl");

impl Sources {
    /// The kernels of series with `n` coefficients.
    fn kernels(&self, gpu: &Gpu, n: usize) -> Result<Kernels, Error> {
        let kernel = |source: &str, entry| {
            Ok::<_, Error>((gpu.kernel(source, entry)?, source.contains("parameters[")))
        };
        let has_clusters = self.dilatation.is_some();
        let of_clusters = |source: fn(&Self, usize) -> String, entry| {
            has_clusters.then(|| kernel(&source(self, n), entry)).transpose()
        };
        let gather = include_str!("kernels/series_gather.wgsl");
        Ok(Kernels {
            stresses: kernel(&self.stresses(n), "expand_stresses")?,
            ratios: of_clusters(Self::ratios, "expand_ratios")?.map(|(kernel, _)| kernel),
            pressures: of_clusters(Self::pressures, "expand_pressures")?,
            gather: gpu.kernel(gather, "gather_series")?,
        })
    }

    fn stresses(&self, n: usize) -> String {
        let energy = source::slopes(&self.energy, &self.rows);
        let stride = stride(&self.rows, self.energy.n_parameters());
        let around = if self.dilatation.is_some() { IN_CLUSTERS } else { ALONE };
        let parts = [
            &format!("const STRIDE = {stride}u;"),
            &source::arithmetic(n),
            ELEMENTARY,
            &source::gradients(n),
            &energy,
            CELLS,
            include_str!("kernels/series_stresses.wgsl"),
            around,
        ];
        parts.join("\n")
    }

    fn ratios(&self, n: usize) -> String {
        let dilatation =
            self.dilatation.as_ref().map(|(energy, _)| source::shared_invariant(energy));
        let parts = [
            &source::arithmetic(n),
            ELEMENTARY,
            &source::gradients(n),
            CELLS,
            dilatation.as_deref().unwrap_or_default(),
            include_str!("kernels/series_ratios.wgsl"),
        ];
        parts.join("\n")
    }

    fn pressures(&self, n: usize) -> String {
        let Some((energy, stride)) = &self.dilatation else { return String::new() };
        let parts = [
            &format!("const STRIDE = {stride}u;"),
            &source::arithmetic(n),
            ELEMENTARY,
            &source::slope(energy),
            include_str!("kernels/series_clusters.wgsl"),
        ];
        parts.join("\n")
    }
}

impl ClusterBuffers {
    fn new(
        gpu: &Gpu,
        solid: &Solid<'_>,
        clusters: Clusters<'_>,
        dilatation: Dilatation<'_>,
    ) -> Result<Self, Error> {
        let n_parameters = dilatation.energy.n_parameters();
        let rows = dilatation.parameters;
        let fits = rows.len() == 1 || rows.len() == solid.cells.len();
        if !fits || rows.iter().any(|row| row.len() < n_parameters) {
            return Err(Error::Input(format!(
                "{} rows of parameters of the dilatation, which reads {n_parameters}, for {} cells",
                rows.len(),
                solid.cells.len()
            )));
        }
        let count = clusters.len();
        let volume_of = |cell: usize| geometry(solid.points, solid.cells[cell])[9];
        let mut volumes = vec![0.0; count];
        clusters
            .of
            .iter()
            .enumerate()
            .for_each(|(cell, &c)| volumes[c as usize] += volume_of(cell));
        let members = Gathered::by_number(count, clusters.of);
        let part = |&cell: &u32| {
            (volume_of(cell as usize) / volumes[clusters.of[cell as usize] as usize]) as f32
        };
        let parts: Vec<f32> = members.parts.iter().map(part).collect();
        Ok(ClusterBuffers {
            of: gpu.buffer("clusters of cells", clusters.of)?,
            starts: gpu.buffer("cells of clusters", &members.starts)?,
            members: gpu.buffer("cells of clusters", &members.parts)?,
            parts: gpu.buffer("cells of clusters", &parts)?,
            parameters: gpu.buffer("parameters", &flat(rows, n_parameters))?,
            count,
        })
    }
}

/// From a cell's parameters to the next one's.
fn stride(rows: &[Vec<f64>], n_parameters: usize) -> usize {
    if rows.len() == 1 { 0 } else { n_parameters }
}

fn flat(rows: &[Vec<f64>], n_parameters: usize) -> Vec<f32> {
    rows.iter().flat_map(|row| &row[..n_parameters]).map(|&p| p as f32).collect()
}
