//! What evaluations need beside their results. Loops that may not allocate keep it from one to the next.

use super::clusters::ClusterWorkspace;
use crate::number::Lane;
use crate::tensor::{Mat3, Vec3};
use crate::threads::share;

/// Memory of the evaluations of one body; it grows with the first ones.
#[derive(Clone, Default)]
pub struct Workspace {
    pub(super) of_cells: CellWorkspace,
    pub(super) of_clusters: ClusterWorkspace,
}

impl Workspace {
    /// Evaluations stay on the thread that asks. From the second on they allocate nothing, take no lock and make no
    /// system call.
    pub fn stay_on_one_thread(&mut self, is_alone: bool) {
        self.of_cells.is_alone = is_alone;
    }
}

/// The part of it that loops over cells need on one thread.
#[derive(Clone, Default)]
pub(super) struct CellWorkspace {
    is_alone: bool,
    /// Forces of the batches of a task, `N` for each.
    pub forces: Vec<Vec3<Lane>>,
    /// Blocks of the cells of a batch.
    pub tangents: Vec<Mat3<Lane>>,
    /// Sums at the nodes of a task, and at its blocks.
    pub nodal: Vec<[f64; 3]>,
    pub blocks: Vec<[f64; 9]>,
}

impl CellWorkspace {
    /// Whether threads share a loop of so many tasks.
    pub fn shares(&self, tasks: usize) -> bool {
        !self.is_alone && share(tasks)
    }
}
