//! A V-cycle of multigrid as a preconditioner. The levels come from the caller; the finest matrix is the one that the
//! system has. The smoother is Chebyshev's iteration on the inverse diagonal blocks (Adams, Brezina, Hu and Tuminaro,
//! J. Comput. Phys. 188, 2003, 593): unlike Gauss-Seidel it needs nothing but products. The cycle is symmetric.

use crate::device::{Gpu, dispatch};
use crate::hierarchy::{Hierarchy, Level, MODES};
use crate::layout::SLICE;
use crate::operator::Operator;
use crate::system::Shared;
use crate::{Error, System};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;
use wgpu::{BindGroup, Buffer, CommandEncoder, ComputePipeline};

/// Steps of the smoother before the correction from below, and after it.
pub const DEGREE: usize = 2;

/// The smoother damps eigenvalues of `D^-1 A` from the largest to this part of it.
const REACH: f64 = 0.1;

/// By which the largest eigenvalue is taken larger than its estimate, which is one from below.
const MARGIN: f64 = 1.1;

/// Workgroups of a dispatch; further slices are reached by a stride.
const MOST_GROUPS: usize = 65_535;

/// The cycle on the device.
pub(crate) struct Cycle {
    kernels: Kernels,
    finest: Buffers,
    coarse: Vec<CoarseLevel>,
    coarsest: Coarsest,
    commands: Vec<Command>,
}

/// The way down from a level and up to it, and its vectors.
struct Buffers {
    /// Length of a block's column, and number of nodes here and below.
    shape: [usize; 3],
    up: Operator,
    down: Operator,
    other: Buffer,
    residual: Buffer,
}

/// A level below the finest.
struct CoarseLevel {
    matrix: Operator,
    inverse: Buffer,
    b: Buffer,
    x: Buffer,
    buffers: Buffers,
}

struct Coarsest {
    inverse: Buffer,
    b: Buffer,
    x: Buffer,
    n: usize,
}

struct Kernels {
    /// By length of a block's column: of the finest level and of others.
    smooth: [ComputePipeline; 2],
    residual: [ComputePipeline; 2],
    restrict: [ComputePipeline; 2],
    restrict_last: [ComputePipeline; 2],
    prolongate: [ComputePipeline; 2],
    coarsest: ComputePipeline,
}

struct Command {
    kernel: ComputePipeline,
    group: BindGroup,
    count: u32,
}

/// What a kernel of a level multiplies with, see the kernels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Task {
    first: u32,
    n_rows: u32,
    stride: u32,
    unused: u32,
    of_x: f32,
    of_y: f32,
    of_inverse: f32,
    of_product: f32,
}

/// Chebyshev's iteration: the part of the first step, and of later ones that of the last change and of the residual.
struct Chebyshev {
    first: f64,
    later: Vec<[f64; 2]>,
}

impl Chebyshev {
    /// For a level whose largest eigenvalue was estimated so.
    fn new(largest: f64) -> Self {
        let (high, low) = (MARGIN * largest, REACH * MARGIN * largest);
        let (middle, half) = (0.5 * (high + low), 0.5 * (high - low));
        let (mut rho, mut later) = (half / middle, Vec::new());
        for _ in 1..DEGREE {
            let next = 1.0 / (2.0 * middle / half - rho);
            later.push([rho * next, 2.0 * next / half]);
            rho = next;
        }
        Chebyshev { first: 1.0 / middle, later }
    }
}

impl Cycle {
    /// Room for a hierarchy, without numbers.
    pub fn new(gpu: &Gpu, system: &System, hierarchy: &Hierarchy<'_>) -> Result<Self, Error> {
        hierarchy.check(system.n_dofs() / 3)?;
        let nodes = hierarchy.nodes();
        let row_of = &system.layout().row_of;
        let placed = |node: usize| row_of[node] as usize;
        let finest = Buffers::new(gpu, &hierarchy.levels[0], [3, nodes[0], nodes[1]], placed)?;
        let levels = hierarchy.levels[1..].iter().zip(nodes[1..].windows(2));
        let coarse = levels
            .map(|(level, pair)| CoarseLevel::new(gpu, level, pair[0], pair[1]))
            .collect::<Result<_, Error>>()?;
        let n = MODES * nodes[nodes.len() - 1];
        let coarsest = Coarsest {
            inverse: gpu.zeros::<f32>("inverse of the coarsest level", n * n)?,
            b: gpu.zeros::<f32>("coarsest level", n)?,
            x: gpu.zeros::<f32>("coarsest level", n)?,
            n,
        };
        let kernels = Kernels::new(gpu)?;
        Ok(Cycle { kernels, finest, coarse, coarsest, commands: Vec::new() })
    }

    /// Whether a hierarchy has the pattern of this one, so that its numbers find room.
    pub fn fits(&self, hierarchy: &Hierarchy<'_>) -> bool {
        let own =
            [self.finest.shape].into_iter().chain(self.coarse.iter().map(|l| l.buffers.shape));
        let nodes = hierarchy.nodes();
        own.map(|shape| shape[1]).chain([self.coarsest.n / MODES]).eq(nodes)
    }

    /// Takes the numbers of a hierarchy of this pattern.
    pub fn take(
        &mut self,
        gpu: &Gpu,
        system: &System,
        hierarchy: &Hierarchy<'_>,
    ) -> Result<(), Error> {
        hierarchy.check(system.n_dofs() / 3)?;
        self.finest.write(gpu, &hierarchy.levels[0]);
        for (own, level) in self.coarse.iter().zip(&hierarchy.levels[1..]) {
            own.write(gpu, level);
        }
        gpu.write(&self.coarsest.inverse, hierarchy.coarsest);
        let smoothers: Vec<_> =
            hierarchy.levels.iter().map(|level| Chebyshev::new(level.largest)).collect();
        self.commands = Commands::of(gpu, system, self, &smoothers);
        gpu.check()
    }

    /// Where it leaves its result.
    pub fn result(&self) -> &Buffer {
        &self.finest.other
    }

    /// From `D^-1 r` in `z` and `r` in `rs` to its result.
    pub fn encode(&self, encoder: &mut CommandEncoder) {
        for Command { kernel, group, count } in &self.commands {
            dispatch(encoder, kernel, group, *count);
        }
    }

    /// Bytes that it reads and writes, for a finest matrix of so many, a vector that neighbours share counted once.
    pub fn bytes(&self, finest: usize) -> usize {
        let coarse = self.coarse.iter();
        let levels = [(finest, 3, &self.finest)]
            .into_iter()
            .chain(coarse.map(|level| (level.matrix.bytes(), MODES, &level.buffers)));
        let of_level = |(matrix, size, buffers): (usize, usize, &Buffers)| {
            let vector = 4 * size * buffers.shape[1];
            let inverse = 2 * size * (size + 1) * buffers.shape[1];
            // A step reads two iterates and the right-hand side, and writes one; the residual takes three vectors.
            let steps = (2 * DEGREE - 1) * (matrix + inverse + 4 * vector);
            let ways = buffers.up.bytes() + buffers.down.bytes() + 3 * vector;
            steps + matrix + 3 * vector + ways + 12 * MODES * buffers.shape[2]
        };
        levels.map(of_level).sum::<usize>() + 4 * self.coarsest.n * self.coarsest.n
    }

    /// Number of dispatches.
    pub fn dispatches(&self) -> usize {
        self.commands.len()
    }
}

impl Buffers {
    /// `row_of` tells where the rows of this level are.
    fn new(
        gpu: &Gpu,
        level: &Level<'_>,
        shape: [usize; 3],
        row_of: impl Fn(usize) -> usize,
    ) -> Result<Self, Error> {
        let [size, n, n_below] = shape;
        let (mut up, mut down) = (vec![Vec::new(); n], vec![Vec::new(); n_below]);
        for node in 0..n {
            let row = row_of(node);
            for block in level.starts[node]..level.starts[node + 1] {
                let column = level.columns[block as usize];
                up[row].push((column, block));
                down[column as usize].push((row as u32, block));
            }
        }
        // Neighbours in the order of their rows.
        down.iter_mut().for_each(|row| row.sort_unstable());
        Ok(Buffers {
            shape,
            up: Operator::new(gpu, [size, MODES], &up)?,
            down: Operator::new(gpu, [MODES, size], &down)?,
            other: gpu.zeros::<f32>("iterate of multigrid", size * n)?,
            residual: gpu.zeros::<f32>("residual of multigrid", size * n)?,
        })
    }

    fn write(&self, gpu: &Gpu, level: &Level<'_>) {
        let size = self.shape[0];
        let entry = |block: u32, i: usize, k: usize| {
            level.blocks[size * MODES * block as usize + MODES * i + k]
        };
        self.up.write(gpu, entry);
        self.down.write(gpu, |block, i, k| entry(block, k, i));
    }
}

impl CoarseLevel {
    fn new(gpu: &Gpu, level: &Level<'_>, n: usize, n_below: usize) -> Result<Self, Error> {
        let mut rows = vec![Vec::new(); n];
        for (&[row, column], block) in level.pairs.iter().zip(0u32..) {
            rows[row as usize].push((column, 2 * block));
            if row != column {
                rows[column as usize].push((row, 2 * block + 1));
            }
        }
        rows.iter_mut().for_each(|row: &mut Vec<_>| row.sort_unstable());
        let triangle = MODES * (MODES + 1) / 2;
        Ok(CoarseLevel {
            matrix: Operator::new(gpu, [MODES, MODES], &rows)?,
            inverse: gpu.zeros::<f32>("inverses of multigrid", triangle * n)?,
            b: gpu.zeros::<f32>("right-hand side of multigrid", MODES * n)?,
            x: gpu.zeros::<f32>("iterate of multigrid", MODES * n)?,
            buffers: Buffers::new(gpu, level, [MODES, n, n_below], |node| node)?,
        })
    }

    fn write(&self, gpu: &Gpu, level: &Level<'_>) {
        let square = MODES * MODES;
        self.matrix.write(gpu, |source, i, k| {
            let at = if source % 2 == 0 { MODES * i + k } else { MODES * k + i };
            level.values[square * (source as usize / 2) + at]
        });
        let triangle = (0..MODES).flat_map(|i| (i..MODES).map(move |k| MODES * i + k));
        let blocks = level.inverses.chunks_exact(square);
        let inverses: Vec<f32> =
            blocks.flat_map(|block| triangle.clone().map(move |at| block[at])).collect();
        gpu.write(&self.inverse, &inverses);
        self.buffers.write(gpu, level);
    }
}

impl Kernels {
    fn new(gpu: &Gpu) -> Result<Self, Error> {
        let kernel = |entry: &str, rows: usize, columns: usize| {
            let threads = SLICE * rows;
            let shape =
                format!("const R = {rows}u;\nconst C = {columns}u;\nconst THREADS = {threads}u;\n");
            gpu.kernel(&(shape + include_str!("kernels/level.wgsl")), entry)
        };
        let square = |entry| Ok([kernel(entry, 3, 3)?, kernel(entry, MODES, MODES)?]);
        let down = |entry| Ok([kernel(entry, MODES, 3)?, kernel(entry, MODES, MODES)?]);
        let coarsest =
            [include_str!("kernels/sum.wgsl"), include_str!("kernels/coarsest.wgsl")].join("\n");
        Ok(Kernels {
            smooth: square("smooth_level")?,
            residual: square("find_residual")?,
            restrict: down("restrict_and_begin")?,
            restrict_last: down("restrict_last")?,
            prolongate: [kernel("prolongate", 3, MODES)?, kernel("prolongate", MODES, MODES)?],
            coarsest: gpu.kernel(&coarsest, "solve_coarsest")?,
        })
    }
}

/// A matrix as the kernels of a level read it: rows, values, columns, slices of each chunk.
type Part<'a> = (Range<usize>, [&'a Buffer; 3]);

fn parts(operator: &Operator) -> Vec<Part<'_>> {
    let chunks = operator.chunks.iter();
    chunks.map(|c| (c.rows.clone(), [&c.values, &c.columns, &c.starts])).collect()
}

/// A level with what it is made of, wherever that is.
struct At<'a> {
    /// Of the kernels.
    kind: usize,
    matrix: Vec<Part<'a>>,
    inverse: &'a Buffer,
    /// Right-hand side, and numbers from one of its rows to the next.
    b: (&'a Buffer, u32),
    /// Two iterates that replace each other.
    iterates: [&'a Buffer; 2],
    buffers: &'a Buffers,
}

struct Commands<'a> {
    gpu: &'a Gpu,
    kernels: &'a Kernels,
    all: Vec<Command>,
}

impl<'a> Commands<'a> {
    fn of(gpu: &Gpu, system: &System, cycle: &Cycle, smoothers: &[Chebyshev]) -> Vec<Command> {
        let Shared { z, rs, inverse, matrix } = system.shared();
        let finest = At {
            kind: 0,
            matrix,
            inverse,
            b: (rs, 6),
            iterates: [z, &cycle.finest.other],
            buffers: &cycle.finest,
        };
        let coarse = cycle.coarse.iter().map(|level| At {
            kind: 1,
            matrix: parts(&level.matrix),
            inverse: &level.inverse,
            b: (&level.b, MODES as u32),
            iterates: [&level.x, &level.buffers.other],
            buffers: &level.buffers,
        });
        let levels: Vec<At<'_>> = [finest].into_iter().chain(coarse).collect();
        let mut commands = Commands { gpu, kernels: &cycle.kernels, all: Vec::new() };
        // z is D^-1 r, and the first iterate a multiple of it; below, the restriction leaves the iterate itself.
        let scale = |k: usize| if k == 0 { smoothers[0].first } else { 1.0 };
        let reached: Vec<usize> = (0..levels.len())
            .map(|k| {
                let next = levels.get(k + 1).map(|next| (next, smoothers[k + 1].first));
                commands.descend(&levels[k], &smoothers[k], scale(k), next, &cycle.coarsest)
            })
            .collect();
        commands.solve(&cycle.coarsest);
        let mut below = &cycle.coarsest.x;
        for k in (0..levels.len()).rev() {
            let scale = if DEGREE == 1 { scale(k) } else { 1.0 };
            let end = commands.ascend(&levels[k], &smoothers[k], (reached[k], scale), below);
            below = levels[k].iterates[end];
        }
        commands.all
    }

    /// Smooths from the first iterate, over `scale`, and hands the residual down; returns which iterate it reached.
    fn descend(
        &mut self,
        at: &At<'_>,
        smoother: &Chebyshev,
        scale: f64,
        next: Option<(&At<'_>, f64)>,
        coarsest: &Coarsest,
    ) -> usize {
        let (mut now, mut scale) = (0, scale);
        for (k, &[change, part]) in smoother.later.iter().enumerate() {
            // Before the first iterate there was zero.
            let before = if k == 0 { 0.0 } else { -change };
            self.smooth(at, now, [scale * (1.0 + change), before, part, scale]);
            (now, scale) = (1 - now, 1.0);
        }
        let Buffers { residual, down, .. } = at.buffers;
        let task = Task { stride: at.b.1, of_product: scale as f32, ..Task::default() };
        let bound = [(3, at.iterates[now]), (4, residual), (5, at.b.0)];
        let kernels = self.kernels;
        self.push(&kernels.residual[at.kind], &at.matrix, &bound, task);
        match next {
            Some((next, first)) => {
                let task = Task { of_inverse: first as f32, ..Task::default() };
                let bound =
                    [(3, residual), (4, next.b.0), (6, next.inverse), (8, next.iterates[0])];
                self.push(&kernels.restrict[at.kind], &parts(down), &bound, task);
            }
            None => {
                let bound = [(3, residual), (4, &coarsest.b)];
                self.push(&kernels.restrict_last[at.kind], &parts(down), &bound, Task::default());
            }
        }
        now
    }

    /// Adds the correction from below to an iterate over its scale, and smooths; returns which iterate it reached.
    fn ascend(
        &mut self,
        at: &At<'_>,
        smoother: &Chebyshev,
        (mut now, scale): (usize, f64),
        below: &Buffer,
    ) -> usize {
        let task = Task { of_y: scale as f32, ..Task::default() };
        let bound = [(3, below), (4, at.iterates[now])];
        let kernels = self.kernels;
        self.push(&kernels.prolongate[at.kind], &parts(&at.buffers.up), &bound, task);
        self.smooth(at, now, [1.0, 0.0, smoother.first, 1.0]);
        now = 1 - now;
        for &[change, part] in &smoother.later {
            self.smooth(at, now, [1.0 + change, -change, part, 1.0]);
            now = 1 - now;
        }
        now
    }

    /// From an iterate to the other one: parts of the one and the other, of the preconditioned residual, and of the
    /// product in it.
    fn smooth(&mut self, at: &At<'_>, now: usize, of: [f64; 4]) {
        let [of_x, of_y, of_inverse, of_product] = of.map(|of| of as f32);
        let task = Task { stride: at.b.1, of_x, of_y, of_inverse, of_product, ..Task::default() };
        let [x, y] = [at.iterates[now], at.iterates[1 - now]];
        let bound = [(3, x), (4, y), (5, at.b.0), (6, at.inverse)];
        let kernels = self.kernels;
        self.push(&kernels.smooth[at.kind], &at.matrix, &bound, task);
    }

    fn solve(&mut self, coarsest: &Coarsest) {
        let Coarsest { inverse, b, x, n } = coarsest;
        let size = self.gpu.uniform([*n as u32, 0, 0, 0]);
        let kernel = &self.kernels.coarsest;
        let group = self.gpu.bind(kernel, &[inverse, b, x, &size]);
        let count = (*n).clamp(1, MOST_GROUPS) as u32;
        self.all.push(Command { kernel: kernel.clone(), group, count });
    }

    fn push(
        &mut self,
        kernel: &ComputePipeline,
        matrix: &[Part<'_>],
        bound: &[(u32, &Buffer)],
        task: Task,
    ) {
        for (rows, [values, columns, starts]) in matrix {
            let (first, n_rows) = (rows.start as u32, rows.len() as u32);
            let task = self.gpu.uniform(Task { first, n_rows, ..task });
            let own = [(0, *values), (1, *columns), (2, *starts), (7, &task)];
            let group = self.gpu.bind_at(kernel, &[&own[..], bound].concat());
            let count = rows.len().div_ceil(SLICE).clamp(1, MOST_GROUPS) as u32;
            self.all.push(Command { kernel: kernel.clone(), group, count });
        }
    }
}
