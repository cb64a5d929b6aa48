//! The cells on the device: they turn a displacement into internal forces and blocks of the tangent. Clusters of cells
//! and the caller may add blocks of their own.

use crate::clusters::{ALONE, ClusterBuffers, Clusters, IN_CLUSTERS};
use crate::commands::workgroups;
use crate::device::Gpu;
use crate::driver::{Buffer, Group, Kernel};
use crate::gathered::{ELSEWHERE, Gathered};
use crate::layout::OF_CELL;
use crate::rest::Rest;
use crate::tangent::Tangent;
use crate::{Error, Law, System};
use rayon::prelude::*;
use std::sync::Arc;

/// A body of linear tetrahedra.
#[derive(Clone, Copy, Debug)]
pub struct Solid<'a> {
    /// Points at rest [m].
    pub points: &'a [[f64; 3]],
    /// Corners of the cells, right-handed.
    pub cells: &'a [[u32; 4]],
    /// The law of all cells.
    pub law: &'a Law,
    /// One row of parameters for all cells, or one row per cell.
    pub parameters: &'a [Vec<f64>],
    /// Cells that share their volume ratio, if any do.
    pub clusters: Option<Clusters<'a>>,
}

struct Kernels {
    respond: Kernel,
    blocks: Kernel,
    forces: Kernel,
}

/// The commands of one chunk.
struct ChunkCommands {
    respond: (Group, u32),
    blocks: (Group, u32),
    forces: (Group, u32),
    clusters: Option<(Group, u32)>,
}

/// Cells that write their tangent into the matrix of a [`System`].
pub struct CellBuffers {
    gpu: Arc<Gpu>,
    kernels: Kernels,
    chunks: Vec<ChunkCommands>,
    displacement: Buffer,
    force: Buffer,
    clusters: Option<ClusterBuffers>,
    rest: Rest,
    n_responses: usize,
}

impl CellBuffers {
    /// The cells of a body, and the system whose matrix they fill. `pairs` as in [`System::new`].
    ///
    /// # Errors
    /// [`Error::Input`] if the body is not sound; too little memory; a fault of the driver.
    pub fn new(
        gpu: &Arc<Gpu>,
        solid: &Solid<'_>,
        pairs: &[(u32, u32)],
    ) -> Result<(Self, System), Error> {
        let n_nodes = solid.points.len();
        solid.check()?;
        let products =
            solid.clusters.map_or(Vec::new(), |clusters| clusters.products_of_rows(n_nodes));
        let system = System::with_cells(gpu, n_nodes, pairs, (solid.cells, &products))?;
        let source = [
            include_str!("kernels/cells.wgsl"),
            if solid.clusters.is_some() { IN_CLUSTERS } else { ALONE },
            &solid.law.source(solid.parameters),
        ];
        let source = source.join("\n");
        let gather = include_str!("kernels/gather.wgsl");
        let kernels = Kernels {
            respond: gpu.kernel(&source, "respond_all")?,
            blocks: gpu.kernel(gather, "gather_blocks")?,
            forces: gpu.kernel(gather, "gather_forces")?,
        };
        let clusters = solid.clusters.map(|c| ClusterBuffers::new(gpu, c)).transpose()?;
        let n_responses = system.layout.chunks.iter().map(|chunk| chunk.cells.len()).sum();
        let largest = system.layout.chunks.iter().map(|chunk| chunk.cells.len()).max();
        let response = gpu.zeros::<f32>("responses of cells", OF_CELL * largest.unwrap_or(0))?;
        let displacement = gpu.zeros::<f32>("displacement", 3 * n_nodes)?;
        let force = gpu.zeros::<f32>("internal force", 3 * n_nodes)?;
        let reads_parameters = source.contains("parameters[");
        let shared = Shared { response, displacement, force, clusters, reads_parameters };
        let parts = Parts { gpu, solid, system: &system, kernels: &kernels, shared: &shared };
        let chunks =
            (0..system.layout.chunks.len()).map(|k| parts.commands(k)).collect::<Result<_, _>>()?;
        gpu.check()?;
        let Shared { displacement, force, clusters, .. } = shared;
        let cells = CellBuffers {
            gpu: gpu.clone(),
            kernels,
            chunks,
            displacement,
            force,
            clusters,
            rest: Rest::new(gpu)?,
            n_responses,
        };
        Ok((cells, system))
    }

    /// Evaluations of the law per frame, in all chunks. Cells on the border of two chunks are evaluated in both.
    pub fn n_responses(&self) -> usize {
        self.n_responses
    }

    /// Makes the tangent the matrix of the system.
    ///
    /// # Errors
    /// A vector of the wrong length or not finite; a block outside the pattern; too little memory; a device fault.
    pub fn form(&mut self, system: &mut System, tangent: &Tangent<'_>) -> Result<(), Error> {
        self.move_to(system, tangent.u)?;
        if let Some(clusters) = &self.clusters {
            clusters.move_to(&self.gpu, tangent)?;
        }
        if let Some(rest) = tangent.rest {
            self.rest.take(&self.gpu, system, rest)?;
        }
        let mut commands = self.gpu.commands();
        let Kernels { respond, blocks, .. } = &self.kernels;
        for chunk in &self.chunks {
            commands.dispatch(respond, &chunk.respond.0, chunk.respond.1);
            commands.dispatch(blocks, &chunk.blocks.0, chunk.blocks.1);
            if let Some((clusters, (group, count))) =
                self.clusters.as_ref().zip(chunk.clusters.as_ref())
            {
                commands.dispatch(&clusters.kernel, group, *count);
            }
        }
        self.rest.encode(&self.gpu, &mut commands, system, tangent.factor)?;
        system.encode_preparation(&mut commands, tangent.shift);
        commands.submit();
        self.gpu.check()
    }

    /// The internal force of the cells at a displacement, in single precision, without the part of the clusters.
    ///
    /// # Errors
    /// A displacement of the wrong length or not finite; a fault of the device.
    pub fn internal_force(&self, system: &System, u: &[f64]) -> Result<Vec<f64>, Error> {
        self.move_to(system, u)?;
        let mut commands = self.gpu.commands();
        let Kernels { respond, forces, .. } = &self.kernels;
        for chunk in &self.chunks {
            commands.dispatch(respond, &chunk.respond.0, chunk.respond.1);
            commands.dispatch(forces, &chunk.forces.0, chunk.forces.1);
        }
        let force = commands.read(&[(&self.force, u.len())])?.remove(0);
        Ok(system.in_order(bytemuck::cast_slice(&force), 1.0))
    }

    fn move_to(&self, system: &System, u: &[f64]) -> Result<(), Error> {
        system.scale_of(u)?;
        self.gpu.write(&self.displacement, &system.placed(u, 1.0, false));
        Ok(())
    }
}

impl Solid<'_> {
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.law.check(self.parameters, self.cells.len())?;
        if let Some(clusters) = &self.clusters {
            clusters.check(self.points.len(), self.cells.len())?;
        }
        let outside = |cell: &[u32; 4]| cell.iter().any(|&node| node as usize >= self.points.len());
        if let Some(cell) = self.cells.iter().position(outside) {
            return Err(Error::Input(format!(
                "cell {cell} is {:?}; there are {} points",
                self.cells[cell],
                self.points.len()
            )));
        }
        match self.cells.iter().position(|&cell| !(geometry(self.points, cell)[9] > 0.0)) {
            Some(cell) => Err(Error::Input(format!(
                "cell {cell} has no volume or is inverted; remove it or turn it round"
            ))),
            None => Ok(()),
        }
    }
}

/// Gradients of the shape functions of corners 1, 2, 3, and the volume.
pub(crate) fn geometry(points: &[[f64; 3]], cell: [u32; 4]) -> [f64; 10] {
    let corner = |a: usize| points[cell[a] as usize];
    let edge = |a: usize| std::array::from_fn::<f64, 3, _>(|i| corner(a)[i] - corner(0)[i]);
    let cross = |a: [f64; 3], b: [f64; 3]| {
        std::array::from_fn::<f64, 3, _>(|i| {
            a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]
        })
    };
    let [e1, e2, e3] = [edge(1), edge(2), edge(3)];
    let normals = [cross(e2, e3), cross(e3, e1), cross(e1, e2)];
    let six_volumes: f64 = (0..3).map(|i| e1[i] * normals[0][i]).sum();
    std::array::from_fn(|k| {
        if k == 9 { six_volumes / 6.0 } else { normals[k / 3][k % 3] / six_volumes }
    })
}

/// Buffers of all chunks.
struct Shared {
    response: Buffer,
    displacement: Buffer,
    force: Buffer,
    clusters: Option<ClusterBuffers>,
    /// Whether the kernel of the law reads parameters.
    reads_parameters: bool,
}

/// The sources of the buffers of a chunk.
struct Parts<'a> {
    gpu: &'a Gpu,
    solid: &'a Solid<'a>,
    system: &'a System,
    kernels: &'a Kernels,
    shared: &'a Shared,
}

impl Parts<'_> {
    fn commands(&self, k: usize) -> Result<ChunkCommands, Error> {
        let Parts { gpu, solid, system, kernels, shared } = self;
        let Shared { response, displacement, force, clusters, .. } = shared;
        let (chunk, row_of) = (&system.layout.chunks[k], &system.layout.row_of);
        let of_chunk = || chunk.cells.iter().map(|&cell| solid.cells[cell as usize]);
        let rows: Vec<[u32; 4]> = of_chunk().map(|c| c.map(|node| row_of[node as usize])).collect();
        let shapes: Vec<f32> =
            of_chunk().flat_map(|cell| geometry(solid.points, cell)).map(|x| x as f32).collect();
        let parameters: Vec<f32> = if solid.parameters.len() == 1 {
            solid.parameters[0].iter().map(|&p| p as f32).collect()
        } else {
            let n = solid.law.n_parameters();
            let row = |&cell: &u32| solid.parameters[cell as usize][..n].iter().map(|&p| p as f32);
            chunk.cells.iter().flat_map(row).collect()
        };
        let rows_of_cells = gpu.buffer("cells", &rows)?;
        let shapes = gpu.buffer("shapes of cells", &shapes)?;
        let parameters = gpu.buffer("parameters", &parameters)?;
        let size = gpu.uniform(&[rows.len() as u32, 0, 0, 0]);
        let mut bound =
            vec![(0, displacement), (1, &rows_of_cells), (2, &shapes), (4, response), (5, &size)];
        if shared.reads_parameters {
            bound.push((3, &parameters));
        }
        let of: Vec<u32> = match solid.clusters {
            Some(clusters) => chunk.cells.iter().map(|&cell| clusters.of[cell as usize]).collect(),
            None => Vec::new(),
        };
        let of = gpu.buffer("clusters of cells", &of)?;
        if let Some(clusters) = clusters {
            bound.extend([(6, &clusters.pressures), (7, &of)]);
        }
        let respond = gpu.bind_at(&kernels.respond, &bound);

        let places = chunk.columns.len();
        let own = |row: u32| chunk.rows.contains(&(row as usize));
        let mut of_blocks = vec![ELSEWHERE; 16 * rows.len()];
        let mut of_forces = vec![ELSEWHERE; 4 * rows.len()];
        let of_cells = of_blocks.par_chunks_mut(16).zip(of_forces.par_chunks_mut(4)).zip(&rows);
        of_cells.try_for_each(|((blocks, forces), cell)| {
            for a in (0..4).filter(|&a| own(cell[a])) {
                forces[a] = cell[a] - chunk.rows.start as u32;
                for b in 0..4 {
                    blocks[4 * a + b] = chunk.place(cell[a], cell[b])? as u32;
                }
            }
            Ok::<(), Error>(())
        })?;
        let of_blocks = Gathered::by_number(places, &of_blocks);
        let of_forces = Gathered::by_number(chunk.rows.len(), &of_forces);
        let bind = |kernel, parts: &Gathered<u32>, sums, size: [u32; 4]| -> Result<Group, Error> {
            let starts = gpu.buffer("parts", &parts.starts)?;
            let parts = gpu.buffer("parts", &parts.parts)?;
            Ok(gpu.bind(kernel, &[response, &starts, &parts, sums, &gpu.uniform(&size)]))
        };
        let size = [places as u32, 0, rows.len() as u32, 0];
        let blocks = bind(&kernels.blocks, &of_blocks, &system.chunks[k].values, size)?;
        let size = [chunk.rows.start as u32, chunk.rows.len() as u32, rows.len() as u32, 0];
        let forces = bind(&kernels.forces, &of_forces, force, size)?;
        let groups = |threads| workgroups(threads, usize::MAX);
        let with_clusters = solid.clusters.zip(clusters.as_ref());
        let clusters = with_clusters
            .map(|(clusters, buffers)| buffers.commands(gpu, system, k, clusters))
            .transpose()?;
        Ok(ChunkCommands {
            respond: (respond, groups(rows.len())),
            blocks: (blocks, groups(places)),
            forces: (forces, groups(chunk.rows.len())),
            clusters: clusters.map(|group| (group, groups(places))),
        })
    }
}
