//! Tools that are inside the body although no sample of its surface touches them: thinner than the surface is fine, or
//! moved through it in one step. The samples alone would say that such a tool is far from the surface.

use super::shape::Shape;
use crate::body::Body;
use crate::mesh::{cross, dot, sub};

/// Most points of a spine along one axis.
const MOST: usize = 17;
/// Points along an axis of the grid that finds the spine of a closed surface.
const GRID: usize = 13;
/// How deep a point of the spine of a closed surface lies, over the deepest.
const DEEP: f64 = 0.5;
/// How far beyond a face of a cell a point still counts as on it, over the height of the cell.
const ROUNDING: f64 = 1e-12;

/// Points of a shape, in its axes, that lie so deep in it that a body it merely presses never holds one.
pub fn spine(shape: &Shape) -> Vec<[f64; 3]> {
    match shape {
        Shape::Rounded { half, radius } => {
            let whole = half.map(|h| h + radius);
            let thin = whole.iter().copied().fold(f64::INFINITY, f64::min);
            let core = whole.map(|h| h - thin);
            let count = core.map(|c| MOST.min(1 + (2.0 * c / thin).ceil() as usize));
            grid(core.map(|c| -c), core, count)
        }
        Shape::HalfSpace => Vec::new(),
        Shape::Solid(solid) => {
            let [low, high] = solid.bounds();
            let points = grid(low, high, [GRID; 3]);
            let gaps: Vec<f64> = points.iter().map(|x| solid.distance(*x).gap).collect();
            let deepest = gaps.iter().copied().fold(0.0, f64::min);
            let is_deep = |gap: f64| gap < 0.0 && gap <= DEEP * deepest;
            points.into_iter().zip(gaps).filter(|(_, gap)| is_deep(*gap)).map(|(x, _)| x).collect()
        }
    }
}

/// How deep the deepest point of a spine lies in its shape [m].
pub fn depth(shape: &Shape, spine: &[[f64; 3]]) -> f64 {
    match shape {
        Shape::HalfSpace => f64::INFINITY,
        _ => spine.iter().map(|x| -shape.distance(*x).gap).fold(0.0, f64::max),
    }
}

/// The straight way of a point from one place to another [m].
pub type Way = [[f64; 3]; 2];

/// Whether a body displaced by `u` holds one of the points, in the straight cells between its corners.
pub fn holds(body: &Body, u: &[f64], points: &[[f64; 3]]) -> bool {
    let still: Vec<Way> = points.iter().map(|x| [*x; 2]).collect();
    meets(body, u, &still)
}

/// Whether one of the ways leads into a body displaced by `u`, or through it however thin it is there.
pub fn meets(body: &Body, u: &[f64], ways: &[Way]) -> bool {
    first_met(body, u, &[ways]).is_some()
}

/// The first of some sets of ways of which one [meets] a body displaced by `u`.
pub fn first_met<W: AsRef<[Way]>>(body: &Body, u: &[f64], sets: &[W]) -> Option<usize> {
    let sets: Vec<_> = sets.iter().map(AsRef::as_ref).filter(|ways| !ways.is_empty()).collect();
    let around: Vec<_> = sets.iter().map(|ways| bounds(ways.as_flattened())).collect();
    let [low, high] = bounds(around.as_flattened());
    let place = |node: u32| {
        let node = node as usize;
        std::array::from_fn::<f64, 3, _>(|i| body.points()[node][i] + u[3 * node + i])
    };
    let mut first = sets.len();
    for cell in body.cells() {
        let corners = cell.map(place);
        let [from, to] = bounds(&corners);
        let is_near =
            |low: &[f64; 3], high: &[f64; 3]| (0..3).all(|i| from[i] <= high[i] && to[i] >= low[i]);
        if first > 0 && is_near(&low, &high) {
            let is_met = |number: &usize| {
                let [low, high] = &around[*number];
                is_near(low, high) && sets[*number].iter().any(|way| crosses(&corners, *way))
            };
            first = (0..first).find(is_met).unwrap_or(first);
        }
    }
    (first < sets.len()).then_some(first)
}

/// Whether some of a way is on the inner side of all four faces of a cell, or on one.
fn crosses(corners: &[[f64; 3]; 4], [from, to]: Way) -> bool {
    let volume = |[a, b, c, d]: [[f64; 3]; 4]| dot(sub(b, a), cross(sub(c, a), sub(d, a)));
    let whole = volume(*corners);
    // The part of the way that is on the inner side of the faces so far.
    let [mut begin, mut end] = [0.0f64, 1.0f64];
    (0..4).all(|i| {
        let inward = |x: [f64; 3]| {
            let mut with = *corners;
            with[i] = x;
            volume(with) * whole.signum() + ROUNDING * whole.abs()
        };
        let [at_start, at_end] = [inward(from), inward(to)];
        if at_start < 0.0 && at_end < 0.0 {
            return false;
        }
        let passed = at_start / (at_start - at_end);
        if at_start < 0.0 {
            begin = begin.max(passed);
        } else if at_end < 0.0 {
            end = end.min(passed);
        }
        begin <= end
    })
}

fn bounds(points: &[[f64; 3]]) -> [[f64; 3]; 2] {
    let of = |choose: fn(f64, f64) -> f64| {
        let among = |i: usize| points.iter().map(|x| x[i]).reduce(choose).unwrap_or(0.0);
        std::array::from_fn(among)
    };
    [of(f64::min), of(f64::max)]
}

/// Points spread evenly between two corners, those included; in the middle along an axis that has one alone.
fn grid(low: [f64; 3], high: [f64; 3], count: [usize; 3]) -> Vec<[f64; 3]> {
    let at = |axis: usize, k: usize| match count[axis] {
        1 => 0.5 * (low[axis] + high[axis]),
        n => low[axis] + (high[axis] - low[axis]) * k as f64 / (n - 1) as f64,
    };
    let [nx, ny, nz] = count;
    let all = (0..nx).flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| [i, j, k])));
    all.map(|[i, j, k]| [at(0, i), at(1, j), at(2, k)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Into a cell, through it, along a face, past it; and through a cell as thin as a sheet.
    #[test]
    fn a_way_meets_the_cells_that_it_leads_through() {
        let cell = |thick: f64| [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, thick]];
        let down = |x: f64, y: f64, to: f64| [[x, y, 2.0], [x, y, to]];
        for thick in [1.0, 1e-3] {
            let mirrored = cell(thick).map(|[x, y, z]| [y, x, z]);
            for corners in [cell(thick), mirrored, cell(thick).map(|[x, y, z]| [x, y, -z])] {
                assert!(crosses(&corners, down(0.2, 0.3, -2.0)));
                assert!(crosses(&corners, down(0.0, 0.3, -2.0)), "along a face");
                assert!(!crosses(&corners, down(0.2, 0.3, 1.5)), "not so far");
                assert!(!crosses(&corners, down(0.7, 0.7, -2.0)), "past it");
                let inside = [0.2, 0.2, 0.1 * corners[3][2]];
                assert!(crosses(&corners, [inside; 2]));
                assert!(crosses(&corners, [[5.0; 3], inside]));
            }
        }
    }

    #[test]
    fn a_spine_lies_half_a_thickness_deep() {
        for (half, radius) in [([0.0; 3], 2.0), ([0.0, 0.0, 9.0], 0.5), ([3.0, 1.0, 5.0], 0.2)] {
            let shape = Shape::Rounded { half, radius };
            let thin = half.iter().map(|h| h + radius).fold(f64::INFINITY, f64::min);
            let points = spine(&shape);
            let deepest = |x: &[f64; 3]| -shape.distance(*x).gap;
            assert!(points.iter().all(|x| deepest(x) >= thin * (1.0 - 1e-12)), "{half:?}");
            assert!(points.iter().any(|x| x.iter().all(|x| x.abs() <= 0.5 * thin)), "{half:?}");
        }
        assert!(spine(&Shape::HalfSpace).is_empty());
    }
}
