//! The cells of a body in batches of [`LANES`] with one set of law parameters.

use super::batch::{Batch, Slot};
use super::blocks::BlockPattern;
use super::cell_order::cell_order;
use super::task_sums::TaskSums;
use super::tasks::task;
use crate::element::{Geometry, Shape};
use crate::law::Material;
use crate::number::LANES;
use std::marker::PhantomData;

/// Cells of an element with `N` nodes.
pub(super) struct CellBatches<E, const N: usize> {
    pub nodes: Vec<[u32; N]>,
    pub batches: Vec<Batch<N>>,
    /// The rows of parameters of the tissues.
    pub tissues: Vec<Vec<f64>>,
    pub slots: Vec<Slot>,
    /// The cells in the order of their slots: those of a tissue after each other, and neighbours near each other.
    pub order: Vec<u32>,
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
        let (mut rows, mut in_order) = (Vec::new(), Vec::with_capacity(nodes.len()));
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
                in_order.extend(members.iter().map(|&cell| cell as u32));
                batches.push(Batch::new(members, &nodes, geometry, tissue));
            }
        }
        CellBatches {
            sums: TaskSums::new(&nodes, &slots, batches.len(), pattern, n_points),
            nodes,
            batches,
            tissues: rows,
            slots,
            order: in_order,
            shape: PhantomData,
        }
    }
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
