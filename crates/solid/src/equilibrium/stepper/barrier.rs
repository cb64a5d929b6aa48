//! A barrier that keeps the volume ratios of cells within bounds beyond those of the law.
//!
//! With the distance `d` of `J` from a bound, 1 where the barrier begins and 0 at the bound, its energy per volume at rest
//! is `kappa b(d)`, `b(d) = -(1 - d)^2 ln d`: smooth to the second derivative where it begins, without limit at the bound.
//! A cell that a load presses against a bound comes to rest before it, may go back or along, and the others go on.
//! Li et al., Incremental Potential Contact, SIGGRAPH 2020, with volume ratios in the place of distances.
//!
//! `J` is cubic in the displacement. Close to the bound a step that knows only its linear part is true for a short way:
//! cut back to it, a body with many cells there would stand still, under whatever load or none. So the stiffness has the
//! curvature of `J` too, made convex, which holds a cell the more against turning and shearing the closer it is to the
//! bound, and a step must leave each cell most of its distance.
//!
//! A body may begin with cells beyond the bounds, as a solution leaves them that knows none. Until they come back, the
//! barrier begins for these where they have begun.

use crate::body::{Body, Outlier, SymmetricBlocks};

/// Volume ratios that a step may end with. No tissue is pressed to a twentieth of its volume, and step by step a cell
/// could lose a part of what it has left for ever, as its tangent outgrows all others'. None swells to several times
/// its volume either: a step that says so has been yanked too far for its tangent.
pub const VOLUME_BOUNDS: [f64; 2] = [0.05, 4.0];

/// A volume ratio below so many times the lower bound, or above this part of the upper, is next to it.
const NEXT_TO_LOW: f64 = 2.0;
const NEXT_TO_HIGH: f64 = 0.8;

/// Distance that a step may always leave.
const FAR: f64 = 0.5;
/// Part of its distance that a step must leave a cell which has less.
const KEPT: f64 = 0.9;

/// The barrier, with the quadrature points that are next to a bound.
pub(super) struct VolumeBarrier {
    range: [f64; 2],
    points: Vec<Outlier>,
    /// Points that have begun beyond the bounds and have not come back, by their number, with bounds of their own.
    beyond: Vec<(usize, [f64; 2])>,
}

impl VolumeBarrier {
    /// Bounds of the volume ratio, and where the body begins.
    pub fn new(range: [f64; 2], body: &Body, u: &[f64]) -> Self {
        let mut barrier = VolumeBarrier { range, points: Vec::new(), beyond: Vec::new() };
        barrier.begin(body, u);
        barrier
    }

    /// Begins anew at a displacement.
    pub fn begin(&mut self, body: &Body, u: &[f64]) {
        self.points = body.outliers(u, self.inner());
        self.beyond = self.points.iter().filter_map(|point| self.begun_beyond(point)).collect();
    }

    /// The bounds of a point that begins beyond those of the body; it keeps bounds of its own within which it is.
    fn begun_beyond(&self, point: &Outlier) -> Option<(usize, [f64; 2])> {
        let ([low, high], here) = (self.range_of(point.point), point.volume_ratio);
        let own = [low.min(here / NEXT_TO_LOW), high.max(here / NEXT_TO_HIGH)];
        if here <= low || here >= high {
            Some((point.point, own))
        } else {
            self.own(point.point).map(|own| (point.point, own))
        }
    }

    /// Bounds within which every point is.
    pub fn range(&self) -> [f64; 2] {
        let widen = |[low, high]: [f64; 2], own: [f64; 2]| [low.min(own[0]), high.max(own[1])];
        self.beyond.iter().map(|&(_, own)| own).fold(self.range, widen)
    }

    /// Volume ratios that are not next to a bound.
    pub fn inner(&self) -> [f64; 2] {
        inner(self.range)
    }

    /// The bounds of a point of its own.
    fn own(&self, point: usize) -> Option<[f64; 2]> {
        let found = self.beyond.binary_search_by_key(&point, |&(point, _)| point);
        found.ok().map(|k| self.beyond[k].1)
    }

    fn range_of(&self, point: usize) -> [f64; 2] {
        self.own(point).unwrap_or(self.range)
    }

    /// Follows a step to a displacement within the bounds, unless a cell would come too close to a bound; returns
    /// whether it did.
    pub fn follow(&mut self, body: &Body, u: &[f64]) -> bool {
        let now = body.outliers(u, self.inner());
        let mut before = self.points.iter().peekable();
        let leaves_enough = now.iter().all(|now| {
            while before.next_if(|old| old.point < now.point).is_some() {}
            let old = before.next_if(|old| old.point == now.point);
            let from = old.map_or(1.0, |old| self.distance(old)[0]);
            self.distance(now)[0] >= FAR.min(KEPT * from)
        });
        if leaves_enough {
            let has_come_back = |k: usize| now.binary_search_by_key(&k, |now| now.point).is_err();
            self.beyond.retain(|&(point, _)| !has_come_back(point));
            self.points = now;
        }
        leaves_enough
    }

    /// Forgets all points next to a bound.
    pub fn forget(&mut self) {
        self.points.clear();
        self.beyond.clear();
    }

    /// Whether no point is next to a bound.
    pub fn is_idle(&self) -> bool {
        self.points.is_empty()
    }

    /// Number of cells next to a bound.
    pub fn n_cells(&self) -> usize {
        self.points.chunk_by(|a, b| a.cell == b.cell).count()
    }

    /// Adds the force of the barrier, the derivative of its energy [N].
    pub fn add_force(&self, body: &Body, force: &mut [f64]) {
        for point in &self.points {
            let [_, pull, _] = self.energy(body, point);
            for (node, slope) in &point.slopes {
                (0..3).for_each(|i| force[3 * *node as usize + i] += pull * slope[i]);
            }
        }
    }

    /// Adds its stiffness [N/m], made convex point by point.
    pub fn add_stiffness(&self, body: &Body, blocks: &mut SymmetricBlocks) {
        for point in &self.points {
            let [_, first, second] = self.energy(body, point);
            for (row, column, block) in point.convex_stiffness([first, second]) {
                let position = body.pattern().position(row, column);
                position.into_iter().for_each(|position| blocks.add(position, &block));
            }
        }
    }

    /// Energy of the barrier at a point [J], and its first and second derivative in `J`. The scale `kappa` is the modulus
    /// of uniaxial strain times the range of `J` that the barrier takes.
    pub fn energy(&self, body: &Body, point: &Outlier) -> [f64; 3] {
        let material = body.material();
        let [shear, bulk] = material.moduli_of_cell(point.cell);
        let [d, slope] = self.distance(point);
        let scale = (bulk + 4.0 / 3.0 * shear) / slope.abs() * point.volume;
        let [energy, first, second] = barrier(d);
        [scale * energy, scale * slope * first, scale * slope * slope * second]
    }

    /// Distance of a point from the bound next to it, at most 1, and the derivative of what is less in `J`.
    fn distance(&self, point: &Outlier) -> [f64; 2] {
        let (range, volume_ratio) = (self.range_of(point.point), point.volume_ratio);
        let ([low, high], [from, to]) = (range, inner(range));
        let [d, slope] = if volume_ratio < from {
            [(volume_ratio - low) / (from - low), 1.0 / (from - low)]
        } else {
            [(high - volume_ratio) / (high - to), -1.0 / (high - to)]
        };
        [d.min(1.0), slope]
    }
}

/// Volume ratios that are not next to these bounds.
fn inner([low, high]: [f64; 2]) -> [f64; 2] {
    [NEXT_TO_LOW * low, NEXT_TO_HIGH * high]
}

/// `b(d)` and its first two derivatives.
fn barrier(d: f64) -> [f64; 3] {
    let (gap, log) = (1.0 - d, d.ln());
    let steep = gap / d;
    [-gap * gap * log, 2.0 * gap * log - gap * steep, -2.0 * log + 4.0 * steep + steep * steep]
}
