//! How long edges may be: each label's own length, and beyond the label so much longer as one goes away from it.

use rayon::prelude::*;

/// Growth of the length with the distance from a label whose edges are shorter.
const GROWTH: f64 = 2.0;
/// Lengths that differ by less than this fraction are equal.
const EQUAL: f64 = 1e-9;

/// Lengths on the voxels of a grid.
pub struct Sizes {
    /// The longest of the labels' lengths [m].
    pub longest: f64,
    /// The others, each with every voxel's distance from the labels that have it [m].
    shorter: Vec<(f64, Vec<f32>)>,
}

/// A lattice's sizes: mean edge of its finest cells [m], and how often this doubles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    pub finest: f64,
    pub count: usize,
}

impl Levels {
    /// The longest edge of the lattice that is no longer than one asked for.
    pub fn edge(&self, asked: f64) -> f64 {
        let fits = |level: &usize| self.length(*level) <= asked * (1.0 + EQUAL);
        self.length((0..=self.count).rev().find(fits).unwrap_or(0))
    }

    fn length(&self, level: usize) -> f64 {
        self.finest * (1_u64 << level) as f64
    }
}

impl Sizes {
    /// The lengths of labels, by the place in the list of labels that each voxel has; `spacing` is the voxels'.
    pub fn new(
        edges: &[f64],
        dims: [usize; 3],
        spacing: [f64; 3],
        place: impl Fn(usize) -> Option<usize> + Sync,
    ) -> Self {
        let mut lengths = edges.to_vec();
        lengths.sort_by(f64::total_cmp);
        lengths.dedup_by(|a, b| *a <= *b * (1.0 + EQUAL));
        let longest = lengths.pop().unwrap_or(f64::INFINITY);
        let shorter = lengths.into_iter().map(|edge| {
            let is_theirs = |v: usize| place(v).is_some_and(|l| edges[l] <= edge * (1.0 + EQUAL));
            (edge, distances(dims, spacing, is_theirs))
        });
        Sizes { longest, shorter: shorter.collect() }
    }

    /// The length at a voxel [m].
    pub fn at(&self, voxel: usize) -> f64 {
        let grown = self.shorter.iter().map(|(edge, far)| edge + GROWTH * f64::from(far[voxel]));
        grown.fold(self.longest, f64::min)
    }

    /// Whether an edge is too long somewhere within a reach of the place at which `value` reads the distances.
    pub fn is_too_long(&self, edge: f64, reach: f64, value: impl Fn(&[f32]) -> f64) -> bool {
        let edge = edge / (1.0 + EQUAL);
        let is_near = |(length, far): &(f64, Vec<f32>)| {
            *length < edge && value(far) < reach + (edge - length) / GROWTH
        };
        edge > self.longest || self.shorter.iter().any(is_near)
    }

    /// The lattice with the fewest cells in some voxels: lengths double, so one of the labels' own lengths is kept and
    /// the others are shorter than asked.
    pub fn levels(&self, is_meshed: impl Fn(usize) -> bool + Sync) -> Levels {
        let lengths = self.shorter.iter().map(|(edge, _)| *edge).chain([self.longest]);
        let shortest = self.shorter.first().map_or(self.longest, |(edge, _)| *edge);
        let candidates = lengths.map(|length| {
            let down = ((length / shortest).log2() - EQUAL).ceil().max(0.0) as i32;
            let finest = length / 2.0_f64.powi(down);
            Levels {
                finest,
                count: (self.longest / finest * (1.0 + EQUAL)).log2().floor() as usize,
            }
        });
        let cells = |levels: &Levels| -> f64 {
            let n = self.shorter.first().map_or(0, |(_, far)| far.len());
            let in_slab = |slab: usize| {
                let voxels = (slab * SLAB..n.min((slab + 1) * SLAB)).filter(|&v| is_meshed(v));
                voxels.map(|v| levels.edge(self.at(v)).powi(-3)).sum::<f64>()
            };
            let sums: Vec<f64> = (0..n.div_ceil(SLAB)).into_par_iter().map(in_slab).collect();
            sums.iter().sum()
        };
        let best = candidates.map(|levels| (cells(&levels), levels));
        let best = best.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, levels)| levels);
        best.unwrap_or(Levels { finest: self.longest, count: 0 })
    }
}

/// Voxels that are summed in one go, so that the sum does not depend on the number of threads.
const SLAB: usize = 1 << 14;

/// Every voxel's distance from the nearest voxel of a kind, from border to border: the lower envelopes of parabolas along
/// one axis after the other (Felzenszwalb and Huttenlocher, 2012). Axes that are not orthogonal are taken as if they were.
fn distances(
    dims: [usize; 3],
    spacing: [f64; 3],
    is_theirs: impl Fn(usize) -> bool + Sync,
) -> Vec<f32> {
    let n = dims[0] * dims[1] * dims[2];
    let start = |v| if is_theirs(v) { 0.0 } else { f32::MAX };
    let mut squares: Vec<f32> = (0..n).into_par_iter().map(start).collect();
    let stride = [dims[1] * dims[2], dims[2], 1];
    for axis in 0..3 {
        let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
        let first = |line: usize| line / dims[t] * stride[s] + line % dims[t] * stride[t];
        let along = |line: usize| -> Vec<f32> {
            let values = (0..dims[axis]).map(|i| squares[first(line) + i * stride[axis]]);
            envelope(&values.collect::<Vec<f32>>(), spacing[axis])
        };
        let lines: Vec<Vec<f32>> = (0..dims[s] * dims[t]).into_par_iter().map(along).collect();
        for (line, values) in lines.into_iter().enumerate() {
            for (i, value) in values.into_iter().enumerate() {
                squares[first(line) + i * stride[axis]] = value;
            }
        }
    }
    let half = 0.5 * spacing.iter().copied().fold(0.0, f64::max) as f32;
    squares.into_par_iter().map(|square| (square.sqrt() - half).max(0.0)).collect()
}

/// `min_j values[j] + (step (i - j))^2` for every i.
fn envelope(values: &[f32], step: f64) -> Vec<f32> {
    let square = |i: usize| (step * i as f64).powi(2);
    // Parabolas that are lowest somewhere, and where each begins to be.
    let mut lowest: Vec<(usize, f64)> = Vec::new();
    for j in (0..values.len()).filter(|&j| values[j] < f32::MAX) {
        let begin = loop {
            let Some(&(i, from)) = lowest.last() else { break f64::NEG_INFINITY };
            let rise = f64::from(values[j]) + square(j) - f64::from(values[i]) - square(i);
            let crossing = rise / (2.0 * step * step * (j - i) as f64);
            if crossing > from {
                break crossing;
            }
            lowest.pop();
        };
        lowest.push((j, begin));
    }
    let mut k = 0;
    (0..values.len())
        .map(|i| {
            while lowest.get(k + 1).is_some_and(|next| next.1 <= i as f64) {
                k += 1;
            }
            lowest
                .get(k)
                .map_or(f32::MAX, |&(j, _)| (f64::from(values[j]) + square(i.abs_diff(j))) as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_nearest_voxel() {
        let (dims, spacing) = ([7, 6, 5], [1.0, 2.0, 0.5]);
        let index = |v: usize| [v / 30, v / 5 % 6, v % 5];
        let theirs = [3, 64, 65, 207];
        let found = distances(dims, spacing, |v| theirs.contains(&v));
        for (v, &distance) in found.iter().enumerate() {
            let to = |w: &usize| -> f64 {
                let gap = |k: usize| spacing[k] * (index(v)[k] as f64 - index(*w)[k] as f64);
                (0..3).map(|k| gap(k).powi(2)).sum::<f64>().sqrt()
            };
            let nearest = theirs.iter().map(to).fold(f64::INFINITY, f64::min);
            assert!((f64::from(distance) - (nearest - 1.0).max(0.0)).abs() < 1e-5);
        }
    }

    #[test]
    fn the_lattice_keeps_one_length_and_shortens_the_others() {
        // A row of 1000 voxels, the first of which has short edges.
        let sizes = |short, few| {
            let place = move |v: usize| Some(usize::from(v >= few));
            Sizes::new(&[short, 8.0], [1000, 1, 1], [1.0; 3], place)
        };
        let kept = sizes(4.0, 10).levels(|_| true);
        assert_eq!(kept, Levels { finest: 4.0, count: 1 });
        // Few voxels of 3: their edges become 2, and the others keep 8. Many: these become 6.
        assert_eq!(sizes(3.0, 2).levels(|_| true), Levels { finest: 2.0, count: 2 });
        assert_eq!(sizes(3.0, 900).levels(|_| true), Levels { finest: 3.0, count: 1 });
        let even = Sizes::new(&[5.0, 5.0], [4, 1, 1], [1.0; 3], |_| Some(0));
        assert_eq!(even.levels(|_| true), Levels { finest: 5.0, count: 0 });
        assert_eq!(kept.edge(7.9), 4.0);
    }
}
