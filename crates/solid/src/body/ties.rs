//! Linear elastic ties: elastic supports of a surface, bonds between surfaces, springs between places.
//!
//! A tie is a sum over samples: with the displacement `j = sum_a w_a u_a` at a sample, or the difference of two, its
//! energy is `1/2 j . k j`. The force `-K u` is linear and the tangent `K` constant, so a series of displacements meets
//! ties in its tangent alone: without its last order, a linear force has no coefficient of that order. Springs and cables
//! between places ([`Link`]) are ties too, but not linear: no series knows them. Of surfaces that may touch
//! ([`ContactPair`]) ties know the pairs of nodes; their forces are those of [`contact`](crate::contact).

use super::blocks::{BlockPattern, SymmetricBlocks, add_block_product};
use super::contact_pair::{ContactPair, ascending};
use super::curvature::Curvature;
use super::links::Link;
use crate::error::Error;
use crate::mesh::surface;
use crate::tensor::Mat3;
use std::collections::HashSet;

/// The samples of ties, in compressed rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ties {
    /// Where the nodes of each sample begin, and where the last ones end.
    pub start: Vec<u32>,
    /// Nodes of the samples.
    pub nodes: Vec<u32>,
    /// Their weights `w`: sum 1 where a sample is tied to the ground, 0 where two surfaces are tied to each other.
    pub weights: Vec<f64>,
    /// `k` of each sample, row by row [N/m]: symmetric, positive semidefinite.
    pub stiffness: Vec<[f64; 9]>,
    /// Springs and cables.
    pub links: Vec<Link>,
    /// Surfaces that may touch.
    pub contact_pairs: Vec<ContactPair>,
}

impl Ties {
    /// Whether there is no sample, no link and no contact pair.
    pub fn is_empty(&self) -> bool {
        self.stiffness.is_empty() && self.links.is_empty() && self.contact_pairs.is_empty()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.stiffness.len()
    }

    /// Nodes and weights of a sample.
    pub fn sample(&self, sample: usize) -> impl Iterator<Item = (u32, f64)> + Clone + '_ {
        let range = self.start[sample] as usize..self.start[sample + 1] as usize;
        self.nodes[range.clone()].iter().copied().zip(self.weights[range].iter().copied())
    }

    /// # Errors
    /// Arrays whose lengths do not fit, nodes out of range, values that are not finite, a stiffness that is not
    /// symmetric or has a negative diagonal.
    pub fn check(&self, n_nodes: usize) -> Result<(), Error> {
        let Ties { start, nodes, weights, stiffness, links, contact_pairs: _ } = self;
        links.iter().enumerate().try_for_each(|(number, link)| link.check(number, n_nodes))?;
        if stiffness.is_empty() && nodes.is_empty() {
            return Ok(());
        }
        let is_sorted = start.first() == Some(&0) && start.is_sorted();
        let fits = start.len() == stiffness.len() + 1 && weights.len() == nodes.len();
        if !(is_sorted && fits && start.last() == Some(&(nodes.len() as u32))) {
            return Err(Error::input(format!(
                "ties: {} starts, {} nodes, {} weights and {} stiffnesses do not fit together",
                start.len(),
                nodes.len(),
                weights.len(),
                stiffness.len()
            )));
        }
        if let Some(node) = nodes.iter().find(|&&node| node as usize >= n_nodes) {
            return Err(Error::input(format!("ties: point {node}; there are {n_nodes} points")));
        }
        if let Some(weight) = weights.iter().find(|weight| !weight.is_finite()) {
            return Err(Error::input(format!("ties: a weight is {weight}; it must be finite")));
        }
        let is_wrong = |k: &[f64; 9]| {
            let size = k.iter().fold(0.0f64, |size, x| size.max(x.abs()));
            let is_symmetric = [(1, 3), (2, 6), (5, 7)]
                .iter()
                .all(|&(a, b): &(usize, usize)| (k[a] - k[b]).abs() <= 1e-12 * size);
            !(size.is_finite() && is_symmetric && [k[0], k[4], k[8]].iter().all(|k| *k >= 0.0))
        };
        match stiffness.iter().position(is_wrong) {
            Some(sample) => Err(Error::input(format!(
                "ties: the stiffness of sample {sample} is {:?} N/m; it must be finite, symmetric and not negative",
                stiffness[sample]
            ))),
            None => Ok(()),
        }
    }

    /// # Errors
    /// A contact pair with a triangle that is no face of the surface of these cells.
    pub(super) fn check_pairs(&self, points: &[[f64; 3]], cells: &[[u32; 4]]) -> Result<(), Error> {
        if self.contact_pairs.is_empty() {
            return Ok(());
        }
        let faces: HashSet<[u32; 3]> = surface(points, cells).iter().map(ascending).collect();
        let mut pairs = self.contact_pairs.iter().enumerate();
        pairs.try_for_each(|(number, pair)| pair.check(number, &faces))
    }

    /// The pairs of nodes that they couple.
    pub(super) fn pairs(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        let of_samples = (0..self.len()).flat_map(|sample| {
            let nodes = self.sample(sample).map(|(node, _)| node);
            nodes.clone().flat_map(move |a| nodes.clone().map(move |b| [a, b]))
        });
        let of_links = self.links.iter().flat_map(|link| {
            link.ends.iter().flat_map(|(a, _)| link.ends.iter().map(|(b, _)| [*a, *b]))
        });
        let of_contact = self.contact_pairs.iter().flat_map(|pair| pair.reserved().iter().copied());
        of_samples.chain(of_links).chain(of_contact)
    }

    /// Displacement, or difference of displacements, at a sample.
    fn stretch(&self, sample: usize, u: &[f64]) -> [f64; 3] {
        let mut stretch = [0.0; 3];
        for (node, weight) in self.sample(sample) {
            (0..3).for_each(|i| stretch[i] += weight * u[3 * node as usize + i]);
        }
        stretch
    }

    /// Energy [J].
    pub fn energy(&self, u: &[f64]) -> f64 {
        let of_sample = |(sample, k): (usize, &[f64; 9])| {
            let stretch = self.stretch(sample, u);
            let pull = times(k, stretch);
            0.5 * (0..3).map(|i| stretch[i] * pull[i]).sum::<f64>()
        };
        let links = self.links.iter().filter_map(|link| link.at(u, Curvature::Exact));
        let of_samples: f64 = self.stiffness.iter().enumerate().map(of_sample).sum();
        of_samples + links.map(|pull| pull.energy).sum::<f64>()
    }

    /// Adds `K u` [N]; returns the energy [J].
    pub fn add_internal_force(&self, u: &[f64], force: &mut [f64]) -> f64 {
        self.add_share_of_force(u, 1.0, force)
    }

    /// Adds a share of `K u` [N]; returns the whole energy [J].
    pub(super) fn add_share_of_force(&self, u: &[f64], share: f64, force: &mut [f64]) -> f64 {
        let mut energy = 0.0;
        for (sample, k) in self.stiffness.iter().enumerate() {
            let stretch = self.stretch(sample, u);
            let pull = times(k, stretch);
            energy += 0.5 * (0..3).map(|i| stretch[i] * pull[i]).sum::<f64>();
            for (node, weight) in self.sample(sample) {
                let weight = share * weight;
                (0..3).for_each(|i| force[3 * node as usize + i] += weight * pull[i]);
            }
        }
        for link in &self.links {
            let Some(pull) = link.at(u, Curvature::Exact) else { continue };
            energy += pull.energy;
            for &(node, weight) in &link.ends {
                let weight = share * weight;
                (0..3).for_each(|i| force[3 * node as usize + i] += weight * pull.force[i]);
            }
        }
        energy
    }
}

/// Ties with the blocks that they add to a tangent.
pub(super) struct Tied {
    pub ties: Ties,
    /// Row and column node, row <= column, position in the pattern, and entries `[i][k]`.
    blocks: Vec<(u32, u32, u32, [f64; 9])>,
}

impl Tied {
    /// None without a sample.
    pub fn new(ties: Ties, pattern: &BlockPattern) -> Option<Self> {
        if ties.is_empty() {
            return None;
        }
        let mut blocks = Vec::new();
        for (sample, k) in ties.stiffness.iter().enumerate() {
            for (row, a) in ties.sample(sample) {
                for (column, b) in ties.sample(sample).filter(|(column, _)| *column >= row) {
                    blocks.push((row, column, pattern.block(row, column), k.map(|k| a * b * k)));
                }
            }
        }
        blocks.sort_by_key(|&(.., position, _)| position);
        blocks.dedup_by(|next, sum| {
            let is_same = next.2 == sum.2;
            if is_same {
                sum.3.iter_mut().zip(next.3).for_each(|(sum, k)| *sum += k);
            }
            is_same
        });
        Some(Tied { ties, blocks })
    }

    /// Row, column and entries of the blocks at a displacement; those of links may share a place.
    pub fn blocks(&self, u: &[f64], curvature: Curvature) -> Vec<(u32, u32, [f64; 9])> {
        let mut all: Vec<_> =
            self.blocks.iter().map(|&(row, column, _, block)| (row, column, block)).collect();
        self.each_link_block(u, curvature, |row, column, block| all.push((row, column, *block)));
        all
    }

    /// Adds a share of `K` at a displacement to a tangent.
    pub fn add_stiffness(
        &self,
        (u, curvature): (&[f64], Curvature),
        share: f64,
        tangent: &mut SymmetricBlocks,
    ) {
        for (.., position, block) in &self.blocks {
            tangent.add(*position as usize, &block.map(|k| share * k));
        }
        self.each_link_block(u, curvature, |row, column, block| {
            let position = tangent.pattern().block(row, column);
            tangent.add(position as usize, &block.map(|k| share * k));
        });
    }

    /// Calls with row and column node, row <= column, and entries `[i][k]` of each pair of nodes of a link.
    fn each_link_block(
        &self,
        u: &[f64],
        curvature: Curvature,
        mut take: impl FnMut(u32, u32, &[f64; 9]),
    ) {
        for link in &self.ties.links {
            let Some(pull) = link.at(u, curvature) else { continue };
            for &(row, a) in &link.ends {
                for &(column, b) in link.ends.iter().filter(|(column, _)| *column >= row) {
                    let k = &pull.stiffness;
                    take(
                        row,
                        column,
                        &std::array::from_fn(|entry| a * b * k[entry / 3][entry % 3]),
                    );
                }
            }
        }
    }

    /// Adds `K x`, with `K` at a displacement.
    pub fn add_product(&self, (u, curvature): (&[f64], Curvature), x: &[f64], y: &mut [f64]) {
        for (row, column, _, block) in &self.blocks {
            add_block_product(block, (*row as usize, *column as usize), x, y);
        }
        self.each_link_block(u, curvature, |row, column, block| {
            add_block_product(block, (row as usize, column as usize), x, y);
        });
    }

    /// Adds the block of each node with itself.
    pub fn add_diagonal(&self, (u, curvature): (&[f64], Curvature), diagonal: &mut [[f64; 9]]) {
        for (row, _, _, block) in self.blocks.iter().filter(|(row, column, ..)| row == column) {
            diagonal[*row as usize].iter_mut().zip(block).for_each(|(sum, k)| *sum += k);
        }
        self.each_link_block(u, curvature, |row, column, block| {
            if row == column {
                diagonal[row as usize].iter_mut().zip(block).for_each(|(sum, k)| *sum += k);
            }
        });
    }
}

fn times(k: &[f64; 9], x: [f64; 3]) -> [f64; 3] {
    let rows: Mat3<f64> = std::array::from_fn(|i| [k[3 * i], k[3 * i + 1], k[3 * i + 2]]);
    rows.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, Curvature, WeightedSubset};
    use crate::element::Element;
    use crate::law::samples::per_cell;
    use crate::mesh::samples::{block, noise};

    /// A corner tied to the ground, a mean of three nodes to another that shares no cell with it; a spring under tension
    /// between distant means, a spring under compression and a cable to points in space, and a slack cable.
    fn ties(n: u32) -> Ties {
        Ties {
            start: vec![0, 1, 5],
            nodes: vec![3, 0, 1, 2, n - 1],
            weights: vec![1.0, 0.25, 0.25, 0.5, -1.0],
            stiffness: vec![
                [5.0, 1.0, 0.0, 1.0, 4.0, 0.5, 0.0, 0.5, 3.0],
                [70.0, 0.0, 0.0, 0.0, 70.0, 0.0, 0.0, 0.0, 70.0],
            ],
            links: vec![
                link(&[(0, 0.5), (1, 0.5), (n - 1, -0.25), (n - 2, -0.75)], 0.9, false),
                link(&[(n - 3, 1.0)], 1.2, false),
                link(&[(n - 3, 0.3), (2, 0.7)], 0.8, true),
                link(&[(4, 1.0)], 1.5, true),
            ],
            contact_pairs: Vec::new(),
        }
    }

    /// A link over a length of 3 cm, as many times as long without force.
    fn link(ends: &[(u32, f64)], relative: f64, is_cable: bool) -> Link {
        let rest = [0.01, -0.02, 0.02];
        Link { ends: ends.to_vec(), rest, stiffness: 40.0, length: relative * 0.03, is_cable }
    }

    fn bodies() -> impl Iterator<Item = [Body; 2]> {
        let (points, cells) = block([2; 3], [0.03, 0.04, 0.05]);
        let law = per_cell("neo_hookean", cells.len());
        Element::ALL.into_iter().map(move |element| {
            let body = |ties| {
                let (points, cells) = (points.clone(), cells.clone());
                Body::tied(element, points, cells, law.clone(), ties).unwrap()
            };
            [body(ties(27)), body(Ties::default())]
        })
    }

    #[test]
    fn force_and_tangent_are_derivatives_of_the_energy() {
        for [body, free] in bodies() {
            let n = body.n_dofs();
            let u: Vec<f64> = noise(n, 1).iter().map(|x| 5e-4 * x).collect();
            let direction: Vec<f64> = noise(n, 2).iter().map(|x| 1e-6 * x).collect();
            let at = |sign: f64| -> Vec<f64> {
                u.iter().zip(&direction).map(|(u, w)| u + sign * w).collect()
            };
            let (mut force, mut tangent) = (vec![0.0; n], body.zero_tangent());
            body.linearize(&u, Curvature::Exact, &mut force, &mut tangent);
            let mut again = vec![0.0; n];
            let energy = body.internal_force(&u, &mut again);
            assert!((energy - body.energy(&u)).abs() < 1e-12 * energy);
            assert!(energy > free.energy(&u), "ties hold energy");
            assert!(force.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-9));
            let work: f64 = force.iter().zip(&direction).map(|(f, w)| f * w).sum();
            let change = 0.5 * (body.energy(&at(1.0)) - body.energy(&at(-1.0)));
            assert!((change - work).abs() < 1e-5 * work.abs(), "{change} {work}");
            let [mut ahead, mut behind, mut product] = std::array::from_fn(|_| vec![0.0; n]);
            body.internal_force(&at(1.0), &mut ahead);
            body.internal_force(&at(-1.0), &mut behind);
            tangent.multiply(&direction, &mut product);
            let size = product.iter().fold(0.0f64, |size, f| size.max(f.abs()));
            let differences = ahead.iter().zip(&behind).map(|(a, b)| 0.5 * (a - b));
            assert!(differences.zip(&product).all(|(d, p)| (d - p).abs() < 1e-4 * size));
        }
    }

    #[test]
    fn the_product_without_a_matrix_is_that_of_the_matrix() {
        for [body, _] in bodies() {
            let n = body.n_dofs();
            let u: Vec<f64> = noise(n, 3).iter().map(|x| 5e-4 * x).collect();
            let (mut force, mut tangent) = (vec![0.0; n], body.zero_tangent());
            body.linearize(&u, Curvature::Exact, &mut force, &mut tangent);
            let mut product = body.tangent_product();
            product.move_to(&u, Curvature::Exact);
            let x = noise(n, 4);
            let (mut y, mut z) = (vec![0.0; n], vec![0.0; n]);
            tangent.multiply(&x, &mut y);
            product.multiply(&x, &mut z);
            let size = y.iter().fold(0.0f64, |size, f| size.max(f.abs()));
            assert!(y.iter().zip(&z).all(|(y, z)| (y - z).abs() < 1e-11 * size));
            let diagonal = product.diagonal();
            let pairs = tangent.diagonal().zip(&diagonal).flat_map(|(a, b)| a.iter().zip(b));
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-11 * size.max(a.abs())));
        }
    }

    /// Blocks that no cell has are cleared before ties add to them again.
    #[test]
    fn a_tangent_that_is_evaluated_again_is_the_same() {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (points, cells) = block([8; 3], [0.03; 3]);
                let (n, law) = (points.len() as u32, per_cell("neo_hookean", 1));
                let body = Body::tied(Element::P1, points, cells, law, ties(n)).unwrap();
                let u: Vec<f64> = noise(body.n_dofs(), 3).iter().map(|x| 1e-4 * x).collect();
                let (mut force, mut tangent) = (vec![0.0; u.len()], body.zero_tangent());
                body.internal_force_and_tangent(&u, &mut force, &mut tangent);
                let first = tangent.values().to_vec();
                body.internal_force_and_tangent(&u, &mut force, &mut tangent);
                assert!(tangent.values() == first, "{threads} threads");
            });
        }
    }

    #[test]
    fn units_hold_no_ties() {
        let [body, free] = bodies().next().unwrap();
        let all: Vec<usize> = (0..body.n_sampling_units()).collect();
        let whole = |body: &Body| -> WeightedSubset {
            body.subset(&all, &vec![1.0; all.len()], crate::body::SharedNodes::Merged)
        };
        let energy = |subset: WeightedSubset| {
            let u = vec![1e-3; subset.body.n_dofs()];
            subset.body.energy(&u)
        };
        assert_eq!(energy(whole(&body)), energy(whole(&free)));
    }

    #[test]
    fn bad_ties_are_refused() {
        let good = ties(27);
        let mut cases = vec![(good.clone(), "accepted")];
        let mut change = |edit: &dyn Fn(&mut Ties), said| {
            let mut bad = good.clone();
            edit(&mut bad);
            cases.push((bad, said));
        };
        change(&|t| t.nodes[0] = 27, "point 27; there are 27 points");
        change(&|t| t.weights[1] = f64::NAN, "a weight is NaN");
        change(&|t| t.stiffness[1][0] = -1.0, "sample 1");
        change(&|t| t.stiffness[0][1] = 9.0, "symmetric");
        change(&|t| t.start[1] = 7, "do not fit");
        change(&|t| t.links[1].ends[0].0 = 27, "spring 1 ends at point 27; there are 27 points");
        change(&|t| t.links[2].stiffness = 0.0, "spring 2 has the stiffness 0 N/m");
        change(&|t| t.links[0].length = f64::NAN, "spring 0");
        for (ties, said) in cases {
            let sentence = ties.check(27).map_or_else(|e| e.to_string(), |()| "accepted".into());
            assert!(sentence.contains(said), "{sentence:?} does not say {said:?}");
        }
    }
}
