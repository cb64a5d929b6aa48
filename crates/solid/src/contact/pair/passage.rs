//! Surfaces that have gone through each other. The layer pushes a point out by the nearest face, so what is led in past the
//! middle of a body comes out on the far side, where nothing but its way there tells that it should not be.
//!
//! Therefore points of the sampled surface, by which the layer acts, are followed from step to step: the corners and the centres
//! of its triangles, each from the face of the other surface that it was closest to, outside or in the layer, to where it
//! is now. A point is asked about only if it may have come to the other surface since it was last. Once one has passed, all are
//! asked in every step, and measured from where they were before, until none is deep or on the far side, or the surfaces lie
//! apart and most points do not tell of a passage.

use super::pieces::DEEPEST;
use super::{ActivePair, mean};
use crate::contact::entry::Way;
use crate::contact::facets::{Candidates, Gap, Placed};
use crate::mesh::{dot, norm, sub};

/// Cosine between the normals of the face by which a point has come in and of the one that it is closest to now, below
/// which that is the far side.
const FAR_SIDE: f64 = -0.25;

/// Depth behind the far side, over the largest that the layer bears, from which a point inside is past the middle. In the tip of
/// a sharp edge both sides are near.
const PAST: f64 = 0.2;

/// How far before a face, over its distance from a point, a way from it to there begins.
const BEFORE: f64 = 1e-6;

/// The ways of the points of the sampled surface.
#[derive(Default)]
pub(super) struct Passage {
    points: Vec<Point>,
    /// Where the corners were at the end of the step for which they hold.
    places: Vec<[f64; 3]>,
}

/// What is known of a point.
#[derive(Clone, Copy, Default)]
struct Point {
    /// How far it may go before it comes to the other surface, at least [m].
    clearance: f64,
    /// Where it was at the end of the last step, if that was asked; if it has gone through, where it was before.
    side: Option<Side>,
    has_passed: bool,
}

/// The face that a point is closest to, from outside or in the layer on it, and its gap [m].
#[derive(Clone, Copy)]
struct Side {
    face: usize,
    gap: f64,
}

impl ActivePair {
    /// Whether one surface was in the other deeper than the layer bears, or had gone through it, when that was last asked.
    pub(in super::super) fn has_passed(&self) -> bool {
        self.passage.points.iter().any(|point| point.has_passed)
    }

    /// Finds that at the end of a step. A surface that touches itself is not followed: which of its parts face each other from
    /// outside depends on where they are.
    pub(in super::super) fn find_passage(&mut self, u: &[f64]) {
        if self.self_contact.is_some() {
            return;
        }
        let places = self.places_at(u);
        let mut passage = std::mem::take(&mut self.passage);
        if passage.places != self.start {
            passage.points.clear();
        }
        if passage.points.iter().any(|point| point.has_passed) || !self.stay_apart(&places) {
            self.follow(&mut passage.points, &places);
            passage.places = places;
        } else {
            passage.places.clear();
        }
        self.passage = passage;
    }

    /// Whether the boxes around both surfaces lie beside each other along an axis at the start of the step and at its end.
    fn stay_apart(&self, places: &[[f64; 3]]) -> bool {
        let [before, now] = [&self.start, places].map(|places| lie_beside(self.boxes(places)));
        before.iter().zip(now).any(|(before, now)| *before && now)
    }

    /// Brings what is known of the points to the end of the step.
    fn follow(&self, known: &mut Vec<Point>, places: &[[f64; 3]]) {
        let moved: Vec<[f64; 3]> =
            places.iter().zip(&self.start).map(|(x, y)| sub(*x, *y)).collect();
        let motion = but_for_the_mean(moved);
        let followed = self.followed();
        let at = |point: &[u32; 3], values: &[[f64; 3]]| {
            mean(&point.map(|corner| values[corner as usize]), [1.0 / 3.0; 3])
        };
        known.resize(followed.len(), Point::default());
        let was_tangled = known.iter().any(|point| point.has_passed);
        let (before, now) = (self.other.at(&self.start), self.other.at(places));
        let other = Other { heights: &self.heights[1], before, now };
        let nodes = self.other.triangles().iter().flatten();
        let fastest = nodes.map(|&node| norm(motion[node as usize])).fold(0.0, f64::max);
        let mut sides = vec![None; if was_tangled { 0 } else { followed.len() }];
        for (number, (point, known)) in followed.iter().zip(known.iter_mut()).enumerate() {
            let (free, moved) = (known.clearance, norm(at(point, &motion)) + fastest);
            known.clearance -= moved;
            if was_tangled {
                known.has_passed = other.is_still_beyond(known.side, at(point, places), self.reach);
            } else if known.clearance <= 0.0 {
                let way = [at(point, &self.start), at(point, places)];
                let behind = if free > 0.0 { moved - free } else { f64::INFINITY };
                (*known, sides[number]) = other.look(*known, Motion { way, behind }, self.reach);
            } else {
                known.side = None;
            }
        }
        // What had passed is measured from where all were before, and anew when all are back.
        let are_apart = || lie_beside(self.boxes(places)).contains(&true);
        let is_back = was_tangled && !most_have_passed(known) && are_apart();
        let is_tangled = !is_back && known.iter().any(|point| point.has_passed);
        if is_tangled {
            known.iter_mut().zip(sides).for_each(|(point, side)| point.side = side);
        } else if was_tangled {
            known.fill(Point::default());
        }
    }

    /// The points of the sampled surface, each the mean of three corners: the corners themselves, and the centres of triangles.
    fn followed(&self) -> Vec<[u32; 3]> {
        let facets = &self.sampled;
        let is_sampled = |corner: &u32| !facets.around(*corner).is_empty();
        let corners = (0..self.corners.len() as u32).filter(is_sampled).map(|corner| [corner; 3]);
        corners.chain(facets.triangles().iter().copied()).collect()
    }
}

/// What a point has done in a step.
struct Motion {
    way: Way,
    /// How much of it can lie behind the other surface, at most [m].
    behind: f64,
}

/// The surface that points may meet, at the start of a step and at its end, with the heights of the cells behind its
/// triangles [m].
struct Other<'a> {
    heights: &'a [f64],
    before: Placed<'a>,
    now: Placed<'a>,
}

impl Other<'_> {
    /// What is known of a point after it has moved, of a pair none of whose points had passed, and the side on which it was.
    fn look(&self, known: Point, motion: Motion, reach: f64) -> (Point, Option<Side>) {
        let Motion { way: [from, to], behind } = motion;
        let deepest = |gap: &Gap| self.deepest(gap, reach);
        let side_of = |gap: &Gap| {
            (gap.gap >= -deepest(gap)).then_some(Side { face: gap.triangle, gap: gap.gap })
        };
        let Some(gap) = Self::gap_at(&self.now, to) else {
            // On the border of a surface that is not closed.
            let closest = self.now.closest(to, f64::INFINITY, Candidates::All);
            let clearance = closest.map_or(f64::INFINITY, |closest| closest.distance);
            return (Point { clearance, ..Point::default() }, known.side);
        };
        let side = match known.side {
            None if behind <= deepest(&gap) => None,
            known => known.or_else(|| side_of(&Self::gap_at(&self.before, from)?)),
        };
        let has_passed =
            side.is_some_and(|side| self.passes(side, &gap, deepest(&gap), [from, to]));
        (Point { clearance: gap.gap.max(0.0), side: side_of(&gap), has_passed }, side)
    }

    /// Whether a point is still too deep, or on the far side, seen from where it was before the first had passed.
    fn is_still_beyond(&self, side: Option<Side>, to: [f64; 3], reach: f64) -> bool {
        let found = side.and_then(|side| Some((side, Self::gap_at(&self.now, to)?)));
        found.is_some_and(|(side, gap)| self.is_beyond(side, &gap, self.deepest(&gap, reach), to))
    }

    /// The gap at a point, however far, to the triangle that faces it.
    fn gap_at(surface: &Placed, x: [f64; 3]) -> Option<Gap> {
        let gap = surface.gap(x, f64::INFINITY, Candidates::All)?;
        Some(Gap { triangle: surface.facing(&gap), ..gap })
    }

    /// How deep a point may be behind the triangle that it is closest to [m].
    fn deepest(&self, gap: &Gap, reach: f64) -> f64 {
        (DEEPEST * self.heights[gap.triangle]).min(reach)
    }

    /// Whether a point comes in too deep, past the middle, or out on the far side.
    fn passes(&self, side: Side, gap: &Gap, deepest: f64, [from, to]: Way) -> bool {
        let (is_deep, is_far) = (gap.gap < -deepest, self.is_far(side, gap));
        if !is_deep && !is_far {
            return false;
        }
        // As the face sees it, which moves as well.
        let [start, end] = [&self.before, &self.now].map(|surface| surface.centre(side.face));
        let from = std::array::from_fn(|i| from[i] + end[i] - start[i]);
        let crossed = self.now.behind_along([from, to]);
        let stays_in = crossed == 0.0 && side.gap < 0.0 && gap.gap < 0.0;
        // With how deep it was behind that face before.
        let way = if stays_in { norm(sub(to, from)) } else { crossed };
        let behind = way - side.gap.min(0.0);
        let is_in = side.gap <= 0.0 || behind > 0.0;
        is_in && is_deep || is_far && (behind > deepest || is_in && gap.gap < -PAST * deepest)
    }

    /// Whether a point that has passed is still too deep, or on the far side.
    fn is_beyond(&self, side: Side, gap: &Gap, deepest: f64, to: [f64; 3]) -> bool {
        let face = self.now.centre(side.face);
        let (normal, before) = (self.now.normal(side.face), BEFORE * norm(sub(to, face)));
        let from = std::array::from_fn(|i| face[i] + before * normal[i]);
        let lies_behind = || gap.gap < 0.0 || self.now.behind_along([from, to]) > deepest;
        gap.gap < -deepest || self.is_far(side, gap) && lies_behind()
    }

    /// Whether a point is closest to the far side of the body, seen from the face that it was closest to.
    fn is_far(&self, side: Side, gap: &Gap) -> bool {
        dot(self.now.normal(side.face), gap.normal) < FAR_SIDE
    }
}

/// Whether the first of two boxes lies before the other along each axis, and whether the other does before the first.
fn lie_beside([one, other]: [[[f64; 3]; 2]; 2]) -> [bool; 6] {
    std::array::from_fn(|k| match k {
        0..3 => one[1][k] < other[0][k],
        _ => other[1][k - 3] < one[0][k - 3],
    })
}

/// Whether most of the followed points are beyond. Of surfaces that lie apart that tells whether they have gone through each
/// other: where bodies were crushed, some points were taken for coming from the far side.
fn most_have_passed(known: &[Point]) -> bool {
    let followed = known.iter().filter(|point| point.side.is_some()).count();
    let passed = known.iter().filter(|point| point.has_passed).count();
    2 * passed > followed
}

/// Vectors without what they have in common.
pub(super) fn but_for_the_mean(vectors: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    let count = vectors.len() as f64;
    let mean = std::array::from_fn(|i| vectors.iter().map(|w| w[i]).sum::<f64>() / count);
    vectors.into_iter().map(|w| sub(w, mean)).collect()
}
