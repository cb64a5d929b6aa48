//! Two surfaces of a body that may touch each other, or one that may touch itself, as contact needs them of the body: their
//! triangles, and the blocks that the pattern of the tangent reserves between their nodes.
//!
//! A quadratic face is cut into four flat triangles. With their corners in the middles of its edges they would turn a uniform
//! pressure into other nodal forces than the element does, which are a third on each middle and none on the corners of the
//! face. With corners that lie a third farther out than the middles,
//!   `y = x_m + (x_m - (x_a + x_b) / 2) / 3`,
//! the forces are those of the element where the face is flat, and near them where it is curved.

use super::self_contact::SelfContact;
use crate::error::Error;
use crate::mesh::{Boxes, norm, quadratic_surface, sub};
use std::collections::{HashMap, HashSet};

/// Weights of the middle of an edge and of its ends in the place of a corner.
const BULGE: [f64; 3] = [4.0 / 3.0, -1.0 / 6.0, -1.0 / 6.0];

/// Two surfaces that may touch each other, or one that may touch itself: then both are the same.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactPair {
    /// The triangles of the one and of the other, seen anticlockwise from outside. Their corners are nodes, but for those with
    /// the number of the middle of an edge, see [`ContactPair::nodes_of`].
    pub surfaces: [Vec<[u32; 3]>; 2],
    /// Surfaces that come closer than this are looked at [m].
    pub reach: f64,
    /// Stiffness of the layer between them, in the units of that of a tool.
    pub stiffness: f64,
    /// Coulomb's coefficient of friction between them; zero for none.
    pub friction: f64,
    /// Which triangles of one surface may touch.
    self_contact: Option<SelfContact>,
    /// The pairs of nodes that the tangent couples.
    reserved: Vec<[u32; 2]>,
    /// The ends of the edges whose middles are corners.
    ends: HashMap<u32, [u32; 2]>,
}

impl ContactPair {
    /// Of two surfaces, each of other nodes, with the blocks between what is at most `reach` apart at these points.
    ///
    /// # Errors
    /// No triangle; nodes out of range or of both surfaces; a reach or a stiffness that is not positive, a coefficient
    /// of friction that is negative.
    pub fn new(
        points: &[[f64; 3]],
        surfaces: [Vec<[u32; 3]>; 2],
        reach: f64,
        stiffness: f64,
        friction: f64,
    ) -> Result<Self, Error> {
        check_sides(points.len(), &surfaces)?;
        Self::checked(points, surfaces, false, [reach, stiffness, friction])
    }

    /// Of one surface that may touch itself; [`SelfContact`] says which of its triangles may.
    ///
    /// # Errors
    /// As [`ContactPair::new`].
    pub fn of_one(
        points: &[[f64; 3]],
        surface: Vec<[u32; 3]>,
        reach: f64,
        stiffness: f64,
        friction: f64,
    ) -> Result<Self, Error> {
        check_sides(points.len(), std::slice::from_ref(&surface))?;
        Self::checked(points, [surface.clone(), surface], true, [reach, stiffness, friction])
    }

    fn checked(
        points: &[[f64; 3]],
        surfaces: [Vec<[u32; 3]>; 2],
        is_of_one: bool,
        [reach, stiffness, friction]: [f64; 3],
    ) -> Result<Self, Error> {
        for (what, value) in [("reach", reach), ("stiffness", stiffness)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::input(format!(
                    "the {what} of a contact pair is {value}; it must be positive"
                )));
            }
        }
        if !(friction >= 0.0 && friction.is_finite()) {
            return Err(Error::input(format!(
                "the friction coefficient of a contact pair is {friction}; it must be finite and not negative"
            )));
        }
        let self_contact = is_of_one.then(|| SelfContact::new(points, &surfaces[0], reach));
        let (reserved, ends) = (Vec::new(), HashMap::new());
        let mut pair =
            ContactPair { surfaces, reach, stiffness, friction, self_contact, reserved, ends };
        pair.reserve(points);
        Ok(pair)
    }

    /// Cuts the faces of quadratic cells into four triangles, with corners at these points: those of the cells, then the middles
    /// of these edges. Faces that are cut already stay as they are.
    pub(super) fn cut(&mut self, points: &[[f64; 3]], edges: &[[u32; 2]]) {
        if !self.ends.is_empty() {
            return;
        }
        let n_corners = points.len() - edges.len();
        for triangles in &mut self.surfaces {
            *triangles = quadratic_surface(n_corners, triangles, edges);
            let corners = triangles.iter().flatten();
            let middles = corners.filter(|&&corner| corner as usize >= n_corners);
            self.ends.extend(middles.map(|&node| (node, edges[node as usize - n_corners])));
        }
        if let Some(rule) = &mut self.self_contact {
            *rule = SelfContact::new(points, &self.surfaces[0], self.reach);
        }
        self.reserve(points);
    }

    /// Which triangles may touch, if both surfaces are the same.
    pub fn self_contact(&self) -> Option<&SelfContact> {
        self.self_contact.as_ref()
    }

    /// The nodes, with their weights, in the place of a corner.
    pub fn nodes_of(&self, corner: u32) -> impl Iterator<Item = (u32, f64)> + Clone {
        let ends = self.ends.get(&corner);
        let nodes = ends.map_or([corner; 3], |&[a, b]| [corner, a, b]);
        let (weights, count) = if ends.is_some() { (BULGE, 3) } else { ([1.0; 3], 1) };
        nodes.into_iter().zip(weights).take(count)
    }

    /// The corners of the face that a triangle is, or is cut out of, ascending.
    pub fn face_of(&self, triangle: &[u32; 3]) -> [u32; 3] {
        let on = |&corner: &u32| self.ends.get(&corner).map_or([corner; 2], |ends| *ends);
        let mut corners: Vec<u32> = triangle.iter().flat_map(on).collect();
        corners.sort_unstable();
        corners.dedup();
        std::array::from_fn(|i| corners[i])
    }

    /// # Errors
    /// A triangle that is no face of the surface of these cells.
    pub(super) fn check(&self, number: usize, faces: &HashSet<[u32; 3]>) -> Result<(), Error> {
        let stray =
            self.surfaces.iter().flatten().find(|triangle| !faces.contains(&ascending(triangle)));
        match stray {
            Some(triangle) => Err(Error::input(format!(
                "contact pair {number}: the points {triangle:?} are no face of the surface; a pair takes triangles of the \
                 surface"
            ))),
            None => Ok(()),
        }
    }

    /// Couples what is at most `reach` apart at these points, beside what is coupled already.
    pub(super) fn reserve(&mut self, points: &[[f64; 3]]) {
        let mut reserved = std::mem::take(&mut self.reserved);
        let [one, other] = &self.surfaces;
        let near = Boxes::new(points, other);
        let carriers = |triangle: &[u32; 3]| -> Vec<u32> {
            let of_corners = triangle.iter().flat_map(|&corner| self.nodes_of(corner));
            of_corners.map(|(node, _)| node).collect()
        };
        let nodes_of_other: Vec<Vec<u32>> = other.iter().map(carriers).collect();
        for (number, triangle) in (0u32..).zip(one) {
            let corners = triangle.map(|node| points[node as usize]);
            let nodes = carriers(triangle);
            near.each_near(&corners, self.reach, |k| {
                if self.self_contact.as_ref().is_some_and(|rule| !rule.may_touch(number, k as u32))
                {
                    return;
                }
                for &a in &nodes {
                    reserved.extend(nodes_of_other[k].iter().map(|&b| [a.min(b), a.max(b)]));
                }
            });
        }
        reserved.sort_unstable();
        reserved.dedup();
        self.reserved = reserved;
    }

    /// The pairs of nodes that the tangent couples.
    pub(super) fn reserved(&self) -> &[[u32; 2]] {
        &self.reserved
    }

    /// The side with the shorter edges: its triangles are sampled.
    pub fn finer(&self, points: &[[f64; 3]]) -> usize {
        let mean = |triangles: &[[u32; 3]]| {
            let edge = |t: &[u32; 3]| norm(sub(points[t[1] as usize], points[t[0] as usize]));
            triangles.iter().map(edge).sum::<f64>() / triangles.len() as f64
        };
        usize::from(mean(&self.surfaces[1]) < mean(&self.surfaces[0]))
    }
}

/// # Errors
/// A side without triangles; nodes out of range or of several sides.
fn check_sides(n_points: usize, sides: &[Vec<[u32; 3]>]) -> Result<(), Error> {
    let mut owner = vec![usize::MAX; n_points];
    for (side, triangles) in sides.iter().enumerate() {
        if triangles.is_empty() {
            return Err(Error::input(format!("side {side} of a contact pair has no triangle")));
        }
        for &node in triangles.iter().flatten() {
            match owner.get_mut(node as usize) {
                Some(known) if *known == usize::MAX || *known == side => *known = side,
                Some(_) => {
                    return Err(Error::input(format!(
                        "point {node} is on both sides of a contact pair; its sides must have no point in common"
                    )));
                }
                None => {
                    return Err(Error::input(format!(
                        "a contact pair has point {node}; there are {n_points} points"
                    )));
                }
            }
        }
    }
    Ok(())
}

/// The corners of a triangle in ascending order.
pub(super) fn ascending(triangle: &[u32; 3]) -> [u32; 3] {
    let mut corners = *triangle;
    corners.sort_unstable();
    corners
}
