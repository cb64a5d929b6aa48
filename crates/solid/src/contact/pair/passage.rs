//! Surfaces that have gone through each other. The layer pushes a point out by the nearest face, so what is led in past the
//! middle of a body comes out on the far side, where nothing but its way there tells that it should not be.
//!
//! Therefore points of both surfaces, the corners and the centres of their triangles, are followed from step to step: from the
//! face of the other surface that each was closest to, outside or in the layer, to where it is now. A point is asked about
//! only if it may have come to the other surface since it was last.

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

/// The ways of the points of both surfaces.
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

/// A corner, or the centre of a triangle: the mean of these corners; and the least height of the cells behind it [m].
struct Followed {
    corners: [u32; 3],
    height: f64,
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
        let [before, now] = [&self.start, places].map(|places| self.boxes(places));
        let is_beside = |k: usize, one: usize| {
            [&before, &now].iter().all(|boxes| boxes[one][1][k] < boxes[1 - one][0][k])
        };
        (0..3).any(|k| is_beside(k, 0) || is_beside(k, 1))
    }

    fn follow(&self, known: &mut Vec<Point>, places: &[[f64; 3]]) {
        let moved: Vec<[f64; 3]> =
            places.iter().zip(&self.start).map(|(x, y)| sub(*x, *y)).collect();
        let motion = but_for_the_mean(moved);
        let followed = [0, 1].map(|side| self.followed(side));
        known.resize(followed.iter().map(Vec::len).sum(), Point::default());
        let mut known = known.iter_mut();
        for (side, followed) in followed.iter().enumerate() {
            let its = if side == 0 { &self.other } else { &self.sampled };
            let heights = &self.heights[1 - side];
            let other = Other { heights, before: its.at(&self.start), now: its.at(places) };
            let nodes = its.triangles().iter().flatten();
            let fastest = nodes.map(|&node| norm(motion[node as usize])).fold(0.0, f64::max);
            for (point, known) in followed.iter().zip(&mut known) {
                let (free, moved) = (known.clearance, norm(point.mean(&motion)) + fastest);
                known.clearance -= moved;
                if known.has_passed || known.clearance <= 0.0 {
                    let way = [point.mean(&self.start), point.mean(places)];
                    let behind = if free > 0.0 { moved - free } else { f64::INFINITY };
                    *known = other.look(*known, Motion { way, behind }, point.height, self.reach);
                } else {
                    known.side = None;
                }
            }
        }
    }

    /// The points of the sampled surface, or of the other.
    fn followed(&self, side: usize) -> Vec<Followed> {
        let facets = if side == 0 { &self.sampled } else { &self.other };
        let height = |triangle: &u32| self.heights[side][*triangle as usize];
        let corners = (0..self.corners.len() as u32).filter_map(|corner| {
            let around = facets.around(corner).iter().map(height);
            Some(Followed { corners: [corner; 3], height: around.reduce(f64::min)? })
        });
        let centres = (0u32..).zip(facets.triangles());
        let centres = centres.map(|(t, &corners)| Followed { corners, height: height(&t) });
        corners.chain(centres).collect()
    }
}

impl Followed {
    fn mean(&self, values: &[[f64; 3]]) -> [f64; 3] {
        mean(&self.corners.map(|corner| values[corner as usize]), [1.0 / 3.0; 3])
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
    /// What is known of a point on cells as high after it has moved.
    fn look(&self, known: Point, motion: Motion, height: f64, reach: f64) -> Point {
        let Motion { way: [from, to], behind } = motion;
        // As [`ActivePair::deepest`].
        let deepest = |gap: &Gap| (DEEPEST * height.min(self.heights[gap.triangle])).min(reach);
        let side_of = |gap: &Gap| {
            (gap.gap >= -deepest(gap)).then_some(Side { face: gap.triangle, gap: gap.gap })
        };
        let gap_at = |surface: &Placed, x: [f64; 3]| {
            let gap = surface.gap(x, f64::INFINITY, Candidates::All)?;
            Some(Gap { triangle: surface.facing(&gap), ..gap })
        };
        let Some(gap) = gap_at(&self.now, to) else {
            // On the border of a surface that is not closed.
            let closest = self.now.closest(to, f64::INFINITY, Candidates::All);
            let clearance = closest.map_or(f64::INFINITY, |closest| closest.distance);
            return match known.has_passed {
                true => known,
                false => Point { clearance, ..Point::default() },
            };
        };
        let side = match known.side {
            None if behind <= deepest(&gap) => None,
            known => known.or_else(|| side_of(&gap_at(&self.before, from)?)),
        };
        let has_passed = side.is_some_and(|side| match known.has_passed {
            true => self.is_beyond(side, &gap, deepest(&gap), to),
            false => self.passes(side, &gap, deepest(&gap), [from, to]),
        });
        let side = if has_passed { side } else { side_of(&gap) };
        Point { clearance: gap.gap.max(0.0), side, has_passed }
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
        let behind = self.now.behind_along([from, to]);
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

    fn is_far(&self, side: Side, gap: &Gap) -> bool {
        dot(self.now.normal(side.face), gap.normal) < FAR_SIDE
    }
}

/// Vectors without what they have in common.
pub(super) fn but_for_the_mean(vectors: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    let count = vectors.len() as f64;
    let mean = std::array::from_fn(|i| vectors.iter().map(|w| w[i]).sum::<f64>() / count);
    vectors.into_iter().map(|w| sub(w, mean)).collect()
}
