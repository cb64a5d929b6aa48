//! Two surfaces of a body that may touch each other, as contact needs them of the body: their triangles, and the blocks
//! that the pattern of the tangent reserves between their nodes.

use crate::error::Error;
use crate::mesh::{Boxes, norm, sub};

/// Two surfaces that may touch each other.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactPair {
    /// The triangles of the one and of the other, seen anticlockwise from outside.
    pub surfaces: [Vec<[u32; 3]>; 2],
    /// Surfaces that come closer than this are looked at [m].
    pub reach: f64,
    /// Stiffness of the layer between them, in the units of that of a tool.
    pub stiffness: f64,
    /// Coulomb's coefficient of friction between them; zero for none.
    pub friction: f64,
    /// The pairs of nodes that the tangent couples.
    reserved: Vec<[u32; 2]>,
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
        let mut owner = vec![2; points.len()];
        for (side, triangles) in surfaces.iter().enumerate() {
            if triangles.is_empty() {
                return Err(Error::input(format!("side {side} of a contact pair has no triangle")));
            }
            for &node in triangles.iter().flatten() {
                match owner.get_mut(node as usize) {
                    Some(known) if *known == 2 || *known == side => *known = side,
                    Some(_) => {
                        return Err(Error::input(format!(
                            "point {node} is on both sides of a contact pair; its sides must have no point in common"
                        )));
                    }
                    None => {
                        return Err(Error::input(format!(
                            "a contact pair has point {node}; there are {} points",
                            points.len()
                        )));
                    }
                }
            }
        }
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
        let mut pair = ContactPair { surfaces, reach, stiffness, friction, reserved: Vec::new() };
        pair.reserve(points);
        Ok(pair)
    }

    /// Couples what is at most `reach` apart at these points, beside what is coupled already.
    pub(super) fn reserve(&mut self, points: &[[f64; 3]]) {
        let [one, other] = &self.surfaces;
        let near = Boxes::new(points, other);
        for triangle in one {
            let corners = triangle.map(|node| points[node as usize]);
            near.each_near(&corners, self.reach, |k| {
                for &a in triangle {
                    self.reserved.extend(other[k].map(|b| [a.min(b), a.max(b)]));
                }
            });
        }
        self.reserved.sort_unstable();
        self.reserved.dedup();
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
