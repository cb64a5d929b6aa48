//! The cells of a body in batches of [`LANES`] with one set of law parameters.

use super::blocks::BlockPattern;
use super::cell_order::cell_order;
use super::task_sums::TaskSums;
use super::tasks::task;
use crate::element::{Geometry, Shape};
use crate::law::Material;
use crate::number::{LANES, Lane, Lanes, Scalar};
use crate::tensor::{Mat3, Vec3};
use crate::unroll::{array, each, tabulate};
use std::marker::PhantomData;

/// Some cells with one set of law parameters; the last of a group repeats a cell with no volume.
pub(super) struct Batch<const N: usize> {
    pub nodes: [[u32; N]; LANES],
    pub gradients: [Vec3<Lane>; 3],
    /// Volume of the cell.
    pub volume: Lane,
    pub tissue: u32,
    /// How many of the lanes are cells of their own.
    pub n_cells: u32,
}

/// Where a cell's results are: batch and lane.
#[derive(Clone, Copy)]
pub(super) struct Slot {
    pub batch: u32,
    pub lane: u8,
}

/// Cells of an element with `N` nodes.
pub(super) struct CellBatches<E, const N: usize> {
    pub nodes: Vec<[u32; N]>,
    pub batches: Vec<Batch<N>>,
    /// The rows of parameters of the tissues.
    pub tissues: Vec<Vec<f64>>,
    pub slots: Vec<Slot>,
    /// Where their contributions are added up.
    pub sums: TaskSums<N>,
    shape: PhantomData<E>,
}

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// Batches of a task.
    pub const TASK: usize = task(N);

    /// Local pairs `a <= b`, whose blocks a cell contributes.
    pub const PAIRS: usize = N * (N + 1) / 2;

    /// Batches cells that share their law parameters; `pattern` must hold their pairs of nodes.
    pub fn new(
        nodes: Vec<[u32; N]>,
        geometry: &[Geometry],
        material: &Material,
        pattern: &BlockPattern,
        n_points: usize,
    ) -> Self {
        let mut batches = Vec::with_capacity(nodes.len() / LANES + 1);
        let mut slots = vec![Slot { batch: 0, lane: 0 }; nodes.len()];
        let mut rows = Vec::new();
        let mut place = vec![0; nodes.len()];
        let order = cell_order(&nodes, pattern, n_points);
        for (at, &cell) in (0u32..).zip(order.iter().flatten()) {
            place[cell as usize] = at;
        }
        for (tissue, mut group) in (0u32..).zip(tissues(nodes.len(), material)) {
            rows.push(material.row(group[0]).to_vec());
            group.sort_by_key(|&cell| place[cell]);
            for members in group.chunks(LANES) {
                for (lane, &cell) in members.iter().enumerate() {
                    slots[cell] = Slot { batch: batches.len() as u32, lane: lane as u8 };
                }
                batches.push(batch(members, &nodes, geometry, tissue));
            }
        }
        CellBatches {
            sums: TaskSums::new(&nodes, &slots, batches.len(), pattern, n_points),
            nodes,
            batches,
            tissues: rows,
            slots,
            shape: PhantomData,
        }
    }
}

/// The pairs of a cell's nodes, `a <= b` in local numbers, in the order its blocks are stored.
pub(super) fn pairs_of<const N: usize>(nodes: &[u32; N]) -> impl Iterator<Item = [u32; 2]> + '_ {
    (0..N).flat_map(move |a| (a..N).map(move |b| [nodes[a], nodes[b]]))
}

/// Cells grouped by equal law parameters.
pub(super) fn tissues(n_cells: usize, material: &Material) -> Vec<Vec<usize>> {
    let row = |cell: usize| material.of_cell(cell);
    let mut order: Vec<usize> = (0..n_cells).collect();
    order.sort_by(|&a, &b| {
        let mut values = row(a).iter().zip(row(b)).map(|(x, y)| x.total_cmp(y));
        values.find(|o| o.is_ne()).unwrap_or(a.cmp(&b))
    });
    order.chunk_by(|&a, &b| row(a) == row(b)).map(<[usize]>::to_vec).collect()
}

fn batch<const N: usize>(
    members: &[usize],
    nodes: &[[u32; N]],
    geometry: &[Geometry],
    tissue: u32,
) -> Batch<N> {
    let cell_of = |lane: usize| members[lane.min(members.len() - 1)];
    let lanes =
        |f: &dyn Fn(&Geometry) -> f64| Lanes(std::array::from_fn(|l| f(&geometry[cell_of(l)])));
    let mut volume = lanes(&|g| g.volume);
    for lane in members.len()..LANES {
        volume[lane] = 0.0;
    }
    Batch {
        nodes: std::array::from_fn(|l| nodes[cell_of(l)]),
        gradients: std::array::from_fn(|k| std::array::from_fn(|i| lanes(&|g| g.gradients[k][i]))),
        volume,
        tissue,
        n_cells: members.len() as u32,
    }
}

impl<const N: usize> Batch<N> {
    /// The deformation gradient at the point with the given slopes of the shape functions.
    #[inline(always)]
    pub fn deformation(&self, slopes: &[[f64; 3]; N], u: &[f64]) -> Mat3<Lane> {
        deformation(slopes, &self.gradients, |a, i| {
            let mut value = Lane::default();
            for lane in 0..LANES {
                value[lane] = u[3 * self.nodes[lane][a] as usize + i];
            }
            value
        })
    }
}

/// `F = I + sum_a u_a (x) grad N_a`, `grad N_a = sum_k slopes[a][k] g_k`.
#[inline(always)]
pub(super) fn deformation<S: Scalar, const N: usize>(
    slopes: &[[f64; 3]; N],
    gradients: &[Vec3<S>; 3],
    u: impl Fn(usize, usize) -> S,
) -> Mat3<S> {
    let zero = gradients[0][0].constant(0.0);
    let mut h = tabulate!(|_, _| zero.clone());
    each!(N, |a| {
        for i in 0..3 {
            let value = u(a, i);
            array!(3, |k| add_product(&mut h[i][k], slopes[a][k], &value));
        }
    });
    tabulate!(|i, j| {
        let sum = h[i][0].clone() * gradients[0][j].clone()
            + h[i][1].clone() * gradients[1][j].clone()
            + h[i][2].clone() * gradients[2][j].clone();
        if i == j { sum + 1.0 } else { sum }
    })
}

/// `sum += slope value`; slopes known to the compiler leave nothing but additions.
#[inline(always)]
pub(super) fn add_product<S: Scalar>(sum: &mut S, slope: f64, value: &S) {
    if slope == 1.0 {
        *sum = sum.clone() + value.clone();
    } else if slope == -1.0 {
        *sum = sum.clone() - value.clone();
    } else if slope != 0.0 {
        *sum = sum.clone() + value.clone() * slope;
    }
}
