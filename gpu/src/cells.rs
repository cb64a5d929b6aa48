//! Cells on the device: internal forces and the tangent's blocks from the displacement.

use crate::device::{Gpu, dispatch, workgroups};
use crate::layout::OF_CELL;
use crate::{Error, Law, System};
use std::sync::Arc;
use wgpu::{BindGroup, Buffer, CommandEncoder, ComputePipeline};

/// A body of linear tetrahedra.
#[derive(Clone, Copy, Debug)]
pub struct Solid<'a> {
    /// Points at rest [m].
    pub points: &'a [[f64; 3]],
    /// Corners of the cells, right-handed.
    pub cells: &'a [[u32; 4]],
    /// What the cells answer with.
    pub law: &'a Law,
    /// One row of the law's parameters for all cells, or one for each.
    pub parameters: &'a [Vec<f64>],
}

struct Kernels {
    respond: ComputePipeline,
    blocks: ComputePipeline,
    forces: ComputePipeline,
}

/// The commands of a run of rows.
struct ChunkCommands {
    respond: (BindGroup, u32),
    blocks: (BindGroup, u32),
    forces: (BindGroup, u32),
}

/// Cells that write their tangent into the matrix of a [`System`].
pub struct CellBuffers {
    gpu: Arc<Gpu>,
    kernels: Kernels,
    chunks: Vec<ChunkCommands>,
    displacement: Buffer,
    force: Buffer,
    n_responses: usize,
}

impl CellBuffers {
    /// A body's cells, and the system that they fill. `pairs` as in [`System::new`].
    ///
    /// # Errors
    /// Input that makes no sense; too little memory; a driver that refuses.
    pub fn new(
        gpu: &Arc<Gpu>,
        solid: &Solid<'_>,
        pairs: &[(u32, u32)],
    ) -> Result<(Self, System), Error> {
        let n_nodes = solid.points.len();
        solid.check()?;
        let system = System::with_cells(gpu, n_nodes, pairs, solid.cells)?;
        let source = format!(
            "{}\n{}",
            include_str!("kernels/cells.wgsl"),
            solid.law.source(solid.parameters)
        );
        let gather = include_str!("kernels/gather.wgsl");
        let kernels = Kernels {
            respond: gpu.kernel(&source, "respond_all")?,
            blocks: gpu.kernel(gather, "gather_blocks")?,
            forces: gpu.kernel(gather, "gather_forces")?,
        };
        let n_responses = system.layout.chunks.iter().map(|chunk| chunk.cells.len()).sum();
        let largest = system.layout.chunks.iter().map(|chunk| chunk.cells.len()).max();
        let response = gpu.zeros::<f32>("responses of cells", OF_CELL * largest.unwrap_or(0))?;
        let displacement = gpu.zeros::<f32>("displacement", 3 * n_nodes)?;
        let force = gpu.zeros::<f32>("internal force", 3 * n_nodes)?;
        let parts = Parts { gpu, solid, system: &system, kernels: &kernels };
        let chunks = (0..system.layout.chunks.len())
            .map(|k| parts.commands(k, &response, &displacement, &force))
            .collect::<Result<_, _>>()?;
        gpu.check()?;
        let cells =
            CellBuffers { gpu: gpu.clone(), kernels, chunks, displacement, force, n_responses };
        Ok((cells, system))
    }

    /// Evaluations of a law in all chunks: above the number of cells by those on the border of chunks.
    pub fn n_responses(&self) -> usize {
        self.n_responses
    }

    /// The tangent at a displacement, with `shift` added to its diagonal, becomes the matrix of the system.
    ///
    /// # Errors
    /// A displacement of a wrong length or not finite; the device.
    pub fn linearize(&self, system: &mut System, u: &[f64], shift: f64) -> Result<(), Error> {
        self.move_to(system, u)?;
        let mut encoder = self.gpu.encoder();
        self.encode(&mut encoder, true);
        system.encode_preparation(&mut encoder, shift);
        self.gpu.submit(encoder);
        self.gpu.check()
    }

    /// The internal force at a displacement, in single precision.
    ///
    /// # Errors
    /// Those of [`CellBuffers::linearize`].
    pub fn internal_force(&self, system: &System, u: &[f64]) -> Result<Vec<f64>, Error> {
        self.move_to(system, u)?;
        let mut encoder = self.gpu.encoder();
        self.encode(&mut encoder, false);
        let force: Vec<f32> = self.gpu.read(encoder, &self.force, u.len())?;
        Ok(system.in_order(&force, 1.0))
    }

    fn move_to(&self, system: &System, u: &[f64]) -> Result<(), Error> {
        system.scale_of(u)?;
        self.gpu.write(&self.displacement, &system.placed(u, 1.0, false));
        Ok(())
    }

    /// Forces, and blocks where they are asked for.
    fn encode(&self, encoder: &mut CommandEncoder, with_blocks: bool) {
        let Kernels { respond, blocks, forces } = &self.kernels;
        for chunk in &self.chunks {
            dispatch(encoder, respond, &chunk.respond.0, chunk.respond.1);
            dispatch(encoder, forces, &chunk.forces.0, chunk.forces.1);
            if with_blocks {
                dispatch(encoder, blocks, &chunk.blocks.0, chunk.blocks.1);
            }
        }
    }
}

impl Solid<'_> {
    fn check(&self) -> Result<(), Error> {
        self.law.check(self.parameters, self.cells.len())?;
        let outside = |cell: &[u32; 4]| cell.iter().any(|&node| node as usize >= self.points.len());
        if let Some(cell) = self.cells.iter().position(outside) {
            return Err(Error::Input(format!(
                "cell {cell} is {:?}; there are {} points",
                self.cells[cell],
                self.points.len()
            )));
        }
        match self.cells.iter().position(|&cell| !(geometry(self.points, cell)[9] > 0.0)) {
            Some(cell) => Err(Error::Input(format!("cell {cell} has no volume, or is inside out"))),
            None => Ok(()),
        }
    }
}

/// Gradients of the shape functions of corners 1, 2, 3, and the volume.
fn geometry(points: &[[f64; 3]], cell: [u32; 4]) -> [f64; 10] {
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

/// What the buffers of a chunk are made from.
struct Parts<'a> {
    gpu: &'a Gpu,
    solid: &'a Solid<'a>,
    system: &'a System,
    kernels: &'a Kernels,
}

impl Parts<'_> {
    fn commands(
        &self,
        k: usize,
        response: &Buffer,
        displacement: &Buffer,
        force: &Buffer,
    ) -> Result<ChunkCommands, Error> {
        let Parts { gpu, solid, system, kernels } = self;
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
        let respond = gpu.bind(
            &kernels.respond,
            &[
                displacement,
                &rows_of_cells,
                &shapes,
                &parameters,
                response,
                &gpu.uniform([rows.len() as u32, 0, 0, 0]),
            ],
        );

        let places = chunk.columns.len();
        let own = |row: u32| chunk.rows.contains(&(row as usize));
        let corners =
            || rows.iter().zip(0u32..).flat_map(|(cell, k)| (0..4).map(move |a| (cell, k, a)));
        let corners = || corners().filter(|&(cell, _, a)| own(cell[a]));
        let mut of_blocks = Vec::with_capacity(16 * rows.len());
        for (cell, k, a) in corners() {
            for b in 0..4 {
                of_blocks.push((chunk.place(cell[a], cell[b])?, 16 * k + (4 * a + b) as u32));
            }
        }
        let of_blocks = Gathered::new(places, &of_blocks);
        let first = chunk.rows.start;
        let of_forces: Vec<_> =
            corners().map(|(cell, k, a)| (cell[a] as usize - first, 16 * k + a as u32)).collect();
        let of_forces = Gathered::new(chunk.rows.len(), &of_forces);
        let bind = |kernel, parts: &Gathered, sums, size| -> Result<BindGroup, Error> {
            let starts = gpu.buffer("parts", &parts.starts)?;
            let parts = gpu.buffer("parts", &parts.parts)?;
            Ok(gpu.bind(kernel, &[response, &starts, &parts, sums, &gpu.uniform(size)]))
        };
        let size = [places as u32, 0, 0, 0];
        let blocks = bind(&kernels.blocks, &of_blocks, &system.chunks[k].values, size)?;
        let size = [chunk.rows.start as u32, chunk.rows.len() as u32, 0, 0];
        let forces = bind(&kernels.forces, &of_forces, force, size)?;
        let groups = |threads| workgroups(threads, usize::MAX);
        Ok(ChunkCommands {
            respond: (respond, groups(rows.len())),
            blocks: (blocks, groups(places)),
            forces: (forces, groups(chunk.rows.len())),
        })
    }
}

/// What is added up at each place, in the order it is given in.
struct Gathered {
    starts: Vec<u32>,
    parts: Vec<u32>,
}

impl Gathered {
    fn new(places: usize, given: &[(usize, u32)]) -> Self {
        let mut starts = vec![0u32; places + 1];
        given.iter().for_each(|(place, _)| starts[place + 1] += 1);
        (0..places).for_each(|k| starts[k + 1] += starts[k]);
        let (mut next, mut parts) = (starts.clone(), vec![0u32; starts[places] as usize]);
        for &(place, part) in given {
            parts[next[place] as usize] = part;
            next[place] += 1;
        }
        Gathered { starts, parts }
    }
}
