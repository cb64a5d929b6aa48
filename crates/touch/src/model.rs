//! The arrays of a reduced model, and what the evaluator looks up in them.

use super::check::{check, offsets};
use super::metadata::Metadata;
use crate::Error;
use viscera_mesh::TriangleTree;
use viscera_number::Monomials;

/// The arrays of a model file (docs/model-file.md), flat and row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrays {
    /// Positions (n, 3) [m] in the shape that is touched: at rest, or under the preload.
    pub points: Vec<f64>,
    /// Displacement (n, 3) from rest to `points` under the preload [m]; empty where there is none.
    pub preload: Vec<f64>,
    /// Tetrahedra (m, 4).
    pub cells: Vec<u32>,
    /// Fixed nodes.
    pub fixed: Vec<u32>,
    /// Law parameters (1 or m, k).
    pub law_parameters: Vec<f64>,
    /// Boundary triangles of the organ (t, 3), by node.
    pub surface: Vec<u32>,
    /// Nodes of the boundary, ascending: the rows of surface modes.
    pub surface_nodes: Vec<u32>,
    /// Load positions (p,), by node.
    pub positions: Vec<u32>,
    /// Touchable triangles (q, 3), by position.
    pub touchable: Vec<u32>,
    /// Edges of touchable triangles (e, 2), by position.
    pub edges: Vec<u32>,
    /// The edges 01, 12, 20 of each touchable triangle (q, 3).
    pub triangle_edges: Vec<u32>,
    /// Where the patch of each position starts (p + 1,).
    pub patch_start: Vec<u32>,
    /// Nodes of the patches.
    pub patch_nodes: Vec<u32>,
    /// Weights of the patches, sum 1 for each.
    pub patch_weights: Vec<f64>,
    /// Region of each position and of each edge.
    pub position_region: Vec<u32>,
    /// Region of each edge.
    pub edge_region: Vec<u32>,
    /// Where the modes of each region start (r + 1,).
    pub region_start: Vec<u32>,
    /// Metres for one unit of a stored mode (modes,).
    pub mode_scale: Vec<f32>,
    /// Modes at the surface nodes (modes, 3 s).
    pub surface_modes: Vec<i16>,
    /// Modes at the other nodes (modes, 3 (n - s)).
    pub interior_modes: Vec<i16>,
    /// Cells whose law the parameter changes; none for all.
    pub parameter_cells: Vec<u32>,
    /// What a touch is answered from.
    pub answers: Answers,
    /// The answers at each node of the parameter; empty where there is none.
    pub family: Answers,
}

/// What touches are answered from, and what depends on a parameter: in a family, all members one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// Compliance of each position (p, 3, 3) [m/N].
    pub compliance: Vec<f64>,
    /// Compliance between the two positions of an edge (e, 3, 3): mean displacement of the second
    /// patch under a force on the first [m/N].
    pub cross_compliance: Vec<f64>,
    /// Force coefficients (p, terms, 3) [N/m^degree].
    pub force: Vec<f64>,
    /// Force coefficients of edge midpoints (e, edge terms, 3).
    pub edge_force: Vec<f64>,
    /// Forms of edges in the energy of third degree (e, 10) [J/N^3]; empty where the second order is interpolated.
    pub edge_energy: Vec<f64>,
    /// The same of the touchable triangles (q, 10).
    pub triangle_energy: Vec<f64>,
    /// Sketches of the fields (p, terms, 24), by which their orders are summed in a Padé form; empty
    /// where they are summed as a polynomial.
    pub sketch: Vec<f32>,
    /// Inner products of the fields of equal degree (p, sum of squares), for the error estimate.
    pub norms: Vec<f32>,
    /// Compression error of each position at full depth, worst direction, relative to the field.
    pub compression: Vec<f32>,
    /// The same of the first order alone, which shallow touches keep; empty in files of format 1.
    pub linear_compression: Vec<f32>,
    /// Mode amplitudes of each position: (terms, modes of its region), position after position.
    pub position_coefficients: Vec<f32>,
    /// Mode amplitudes of each edge: (edge terms, modes of its region), edge after edge.
    pub edge_coefficients: Vec<f32>,
}

impl Answers {
    /// Name and length of each array.
    pub(super) fn lengths(&self) -> [(&'static str, usize); 12] {
        [
            ("compliance", self.compliance.len()),
            ("cross_compliance", self.cross_compliance.len()),
            ("force", self.force.len()),
            ("edge_force", self.edge_force.len()),
            ("edge_energy", self.edge_energy.len()),
            ("triangle_energy", self.triangle_energy.len()),
            ("sketch", self.sketch.len()),
            ("norms", self.norms.len()),
            ("compression", self.compression.len()),
            ("linear_compression", self.linear_compression.len()),
            ("position_coefficients", self.position_coefficients.len()),
            ("edge_coefficients", self.edge_coefficients.len()),
        ]
    }
}

/// A reduced model, checked and ready to evaluate.
#[derive(Clone, Debug)]
pub struct ReducedModel {
    pub(super) metadata: Metadata,
    pub(super) arrays: Arrays,
    /// Exponents of the series' monomials, the constant left out.
    pub(super) exponents: Vec<[u8; 3]>,
    /// How many of them edges have: those of degree 2 to `edge_order`, at the front of degree >= 2.
    pub(super) edge_terms: usize,
    pub(super) position_offset: Vec<usize>,
    pub(super) edge_offset: Vec<usize>,
    pub(super) largest_region: usize,
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) tree: TriangleTree,
    /// Mean edge length of the touchable triangles [m].
    pub(super) edge_length: f64,
    /// Nodes that are not on the surface, ascending.
    pub(super) interior_nodes: Vec<u32>,
}

impl ReducedModel {
    /// Checks every shape, index range and value, then builds what the evaluator looks up.
    ///
    /// # Errors
    /// [`Error::ModelFile`] naming the array, the place and the value.
    pub fn new(metadata: Metadata, arrays: Arrays) -> Result<Self, Error> {
        let counts = check(&metadata, &arrays)?;
        let (position_offset, edge_offset) = offsets(&arrays, &counts)?;

        let sizes = arrays.region_start.windows(2).map(|w| (w[1] - w[0]) as usize);
        let largest_region = sizes.max().unwrap_or(0);
        let position = |&node: &u32| {
            let n = 3 * node as usize;
            [arrays.points[n], arrays.points[n + 1], arrays.points[n + 2]]
        };
        let positions: Vec<[f64; 3]> = arrays.positions.iter().map(position).collect();
        let triangles: Vec<[u32; 3]> =
            arrays.touchable.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let tree = TriangleTree::new(&positions, &triangles);
        let lengths = arrays.edges.chunks_exact(2).map(|e| {
            let (a, b) = (positions[e[0] as usize], positions[e[1] as usize]);
            (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
        });
        let edge_length = lengths.sum::<f64>() / counts.edges as f64;
        let mut is_surface = vec![false; counts.points];
        arrays.surface_nodes.iter().for_each(|&node| is_surface[node as usize] = true);
        let interior_nodes =
            (0..counts.points as u32).filter(|&node| !is_surface[node as usize]).collect();
        Ok(ReducedModel {
            exponents: Monomials::of(3, metadata.order).exponents()[1..].to_vec(),
            edge_terms: counts.edge_terms,
            position_offset,
            edge_offset,
            largest_region,
            positions,
            triangles,
            tree,
            edge_length,
            interior_nodes,
            metadata,
            arrays,
        })
    }

    /// What the model says about itself.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Replaces what the writer has added to the metadata.
    pub fn set_user(&mut self, user: serde_json::Value) {
        self.metadata.user = user;
    }

    /// Its arrays.
    pub fn arrays(&self) -> &Arrays {
        &self.arrays
    }

    /// What it says about itself, and its arrays.
    pub fn into_parts(self) -> (Metadata, Arrays) {
        (self.metadata, self.arrays)
    }

    /// Number of nodes of the organ.
    pub fn n_points(&self) -> usize {
        self.arrays.points.len() / 3
    }

    /// Number of load positions.
    pub fn n_positions(&self) -> usize {
        self.arrays.positions.len()
    }

    /// Number of modes of all regions.
    pub fn n_modes(&self) -> usize {
        self.arrays.mode_scale.len()
    }

    /// Touchable triangles, by position.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// A load position [m].
    pub fn position(&self, position: usize) -> [f64; 3] {
        self.positions[position]
    }

    /// Number of monomials of the series.
    pub fn n_terms(&self) -> usize {
        self.exponents.len()
    }

    /// Exponents of the series' monomials, the constant left out.
    pub fn exponents(&self) -> &[[u8; 3]] {
        &self.exponents
    }

    /// How many of them edges have: those of degree 2 to `edge_order`, at the front of degree >= 2.
    pub fn edge_terms(&self) -> usize {
        self.edge_terms
    }

    /// Where the amplitudes of each position start in `position_coefficients`, and where the last ones end.
    pub fn position_offsets(&self) -> &[usize] {
        &self.position_offset
    }

    /// The same of the edges, in `edge_coefficients`.
    pub fn edge_offsets(&self) -> &[usize] {
        &self.edge_offset
    }
}
