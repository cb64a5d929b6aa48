//! All positions of a surface solved, region by region: series, forces, compliances, modes.

use super::build::{Progress, Reduction};
use super::positions::Positions;
use super::region::{Exact, Region, compress};
use super::resummation::SKETCH;
use crate::equilibrium::patch_mean;
use crate::error::Error;
use crate::mesh::Patch;
use crate::number::Monomials;
use crate::series::{TouchExpansion, TouchSeries};
use rayon::Yield;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Orders up to this one are also solved at edge midpoints.
pub(super) const EDGE_ORDER: usize = 3;

/// An organ with its patches and its factorised tangent.
pub(super) struct Expanded<'a> {
    pub positions: Positions,
    pub expansion: TouchExpansion<'a>,
}

/// What a region's task returns.
pub(super) struct Solved {
    pub region: Region,
    pub positions: Vec<u32>,
    pub edges: Vec<u32>,
    /// Of each member.
    pub answers: Vec<Answered>,
}

/// What one member answers in a region, but for its fields.
pub(super) struct Answered {
    pub force: Vec<Vec<[f64; 3]>>,
    pub edge_force: Vec<Vec<[f64; 3]>>,
    pub compliance: Vec<[f64; 9]>,
    /// By edge.
    pub cross_compliance: Vec<[f64; 9]>,
    /// Empty where the orders are summed as a polynomial.
    pub sketches: Vec<Vec<f32>>,
    pub norms: Vec<Vec<f32>>,
}

impl Reduction {
    pub(super) fn solve_regions(
        &self,
        members: &[Expanded],
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Vec<Solved>, Error> {
        let total = members[0].positions.nodes.len();
        let stop = AtomicBool::new(false);
        let (sender, receiver) = mpsc::channel::<usize>();
        let mut solved = Ok(Vec::new());
        rayon::in_place_scope(|scope| {
            let (stop, solved) = (&stop, &mut solved);
            scope.spawn(move |_| {
                let task = |region: &Vec<u32>| {
                    if stop.load(Ordering::Relaxed) {
                        return Err(Error::Cancelled);
                    }
                    let solved = self.solve_region(members, region);
                    // The receiver lives until this scope has ended.
                    let _ = sender.send(region.len());
                    solved
                };
                *solved = members[0].positions.regions.par_iter().map(task).collect();
            });
            let mut done = 0;
            loop {
                // A thread of the pool that waits must also work: it may be the only one.
                if let Some(Yield::Executed) = rayon::yield_now() {
                    continue;
                }
                match receiver.recv_timeout(Duration::from_millis(50)) {
                    Ok(count) => done += count,
                    Err(RecvTimeoutError::Timeout) => (),
                    Err(RecvTimeoutError::Disconnected) => break,
                }
                if !progress(Progress { done, total, stage: "solve" }) {
                    stop.store(true, Ordering::Relaxed);
                }
            }
        });
        let solved = solved?;
        if progress(Progress { done: total, total, stage: "solve" }) {
            Ok(solved)
        } else {
            Err(Error::Cancelled)
        }
    }

    fn solve_region(&self, members: &[Expanded], region: &[u32]) -> Result<Solved, Error> {
        let edge_order = EDGE_ORDER.min(self.order);
        let is_ours = |edge: &&[u32; 2]| region.binary_search(&edge[0]).is_ok();
        let edges: Vec<u32> = (0u32..)
            .zip(&members[0].positions.edges)
            .filter(|(_, edge)| is_ours(edge))
            .map(|(e, _)| e)
            .collect();
        let series = members
            .iter()
            .map(|Expanded { positions, expansion }| {
                let at = |&p: &u32| &positions.patches[p as usize];
                let patches: Vec<&Patch> = region.iter().map(at).collect();
                let own = expansion.expand(&patches, self.order)?;
                let patches: Vec<Patch> =
                    edges.iter().map(|&e| positions.edge_patch(e as usize)).collect();
                Ok((own, expansion.expand(&patches.iter().collect::<Vec<_>>(), edge_order)?))
            })
            .collect::<Result<Vec<_>, Error>>()?;
        let table = Monomials::of(3, self.order);
        let exact = series.iter().map(|(positions, edges)| Exact {
            exponents: &table.exponents()[1..],
            edge_terms: table.up_to(edge_order) - table.up_to(1),
            depth: self.depth,
            positions,
            edges,
        });
        let compressed = compress(&exact.collect::<Vec<_>>(), self.tolerance)?;
        let answers = members.iter().zip(series).map(|(member, (own, of_edges))| {
            let cross = edges.iter().map(|&e| {
                let [p, q] = member.positions.edges[e as usize];
                let first = region.binary_search(&p).unwrap_or(0);
                cross_compliance(&own[first], &member.positions.patches[q as usize])
            });
            Answered {
                cross_compliance: cross.collect(),
                sketches: own
                    .iter()
                    .map(|s| if self.pade { sketch(s) } else { Vec::new() })
                    .collect(),
                norms: own.iter().map(|s| gram_by_degree(s, self.order)).collect(),
                compliance: own.iter().map(|s| flat(&s.compliance)).collect(),
                force: own.into_iter().map(|s| s.force).collect(),
                edge_force: of_edges.into_iter().map(|s| s.force[3..].to_vec()).collect(),
            }
        });
        Ok(Solved {
            answers: answers.collect(),
            region: compressed,
            positions: region.to_vec(),
            edges,
        })
    }
}

/// `W_q G_p` from the first-order fields of p: their means over q's patch times p's compliance.
fn cross_compliance(series: &TouchSeries, patch: &Patch) -> [f64; 9] {
    let means: [[f64; 3]; 3] = std::array::from_fn(|k| patch_mean(patch, &series.displacement[k]));
    let mut out = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] = (0..3).map(|k| means[k][i] * series.compliance[k][j]).sum();
        }
    }
    out
}

/// Sums of a field with random signs, the same for all fields: the angles between fields in few numbers.
fn sketch(series: &TouchSeries) -> Vec<f32> {
    let mut sketch = Vec::with_capacity(SKETCH * series.displacement.len());
    for field in &series.displacement {
        let mut sums = [0.0; SKETCH];
        for (dof, u) in field.iter().enumerate() {
            let bits = random(dof as u64);
            for (s, sum) in sums.iter_mut().enumerate() {
                *sum += if bits >> s & 1 == 1 { *u } else { -u };
            }
        }
        sketch.extend(sums.map(|sum| (sum / (SKETCH as f64).sqrt()) as f32));
    }
    sketch
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood, 2014).
fn random(seed: u64) -> u64 {
    let mut z = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Inner products of the fields of each degree, degree after degree.
fn gram_by_degree(series: &TouchSeries, order: usize) -> Vec<f32> {
    let table = Monomials::of(3, order);
    let mut gram = Vec::new();
    for degree in 1..=order {
        for a in table.of_degree(degree) {
            for b in table.of_degree(degree) {
                let (u, v) = (&series.displacement[a - 1], &series.displacement[b - 1]);
                gram.push(u.iter().zip(v).map(|(x, y)| x * y).sum::<f64>() as f32);
            }
        }
    }
    gram
}

fn flat(m: &[[f64; 3]; 3]) -> [f64; 9] {
    std::array::from_fn(|k| m[k / 3][k % 3])
}
