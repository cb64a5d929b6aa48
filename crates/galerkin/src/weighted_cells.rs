//! Some cells of a body with weights, and the modes on them: what the reduced energy is summed over.

use crate::element::Geometry;
use crate::law::Material;
use crate::number::{LANES, Lane, Lanes};
use crate::tensor::Vec3;

/// Coordinates of a linear cell that it deforms by: displacements of its corners 1 to 3 against corner 0.
pub(super) const EDGES: usize = 9;

/// Some sampled cells with one set of law parameters, side by side; the last of a group repeats a cell of no weight.
#[derive(Clone)]
pub(super) struct Batch {
    pub nodes: [[u32; 4]; LANES],
    pub gradients: [Vec3<Lane>; 3],
    /// `w_e V_e`.
    pub weight: Lane,
    pub parameters: Vec<f64>,
}

/// Linear cells of a body, sampled.
#[derive(Clone)]
pub(super) struct WeightedCells {
    pub material: Material,
    pub batches: Vec<Batch>,
    /// Where each cell is: batch and lane.
    slots: Vec<(usize, usize)>,
}

impl WeightedCells {
    /// Cells of a mesh, each counting as itself.
    pub fn new(
        points: &[[f64; 3]],
        cells: &[[u32; 4]],
        material: &Material,
        chosen: &[usize],
    ) -> Self {
        let geometry = |cell: usize| Geometry::new(cells[cell].map(|node| points[node as usize]));
        let row = |cell: usize| material.row(cell);
        let mut places: Vec<usize> = (0..chosen.len()).collect();
        if material.parameters().len() > 1 {
            places.sort_by(|&a, &b| {
                let pairs = row(chosen[a]).iter().zip(row(chosen[b]));
                pairs.map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(a.cmp(&b))
            });
        }
        let (mut batches, mut slots) = (Vec::new(), vec![(0, 0); chosen.len()]);
        for tissue in places.chunk_by(|&a, &b| row(chosen[a]) == row(chosen[b])) {
            for members in tissue.chunks(LANES) {
                let cell = |lane: usize| chosen[members[lane.min(members.len() - 1)]];
                let shapes: [Geometry; LANES] = std::array::from_fn(|l| geometry(cell(l)));
                let volume = |l: usize| if l < members.len() { shapes[l].volume } else { 0.0 };
                members.iter().enumerate().for_each(|(l, &p)| slots[p] = (batches.len(), l));
                batches.push(Batch {
                    nodes: std::array::from_fn(|l| cells[cell(l)]),
                    gradients: std::array::from_fn(|k| {
                        std::array::from_fn(|i| {
                            Lanes(std::array::from_fn(|l| shapes[l].gradients[k][i]))
                        })
                    }),
                    weight: Lanes(std::array::from_fn(volume)),
                    parameters: row(cell(0)).to_vec(),
                });
            }
        }
        WeightedCells { material: material.clone(), batches, slots }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Makes each cell count `weights` times.
    pub fn set_weights(&mut self, weights: &[f64]) {
        for (&(batch, lane), w) in self.slots.iter().zip(weights) {
            self.batches[batch].weight[lane] *= w;
        }
    }

    /// The edge displacements of the cells of some batches under a mode, a run of all degrees of freedom:
    /// `out(batch, edge, lane, value)`.
    pub fn restrict(
        batches: &[Batch],
        mode: &[f64],
        mut out: impl FnMut(usize, usize, usize, f64),
    ) {
        for (batch, Batch { nodes, .. }) in batches.iter().enumerate() {
            for (lane, nodes) in nodes.iter().enumerate() {
                let [origin, corners @ ..] = nodes.map(|node| 3 * node as usize);
                for edge in 0..EDGES {
                    let (corner, i) = (corners[edge / 3], edge % 3);
                    out(batch, edge, lane, mode[corner + i] - mode[origin + i]);
                }
            }
        }
    }

    /// From numbers by batch, lane and mode to runs of all modes, cell by cell.
    pub fn by_cell(&self, values: &[f64], r: usize) -> Vec<f64> {
        let run = |&(batch, lane): &(usize, usize)| {
            let cell = batch * LANES + lane;
            &values[cell * r..(cell + 1) * r]
        };
        self.slots.iter().flat_map(run).copied().collect()
    }
}
