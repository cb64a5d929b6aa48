//! The owner of each point: the labels' indicators, smoothed, with biases that keep the labels' volumes.

use crate::indicators::{blend, indicators, smoothed};
use crate::pieces::Pieces;
use crate::size::{Levels, Sizes};
use crate::vector::{Point, dot, norm, scale, sub};
use rayon::prelude::*;

/// A label map: `values[(i * dims[1] + j) * dims[2] + k]` is the label of voxel (i, j, k), whose centre lies at
/// `affine * (i, j, k, 1)` [m].
pub struct Labels<'a> {
    /// Number of voxels along each axis.
    pub dims: [usize; 3],
    /// The label of each voxel.
    pub values: &'a [u16],
    /// From voxel indices to places [m].
    pub affine: [[f64; 4]; 3],
    /// Volume of each label that is meshed [m^3], where it is known better than by counting voxels.
    pub volumes: Option<&'a [f64]>,
}

/// Standard deviation of the smoothing: in voxels, against the staircase, and in edges, against what is finer than
/// the mesh. An axis with fine voxels takes part in the smoothing of the coarsest one, or slices would show.
const BY_VOXEL: f64 = 0.8;
const BY_EDGE: f64 = 0.25;
const COARSEST: f64 = 0.5;
/// Where some owners without bias meet, each has an equal share of 1 as its score. A larger bias would win there, however
/// far its label is: what it has above that, less a margin, fades where its label's indicator is below [`FADING`]. Three
/// owners meet along lines, four at points, or along a line where planes divide an organ. More are rare.
const MEETING: usize = 4;
const MARGIN: f64 = 0.02;
const FADING: f64 = 0.1;
/// With this bias a label owns all that is near it.
const HIGHEST: f64 = 1.0;

/// Smoothed indicators on the part of the grid that holds the labels.
pub struct Field {
    /// Number of voxels along each axis.
    dims: [usize; 3],
    n_labels: usize,
    /// `u[voxel * n_labels + label]`.
    u: Vec<f32>,
    /// The pieces of the labels.
    pub pieces: Pieces,
    to_index: Affine,
    /// Added to each label's indicator, less what it lacks; the outside has none.
    bias: Vec<f64>,
    /// The largest bias that lacks nothing.
    everywhere: f64,
    /// Where the image ends within a label.
    pub planes: Vec<Plane>,
    /// Volume of each label's voxels [m^3].
    pub volumes: Vec<f64>,
    /// Lowest and highest corner of a box that holds the labels [m].
    pub bounds: [Point; 2],
    /// Volume of a voxel [m^3].
    voxel_volume: f64,
    reach: f64,
    sizes: Sizes,
    /// The sizes of the lattice that suits the labels' edges.
    pub levels: Levels,
}

/// Half of space: beyond it where `normal . x > offset`, the normal being of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub normal: Point,
    pub offset: f64,
}

impl Plane {
    pub fn distance(&self, x: Point) -> f64 {
        dot(self.normal, x) - self.offset
    }
}

/// `linear * x + shift`.
struct Affine {
    linear: [Point; 3],
    shift: Point,
}

impl Affine {
    fn apply(&self, x: Point) -> Point {
        std::array::from_fn(|i| dot(self.linear[i], x) + self.shift[i])
    }

    fn new(rows: &[[f64; 4]; 3]) -> Self {
        Affine { linear: rows.map(|r| [r[0], r[1], r[2]]), shift: rows.map(|r| r[3]) }
    }

    fn column(&self, k: usize) -> Point {
        self.linear.map(|row| row[k])
    }

    fn determinant(&self) -> f64 {
        dot(self.linear[0], crate::vector::cross(self.linear[1], self.linear[2]))
    }

    fn inverse(&self) -> Self {
        use crate::vector::cross;
        let [a, b, c] = self.linear;
        let columns =
            [cross(b, c), cross(c, a), cross(a, b)].map(|v| scale(v, 1.0 / self.determinant()));
        let linear: [Point; 3] = std::array::from_fn(|i| columns.map(|column| column[i]));
        let shift = linear.map(|row| -dot(row, self.shift));
        Affine { linear, shift }
    }
}

impl Field {
    /// The field of some labels of a map, each with its edge. None of them may be absent from it.
    pub fn new(map: &Labels, labels: &[u16], edges: &[f64]) -> Self {
        let to_world = Affine::new(&map.affine);
        let spacing: [f64; 3] = std::array::from_fn(|k| norm(to_world.column(k)));
        let coarsest = COARSEST * spacing.iter().copied().fold(0.0, f64::max);
        let smoothing = |edge: f64| {
            spacing.map(|step| (BY_VOXEL * step.max(coarsest)).max(BY_EDGE * edge) / step)
        };
        let sigma = smoothing(edges.iter().copied().fold(0.0, f64::max));
        let held = box_of(map, labels);
        let margin = sigma.map(|s| (3.0 * s).ceil() as usize + 2);
        let low: [usize; 3] = std::array::from_fn(|k| held[0][k].saturating_sub(margin[k]));
        let high: [usize; 3] =
            std::array::from_fn(|k| (held[1][k] + 1 + margin[k]).min(map.dims[k]));
        let dims: [usize; 3] = std::array::from_fn(|k| high[k] - low[k]);
        let place = |voxel: usize| {
            let [i, j, k] =
                [voxel / (dims[1] * dims[2]), voxel / dims[2] % dims[1], voxel % dims[2]];
            let label =
                map.values[((i + low[0]) * map.dims[1] + j + low[1]) * map.dims[2] + k + low[2]];
            labels.iter().position(|&known| known == label)
        };
        let sizes = Sizes::new(edges, dims, spacing, place);
        let indicators = indicators(dims, labels.len(), place);
        let mut u = smoothed(&indicators, dims, labels.len(), sigma);
        let finest = smoothing(edges.iter().copied().fold(f64::INFINITY, f64::min));
        if finest != sigma {
            let fine = smoothed(&indicators, dims, labels.len(), finest);
            blend(&mut u, &fine, labels.len(), |voxel| {
                let [at, low, high] =
                    [smoothing(sizes.at(voxel)), finest, sigma].map(|s| dot(s, s));
                (at - low) / (high - low)
            });
        }
        let to_index = to_world.inverse();
        let mut planes = Vec::new();
        for k in 0..3 {
            let (row, length) = (to_index.linear[k], norm(to_index.linear[k]));
            let mut plane = |sign: f64, end: f64| {
                let normal = scale(row, sign / length);
                planes.push(Plane { normal, offset: sign * (end - to_index.shift[k]) / length });
            };
            if held[0][k] == 0 {
                plane(-1.0, -0.5);
            }
            if held[1][k] + 1 == map.dims[k] {
                plane(1.0, map.dims[k] as f64 - 0.5);
            }
        }
        let voxel_volume = to_world.determinant().abs();
        let volumes = match map.volumes {
            Some(known) => known.to_vec(),
            None => volumes(map, labels, voxel_volume),
        };
        let mut field = Field {
            dims,
            n_labels: labels.len(),
            u,
            pieces: Pieces::new(dims, place, &volumes, voxel_volume),
            bias: vec![0.0; labels.len()],
            everywhere: Self::share(labels.len()),
            planes,
            volumes,
            bounds: bounds(&to_world, held),
            voxel_volume,
            reach: (0..3).map(|k| sigma[k] * spacing[k]).fold(0.0, f64::max),
            levels: sizes.levels(|voxel| place(voxel).is_some()),
            sizes,
            to_index: Affine { shift: sub(to_index.shift, low.map(|i| i as f64)), ..to_index },
        };
        for _ in 0..3 {
            for label in 0..labels.len() {
                field.set_bias(label, field.level(label));
            }
        }
        field
    }

    /// Half the width of the smoothed steps [m].
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Number of labels; as a label, it is the outside.
    pub fn outside(&self) -> usize {
        self.n_labels
    }

    /// The voxel whose centre is nearest to a place.
    pub fn voxel(&self, x: Point) -> usize {
        let index = self.to_index.apply(x);
        (0..3).fold(0, |voxel, k| {
            let last = (self.dims[k] - 1) as f64;
            voxel * self.dims[k] + index[k].round().clamp(0.0, last) as usize
        })
    }

    /// Whether an edge is longer than the labels allow, somewhere within a reach of a place.
    pub fn is_too_long(&self, x: Point, edge: f64, reach: f64) -> bool {
        let (corners, weights, _) = self.voxels(x);
        let read =
            |values: &[f32]| (0..8).map(|i| weights[i] * f64::from(values[corners[i]])).sum();
        self.sizes.is_too_long(edge, reach, read)
    }

    /// How far the outside's score is above the largest one of a label.
    pub fn outsideness(&self, x: Point, scores: &mut Vec<f64>) -> f64 {
        self.scores(x, scores);
        let (outside, labels) = (scores[self.n_labels], &scores[..self.n_labels]);
        outside - labels.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Scores of all labels, and last of the outside. The highest one owns the point.
    pub fn scores(&self, x: Point, scores: &mut Vec<f64>) {
        scores.clear();
        scores.extend_from_slice(&self.bias);
        let (corners, weights, _) = self.voxels(x);
        let mut sum = 0.0;
        for (corner, weight) in corners.into_iter().zip(weights) {
            let u = &self.u[corner * self.n_labels..][..self.n_labels];
            for (score, &value) in scores.iter_mut().zip(u) {
                *score += weight * f64::from(value);
                sum += weight * f64::from(value);
            }
        }
        for (label, score) in scores.iter_mut().enumerate() {
            *score -= self.lack(label, *score - self.bias[label]);
        }
        scores.push(1.0 - sum);
    }

    /// Makes a label's bias larger.
    pub fn raise(&mut self, label: usize, by: f64) {
        self.set_bias(label, self.bias[label] + by);
    }

    /// Each label's bias.
    pub fn biases(&self) -> &[f64] {
        &self.bias
    }

    /// Sets every label's bias.
    pub fn set_biases(&mut self, biases: &[f64]) {
        for (label, &bias) in biases.iter().enumerate() {
            self.set_bias(label, bias);
        }
    }

    fn set_bias(&mut self, label: usize, bias: f64) {
        self.bias[label] = bias.min(HIGHEST);
        // Where owners meet, their scores are at least their share and the lower of their biases.
        let lowest = self.bias.iter().copied().fold(0.0, f64::min);
        self.everywhere = Self::share(self.n_labels) + lowest;
    }

    /// A little less than the largest score where the owners other than a label meet: there are as many as labels, since
    /// the outside is one.
    fn share(n_labels: usize) -> f64 {
        1.0 / n_labels.min(MEETING) as f64 - MARGIN
    }

    /// What a label's bias lacks where its indicator is `u`.
    fn lack(&self, label: usize, u: f64) -> f64 {
        self.fading(label) * (1.0 - u / FADING).max(0.0)
    }

    /// How much of a label's bias fades.
    fn fading(&self, label: usize) -> f64 {
        (self.bias[label] - self.everywhere).max(0.0)
    }

    /// The bias with which a label has a score where its indicator is `u`.
    fn needed(&self, u: f64, score: f64) -> f64 {
        let bias = score - u;
        if u >= FADING || bias <= self.everywhere {
            return bias;
        }
        self.everywhere + (bias - self.everywhere) * FADING / u
    }

    /// Score and gradient of the difference between two owners.
    pub fn difference(&self, a: usize, b: usize, x: Point) -> (f64, Point) {
        let (corners, weights, slopes) = self.voxels(x);
        let mut value = self.constant(a) - self.constant(b);
        let mut slope = [0.0; 3];
        for (i, corner) in corners.into_iter().enumerate() {
            let u = &self.u[corner * self.n_labels..][..self.n_labels];
            let at = self.part(a, u) - self.part(b, u);
            value += weights[i] * at;
            for k in 0..3 {
                slope[k] += slopes[i][k] * at;
            }
        }
        for (owner, sign) in [(a, 1.0), (b, -1.0)] {
            if owner == self.n_labels || self.fading(owner) == 0.0 {
                continue;
            }
            let u = corners.map(|corner| f64::from(self.u[corner * self.n_labels + owner]));
            let read = |by: [f64; 8]| by.iter().zip(u).map(|(by, u)| by * u).sum::<f64>();
            let lack = self.lack(owner, read(weights));
            if lack > 0.0 {
                value -= sign * lack;
                for k in 0..3 {
                    slope[k] += sign * self.fading(owner) / FADING * read(slopes.map(|s| s[k]));
                }
            }
        }
        let gradient = std::array::from_fn(|j| {
            (0..3).map(|k| slope[k] * self.to_index.linear[k][j]).sum::<f64>()
        });
        (value, gradient)
    }

    fn constant(&self, owner: usize) -> f64 {
        if owner == self.n_labels { 1.0 } else { self.bias[owner] }
    }

    fn part(&self, owner: usize, u: &[f32]) -> f64 {
        if owner == self.n_labels {
            -u.iter().map(|&v| f64::from(v)).sum::<f64>()
        } else {
            f64::from(u[owner])
        }
    }

    /// The eight voxels around a place, their trilinear weights and the slopes of these; beyond the grid, as at its
    /// border.
    fn voxels(&self, x: Point) -> ([usize; 8], [f64; 8], [Point; 8]) {
        let index = self.to_index.apply(x);
        let mut first = [0; 3];
        let mut t = [0.0; 3];
        let mut step = [0; 3];
        let mut is_inside = [1.0; 3];
        let stride = [self.dims[1] * self.dims[2], self.dims[2], 1];
        for k in 0..3 {
            let last = self.dims[k] - 1;
            let clamped = index[k].clamp(0.0, last as f64);
            first[k] = (clamped as usize).min(last.saturating_sub(1));
            t[k] = clamped - first[k] as f64;
            step[k] = if last == 0 { 0 } else { stride[k] };
            is_inside[k] = f64::from(u8::from(clamped == index[k] && last > 0));
        }
        let origin: usize = (0..3).map(|k| first[k] * stride[k]).sum();
        let mut corners = [0; 8];
        let mut weights = [0.0; 8];
        let mut slopes = [[0.0; 3]; 8];
        for i in 0..8 {
            let bit = [(i >> 2) & 1, (i >> 1) & 1, i & 1];
            corners[i] = origin + (0..3).map(|k| bit[k] * step[k]).sum::<usize>();
            let w: [f64; 3] = std::array::from_fn(|k| if bit[k] == 1 { t[k] } else { 1.0 - t[k] });
            let d: [f64; 3] =
                std::array::from_fn(|k| is_inside[k] * if bit[k] == 1 { 1.0 } else { -1.0 });
            weights[i] = w[0] * w[1] * w[2];
            slopes[i] = [d[0] * w[1] * w[2], w[0] * d[1] * w[2], w[0] * w[1] * d[2]];
        }
        (corners, weights, slopes)
    }

    /// The bias at which a label owns its volume, the others' unchanged, by counting voxels.
    fn level(&self, label: usize) -> f64 {
        let voxels = self.u.len() / self.n_labels;
        let count = (self.volumes[label] / self.voxel_volume).round() as usize;
        let count = count.clamp(1, voxels);
        let mut needed: Vec<f64> = self
            .u
            .par_chunks(self.n_labels)
            .map(|u| {
                let outside = 1.0 - u.iter().map(|&v| f64::from(v)).sum::<f64>();
                let score =
                    |l: usize| f64::from(u[l]) + self.bias[l] - self.lack(l, f64::from(u[l]));
                let others =
                    (0..self.n_labels).filter(|&l| l != label).map(score).fold(outside, f64::max);
                self.needed(f64::from(u[label]), others)
            })
            .collect();
        needed.par_sort_unstable_by(f64::total_cmp);
        0.5 * (needed[count - 1] + needed[count.min(needed.len() - 1)])
    }
}

/// Lowest and highest index of the voxels that carry one of the labels.
fn box_of(map: &Labels, labels: &[u16]) -> [[usize; 3]; 2] {
    let [_, ny, nz] = map.dims;
    let mut held = [map.dims, [0; 3]];
    for (voxel, value) in map.values.iter().enumerate() {
        if labels.contains(value) {
            let index = [voxel / (ny * nz), voxel / nz % ny, voxel % nz];
            for k in 0..3 {
                held[0][k] = held[0][k].min(index[k]);
                held[1][k] = held[1][k].max(index[k]);
            }
        }
    }
    held
}

fn volumes(map: &Labels, labels: &[u16], voxel: f64) -> Vec<f64> {
    let count = |label| map.values.iter().filter(|&&value| value == label).count();
    labels.iter().map(|&label| count(label) as f64 * voxel).collect()
}

/// A box around the voxels, a voxel wider.
fn bounds(to_world: &Affine, held: [[usize; 3]; 2]) -> [Point; 2] {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for i in 0..8 {
        let corner = std::array::from_fn(|k| match (i >> k) & 1 {
            0 => held[0][k] as f64 - 1.5,
            _ => held[1][k] as f64 + 1.5,
        });
        let place = to_world.apply(corner);
        for k in 0..3 {
            bounds[0][k] = bounds[0][k].min(place[k]);
            bounds[1][k] = bounds[1][k].max(place[k]);
        }
    }
    bounds
}
