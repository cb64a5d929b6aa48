//! Boxes around triangles, in the order of their lower ends, for finding those near a triangle.

use super::Vector;

/// Boxes around the triangles of a surface.
pub struct Boxes {
    /// Lower and upper corner, and triangle, ascending along the axis.
    boxes: Vec<([Vector; 2], usize)>,
    axis: usize,
    /// Largest extent of a box along the axis.
    widest: f64,
    /// The box around all.
    whole: [Vector; 2],
}

impl Boxes {
    /// Of triangles with these points.
    pub fn new(points: &[Vector], triangles: &[[u32; 3]]) -> Self {
        let of = |triangle: &[u32; 3]| around(&triangle.map(|node| points[node as usize]));
        let mut boxes: Vec<_> = triangles.iter().map(of).zip(0..).collect();
        let low = |axis: usize| boxes.iter().map(|(b, _)| b[0][axis]).fold(f64::MAX, f64::min);
        let high = |axis: usize| boxes.iter().map(|(b, _)| b[1][axis]).fold(f64::MIN, f64::max);
        let whole: [Vector; 2] = [std::array::from_fn(low), std::array::from_fn(high)];
        let extent = |axis: usize| whole[1][axis] - whole[0][axis];
        let axis = (0..3).max_by(|&i, &j| extent(i).total_cmp(&extent(j))).unwrap_or(0);
        boxes.sort_by(|(a, _), (b, _)| a[0][axis].total_cmp(&b[0][axis]));
        let widest =
            boxes.iter().map(|([low, high], _)| high[axis] - low[axis]).fold(0.0, f64::max);
        Boxes { boxes, axis, widest, whole }
    }

    /// Whether the box around points is at most `reach` away from that around all triangles.
    pub fn are_near(&self, points: &[Vector], reach: f64) -> bool {
        are_near(around(points), self.whole, reach)
    }

    /// Calls with each triangle whose box is at most `reach` away from that around points.
    pub fn each_near(&self, points: &[Vector], reach: f64, mut take: impl FnMut(usize)) {
        let ([low, high], axis) = (around(points), self.axis);
        let least = low[axis] - reach - self.widest;
        let first = self.boxes.partition_point(|([from, _], _)| from[axis] < least);
        for &([from, to], triangle) in &self.boxes[first..] {
            if from[axis] > high[axis] + reach {
                return;
            }
            if are_near([low, high], [from, to], reach) {
                take(triangle);
            }
        }
    }
}

/// Whether two boxes are at most `reach` apart, along every axis.
fn are_near([low, high]: [Vector; 2], [from, to]: [Vector; 2], reach: f64) -> bool {
    (0..3).all(|k| from[k] <= high[k] + reach && low[k] <= to[k] + reach)
}

/// Lower and upper corner of the box around points.
fn around(points: &[Vector]) -> [Vector; 2] {
    let end = |k: usize, start: f64, choose: fn(f64, f64) -> f64| {
        points.iter().map(|x| x[k]).fold(start, choose)
    };
    [
        std::array::from_fn(|k| end(k, f64::MAX, f64::min)),
        std::array::from_fn(|k| end(k, f64::MIN, f64::max)),
    ]
}
