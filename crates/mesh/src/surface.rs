//! The boundary of a mesh: its triangles, and per node normals, areas and neighbours, made once.

use super::closest::{Closest, TriangleTree};
use super::{cell_volume, cross, norm, sub};

/// The four faces of a cell, seen from outside for a positively oriented one.
pub const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

/// Boundary triangles `(t, 3)`, oriented outward whichever way their cells are, in the order of the cells.
/// A face shared by two cells is inside. All indices must be in range.
pub fn surface(points: &[[f64; 3]], cells: &[[u32; 4]]) -> Vec<[u32; 3]> {
    let mut outer: Vec<u32> = sorted_faces(cells)
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|same| same.len() == 1)
        .map(|same| same[0].1)
        .collect();
    outer.sort_unstable();
    outer
        .into_iter()
        .map(|index| {
            let cell = cells[index as usize / 4];
            let triangle = FACES[index as usize % 4].map(|i| cell[i]);
            let is_inverted = cell_volume(points, cell) < 0.0;
            if is_inverted { [triangle[0], triangle[2], triangle[1]] } else { triangle }
        })
        .collect()
}

/// The faces of all cells by their ascending corners, each with its number `4 * cell + its place in FACES`, sorted: equal
/// faces are neighbours in the list.
pub(super) fn sorted_faces(cells: &[[u32; 4]]) -> Vec<([u32; 3], u32)> {
    let mut faces = Vec::with_capacity(4 * cells.len());
    for (c, cell) in cells.iter().enumerate() {
        for (f, face) in FACES.iter().enumerate() {
            let mut key = face.map(|i| cell[i]);
            key.sort_unstable();
            faces.push((key, (4 * c + f) as u32));
        }
    }
    faces.sort_unstable();
    faces
}

/// A triangulated surface with what contact needs of it. Node indices are those of the mesh.
#[derive(Clone, Debug)]
pub struct Surface {
    points: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    nodes: Vec<u32>,
    normals: Vec<[f64; 3]>,
    areas: Vec<f64>,
    first_neighbour: Vec<u32>,
    neighbours: Vec<u32>,
    tree: TriangleTree,
}

impl Surface {
    /// Builds the surface of the given triangles over the mesh's points. All indices must be in range.
    pub fn new(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Self {
        let mut areas = vec![0.0; points.len()];
        let mut normals = vec![[0.0; 3]; points.len()];
        let mut edges = Vec::with_capacity(6 * triangles.len());
        for &[a, b, c] in triangles {
            let x = [a, b, c].map(|i| points[i as usize]);
            let doubled = cross(sub(x[1], x[0]), sub(x[2], x[0])); // twice the area, along the normal
            for i in [a, b, c] {
                areas[i as usize] += norm(doubled) / 6.0;
                (0..3).for_each(|k| normals[i as usize][k] += doubled[k]);
            }
            edges.extend([(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)]);
        }
        for normal in &mut normals {
            let length = norm(*normal);
            if length > 0.0 {
                *normal = normal.map(|component| component / length);
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let mut first_neighbour = vec![0; points.len() + 1];
        edges.iter().for_each(|&(a, _)| first_neighbour[a as usize + 1] += 1);
        (0..points.len()).for_each(|i| first_neighbour[i + 1] += first_neighbour[i]);
        let mut nodes: Vec<u32> = triangles.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        Self {
            points: points.to_vec(),
            triangles: triangles.to_vec(),
            nodes,
            normals,
            areas,
            first_neighbour,
            neighbours: edges.into_iter().map(|(_, b)| b).collect(),
            tree: TriangleTree::new(points, triangles),
        }
    }

    /// Positions of all points of the mesh [m].
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The nodes that belong to a triangle, ascending.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// Unit outward normal of each point, the mean of its triangles weighted by area; zero for a point inside.
    pub fn normals(&self) -> &[[f64; 3]] {
        &self.normals
    }

    /// A third of the area of the adjacent triangles of each point [m^2]; zero for a point inside.
    pub fn lumped_areas(&self) -> &[f64] {
        &self.areas
    }

    /// The nodes joined to a node by an edge of the surface, ascending.
    pub fn neighbours(&self, node: u32) -> &[u32] {
        let [start, end] =
            [node as usize, node as usize + 1].map(|i| self.first_neighbour[i] as usize);
        &self.neighbours[start..end]
    }

    /// Whether the node belongs to a triangle.
    pub fn contains(&self, node: u32) -> bool {
        self.nodes.binary_search(&node).is_ok()
    }

    /// The point of the surface closest to a point; `None` for an empty surface or a point that is not finite.
    /// Allocates nothing.
    pub fn closest(&self, point: [f64; 3]) -> Option<Closest> {
        self.tree.closest(&self.points, &self.triangles, point)
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::block;
    use super::super::{Vector, dot};
    use super::*;

    /// Enclosed volume by the divergence theorem: positive only if the triangles look outward.
    fn enclosed(points: &[Vector], triangles: &[[u32; 3]]) -> f64 {
        let corner = |i: u32| points[i as usize];
        triangles.iter().map(|&[a, b, c]| dot(corner(a), cross(corner(b), corner(c))) / 6.0).sum()
    }

    #[test]
    fn the_surface_of_a_block_is_closed_and_outward() {
        let (points, cells) = block([3, 2, 4], [3.0, 2.0, 1.0]);
        let triangles = surface(&points, &cells);
        assert_eq!(triangles.len(), 2 * 2 * (3 * 2 + 2 * 4 + 3 * 4));
        assert!((enclosed(&points, &triangles) - 6.0).abs() < 1e-13);
        let edges = |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)];
        let mut directed: Vec<(u32, u32)> = triangles.iter().flat_map(edges).collect();
        directed.sort_unstable();
        assert!(directed.windows(2).all(|pair| pair[0] != pair[1]));
        assert!(directed.iter().all(|&(a, b)| directed.binary_search(&(b, a)).is_ok()));
    }

    #[test]
    fn a_flipped_cell_still_looks_outward() {
        let (points, mut cells) = block([1, 1, 1], [1.0; 3]);
        cells.iter_mut().step_by(2).for_each(|cell| cell.swap(1, 3));
        assert!((enclosed(&points, &surface(&points, &cells)) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn areas_normals_and_neighbours_of_a_block() {
        let (points, cells) = block([2, 2, 2], [1.0, 2.0, 3.0]);
        let surface = Surface::new(&points, &surface(&points, &cells));
        assert!((surface.lumped_areas().iter().sum::<f64>() - 22.0).abs() < 1e-13);
        assert_eq!(
            (surface.nodes().len(), surface.contains(13), surface.lumped_areas()[13]),
            (26, false, 0.0)
        );
        assert_eq!(surface.normals()[4], [0.0, 0.0, -1.0], "middle of the bottom");
        assert!((norm(surface.normals()[0]) - 1.0).abs() < 1e-15);
        assert!(surface.neighbours(13).is_empty());
        for &i in surface.nodes() {
            assert!(surface.neighbours(i).iter().all(|&j| surface.neighbours(j).contains(&i)));
        }
    }
}
