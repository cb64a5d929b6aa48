//! Contacts that hold an organ: basis, cells and weights for them, and what the reduced equilibrium says and is worth.

use super::model::{Galerkin, Sampling};
use super::nnls::{Columns, greedy, norm};
use super::sample::Sample;
use super::solver::{Search, Solver, Status};
use super::subspace::Subspace;
use super::training::{Forces, State, states, systematic};
use super::trial::Errors;
use crate::body::Body;
use crate::error::Error;
use crate::mesh::Patch;
use crate::reduced::{Contact, allowance};
use std::sync::Arc;
use std::time::Instant;

/// States by which cells and weights of a grasp are found, and how many of them show which cells come into question.
const STATES: usize = 24;
const FIRST_STATES: usize = 4;
/// Cells that come into question.
const CANDIDATES: usize = 2000;

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
    solver: Solver,
    errors: Errors,
    seconds: f64,
    /// Whether it is at an equilibrium, to start the next from.
    is_settled: bool,
}

impl Grasp {
    pub(super) fn new(owner: Arc<Galerkin>, contacts: Vec<Contact>) -> Result<Self, Error> {
        let clock = Instant::now();
        let Sampling { order, tolerance, depth } = owner.sampling;
        let subspace = Subspace::new(&owner.model, &owner.rest, &contacts, order)?;
        let training = states(&owner.rest, &subspace, depth, 0..STATES);
        let sample = sample(&owner.rest.body, &subspace, &training, tolerance);
        let unit = (training.iter().map(State::square).sum::<f64>() / STATES as f64).sqrt();
        let solver = Solver::new(sample, &subspace.basis.modes, subspace.means.clone(), unit);
        let (errors, seconds, is_settled) = (Errors::NONE, 0.0, false);
        let mut grasp = Grasp { owner, contacts, subspace, solver, errors, seconds, is_settled };
        grasp.errors = Errors::measure(&mut grasp);
        grasp.is_settled = false;
        grasp.seconds = clock.elapsed().as_secs_f64();
        Ok(grasp)
    }

    /// Where the contacts are.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Their patches, the weighted means of which are displaced. Allocates.
    pub fn patches(&self) -> Vec<Patch> {
        self.contacts.iter().map(|c| self.owner.model.patch(c)).collect()
    }

    /// The model it belongs to.
    pub(super) fn galerkin(&self) -> &Galerkin {
        &self.owner
    }

    /// The modes and what they are made of.
    pub(super) fn subspace(&self) -> &Subspace {
        &self.subspace
    }

    /// What is solved on them.
    pub(super) fn solver(&self) -> &Solver {
        &self.solver
    }

    /// Reduced strain energy at some coordinates [J].
    #[cfg(test)]
    pub(super) fn energy_at(&mut self, coordinates: &[f64]) -> f64 {
        self.solver.start(|_| coordinates.to_vec());
        self.solver.reduced.energy
    }

    /// Number of modes.
    pub fn n_modes(&self) -> usize {
        self.subspace.len()
    }

    /// Number of sampled cells.
    pub fn n_cells(&self) -> usize {
        self.solver.n_cells()
    }

    /// Errors of the field, measured when it took hold.
    pub fn errors(&self) -> Errors {
        self.errors
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
        let mut search = Search::default();
        let status = if from_last && self.is_settled {
            self.follow(d, &mut search)
        } else {
            self.find(d, &mut search)
        };
        let mut stiffness = Vec::new();
        if with_stiffness && self.is_settled {
            stiffness = self.solver.stiffness(&mut search);
        }
        let force = |f: &[f64]| {
            let is_known = f.iter().all(|x| x.is_finite());
            if is_known { [f[0], f[1], f[2]] } else { [0.0; 3] }
        };
        let forces = self.solver.forces.chunks_exact(3).map(force).collect();
        let deepest = displacements.iter().map(|d| norm(d)).fold(0.0, f64::max);
        let error_estimate = self.errors.at(deepest / self.owner.sampling.depth);
        Ok(Solution {
            forces,
            stiffness,
            energy: self.solver.reduced.energy,
            status,
            trust: self.trust(deepest, status, error_estimate),
            error_estimate,
            smallest_jacobian: self.solver.reduced.jacobian,
            iterations: search.iterations,
            tangents: search.tangents,
            residual: search.residual,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }

    /// Equilibrium under mean displacements `d`, one contact after the other, from the superposed series.
    pub(super) fn find(&mut self, d: &[f64], search: &mut Search) -> Status {
        let subspace = &self.subspace;
        let share_of = |share: f64| d.iter().map(|x| share * x).collect::<Vec<_>>();
        self.solver.start(|share| subspace.superposed(&share_of(share)));
        self.follow(d, search)
    }

    /// The same from where it is.
    fn follow(&mut self, d: &[f64], search: &mut Search) -> Status {
        let status = self.solver.solve(d, search);
        self.is_settled = status == Status::Converged;
        status
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

    fn trust(&self, depth: f64, status: Status, estimate: f64) -> Trust {
        let metadata = self.owner.model.metadata();
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

/// Cells and weights that give the forces of the whole body in training.
fn sample(body: &Body, subspace: &Subspace, training: &[State], tolerance: f64) -> Sample {
    let all: Vec<usize> = (0..body.cells().len()).collect();
    let sizes = Forces::new(body, &all, subspace, &training[..FIRST_STATES]).sizes();
    let candidates = systematic(&sizes, CANDIDATES);
    let forces = Forces::new(body, &candidates, subspace, training);
    let columns = Columns { rows: forces.rows, values: &forces.cells };
    let chosen = greedy(&columns, &forces.body, tolerance);
    let (cells, weights): (Vec<usize>, Vec<f64>) =
        chosen.into_iter().map(|(place, weight)| (candidates[place], weight)).unzip();
    let mut sample = Sample::new(body.points(), body.cells(), body.material(), &cells);
    sample.weigh(&weights);
    sample
}
