//! Contacts that hold an organ: the reduced equilibrium under whatever displacements they are given.
//!
//! Minimise W(q) under A q = d. With the tangent K at an earlier iterate and f = dW/dq, a step is
//!   [K A^T; A 0] [dq; -F] = [-f; d - A q],
//! F the contact forces; the tangent is renewed when steps shrink too slowly, so most iterations cost a force only.

use super::assembly::Reduced;
use super::factor::Factor;
use super::model::Galerkin;
use super::nnls::{self, norm};
use super::sample::Sample;
use super::subspace::Subspace;
use super::training::{Forces, State, states};
use crate::body::Lane;
use crate::error::Error;
use crate::mesh::Patch;
use crate::reduced::{Contact, allowance};
use faer::MatRef;
use std::sync::Arc;
use std::time::Instant;

/// States by which the weights of a grasp are found, and further ones by which they are judged.
const STATES: usize = 24;
const CHECKS: usize = 6;
/// A step is small enough when it is below this part of the coordinates.
const TOLERANCE: f64 = 1e-5;
/// Coordinates below this part of those in training count as this.
const SMALLEST: f64 = 1e-6;
/// Steps that shrink by less than this ask for a new tangent.
const SLOW: f64 = 0.2;
const MAX_ITERATIONS: usize = 40;
/// Shortest step that is tried.
const SHORTEST: f64 = 1.0 / 1024.0;

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// At an equilibrium of the reduced energy.
    Converged,
    /// Every step towards it, however short, turns a sampled cell inside out or raises the energy.
    StepTooSmall,
    /// The iterations did not suffice.
    TooManyIterations,
}

/// Whether a solution may be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// The estimated error is within what is allowed at this depth.
    Trusted,
    /// No equilibrium was found.
    NotConverged,
    /// A sampled cell is inside out.
    Inverted,
    /// A contact is displaced by more than it was in training.
    BeyondDepth,
    /// The estimated error is larger than allowed.
    ErrorTooLarge,
}

/// An equilibrium of the reduced energy, or how near it came.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Force of each tool on the organ [N].
    pub forces: Vec<[f64; 3]>,
    /// Derivative of the forces by the displacements [N/m], rows and columns by contact and component; empty where it
    /// was not asked for.
    pub stiffness: Vec<f64>,
    /// Reduced strain energy [J].
    pub energy: f64,
    /// How it ended.
    pub status: Status,
    /// Whether to rely on it.
    pub trust: Trust,
    /// Estimated error of the field relative to its norm, at most 1.
    pub error_estimate: f64,
    /// Smallest volume ratio of a sampled cell.
    pub smallest_jacobian: f64,
    /// Newton steps.
    pub iterations: usize,
    /// Tangents among them.
    pub tangents: usize,
    /// Last step, relative to the coordinates.
    pub residual: f64,
    /// Time spent [s].
    pub seconds: f64,
}

/// Some contacts of an organ, ready to be displaced.
pub struct Grasp {
    owner: Arc<Galerkin>,
    contacts: Vec<Contact>,
    subspace: Subspace,
    sample: Sample,
    /// The modes on the sampled cells.
    modes: Vec<Lane>,
    sampling_error: f64,
    seconds: f64,
    /// Norm of the coordinates in training, root mean square.
    unit: f64,
    reduced: Reduced,
    factor: Factor,
    q: Vec<f64>,
    /// Whether `q` is an equilibrium to start the next from.
    is_settled: bool,
}

impl Grasp {
    pub(super) fn new(owner: Arc<Galerkin>, contacts: Vec<Contact>) -> Result<Self, Error> {
        let clock = Instant::now();
        let (model, rest) = (&owner.model, &owner.rest);
        let subspace = Subspace::new(model, rest, &contacts, owner.sampling.order)?;
        let body = &rest.body;
        let mut cells: Vec<usize> = contacts
            .iter()
            .flat_map(|c| model.regions_of(c))
            .flat_map(|region| owner.cells[region].iter().map(|&cell| cell as usize))
            .collect();
        cells.sort_unstable();
        cells.dedup();
        let sample = |cells: &[usize]| {
            Sample::new(body.points(), body.cells(), body.material(), cells)
        };
        let depth = owner.sampling.depth;
        let training = states(rest, &subspace, depth, 0..STATES);
        let weights = weights(&sample(&cells), &subspace, &training);
        let (kept, weights): (Vec<usize>, Vec<f64>) =
            cells.iter().zip(weights).filter(|(_, w)| *w > 0.0).unzip();
        let mut sample = sample(&kept);
        let unseen = states(rest, &subspace, depth, STATES..STATES + CHECKS);
        let sampling_error =
            Forces::new(&sample, &subspace, &unseen).error(&weights, unseen.len());
        sample.weigh(&weights);
        let r = subspace.len();
        Ok(Grasp {
            modes: sample.restrict(&subspace.basis.modes),
            reduced: Reduced::new(r),
            factor: Factor::new(r, subspace.means.len()),
            q: vec![0.0; r],
            is_settled: false,
            unit: unit(&training),
            seconds: clock.elapsed().as_secs_f64(),
            sampling_error,
            owner,
            contacts,
            subspace,
            sample,
        })
    }

    /// Where the contacts are.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Their patches, the weighted means of which are displaced. Allocates.
    pub fn patches(&self) -> Vec<Patch> {
        self.contacts.iter().map(|c| self.owner.model.patch(c)).collect()
    }

    /// Number of modes.
    pub fn n_modes(&self) -> usize {
        self.subspace.len()
    }

    /// Number of sampled cells.
    pub fn n_cells(&self) -> usize {
        self.sample.len()
    }

    /// Error of the sampled forces in states unseen in training, relative to the forces.
    pub fn sampling_error(&self) -> f64 {
        self.sampling_error
    }

    /// Time that taking hold has taken [s].
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Displacement of all nodes at the last solution [m]. Allocates.
    pub fn displacement(&self) -> Vec<f64> {
        self.subspace.basis.field(&self.q)
    }

    /// Displacement of all nodes [m] by the superposed series, which solutions start from. Allocates.
    pub fn superposed(&self, displacements: &[[f64; 3]]) -> Vec<f64> {
        self.subspace.basis.field(&self.subspace.superposed(displacements.as_flattened()))
    }

    /// Equilibrium with the mean of each patch displaced by its `displacements` [m].
    ///
    /// From the superposed series, so that the answer depends on nothing before it; or, `from_last`, from the last
    /// solution, as a hand moves on. `with_stiffness` costs one more tangent.
    ///
    /// # Errors
    /// A displacement that is not finite; a number of them other than that of the contacts.
    pub fn solve(
        &mut self,
        displacements: &[[f64; 3]],
        from_last: bool,
        with_stiffness: bool,
    ) -> Result<Solution, Error> {
        let clock = Instant::now();
        self.check(displacements)?;
        let d = displacements.as_flattened();
        if !(from_last && self.is_settled) {
            self.start(d);
        }
        let mut search = Search::default();
        let status = self.iterate(d, &mut search);
        self.is_settled = status == Status::Converged;
        let mut stiffness = Vec::new();
        if with_stiffness && self.is_settled {
            self.renew();
            search.tangents += 1;
            stiffness = self.factor.stiffness();
        }
        let forces = search.forces.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
        let error_estimate = self.error_estimate();
        Ok(Solution {
            forces,
            stiffness,
            energy: self.reduced.energy,
            status,
            trust: self.trust(displacements, status, error_estimate),
            error_estimate,
            smallest_jacobian: self.reduced.jacobian,
            iterations: search.iterations,
            tangents: search.tangents,
            residual: search.residual,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }

    fn check(&self, displacements: &[[f64; 3]]) -> Result<(), Error> {
        if displacements.len() != self.contacts.len() {
            return Err(Error::input(format!(
                "{} displacements for {} contacts; give one for each",
                displacements.len(),
                self.contacts.len()
            )));
        }
        match displacements.iter().position(|d| d.iter().any(|x| !x.is_finite())) {
            Some(k) => Err(Error::input(format!(
                "contact {k} is displaced by {:?}; it must be finite",
                displacements[k]
            ))),
            None => Ok(()),
        }
    }

    /// The superposed series, drawn back towards rest until no sampled cell is inside out.
    fn start(&mut self, d: &[f64]) {
        let mut share = 1.0;
        loop {
            let part: Vec<f64> = d.iter().map(|x| share * x).collect();
            self.q = self.subspace.superposed(&part);
            self.evaluate(false);
            if self.reduced.jacobian > 0.0 || share < SHORTEST {
                break;
            }
            share *= 0.5;
        }
        self.factor.forget();
    }

    fn evaluate(&mut self, with_tangent: bool) {
        self.reduced.evaluate(&self.sample, &self.modes, &self.q, with_tangent);
    }

    fn renew(&mut self) {
        self.evaluate(true);
        self.factor.factorize(&self.reduced.tangent, &self.subspace.means);
    }

    fn iterate(&mut self, d: &[f64], search: &mut Search) -> Status {
        let size = d.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let mut last = f64::INFINITY;
        let mut is_fresh = false;
        self.evaluate(false);
        for _ in 0..MAX_ITERATIONS {
            search.iterations += 1;
            if !self.factor.is_ready() {
                self.renew();
                search.tangents += 1;
                is_fresh = true;
            }
            let missing = self.missing(d);
            let is_feasible = norm(&missing) <= 1e-9 * size;
            let (step, forces) =
                self.factor.step(&self.reduced.force, &missing, &self.subspace.means);
            search.forces = forces;
            let Some(length) = self.advance(&step, is_feasible) else {
                if is_fresh {
                    return Status::StepTooSmall;
                }
                self.factor.forget();
                continue;
            };
            let length_of_step = norm(&step);
            search.residual = length_of_step / norm(&self.q).max(SMALLEST * self.unit);
            if length == 1.0 && search.residual <= TOLERANCE {
                return Status::Converged;
            }
            if length < 1.0 || length_of_step > SLOW * last || self.factor.is_shifted() {
                self.factor.forget();
            }
            (last, is_fresh) = (length_of_step, false);
        }
        Status::TooManyIterations
    }

    /// `d - A q`.
    fn missing(&self, d: &[f64]) -> Vec<f64> {
        let mean = |row: &Vec<f64>| nnls::dot(row, &self.q);
        self.subspace.means.iter().zip(d).map(|(row, d)| d - mean(row)).collect()
    }

    /// Goes along a step, half as far again and again until no sampled cell is inside out and, on the constraint, the
    /// energy does not rise; none where that leads nowhere.
    fn advance(&mut self, step: &[f64], is_feasible: bool) -> Option<f64> {
        let (energy, start) = (self.reduced.energy, self.q.clone());
        let mut length = 1.0;
        while length >= SHORTEST {
            for ((q, &from), &along) in self.q.iter_mut().zip(&start).zip(step) {
                *q = from + length * along;
            }
            self.evaluate(false);
            let is_lower = self.reduced.energy <= energy + 1e-9 * energy.abs();
            if self.reduced.jacobian > 0.0 && (!is_feasible || is_lower) {
                return Some(length);
            }
            length *= 0.5;
        }
        self.q = start;
        self.evaluate(false);
        None
    }

    /// What the orders beyond the basis would add, as the tail of a geometric series of energy norms, and what the
    /// sampling leaves.
    fn error_estimate(&self) -> f64 {
        let order = self.owner.sampling.order;
        let norms: Vec<f64> = (1..=order)
            .map(|p| {
                let parts = self.q.iter().zip(&self.subspace.orders);
                parts.filter(|(_, o)| **o == p).map(|(q, _)| q * q).sum::<f64>().sqrt()
            })
            .collect();
        let all = norm(&self.q);
        if !(all > 0.0) {
            return 0.0;
        }
        let last = norms[order - 1];
        let ratio = if order > 1 { last / norms[order - 2].max(f64::MIN_POSITIVE) } else { last / all };
        let tail = if ratio < 0.9 { last * ratio / (1.0 - ratio) / all } else { 1.0 };
        (tail + 0.5 * self.sampling_error).min(1.0)
    }

    fn trust(&self, displacements: &[[f64; 3]], status: Status, estimate: f64) -> Trust {
        let metadata = self.owner.model.metadata();
        let depth = displacements.iter().map(|d| norm(d)).fold(0.0, f64::max);
        if status != Status::Converged {
            Trust::NotConverged
        } else if !(self.reduced.jacobian > 0.0) {
            Trust::Inverted
        } else if !(depth <= self.owner.sampling.depth * (1.0 + 1e-9)) {
            Trust::BeyondDepth
        } else if !(estimate <= allowance(depth / metadata.diagonal)) {
            Trust::ErrorTooLarge
        } else {
            Trust::Trusted
        }
    }
}

/// How a search for equilibrium goes.
#[derive(Default)]
struct Search {
    forces: Vec<f64>,
    iterations: usize,
    tangents: usize,
    residual: f64,
}

/// Root mean square of the norms of some states.
fn unit(states: &[State]) -> f64 {
    let squares = states.iter().map(|s| s.square()).sum::<f64>();
    (squares / states.len() as f64).sqrt()
}

/// The non-negative weights that integrate the forces of the training states best.
fn weights(sample: &Sample, subspace: &Subspace, training: &[State]) -> Vec<f64> {
    let forces = Forces::new(sample, subspace, training);
    let columns = MatRef::from_column_major_slice(&forces.cells, forces.rows, sample.len());
    let gram = columns.transpose() * columns;
    let target: Vec<f64> = forces
        .cells
        .chunks_exact(forces.rows)
        .map(|cell| nnls::dot(cell, &forces.body))
        .collect();
    nnls::solve(gram.as_ref(), &target)
}
