//! The displacement of places inside: of nodes, and of points in cells by the shape functions of the element.
//!
//! The modes at the nodes around the places are kept apart, so a touch costs as little as the places are few.

use super::contact::Contact;
use super::model::ReducedModel;
use crate::Error;
use viscera_mesh::{Locator, edges, quadratic_cells};

/// Name of the element with nodes on the edges of its cells.
const QUADRATIC: &str = "P2";

/// Places whose displacement a touch tells, and the memory that this takes.
#[derive(Clone, Debug)]
pub struct Places {
    /// Where the nodes of each place start in `rows`, and where the last ones end.
    start: Vec<usize>,
    /// Rows of the modes, and how much each counts.
    rows: Vec<(u32, f64)>,
    /// The node of each row.
    nodes: Vec<u32>,
    /// The modes at the nodes that count (modes, 3 nodes).
    modes: Vec<i16>,
    workspace: Vec<f32>,
    field: Vec<f32>,
    /// Checksum of the mesh that they are in.
    mesh: u32,
}

impl Places {
    /// [`ReducedModel::mesh_checksum`] of the mesh that they are in.
    pub fn mesh_checksum(&self) -> u32 {
        self.mesh
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What a field of nodes is at the places. It allocates nothing.
    pub fn interpolate(&self, of_node: impl Fn(usize) -> [f64; 3], out: &mut [[f64; 3]]) {
        self.sum(|row| of_node(self.nodes[row] as usize), out);
    }

    fn sum(&self, of_row: impl Fn(usize) -> [f64; 3], out: &mut [[f64; 3]]) {
        for (range, out) in self.start.windows(2).zip(out) {
            *out = [0.0; 3];
            for &(row, share) in &self.rows[range[0]..range[1]] {
                let u = of_row(row as usize);
                (0..3).for_each(|i| out[i] += share * u[i]);
            }
        }
    }
}

impl ReducedModel {
    /// Places at points of the untouched shape [m].
    ///
    /// # Errors
    /// A point outside all cells; a model without cells.
    pub fn places_at(&self, points: &[[f64; 3]]) -> Result<Places, Error> {
        let cells: Vec<[u32; 4]> =
            self.arrays.cells.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect();
        if cells.is_empty() {
            return Err(Error::input(
                "this model has no cells: of what lies inside nothing is kept",
            ));
        }
        let rest: Vec<[f64; 3]> =
            self.arrays.points.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect();
        let middles = self.middles(&cells)?;
        let locator = Locator::new(&rest, &cells);
        let shares = points.iter().enumerate().map(|(k, x)| {
            let found = locator.find(x).ok_or_else(|| {
                Error::input(format!("place {k} at {x:?} m lies outside the organ"))
            })?;
            let cell = found.cell as usize;
            Ok(match &middles {
                None => cells[cell].into_iter().zip(found.weights).collect(),
                Some(all) => all[cell].into_iter().zip(quadratic(found.weights)).collect(),
            })
        });
        Ok(self.places(&shares.collect::<Result<Vec<_>, Error>>()?))
    }

    /// Places at nodes.
    ///
    /// # Errors
    /// A node that the organ does not have.
    pub fn places_of_nodes(&self, nodes: &[u32]) -> Result<Places, Error> {
        let n = self.n_points();
        match nodes.iter().position(|&node| node as usize >= n) {
            Some(k) => Err(Error::input(format!(
                "place {k} is node {}; the organ has nodes 0 to {}",
                nodes[k],
                n - 1
            ))),
            None => {
                Ok(self.places(&nodes.iter().map(|&node| vec![(node, 1.0)]).collect::<Vec<_>>()))
            }
        }
    }

    /// Displacement of the places [m]. It allocates nothing.
    ///
    /// # Panics
    /// If `places` are of a model with other regions, or `out` is too short.
    pub fn move_places(
        &self,
        places: &mut Places,
        contact: &Contact,
        d: [f64; 3],
        out: &mut [[f64; 3]],
    ) {
        let Places { modes, workspace, field, .. } = places;
        self.modes_displacement(contact, d, workspace, modes, field);
        places.sum(|row| std::array::from_fn(|i| f64::from(places.field[3 * row + i])), out);
    }

    /// All nodes of every cell of a quadratic element; none of a linear one.
    fn middles(&self, cells: &[[u32; 4]]) -> Result<Option<Vec<[u32; 10]>>, Error> {
        if self.metadata.element != QUADRATIC {
            return Ok(None);
        }
        let corners = self.arrays.cells.iter().max().map_or(0, |&node| node as usize + 1);
        let edges = edges(cells);
        if corners + edges.len() != self.n_points() {
            return Err(Error::model_file(format!(
                "{} points; its quadratic cells have {corners} corners and {} edges",
                self.n_points(),
                edges.len()
            )));
        }
        Ok(Some(quadratic_cells(corners, cells, &edges)))
    }

    fn places(&self, shares: &[Vec<(u32, f64)>]) -> Places {
        let mut nodes: Vec<u32> = shares.iter().flatten().map(|&(node, _)| node).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let row = |node: u32| nodes.partition_point(|&other| other < node) as u32;
        let mut start = vec![0];
        start.extend(shares.iter().scan(0, |end, place| {
            *end += place.len();
            Some(*end)
        }));
        Places {
            start,
            rows: shares.iter().flatten().map(|&(node, share)| (row(node), share)).collect(),
            modes: self.modes_at(&nodes),
            workspace: vec![0.0; self.workspace_len()],
            field: vec![0.0; 3 * nodes.len()],
            nodes,
            mesh: self.mesh_checksum(),
        }
    }
}

/// Shape functions of the quadratic cell: `l (2 l - 1)` at corners, `4 l_a l_b` on edges.
fn quadratic(l: [f64; 4]) -> [f64; 10] {
    std::array::from_fn(|k| match k {
        0..4 => l[k] * (2.0 * l[k] - 1.0),
        _ => {
            let [a, b] = viscera_mesh::EDGES[k - 4];
            4.0 * l[a] * l[b]
        }
    })
}
