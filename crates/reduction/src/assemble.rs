//! The results of all regions, put in the order of positions and edges.

use super::batch::Solved;
use super::second_order::energies;
use super::solve::Expanded;
use crate::body::Body;
use crate::mesh::Surface;
use std::ops::Range;
use viscera_touch::{Answers, Arrays};

/// The arrays of a model.
///
/// The arrays of the family hold the answers of its members one after the other; the plain arrays
/// hold the first.
pub(super) fn assemble(
    body: &Body,
    surface: &Surface,
    fixed: &[u32],
    members: &[Expanded],
    solved: Vec<Solved>,
) -> Arrays {
    let positions = &members[0].positions;
    let n = surface.points().len();
    let surface_nodes = surface.nodes().to_vec();
    let mut is_surface = vec![false; n];
    surface_nodes.iter().for_each(|&node| is_surface[node as usize] = true);
    let (p, e) = (positions.nodes.len(), positions.edges.len());
    let ties = body.ties().cloned().unwrap_or_default();
    let mut arrays = Arrays {
        points: surface.points().iter().flatten().copied().collect(),
        cells: body.cells().iter().flatten().copied().collect(),
        fixed: fixed.to_vec(),
        tie_start: ties.start,
        tie_nodes: ties.nodes,
        tie_weights: ties.weights,
        tie_stiffness: ties.stiffness.into_flattened(),
        law_parameters: body.material().parameters().concat(),
        surface: surface.triangles().iter().flatten().copied().collect(),
        surface_nodes,
        positions: positions.nodes.clone(),
        touchable: positions.triangles.iter().flatten().copied().collect(),
        edges: positions.edges.iter().flatten().copied().collect(),
        triangle_edges: positions.triangle_edges.iter().flatten().copied().collect(),
        patch_start: vec![0],
        region_start: vec![0],
        position_region: vec![0; p],
        edge_region: vec![0; e],
        ..Arrays::default()
    };
    for patch in &positions.patches {
        arrays.patch_nodes.extend(&patch.nodes);
        arrays.patch_weights.extend(&patch.weights);
        arrays.patch_start.push(arrays.patch_nodes.len() as u32);
    }
    let (mut by_position, mut by_edge) = (vec![(0, 0); p], vec![(0, 0); e]);
    for (r, part) in solved.iter().enumerate() {
        for (k, &position) in part.positions.iter().enumerate() {
            arrays.position_region[position as usize] = r as u32;
            by_position[position as usize] = (r, k);
        }
        for (k, &edge) in part.edges.iter().enumerate() {
            arrays.edge_region[edge as usize] = r as u32;
            by_edge[edge as usize] = (r, k);
        }
        arrays.mode_scale.extend(&part.region.scales);
        arrays.region_start.push(arrays.mode_scale.len() as u32);
        for mode in part.region.modes.chunks_exact(3 * n) {
            for (node, u) in mode.chunks_exact(3).enumerate() {
                let modes = if is_surface[node] {
                    &mut arrays.surface_modes
                } else {
                    &mut arrays.interior_modes
                };
                modes.extend(u);
            }
        }
    }
    let places = Places { members, solved: &solved, positions: by_position, edges: by_edge };
    Arrays {
        answers: places.answers(0..1),
        family: places.answers(if members.len() > 1 { 0..members.len() } else { 0..0 }),
        ..arrays
    }
}

/// Where the results of each position and of each edge are: region, and place in it.
struct Places<'a> {
    members: &'a [Expanded<'a>],
    solved: &'a [Solved],
    positions: Vec<(usize, usize)>,
    edges: Vec<(usize, usize)>,
}

impl Places<'_> {
    /// The answers of some members, member after member.
    fn answers(&self, members: Range<usize>) -> Answers {
        let mut all = Answers::default();
        for j in members {
            for &(r, k) in &self.positions {
                let (own, modes) = (&self.solved[r].answers[j], &self.solved[r].region.members[j]);
                all.compliance.extend(own.compliance[k]);
                all.force.extend(own.force[k].iter().flatten());
                all.sketch.extend(&own.sketches[k]);
                all.norms.extend(&own.norms[k]);
                all.compression.push(modes.errors[k]);
                all.linear_compression.push(modes.linear_errors[k]);
                all.position_coefficients.extend(&modes.positions[k]);
            }
            for &(r, k) in &self.edges {
                let (own, modes) = (&self.solved[r].answers[j], &self.solved[r].region.members[j]);
                all.cross_compliance.extend(own.cross_compliance[k]);
                all.edge_force.extend(own.edge_force[k].iter().flatten());
                all.edge_coefficients.extend(&modes.edges[k]);
            }
            let parts = self.solved.iter();
            let regions: Vec<_> =
                parts.map(|part| (&part.positions[..], &part.answers[j].forms)).collect();
            let [of_edges, of_triangles] = energies(&self.members[j].positions, &regions);
            all.edge_energy.extend(of_edges);
            all.triangle_energy.extend(of_triangles);
        }
        all
    }
}
