//! Finds the cell that contains a point: cells are sorted into the boxes of a regular grid, about one to a box.

use super::{Vector, cross, dot, sub};

/// A place this far outside a cell, in barycentric coordinates, still counts as on its face.
const ON_FACE: f64 = 1e-9;

/// Boxes along an axis.
const MOST_BOXES: usize = 256;

/// The cell that holds a place, and the barycentric coordinates of the place in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// Index of the cell.
    pub cell: u32,
    /// One weight for each corner, of sum 1.
    pub weights: [f64; 4],
}

/// Finds cells by place.
pub struct Locator {
    low: Vector,
    /// Boxes per length, by axis.
    density: Vector,
    counts: [usize; 3],
    /// Where the cells of each box begin in `cells`.
    start: Vec<u32>,
    cells: Vec<u32>,
    /// By cell: its first corner, and the gradients of the barycentric coordinates of the others.
    frames: Vec<(Vector, [Vector; 3])>,
}

impl Locator {
    /// Of cells turned either way; those of no volume hold nothing. Every index must be one of a point.
    pub fn new(points: &[Vector], cells: &[[u32; 4]]) -> Self {
        let frames: Vec<_> = cells.iter().map(|nodes| frame(corners(points, nodes))).collect();
        let used = cells.iter().flat_map(|nodes| corners(points, nodes));
        let (low, high) = used.fold(([f64::MAX; 3], [f64::MIN; 3]), |(low, high), x| {
            (std::array::from_fn(|i| low[i].min(x[i])), std::array::from_fn(|i| high[i].max(x[i])))
        });
        let extent: Vector = std::array::from_fn(|i| (high[i] - low[i]).max(0.0));
        let longest = extent.iter().fold(0.0, |max: f64, &length| max.max(length));
        let edge = (extent.iter().product::<f64>() / cells.len().max(1) as f64).cbrt();
        let edge = edge.max(longest / MOST_BOXES as f64);
        let counts = extent.map(|length| ((length / edge) as usize).clamp(1, MOST_BOXES));
        let density: Vector =
            std::array::from_fn(
                |i| {
                    if extent[i] > 0.0 { counts[i] as f64 / extent[i] } else { 0.0 }
                },
            );
        let mut locator =
            Locator { low, density, counts, start: Vec::new(), cells: Vec::new(), frames };
        locator.fill(points, cells);
        locator
    }

    /// Sorts the cells into the boxes that the box around them meets.
    fn fill(&mut self, points: &[Vector], cells: &[[u32; 4]]) {
        let mut start = vec![0u32; self.counts.iter().product::<usize>() + 1];
        let ranges: Vec<[[usize; 3]; 2]> = (cells.iter())
            .map(|nodes| {
                let x = corners(points, nodes);
                let bound = |best: fn(f64, f64) -> f64| -> Vector {
                    std::array::from_fn(|i| x.iter().map(|x| x[i]).reduce(best).unwrap_or(0.0))
                };
                [self.place(&bound(f64::min)), self.place(&bound(f64::max))]
            })
            .collect();
        for range in &ranges {
            self.boxes(range).for_each(|b| start[b + 1] += 1);
        }
        (1..start.len()).for_each(|b| start[b] += start[b - 1]);
        let mut next = start.clone();
        let mut sorted = vec![0; start[start.len() - 1] as usize];
        for (cell, range) in (0u32..).zip(&ranges) {
            for b in self.boxes(range) {
                sorted[next[b] as usize] = cell;
                next[b] += 1;
            }
        }
        (self.start, self.cells) = (start, sorted);
    }

    fn place(&self, x: &Vector) -> [usize; 3] {
        std::array::from_fn(|i| {
            (((x[i] - self.low[i]) * self.density[i]) as usize).min(self.counts[i] - 1)
        })
    }

    fn index(&self, place: [usize; 3]) -> usize {
        (place[0] * self.counts[1] + place[1]) * self.counts[2] + place[2]
    }

    fn boxes(&self, &[low, high]: &[[usize; 3]; 2]) -> impl Iterator<Item = usize> + '_ {
        (low[0]..=high[0]).flat_map(move |i| {
            (low[1]..=high[1])
                .flat_map(move |j| (low[2]..=high[2]).map(move |k| self.index([i, j, k])))
        })
    }

    /// The cell that holds a place most deeply, the first of several; nothing outside of all, nor where a coordinate is
    /// not finite.
    pub fn find(&self, x: &Vector) -> Option<Located> {
        if self.cells.is_empty() || !x.iter().all(|x| x.is_finite()) {
            return None;
        }
        let b = self.index(self.place(x)); // a place beside the grid falls into a box at its border, in no cell of it
        let mut best: Option<(f64, Located)> = None;
        for &cell in &self.cells[self.start[b] as usize..self.start[b + 1] as usize] {
            let (origin, gradients) = &self.frames[cell as usize];
            let [p, q, r] = gradients.map(|g| dot(g, sub(*x, *origin)));
            let weights = [1.0 - p - q - r, p, q, r];
            let depth = if weights[0].is_finite() { least(weights) } else { f64::NEG_INFINITY };
            if depth >= -ON_FACE && best.as_ref().is_none_or(|(deepest, _)| depth > *deepest) {
                best = Some((depth, Located { cell, weights }));
            }
        }
        best.map(|(_, located)| located)
    }
}

fn least(weights: [f64; 4]) -> f64 {
    weights.into_iter().fold(f64::MAX, f64::min)
}

fn corners(points: &[Vector], nodes: &[u32; 4]) -> [Vector; 4] {
    nodes.map(|node| points[node as usize])
}

/// First corner, and gradients of the other barycentric coordinates; not finite where the cell is flat.
fn frame([a, b, c, d]: [Vector; 4]) -> (Vector, [Vector; 3]) {
    let edges = [sub(b, a), sub(c, a), sub(d, a)];
    let volume = dot(edges[0], cross(edges[1], edges[2]));
    let gradient = |k: usize| cross(edges[(k + 1) % 3], edges[(k + 2) % 3]).map(|x| x / volume);
    (a, std::array::from_fn(gradient))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::{block, noise};

    #[test]
    fn places_inside_are_found_in_a_cell_that_holds_them() {
        let (points, cells) = block([4, 3, 5], [0.4, 0.2, 0.6]);
        let locator = Locator::new(&points, &cells);
        for r in noise(3 * 500, 5).chunks_exact(3) {
            let size = [0.4, 0.2, 0.6];
            let x: Vector = std::array::from_fn(|i| size[i] * (0.5 + 0.6 * r[i]));
            let inside = (0..3).all(|i| (0.0..=size[i]).contains(&x[i]));
            let found = locator.find(&x);
            assert_eq!(found.is_some(), inside, "{x:?}");
            if let Some(Located { cell, weights }) = found {
                let corners = corners(&points, &cells[cell as usize]);
                for i in 0..3 {
                    let back: f64 = (0..4).map(|a| weights[a] * corners[a][i]).sum();
                    assert!((back - x[i]).abs() < 1e-14 && weights.iter().all(|w| *w > -1e-8));
                }
            }
        }
    }

    #[test]
    fn corners_faces_and_what_is_no_place() {
        let (points, cells) = block([2; 3], [1.0; 3]);
        let locator = Locator::new(&points, &cells);
        assert!(points.iter().all(|x| locator.find(x).is_some()));
        assert!(locator.find(&[f64::NAN, 0.0, 0.0]).is_none());
        assert!(locator.find(&[f64::INFINITY, 0.0, 0.0]).is_none());
        assert!(locator.find(&[-1e-6, 0.5, 0.5]).is_none());
        assert!(Locator::new(&[], &[]).find(&[0.0; 3]).is_none());
        let flat = Locator::new(&[[0.0; 3]; 4], &[[0, 1, 2, 3]]);
        assert!(flat.find(&[0.0; 3]).is_none());
    }
}
