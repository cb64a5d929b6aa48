//! All positions of a surface solved, region by region: series, forces, compliances, modes.

use super::attend::attend;
use super::batch::{Answered, Batches, Solved};
use super::memory::AtOnce;
use super::positions::Positions;
use super::region::{Exact, FIRST_ORDER, compress};
use super::second_order::Forms;
use super::settings::{Progress, Reduction};
use crate::equilibrium::patch_mean;
use crate::error::Error;
use crate::mesh::Patch;
use crate::number::Monomials;
use crate::number::simd::{Kernel, dispatch_solver};
use crate::series::{Fields, TouchExpansion, TouchSeries};
use faer::MatRef;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use viscera_touch::SKETCH;

/// Orders up to this one are also solved at edge midpoints.
pub(super) const EDGE_ORDER: usize = 4;

/// An organ with its patches and its factorised tangent.
pub(super) struct Expanded<'a> {
    pub positions: Positions,
    pub expansion: TouchExpansion<'a>,
}

impl Reduction {
    /// Solves the regions that `batches` does not hold yet, and keeps each of them there as soon as it is solved.
    pub(super) fn solve_regions(
        &self,
        members: &[Expanded],
        batches: &mut dyn Batches,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Vec<Solved>, Error> {
        let (regions, total) = (&members[0].positions.regions, members[0].positions.nodes.len());
        let mut solved: Vec<Option<Solved>> = Vec::new();
        solved.resize_with(regions.len(), || None);
        let finished = batches.finished().ok_or(Error::Cancelled)?;
        for (region, batch) in
            finished.iter().filter_map(|bytes| Solved::from_bytes(bytes, regions))
        {
            solved[region] = Some(batch);
        }
        let mut done: usize = solved.iter().flatten().map(|batch| batch.positions.len()).sum();
        let pairs = regions.iter().zip(&mut solved);
        let mut missing: Vec<_> = pairs.filter(|(_, batch)| batch.is_none()).collect();
        let at_once = self.at_once(members, missing.iter().map(|(region, _)| &region[..]));
        let (sender, receiver) = mpsc::channel::<(usize, Vec<u8>)>();
        let mut is_wanted = || {
            let kept = receiver.try_iter().all(|(count, batch)| {
                done += count;
                batches.keep(&batch)
            });
            kept & progress(Progress { done, total, stage: "solve" })
        };
        let outcome = attend(&mut is_wanted, |stop| {
            let solve = |(region, batch): &mut (&Vec<u32>, &mut Option<Solved>)| {
                let solved = self.solve_region(members, region, at_once.blocks, stop)?;
                // The receiver outlives the work.
                let _ = sender.send((region.len(), solved.to_bytes()?));
                **batch = Some(solved);
                Ok(())
            };
            // All in one where as many as threads fit: no thread waits for others.
            let is_bounded = at_once.regions < rayon::current_num_threads();
            let count = if is_bounded { at_once.regions } else { missing.len().max(1) };
            missing.chunks_mut(count).try_for_each(|some| some.par_iter_mut().try_for_each(solve))
        });
        let is_complete = is_wanted(); // what was finished last is kept too
        outcome?;
        if is_complete { Ok(solved.into_iter().flatten().collect()) } else { Err(Error::Cancelled) }
    }

    /// How much of the missing regions runs at a time.
    fn at_once<'a>(
        &self,
        members: &[Expanded],
        missing: impl ExactSizeIterator<Item = &'a [u32]>,
    ) -> AtOnce {
        let (edges, count) = (&members[0].positions.edges, missing.len());
        let fields = missing.map(|region| {
            let ours = edges.iter().filter(|edge| region.binary_search(&edge[0]).is_ok()).count();
            let terms = |order: usize| Monomials::of(3, order).len() - 1;
            region.len() * terms(self.order) + ours * terms(EDGE_ORDER.min(self.order))
        });
        let fields = members.len() * fields.max().unwrap_or(0);
        let n_dofs = members[0].expansion.body().n_dofs();
        let threads = rayon::current_num_threads();
        AtOnce::within(self.memory as usize, n_dofs, (count, fields), self.order, threads)
    }

    fn solve_region(
        &self,
        members: &[Expanded],
        region: &[u32],
        blocks: usize,
        stop: &AtomicBool,
    ) -> Result<Solved, Error> {
        let is_wanted = || !stop.load(Ordering::Relaxed);
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
                let own = expansion.expand_while(&is_wanted, &patches, self.order, blocks)?;
                let patches: Vec<Patch> =
                    edges.iter().map(|&e| positions.edge_patch(e as usize)).collect();
                let patches: Vec<&Patch> = patches.iter().collect();
                Ok((own, expansion.expand_while(&is_wanted, &patches, edge_order, blocks)?))
            })
            .collect::<Result<Vec<_>, Error>>()?;
        let table = Monomials::of(3, self.order);
        let exact = series.iter().map(|(positions, edges)| Exact {
            exponents: &table.exponents()[1..],
            edge_terms: table.up_to(edge_order) - table.up_to(1),
            depth: self.depth,
            positions: positions.iter().map(|s| fields(s, 0)).collect(),
            edges: edges.iter().map(|s| fields(s, FIRST_ORDER)).collect(),
        });
        let compressed = compress(&exact.collect::<Vec<_>>(), self.tolerance)?;
        let answers: Vec<Answered> = members
            .iter()
            .zip(series)
            .map(|(member, (own, of_edges))| {
                let cross = edges.iter().map(|&e| {
                    let [p, q] = member.positions.edges[e as usize];
                    let first = region.binary_search(&p).unwrap_or(0);
                    cross_compliance(&own[first], &member.positions.patches[q as usize])
                });
                Answered {
                    cross_compliance: cross.collect(),
                    forms: Forms::new(&member.positions, region, &edges, &own, &of_edges),
                    sketches: own
                        .iter()
                        .map(|s| if self.pade { sketch(s) } else { Vec::new() })
                        .collect(),
                    norms: own
                        .iter()
                        .map(|s| gram_by_degree(s, self.order, self.norm_length()))
                        .collect(),
                    compliance: own.iter().map(|s| flat(&s.compliance)).collect(),
                    force: own.into_iter().map(|s| s.force).collect(),
                    edge_force: of_edges.into_iter().map(|s| s.force[3..].to_vec()).collect(),
                }
            })
            .collect();
        let solved = Solved { answers, region: compressed, positions: region.to_vec(), edges };
        if solved.is_finite() { Ok(solved) } else { Err(self.beyond_single_precision()) }
    }

    fn beyond_single_precision(&self) -> Error {
        Error::input(format!(
            "the fields of order {} under a patch of radius {:.2e} m leave the range of single precision, in which \
             a model keeps them; reduce to a lower order",
            self.order, self.radius
        ))
    }
}

/// The fields of a series from a term on, as columns.
fn fields(series: &TouchSeries, from: usize) -> MatRef<'_, f64> {
    let fields = &series.displacement;
    MatRef::from_column_major_slice(fields.from_term(from), fields.n_dofs(), fields.len() - from)
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
pub(super) fn sketch(series: &TouchSeries) -> Vec<f32> {
    let sums = dispatch_solver(Sketch { fields: &series.displacement });
    sums.as_flattened().iter().map(|sum| (sum / (SKETCH as f64).sqrt()) as f32).collect()
}

/// The sums of [`sketch`], field by field.
struct Sketch<'a> {
    fields: &'a Fields,
}

impl Kernel for Sketch<'_> {
    type Output = Vec<[f64; SKETCH]>;

    /// Block by block of the degrees of freedom: the signs are made once for all fields, and stay in the cache.
    #[inline(always)]
    fn run(self) -> Vec<[f64; SKETCH]> {
        const BLOCK: usize = 16;
        let mut sums = vec![[0.0; SKETCH]; self.fields.len()];
        let dofs = self.fields.n_dofs();
        for first in (0..dofs).step_by(BLOCK) {
            let block = first..dofs.min(first + BLOCK);
            let signs: [[f64; SKETCH]; BLOCK] = std::array::from_fn(|k| signs((first + k) as u64));
            for (field, sums) in self.fields.iter().zip(&mut sums) {
                for (u, signs) in field[block.clone()].iter().zip(&signs) {
                    for (sum, sign) in sums.iter_mut().zip(signs) {
                        *sum += u * sign;
                    }
                }
            }
        }
        sums
    }
}

/// One or minus one for each sum, from the bits of a random number.
#[inline(always)]
fn signs(dof: u64) -> [f64; SKETCH] {
    let bits = random(dof);
    std::array::from_fn(|s| if bits >> s & 1 == 1 { 1.0 } else { -1.0 })
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood, 2014).
#[inline(always)]
fn random(seed: u64) -> u64 {
    let mut z = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Inner products of the fields of each degree, degree after degree, with this unit of length [m].
fn gram_by_degree(series: &TouchSeries, order: usize, length: f64) -> Vec<f32> {
    let table = Monomials::of(3, order);
    let mut gram = Vec::new();
    for degree in 1..=order {
        let unit = length.powi(2 * (degree as i32 - 1));
        for a in table.of_degree(degree) {
            for b in table.of_degree(degree) {
                let (u, v) = (&series.displacement[a - 1], &series.displacement[b - 1]);
                gram.push((unit * u.iter().zip(v).map(|(x, y)| x * y).sum::<f64>()) as f32);
            }
        }
    }
    gram
}

fn flat(m: &[[f64; 3]; 3]) -> [f64; 9] {
    std::array::from_fn(|k| m[k / 3][k % 3])
}
