//! From a level to the next finer one: the modes of each aggregate, smoothed.

use super::aggregates::Aggregates;
use super::parts::Parts;
use crate::neighbours::Neighbours;
use crate::threads::each;
use std::ops::Range;
use viscera_number::simd::{Kernel, dispatch};

/// Rigid-body modes, and so unknowns of an aggregate.
pub(super) const MODES: usize = 6;

/// A number for each mode of an aggregate; two lanes of padding.
pub(super) type Modal = [f32; 8];

/// A mode that the others of its aggregate leave less of is one of them: nodes in a line turn about it in vain.
const RANK_TOLERANCE: f64 = 1e-10;

/// Values of all modes at the unknowns of a level, one row each.
pub(super) type Modes = Vec<[f64; MODES]>;

/// Translations and rotations at every point, lengths over the size of the body.
pub(super) fn rigid_modes(points: &[[f64; 3]]) -> Modes {
    let n = points.len().max(1) as f64;
    let centre: [f64; 3] =
        std::array::from_fn(|i| points.iter().map(|point| point[i]).sum::<f64>() / n);
    let arm = |point: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|i| point[i] - centre[i]) };
    let size = points.iter().flat_map(arm).fold(0.0f64, |size, x| size.max(x.abs()));
    let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
    let at = |point: &[f64; 3]| {
        let [x, y, z] = arm(point).map(|x| scale * x);
        [[1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x], [0.0, 0.0, 1.0, y, -x, 0.0]]
    };
    points.iter().flat_map(at).collect()
}

/// Which aggregates each node has a block for, ascending.
pub(super) struct Reach {
    start: Vec<u32>,
    column: Vec<u32>,
}

impl Reach {
    /// Places of the blocks of some nodes.
    #[inline(always)]
    pub fn places(&self, nodes: Range<usize>) -> Range<usize> {
        self.start[nodes.start] as usize..self.start[nodes.end] as usize
    }

    /// Place of a node's block for an aggregate of its own or of a neighbour.
    #[inline(always)]
    pub fn place(&self, node: usize, aggregate: u32) -> usize {
        let places = self.places(node..node + 1);
        let found = self.column[places.clone()].iter().position(|&a| a == aggregate);
        places.start
            + found.unwrap_or_else(|| unreachable!("a node knows its neighbours' aggregates"))
    }
}

/// Blocks of `B` rows and six columns.
pub(super) struct Prolongation<const B: usize> {
    n_coarse: usize,
    /// The aggregate of each node.
    pub aggregate: Vec<u32>,
    /// Its orthonormal modes at each node, by rows.
    pub tentative: Vec<[Modal; B]>,
    pub pattern: Reach,
    pub blocks: Vec<[Modal; B]>,
    /// Unknowns of the next level that stand for a mode.
    has_unknown: Vec<bool>,
    /// The parts in which threads share the nodes, and the aggregates of each, from the first to the last.
    parts: Vec<(Range<usize>, Range<usize>)>,
}

impl<const B: usize> Prolongation<B> {
    /// From the aggregates of a node and of its neighbours.
    pub fn new(aggregates: &Aggregates, neighbours: &Neighbours, parts: &Parts) -> Self {
        let n = aggregates.of.len();
        let (mut start, mut column) = (vec![0u32], Vec::new());
        for node in 0..n {
            let around = neighbours.of(node).iter().map(|&k| aggregates.of[k as usize]);
            let first = column.len();
            for aggregate in around.chain([aggregates.of[node]]) {
                if !column[first..].contains(&aggregate) {
                    column.push(aggregate);
                }
            }
            column[first..].sort_unstable();
            start.push(column.len() as u32);
        }
        let pattern = Reach { start, column };
        let reached = |nodes: &Range<usize>| {
            let columns = &pattern.column[pattern.places(nodes.clone())];
            let first = columns.iter().min().map_or(0, |&first| first as usize);
            first..columns.iter().max().map_or(0, |&last| last as usize + 1)
        };
        let nodes = parts.all().iter().map(|part| part.nodes.clone());
        Prolongation {
            parts: nodes.map(|nodes| (nodes.clone(), reached(&nodes))).collect(),
            n_coarse: aggregates.count(),
            aggregate: aggregates.of.clone(),
            tentative: vec![[Modal::default(); B]; n],
            blocks: vec![[Modal::default(); B]; pattern.column.len()],
            pattern,
            has_unknown: vec![false; MODES * aggregates.count()],
        }
    }

    pub fn n_coarse(&self) -> usize {
        self.n_coarse
    }

    /// Which rows of the next level stand for a mode.
    pub fn unknowns(&self) -> &[bool] {
        &self.has_unknown
    }

    /// A node's aggregates and blocks.
    #[inline(always)]
    pub fn row(&self, node: usize) -> (&[u32], &[[Modal; B]]) {
        let places = self.pattern.places(node..node + 1);
        (&self.pattern.column[places.clone()], &self.blocks[places])
    }

    /// Makes the modes orthonormal in each aggregate, `modes = Q R`, and keeps `Q`; `R`, the modes of the next level.
    pub fn orthonormalize(&mut self, modes: &Modes) -> Modes {
        let mut members = vec![Vec::new(); self.n_coarse];
        for (node, &aggregate) in self.aggregate.iter().enumerate() {
            members[aggregate as usize].push(node);
        }
        let mut coarse = vec![[0.0; MODES]; MODES * self.n_coarse];
        for (aggregate, members) in members.iter().enumerate() {
            let rows: Vec<usize> =
                members.iter().flat_map(|&node| B * node..B * (node + 1)).collect();
            let own: Modes = rows.iter().map(|&row| modes[row]).collect();
            let (q, is_new) = orthonormal(&own);
            for (k, &node) in members.iter().enumerate() {
                for (i, part) in self.tentative[node].iter_mut().enumerate() {
                    (0..MODES).for_each(|mode| part[mode] = q[B * k + i][mode] as f32);
                }
            }
            let first = MODES * aggregate;
            self.has_unknown[first..first + MODES].copy_from_slice(&is_new);
            for (q, mode) in q.iter().zip(&own) {
                for i in 0..MODES {
                    (0..MODES).for_each(|k| coarse[first + i][k] += q[i] * mode[k]);
                }
            }
        }
        coarse
    }

    /// `r_coarse = -Pᵀ x`: parts add up what is theirs, and the sums are added part by part.
    pub fn restrict_negative<const W: usize>(&self, x: &[[f32; W]], coarse: &mut [Modal]) {
        let of_part = |(nodes, reached): &(Range<usize>, Range<usize>), sums: &mut [Modal]| {
            let (first, nodes) = (reached.start, nodes.clone());
            dispatch(Restrict { prolongation: self, x, nodes, first, sums });
        };
        if let [alone] = &self.parts[..] {
            return of_part(alone, &mut coarse[alone.1.clone()]);
        }
        coarse.fill(Modal::default());
        let sums = each(self.parts.iter().collect(), |part| {
            let mut sums = vec![Modal::default(); part.1.len()];
            of_part(part, &mut sums);
            sums
        });
        for ((_, reached), sums) in self.parts.iter().zip(sums) {
            for (coarse, sum) in coarse[reached.clone()].iter_mut().zip(&sums) {
                (0..8).for_each(|m| coarse[m] += sum[m]);
            }
        }
    }

    /// `x += P x_coarse`.
    pub fn prolongate<const W: usize>(&self, coarse: &[Modal], mut x: &mut [[f32; W]]) {
        let mut tasks = Vec::with_capacity(self.parts.len());
        for (nodes, _) in &self.parts {
            let (own, rest) = std::mem::take(&mut x).split_at_mut(nodes.len());
            tasks.push(Prolongate { prolongation: self, coarse, first: nodes.start, x: own });
            x = rest;
        }
        each(tasks, dispatch);
    }
}

/// What the nodes of a part add to the aggregates that it reaches, of which `first` is the first.
struct Restrict<'a, const B: usize, const W: usize> {
    prolongation: &'a Prolongation<B>,
    x: &'a [[f32; W]],
    nodes: Range<usize>,
    first: usize,
    sums: &'a mut [Modal],
}

impl<const B: usize, const W: usize> Kernel for Restrict<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.sums.fill(Modal::default());
        for (node, x) in self.nodes.clone().zip(&self.x[self.nodes]) {
            let (columns, blocks) = self.prolongation.row(node);
            for (&column, block) in columns.iter().zip(blocks) {
                let sum = &mut self.sums[column as usize - self.first];
                for i in 0..B {
                    (0..8).for_each(|m| sum[m] -= block[i][m] * x[i]);
                }
            }
        }
    }
}

/// At the nodes of a part, of which `first` is the first.
struct Prolongate<'a, const B: usize, const W: usize> {
    prolongation: &'a Prolongation<B>,
    coarse: &'a [Modal],
    first: usize,
    x: &'a mut [[f32; W]],
}

impl<const B: usize, const W: usize> Kernel for Prolongate<'_, B, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (node, x) in (self.first..).zip(self.x) {
            let (columns, blocks) = self.prolongation.row(node);
            let mut products = [Modal::default(); B];
            for (&column, block) in columns.iter().zip(blocks) {
                let coarse = &self.coarse[column as usize];
                for i in 0..B {
                    (0..8).for_each(|m| products[i][m] += block[i][m] * coarse[m]);
                }
            }
            (0..B).for_each(|i| x[i] += products[i].iter().sum::<f32>());
        }
    }
}

/// Orthonormal columns that span the given ones, by Gram and Schmidt twice over; zero where a column brings nothing new.
fn orthonormal(columns: &Modes) -> (Modes, [bool; MODES]) {
    let (mut q, mut is_new) = (columns.clone(), [false; MODES]);
    for k in 0..MODES {
        let norm = |q: &Modes| q.iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
        let whole = norm(&q);
        for _ in 0..2 {
            for j in 0..k {
                let along: f64 = q.iter().map(|row| row[j] * row[k]).sum();
                q.iter_mut().for_each(|row| row[k] -= along * row[j]);
            }
        }
        let left = norm(&q);
        is_new[k] = left > RANK_TOLERANCE * whole;
        q.iter_mut().for_each(|row| row[k] = if is_new[k] { row[k] / left } else { 0.0 });
    }
    (q, is_new)
}
