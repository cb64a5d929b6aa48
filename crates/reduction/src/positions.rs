//! The load positions of a touchable surface: nodes, triangles, edges, patches, regions.

use crate::error::Error;
use crate::mesh::{Patch, Surface};

/// Positions and their connectivity, in position numbers.
pub(super) struct Positions {
    /// Node of each position, ascending.
    pub nodes: Vec<u32>,
    pub triangles: Vec<[u32; 3]>,
    pub edges: Vec<[u32; 2]>,
    /// The edges 01, 12, 20 of each triangle.
    pub triangle_edges: Vec<[u32; 3]>,
    pub patches: Vec<Patch>,
    /// Positions of each region.
    pub regions: Vec<Vec<u32>>,
}

/// Largest number of positions in a region: few enough that a touch reads few modes, enough that
/// neighbours share them.
const REGION: usize = 16;

impl Positions {
    /// All triangles of the surface whose three corners are in `touchable`.
    ///
    /// # Errors
    /// A touchable node that is fixed or not on the surface; no triangle at all.
    pub fn new(
        surface: &Surface,
        touchable: &[u32],
        fixed: &[u32],
        radius: f64,
    ) -> Result<Self, Error> {
        let n = surface.points().len();
        let mut is_fixed = vec![false; n];
        fixed.iter().for_each(|&node| is_fixed[node as usize] = true);
        let mut is_touchable = vec![false; n];
        for &node in touchable {
            if node as usize >= n || !surface.contains(node) {
                return Err(Error::input(format!(
                    "touchable point {node} is not on the surface; give surface points only"
                )));
            }
            if is_fixed[node as usize] {
                return Err(Error::input(format!(
                    "point {node} is both touchable and fixed; a fixed point cannot be pushed"
                )));
            }
            is_touchable[node as usize] = true;
        }
        let by_node: Vec<[u32; 3]> = surface
            .triangles()
            .iter()
            .copied()
            .filter(|t| t.iter().all(|&node| is_touchable[node as usize]))
            .collect();
        if by_node.is_empty() {
            return Err(Error::input(format!(
                "the {} touchable points span no surface triangle; give a connected piece of surface",
                touchable.len()
            )));
        }
        let mut nodes: Vec<u32> = by_node.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let position = |node: u32| nodes.partition_point(|&other| other < node) as u32;
        let triangles: Vec<[u32; 3]> = by_node.iter().map(|t| t.map(position)).collect();
        let (edges, triangle_edges) = edges(&triangles);
        let excluded = |node: u32| is_fixed[node as usize];
        let patches = nodes
            .iter()
            .map(|&node| {
                surface.patch_at_node(node, radius, &excluded).ok_or_else(|| {
                    Error::input(format!("there is no patch around point {node}; is it fixed?"))
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let points: Vec<[f64; 3]> = nodes.iter().map(|&n| surface.points()[n as usize]).collect();
        let mut regions = Vec::new();
        bisect((0..nodes.len() as u32).collect(), &points, &mut regions);
        Ok(Positions { nodes, triangles, edges, triangle_edges, patches, regions })
    }

    /// The patch at the middle of an edge.
    pub fn edge_patch(&self, edge: usize) -> Patch {
        let [p, q] = self.edges[edge].map(|p| &self.patches[p as usize]);
        Patch::blend(&[(0.5, p), (0.5, q)])
    }
}

/// Unique edges, lower position first, and the edges 01, 12, 20 of each triangle.
fn edges(triangles: &[[u32; 3]]) -> (Vec<[u32; 2]>, Vec<[u32; 3]>) {
    let sides = |t: &[u32; 3]| {
        [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[p, q]| [p.min(q), p.max(q)])
    };
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(sides).collect();
    edges.sort_unstable();
    edges.dedup();
    let index = |edge: [u32; 2]| edges.partition_point(|&other| other < edge) as u32;
    let triangle_edges = triangles.iter().map(|t| sides(t).map(index)).collect();
    (edges, triangle_edges)
}

/// Splits positions at the median of their longest extent until regions are small.
fn bisect(mut members: Vec<u32>, points: &[[f64; 3]], regions: &mut Vec<Vec<u32>>) {
    if members.len() <= REGION {
        members.sort_unstable();
        regions.push(members);
        return;
    }
    let extent = |axis: usize| {
        let values = members.iter().map(|&p| points[p as usize][axis]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    };
    let extents: [f64; 3] = std::array::from_fn(extent);
    let axis = (0..3).max_by(|&a, &b| extents[a].total_cmp(&extents[b])).unwrap_or(0);
    members.sort_by(|&a, &b| {
        points[a as usize][axis].total_cmp(&points[b as usize][axis]).then(a.cmp(&b))
    });
    let upper = members.split_off(members.len() / 2);
    bisect(members, points, regions);
    bisect(upper, points, regions);
}
