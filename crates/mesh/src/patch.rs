//! The contact patch: a smooth bump of weights on the surface around a node.
//!
//! A load at a single node is a mesh-dependent singularity; the weighted mean over a patch converges with the mesh.

use super::{Surface, dot, norm, sub};

/// A weighted mean over surface nodes, `sum_i w_i u_i`.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Nodes of the mesh, ascending, each once.
    pub nodes: Vec<u32>,
    /// Their weights, positive, sum 1.
    pub weights: Vec<f64>,
}

impl Patch {
    /// The weighted mean of patches, `sum_k factor_k patch_k`, for factors >= 0 of sum 1: the patch of a point inside
    /// a triangle from those of its corners. A factor of zero leaves its patch out.
    pub fn blend(parts: &[(f64, &Patch)]) -> Patch {
        let mut entries: Vec<(u32, f64)> = Vec::new();
        for &(factor, patch) in parts.iter().filter(|(factor, _)| *factor != 0.0) {
            entries.extend(
                patch
                    .nodes
                    .iter()
                    .zip(&patch.weights)
                    .map(|(&node, &weight)| (node, factor * weight)),
            );
        }
        entries.sort_by_key(|&(node, _)| node);
        entries
            .chunk_by(|a, b| a.0 == b.0)
            .map(|same| (same[0].0, same.iter().map(|&(_, w)| w).sum::<f64>()))
            .collect()
    }
}

impl FromIterator<(u32, f64)> for Patch {
    fn from_iter<I: IntoIterator<Item = (u32, f64)>>(entries: I) -> Self {
        let (nodes, weights) = entries.into_iter().unzip();
        Self { nodes, weights }
    }
}

/// Why there is no patch around a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPatch {
    /// The surface is farther away than the radius.
    TooFar,
    /// The closest surface point lies on excluded nodes alone; a wider patch would not help.
    Excluded,
}

impl Surface {
    /// The patch around a surface point: the blend of the patches at the corners of its triangle.
    ///
    /// # Errors
    /// The closest surface point is farther than the radius, or on excluded nodes alone.
    pub fn patch_at_point(
        &self,
        point: [f64; 3],
        radius: f64,
        excluded: &dyn Fn(u32) -> bool,
    ) -> Result<Patch, NoPatch> {
        let near = self.closest(point).filter(|closest| closest.distance <= radius);
        let closest = near.ok_or(NoPatch::TooFar)?;
        let corners = self.triangles()[closest.triangle as usize];
        let parts: Vec<(f64, Patch)> = corners
            .iter()
            .zip(closest.barycentric)
            .filter_map(|(&node, weight)| {
                Some((weight, self.patch_at_node(node, radius, excluded)?))
            })
            .collect();
        let total: f64 = parts.iter().map(|(weight, _)| weight).sum();
        let blend: Vec<(f64, &Patch)> = parts.iter().map(|(w, patch)| (w / total, patch)).collect();
        (total > 0.0).then(|| Patch::blend(&blend)).ok_or(NoPatch::Excluded)
    }

    /// The patch of the given radius [m] around node `s`: `w_i` proportional to
    /// `A_i (1 - (rho_i/radius)^2)^2 (n_i . n_s)^2`, with `A_i` the lumped area, `n_i` the normal and
    /// `rho_i = |x_i - x_s| < radius`, normalised to sum 1.
    ///
    /// It holds the nodes reached from `s` along edges without leaving that ball, and only those whose normal makes an
    /// acute angle with the one at `s`, so that a thin rim does not grab its other side. Excluded (fixed) nodes drop
    /// out. `s` itself always belongs: `None` when it is excluded or not on the surface.
    pub fn patch_at_node(
        &self,
        node: u32,
        radius: f64,
        excluded: &dyn Fn(u32) -> bool,
    ) -> Option<Patch> {
        if !self.contains(node) || excluded(node) {
            return None;
        }
        let (center, axis) = (self.points()[node as usize], self.normals()[node as usize]);
        let distance = |i: u32| norm(sub(self.points()[i as usize], center));
        let belongs = |i: u32| distance(i) < radius && dot(self.normals()[i as usize], axis) > 0.0;
        let mut reached = vec![node];
        let mut next = 0;
        while let Some(&here) = reached.get(next) {
            next += 1;
            for &neighbour in self.neighbours(here) {
                if belongs(neighbour) && !reached.contains(&neighbour) {
                    reached.push(neighbour);
                }
            }
        }
        reached.retain(|&i| !excluded(i));
        reached.sort_unstable();
        let bump = |i: u32| {
            if i == node {
                1.0
            } else {
                // The squared cosine lets a node on a bend fade out instead of dropping out.
                let cosine = dot(self.normals()[i as usize], axis);
                (1.0 - (distance(i) / radius).powi(2)).powi(2) * cosine.powi(2)
            }
        };
        let raw: Vec<f64> =
            reached.iter().map(|&i| self.lumped_areas()[i as usize] * bump(i)).collect();
        let total: f64 = raw.iter().sum();
        if total > 0.0 {
            return Some(reached.into_iter().zip(raw.into_iter().map(|w| w / total)).collect());
        }
        Some(Patch { nodes: vec![node], weights: vec![1.0] }) // only where all triangles at the node are flat
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::block;
    use super::super::surface;
    use super::*;

    fn plate(n: usize, thickness: f64) -> Surface {
        let (points, cells) = block([n, n, 1], [1.0, 1.0, thickness]);
        Surface::new(&points, &surface(&points, &cells))
    }

    /// The node at the given place.
    fn at(surface: &Surface, place: [f64; 3]) -> u32 {
        surface.points().iter().position(|&p| norm(sub(p, place)) < 1e-12).expect("a node there")
            as u32
    }

    fn first_moment(surface: &Surface, patch: &Patch) -> [f64; 3] {
        std::array::from_fn(|k| {
            patch
                .nodes
                .iter()
                .zip(&patch.weights)
                .map(|(&i, w)| w * surface.points()[i as usize][k])
                .sum()
        })
    }

    #[test]
    fn weights_are_positive_and_sum_to_one() {
        let surface = plate(10, 0.5);
        for &s in surface.nodes() {
            let patch = surface.patch_at_node(s, 0.35, &|_| false).unwrap();
            assert!(patch.weights.iter().all(|&w| w > 0.0) && patch.nodes.contains(&s));
            assert!(patch.nodes.is_sorted_by(|a, b| a < b));
            assert!((patch.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn a_patch_on_a_regular_face_is_symmetric_and_centred() {
        let surface = plate(10, 0.5);
        let middle = [0.5, 0.5, 0.5];
        let patch = surface.patch_at_node(at(&surface, middle), 0.25, &|_| false).unwrap();
        assert_eq!(patch.nodes.len(), 21, "lattice points strictly within 2.5 spacings");
        let weight = |x: f64, y: f64| {
            let node = at(&surface, [x, y, 0.5]);
            patch.weights[patch.nodes.iter().position(|&i| i == node).unwrap()]
        };
        assert!((weight(0.6, 0.5) - weight(0.5, 0.4)).abs() < 1e-15);
        let ratio = (1.0f64 - 0.16).powi(2);
        assert!(
            (weight(0.6, 0.5) / weight(0.5, 0.5) - ratio).abs() < 1e-12,
            "equal areas leave the bump alone"
        );
        assert!(norm(sub(first_moment(&surface, &patch), middle)) < 1e-14);
    }

    #[test]
    fn a_thin_plate_does_not_grab_its_other_side() {
        let surface = plate(10, 0.01);
        let inner = surface.patch_at_node(at(&surface, [0.5, 0.5, 0.01]), 0.3, &|_| false).unwrap();
        assert!(inner.nodes.iter().all(|&i| surface.points()[i as usize][2] > 0.0));
        let near_rim = at(&surface, [0.9, 0.5, 0.01]);
        let rim = surface.patch_at_node(near_rim, 0.3, &|_| false).unwrap();
        let is_acute = |&i: &u32| {
            dot(surface.normals()[i as usize], surface.normals()[near_rim as usize]) > 0.0
        };
        assert!(rim.nodes.iter().all(is_acute));
        assert!(rim.nodes.iter().all(|&i| surface.points()[i as usize][2] > 0.0));
    }

    #[test]
    fn only_connected_surface_within_the_ball_belongs() {
        let (points, cells) = block([4, 4, 1], [1.0, 1.0, 0.1]);
        let above: Vec<[f64; 3]> = points.iter().map(|p| [p[0], p[1], p[2] + 0.15]).collect();
        let shifted: Vec<[u32; 4]> =
            cells.iter().map(|cell| cell.map(|i| i + points.len() as u32)).collect();
        let all = [points.clone(), above].concat();
        let surface = Surface::new(&all, &surface(&all, &[cells, shifted].concat()));
        let patch = surface.patch_at_node(at(&surface, [0.5, 0.5, 0.1]), 0.3, &|_| false).unwrap();
        assert!(
            patch.nodes.iter().all(|&i| (i as usize) < points.len()),
            "a stacked plate is another body"
        );
    }

    #[test]
    fn excluded_nodes_drop_out_and_small_radii_leave_the_node() {
        let surface = plate(10, 0.5);
        let s = at(&surface, [0.5, 0.5, 0.5]);
        let fixed = |i: u32| surface.points()[i as usize][0] > 0.55;
        let patch = surface.patch_at_node(s, 0.25, &fixed).unwrap();
        assert!(patch.nodes.iter().all(|&i| !fixed(i)) && patch.nodes.len() == 13);
        assert!((patch.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        let alone = Patch { nodes: vec![s], weights: vec![1.0] };
        assert_eq!(surface.patch_at_node(s, 0.05, &|_| false), Some(alone.clone()));
        assert_eq!(surface.patch_at_node(s, 0.0, &|_| false), Some(alone));
        assert_eq!(surface.patch_at_node(s, 0.25, &|i| i == s), None);
        assert_eq!(surface.patch_at_node(u32::MAX, 0.25, &|_| false), None);
    }

    #[test]
    fn a_point_without_a_patch_is_too_far_or_on_excluded_nodes() {
        let surface = plate(10, 0.5);
        let fixed = |i: u32| surface.points()[i as usize][0] < 0.45;
        let ask = |point, radius| surface.patch_at_point(point, radius, &fixed);
        assert_eq!(ask([0.72, 0.52, 0.9], 0.3), Err(NoPatch::TooFar));
        assert_eq!(ask([0.22, 0.52, 0.5], 0.3), Err(NoPatch::Excluded));
        assert_eq!(ask([0.22, 0.52, 0.5], 2.0), Err(NoPatch::Excluded), "not for want of width");
        assert!(ask([0.48, 0.52, 0.5], 0.3).is_ok(), "a corner of its triangle is free");
    }

    #[test]
    fn a_blend_is_the_mean_of_its_parts() {
        let surface = plate(10, 0.5);
        let corners =
            [[0.5, 0.5, 0.5], [0.6, 0.5, 0.5], [0.6, 0.6, 0.5]].map(|place| at(&surface, place));
        let patches = corners.map(|s| surface.patch_at_node(s, 0.25, &|_| false).unwrap());
        let blend = Patch::blend(&[(0.5, &patches[0]), (0.3, &patches[1]), (0.2, &patches[2])]);
        assert!((blend.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        assert!(blend.nodes.is_sorted_by(|a, b| a < b));
        assert!(norm(sub(first_moment(&surface, &blend), [0.55, 0.52, 0.5])) < 1e-14);
        assert_eq!(Patch::blend(&[(1.0, &patches[1]), (0.0, &patches[0])]), patches[1]);
    }
}
