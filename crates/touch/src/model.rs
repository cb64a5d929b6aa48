//! A reduced model, and what the evaluator looks up in it.

use super::arrays::Arrays;
use super::check::{check, offsets};
use super::departure::{DIRECTIONS, directions};
use super::ground::Ground;
use super::metadata::Metadata;
use super::skin::Skin;
use super::supports::Supports;
use crate::{Error, Notes};
use viscera_mesh::TriangleTree;
use viscera_number::Monomials;

/// A reduced model, checked and ready to evaluate.
#[derive(Clone, Debug)]
pub struct ReducedModel {
    pub(super) metadata: Metadata,
    pub(super) arrays: Arrays,
    /// Exponents of the series' monomials, the constant left out.
    pub(super) exponents: Vec<[u8; 3]>,
    /// Number of monomials that edges have amplitudes for: those of degree 2 to `edge_order`, the first of degree >= 2.
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
    pub(super) supports: Supports,
    pub(super) ground: Ground,
    pub(super) skin: Skin,
    /// In which departure is known.
    pub(super) directions: [[f64; 3]; DIRECTIONS],
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
        let is_outside = |node: &&u32| is_surface[**node as usize];
        let fixed = arrays.fixed.iter().filter(is_outside).map(position);
        let supports = Supports::new(fixed.collect());
        let ground = Ground::new(&positions, &triangles, &arrays.triangle_edges);
        let (points, _) = arrays.points.as_chunks::<3>();
        let (surface, _) = arrays.surface.as_chunks::<3>();
        let skin = Skin::new(points, surface.to_vec());
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
            supports,
            ground,
            skin,
            directions: directions(),
            metadata,
            arrays,
        })
    }

    /// The metadata of the model.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Replaces what the writer has added to the metadata.
    pub fn set_user(&mut self, user: Notes) {
        self.metadata.user = user;
    }

    /// The arrays of the model.
    pub fn arrays(&self) -> &Arrays {
        &self.arrays
    }

    /// The metadata and the arrays.
    pub fn into_parts(self) -> (Metadata, Arrays) {
        (self.metadata, self.arrays)
    }

    /// Number of nodes of the organ.
    pub fn n_points(&self) -> usize {
        self.arrays.points.len() / 3
    }

    /// A number that models of one mesh have in common, and those of two meshes hardly ever: the CRC-32 of points and cells.
    pub fn mesh_checksum(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        self.arrays.points.iter().for_each(|x| hasher.update(&x.to_le_bytes()));
        self.arrays.cells.iter().for_each(|node| hasher.update(&node.to_le_bytes()));
        hasher.finalize()
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

    /// Number of monomials that edges have amplitudes for: those of degree 2 to `edge_order`, the first of degree >= 2.
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
