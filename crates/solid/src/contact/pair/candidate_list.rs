//! Candidates for self-contact: which triangles of one surface may touch and are near each other. The list is made for more
//! than the reach, and serves until the surface has moved (Verlet, Phys. Rev. 159 (1967) 98).

use crate::body::SelfContact;
use crate::contact::facets::Candidates;
use crate::mesh::{Boxes, Sphere, norm, sub};

/// How much farther than the reach triangles are listed, over the reach: the list serves until they have moved half as far.
const MARGIN: f64 = 1.0;

/// Candidates for self-contact of a surface.
pub(super) struct CandidateList {
    rule: SelfContact,
    reach: f64,
    /// Pairs of triangles that may touch and are near each other, each pair both ways, in the order of the first.
    near: Vec<[u32; 2]>,
    /// Where those of each triangle start, and where the last ones end.
    starts: Vec<usize>,
    /// The places of the corners for which they were listed.
    listed: Vec<[f64; 3]>,
}

impl CandidateList {
    pub fn new(rule: SelfContact, reach: f64) -> Self {
        let (near, starts, listed) = (Vec::new(), Vec::new(), Vec::new());
        CandidateList { rule, reach, near, starts, listed }
    }

    /// What a point on a triangle may touch.
    pub fn candidates(&self, triangle: u32) -> Candidates<'_> {
        let near = self.starts[triangle as usize]..self.starts[triangle as usize + 1];
        Candidates::Near { rule: &self.rule, triangle, pairs: &self.near[near] }
    }

    /// Makes the list anew if the surface has moved so far that it may lack something at these places.
    pub fn update(&mut self, triangles: &[[u32; 3]], places: &[[f64; 3]]) {
        if self.slack(places) >= 0.0 {
            return;
        }
        let boxes = Boxes::new(places, triangles);
        let spheres: Vec<Sphere> = triangles.iter().map(|t| Sphere::around(places, t)).collect();
        let far = (1.0 + MARGIN) * self.reach;
        self.near.clear();
        self.starts.clear();
        self.starts.push(0);
        for (one, triangle) in (0u32..).zip(triangles) {
            let start = self.near.len();
            let corners = triangle.map(|corner| places[corner as usize]);
            boxes.each_near(&corners, far, |other| {
                let apart = spheres[one as usize].apart(&spheres[other]);
                if apart <= far && self.rule.may_touch(one, other as u32) {
                    self.near.push([one, other as u32]);
                }
            });
            self.near[start..].sort_unstable();
            self.starts.push(self.near.len());
        }
        self.listed.clear();
        self.listed.extend_from_slice(places);
    }

    /// How far apart triangles that are not listed are at these places, at least [m].
    pub fn clearance(&self, places: &[[f64; 3]]) -> f64 {
        self.reach + 2.0 * self.slack(places)
    }

    /// How far each corner may move from these places before the list may lack something [m]; negative if it may already.
    fn slack(&self, places: &[[f64; 3]]) -> f64 {
        if self.listed.is_empty() {
            return f64::NEG_INFINITY;
        }
        let moved = places.iter().zip(&self.listed).map(|(x, y)| norm(sub(*x, *y)));
        0.5 * MARGIN * self.reach - moved.fold(0.0, f64::max)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.near.is_empty()
    }

    /// The pairs of triangles that are near each other, in the order of the first.
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.near
    }

    /// The triangles that have a candidate, ascending.
    pub fn triangles(&self) -> Vec<u32> {
        self.near.chunk_by(|a, b| a[0] == b[0]).map(|pairs| pairs[0][0]).collect()
    }
}
