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

/// Whether a body displaced by `u` holds one of the points, in the straight cells between its corners.
pub fn holds(body: &Body, u: &[f64], points: &[[f64; 3]]) -> bool {
    first_held(body, u, &[points]).is_some()
}

/// The first of some sets of points of which a body displaced by `u` holds one, see [`holds`].
pub fn first_held<P: AsRef<[[f64; 3]]>>(body: &Body, u: &[f64], sets: &[P]) -> Option<usize> {
    let sets: Vec<_> = sets.iter().map(AsRef::as_ref).filter(|points| !points.is_empty()).collect();
    let around: Vec<_> = sets.iter().map(|points| bounds(points)).collect();
    let [low, high] = bounds(&around.concat());
    let place = |node: u32| {
        let node = node as usize;
        std::array::from_fn::<f64, 3, _>(|i| body.points()[node][i] + u[3 * node + i])
    };
    let mut first = sets.len();
    for cell in body.cells() {
        let corners = cell.map(place);
        let [from, to] = bounds(&corners);
        let meets =
            |low: &[f64; 3], high: &[f64; 3]| (0..3).all(|i| from[i] <= high[i] && to[i] >= low[i]);
        if first > 0 && meets(&low, &high) {
            let is_in = |number: &usize| {
                let [low, high] = &around[*number];
                meets(low, high) && sets[*number].iter().any(|x| is_between(&corners, *x))
            };
            first = (0..first).find(is_in).unwrap_or(first);
        }
    }
    (first < sets.len()).then_some(first)
}

/// Whether a point is on the inner side of all four faces of a cell, or on one.
fn is_between(corners: &[[f64; 3]; 4], x: [f64; 3]) -> bool {
    let volume = |[a, b, c, d]: [[f64; 3]; 4]| dot(sub(b, a), cross(sub(c, a), sub(d, a)));
    let whole = volume(*corners);
    (0..4).all(|i| {
        let mut with = *corners;
        with[i] = x;
        volume(with) * whole.signum() >= -ROUNDING * whole.abs()
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
