//! Contacts that hold an organ: basis and weights for them, and what the reduced equilibrium says and is worth.

use super::model::Galerkin;
use super::nnls::{self, norm};
use super::sample::Sample;
use super::solver::{Search, Solver, Status};
use super::subspace::Subspace;
use super::training::{Forces, State, states};
use crate::error::Error;
use crate::mesh::Patch;
use crate::reduced::{Contact, allowance};
use faer::MatRef;
use std::sync::Arc;
use std::time::Instant;

/// States by which the weights of a grasp are found, at least, and further ones by which they are judged.
const STATES: usize = 24;
const CHECKS: usize = 6;

/// Part of tail and sampling error that is left as error of the field (measured: 0.4 covers 19 of 20).
const SHARE: f64 = 0.5;

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
    /// Force of each tool on the organ [N]; zero where the search broke off before there was one.
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
    sampling_error: f64,
    seconds: f64,
    solver: Solver,
    /// Whether it is at an equilibrium, to start the next from.
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
            .flat_map(|c| &owner.cells[model.region_of(c)])
            .map(|&cell| cell as usize)
            .collect();
        cells.sort_unstable();
        cells.dedup();
        let sample =
            |cells: &[usize]| Sample::new(body.points(), body.cells(), body.material(), cells);
        let depth = owner.sampling.depth;
        // More equations than weights, or these are not determined.
        let count = (2 * cells.len()).div_ceil(subspace.len()).clamp(STATES, 4 * STATES);
        let training = states(rest, &subspace, depth, 0..count);
        let weights = weights(&sample(&cells), &subspace, &training);
        let (kept, weights): (Vec<usize>, Vec<f64>) =
            cells.iter().zip(weights).filter(|(_, w)| *w > 0.0).unzip();
        let mut sample = sample(&kept);
        let unseen = states(rest, &subspace, depth, count..count + CHECKS);
        let sampling_error = Forces::new(&sample, &subspace, &unseen).error(&weights, unseen.len());
        sample.weigh(&weights);
        let modes = &subspace.basis.modes;
        let solver = Solver::new(sample, modes, subspace.means.clone(), unit(&training));
        let seconds = clock.elapsed().as_secs_f64();
        let is_settled = false;
        Ok(Grasp { owner, contacts, subspace, sampling_error, seconds, solver, is_settled })
    }

    /// Where the contacts are.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Their patches, the weighted means of which are displaced. Allocates.
    pub fn patches(&self) -> Vec<Patch> {
        self.contacts.iter().map(|c| self.owner.model.patch(c)).collect()
    }

    /// The modes and what they are made of.
    #[cfg(test)]
    pub(super) fn subspace(&self) -> &Subspace {
        &self.subspace
    }

    /// What is solved on them.
    #[cfg(test)]
    pub(super) fn solver(&mut self) -> &mut Solver {
        &mut self.solver
    }

    /// Number of modes.
    pub fn n_modes(&self) -> usize {
        self.subspace.len()
    }

    /// Number of sampled cells.
    pub fn n_cells(&self) -> usize {
        self.solver.n_cells()
    }

    /// Error of the sampled forces in states unseen in training, relative to the forces.
    pub fn sampling_error(&self) -> f64 {
        self.sampling_error
    }

    /// Time that taking hold has taken [s].
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Coordinates of the last solution in the modes.
    pub fn coordinates(&self) -> &[f64] {
        &self.solver.q
    }

    /// Displacement of all nodes [m] at some coordinates. Allocates.
    pub fn displacement(&self, coordinates: &[f64]) -> Vec<f64> {
        self.subspace.basis.field(coordinates)
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
            let subspace = &self.subspace;
            let share_of = |share: f64| d.iter().map(|x| share * x).collect::<Vec<_>>();
            self.solver.start(|share| subspace.superposed(&share_of(share)));
        }
        let mut search = Search::default();
        let status = self.solver.solve(d, &mut search);
        self.is_settled = status == Status::Converged;
        let mut stiffness = Vec::new();
        if with_stiffness && self.is_settled {
            stiffness = self.solver.stiffness(&mut search);
        }
        let force = |f: &[f64]| {
            let is_known = f.iter().all(|x| x.is_finite());
            if is_known { [f[0], f[1], f[2]] } else { [0.0; 3] }
        };
        let forces = search.forces.chunks_exact(3).map(force).collect();
        let error_estimate = self.error_estimate();
        Ok(Solution {
            forces,
            stiffness,
            energy: self.solver.reduced.energy,
            status,
            trust: self.trust(displacements, status, error_estimate),
            error_estimate,
            smallest_jacobian: self.solver.reduced.jacobian,
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

    /// What the orders beyond the basis would add, as the tail of a geometric series of energy norms, and the error of
    /// the sampled forces.
    fn error_estimate(&self) -> f64 {
        let order = self.owner.sampling.order;
        let norms: Vec<f64> = (1..=order)
            .map(|p| {
                let parts = self.solver.q.iter().zip(&self.subspace.orders);
                parts.filter(|(_, o)| **o == p).map(|(q, _)| q * q).sum::<f64>().sqrt()
            })
            .collect();
        let all = norm(&self.solver.q);
        if self.solver.is_at_rest() {
            return 0.0;
        }
        let last = norms[order - 1];
        let ratio =
            if order > 1 { last / norms[order - 2].max(f64::MIN_POSITIVE) } else { last / all };
        let tail = if ratio < 0.9 { last * ratio / (1.0 - ratio) / all } else { 1.0 };
        (SHARE * (tail + self.sampling_error)).min(1.0)
    }

    fn trust(&self, displacements: &[[f64; 3]], status: Status, estimate: f64) -> Trust {
        let metadata = self.owner.model.metadata();
        let depth = displacements.iter().map(|d| norm(d)).fold(0.0, f64::max);
        if status != Status::Converged {
            Trust::NotConverged
        } else if !(self.solver.reduced.jacobian > 0.0) {
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
    let target: Vec<f64> =
        forces.cells.chunks_exact(forces.rows).map(|cell| nnls::dot(cell, &forces.body)).collect();
    nnls::solve(gram.as_ref(), &target)
}
