//! Contacts that hold an organ, ready to be displaced: which cells count how much, and the search for equilibrium.

use super::background::BackgroundTraining;
use super::contacts::ReducedContacts;
use super::forces::{Forces, State, systematic};
use super::newton::{ReducedNewton, ReducedStatus, Search};
use super::nnls::{Columns, greedy};
use super::origin::Origin;
use super::sampled::Sampled;
use super::subspace::Subspace;
use super::training::Training;
use crate::clock::Instant;
use crate::error::Error;
use crate::number::norm;
use std::sync::Arc;
use std::time::Duration;

/// States of training that show which units come into question.
const FIRST_STATES: usize = 4;
/// Sampling units that come into question.
const CANDIDATES: usize = 2000;

/// An equilibrium of the reduced energy, or how near it came.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Coordinates in the modes.
    pub coordinates: Vec<f64>,
    /// Force of each tool on the organ [N]; zero where the search broke off before there was one.
    pub forces: Vec<[f64; 3]>,
    /// Derivative of the forces by the displacements [N/m], rows and columns by contact and component; empty where it
    /// was not asked for.
    pub stiffness: Vec<f64>,
    /// Reduced strain energy [J].
    pub energy: f64,
    /// Largest displacement of a contact [m].
    pub depth: f64,
    /// How it ended.
    pub status: ReducedStatus,
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

/// Where the last search has left the coordinates.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    /// Where none should start.
    Nowhere,
    /// On the way to an equilibrium.
    UnderWay,
    /// At an equilibrium of this depth [m].
    At(f64),
}

/// Some contacts of an organ, ready to be displaced.
pub struct HyperReducedModel {
    contacts: Arc<ReducedContacts>,
    solver: ReducedNewton,
    training: Training,
    seconds: f64,
    place: Place,
    /// Where better ones come from, if it trains in the background.
    background: Option<BackgroundTraining>,
}

impl HyperReducedModel {
    /// Trained by the states that are there so far.
    pub(super) fn new(contacts: ReducedContacts, training: Training, since: Instant) -> Self {
        let states = training.states(&contacts);
        HyperReducedModel {
            solver: solver(&contacts, &states, training.n_snapshots()),
            contacts: Arc::new(contacts),
            training,
            seconds: since.elapsed().as_secs_f64(),
            place: Place::Nowhere,
            background: None,
        }
    }

    /// In the span of the series; snapshots follow while it is in use.
    pub(super) fn in_training(
        mut contacts: ReducedContacts,
        since: Instant,
    ) -> Result<Self, Error> {
        let background = (contacts.owner.sampling.snapshots > 0)
            .then(|| BackgroundTraining::start(contacts.clone(), since))
            .transpose()?;
        let training = Training::new(&mut contacts, 0, &|| true)?;
        Ok(HyperReducedModel { background, ..HyperReducedModel::new(contacts, training, since) })
    }

    /// Whether better ones are still to come; those that are ready have taken its place.
    ///
    /// # Errors
    /// What ended the training in the background.
    pub fn is_training(&mut self) -> Result<bool, Error> {
        self.improve()?;
        Ok(self.background.as_ref().is_some_and(BackgroundTraining::is_busy))
    }

    /// Compares the last answer with the equilibrium of the whole body next to it, and takes that in where the answer is
    /// wrong; whether it was, and it found one. Takes some tenths of a second, or seconds.
    ///
    /// # Errors
    /// No memory for a solver; a model that trains in the background, which does it by itself.
    pub fn add_snapshot(&mut self) -> Result<bool, Error> {
        if self.background.is_some() {
            return Err(Error::input("this model trains in the background by itself; wait for it"));
        }
        let (Place::At(depth), since) = (self.place, Instant::now()) else { return Ok(false) };
        let (mut contacts, mut training) =
            (ReducedContacts::clone(&self.contacts), self.training.clone());
        let is_wrong = training.correct(&mut contacts, &self.field(), depth)?;
        if is_wrong {
            self.give_way(HyperReducedModel::new(contacts, training, since));
        }
        Ok(is_wrong)
    }

    /// A better one takes its place, if it is ready.
    fn improve(&mut self) -> Result<(), Error> {
        let Some(mut background) = self.background.take() else { return Ok(()) };
        let better = background.newest()?; // a training that fails is over
        self.background = Some(background);
        if let Some(better) = better {
            self.give_way(better);
        }
        Ok(())
    }

    /// A better one takes its place, and goes on from its field: modes are only ever added, and what is there has nothing
    /// of the new ones. Its memory is given back elsewhere, for that may take longer than a tick.
    fn give_way(&mut self, better: HyperReducedModel) {
        let mut q = self.solver.q.clone();
        q.resize(better.contacts.n_modes(), 0.0);
        let (background, place) = (self.background.take(), self.place);
        let old = std::mem::replace(self, HyperReducedModel { background, place, ..better });
        if place != Place::Nowhere {
            self.solver.start(|share| q.iter().map(|q| share * q).collect());
        }
        rayon::spawn(|| drop(old));
    }

    /// Displacement of all nodes.
    fn field(&self) -> Vec<f64> {
        self.contacts.subspace.basis.field(&self.solver.q)
    }

    /// The search, to be asked what it lacks.
    pub(super) fn solver(&self) -> &ReducedNewton {
        &self.solver
    }

    /// What does not change from one solution to the next.
    pub fn contacts(&self) -> &Arc<ReducedContacts> {
        &self.contacts
    }

    /// Number of sampled cells.
    pub fn n_cells(&self) -> usize {
        self.solver.n_cells()
    }

    /// Number of states solved on the whole body, that the modes hold.
    pub fn n_snapshots(&self) -> usize {
        self.training.n_snapshots()
    }

    /// Time from taking hold to the modes as they are, or that the last of them took [s].
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// What it is trained with.
    #[cfg(test)]
    pub(super) fn training(&self) -> &Training {
        &self.training
    }

    /// What is solved.
    #[cfg(test)]
    pub(super) fn solver_mut(&mut self) -> &mut ReducedNewton {
        &mut self.solver
    }

    /// Equilibrium with the mean of each patch displaced by its `displacements` [m].
    ///
    /// From the superposed series, so that the answer depends on nothing before it; or, `from_last`, from the last
    /// solution, as a hand moves on. `with_stiffness` costs one more tangent.
    ///
    /// # Errors
    /// A displacement that is not finite; a number of them other than that of the contacts; training in the background
    /// has failed.
    pub fn solve(
        &mut self,
        displacements: &[[f64; 3]],
        from_last: bool,
        with_stiffness: bool,
    ) -> Result<Solution, Error> {
        self.solve_within(displacements, from_last, with_stiffness, None)
    }

    /// As [`HyperReducedModel::solve`], with a `budget` for the search: when it is over, the status is
    /// [`ReducedStatus::OutOfTime`], and the next search from the last goes on. One step is always taken, with its
    /// tangent where it needs one.
    ///
    /// # Errors
    /// As [`HyperReducedModel::solve`].
    pub fn solve_within(
        &mut self,
        displacements: &[[f64; 3]],
        from_last: bool,
        with_stiffness: bool,
        budget: Option<Duration>,
    ) -> Result<Solution, Error> {
        let clock = Instant::now();
        self.contacts.check(displacements)?;
        self.improve()?;
        let d = displacements.as_flattened();
        if !from_last || self.place == Place::Nowhere {
            self.solver.start_at(d, self.contacts.subspace.guess(d));
        }
        let limit = budget.map(|budget| (clock, budget));
        let mut search = Search { limit, ..Search::default() };
        let status = self.solver.solve(d, &mut search);
        let depth = displacements.iter().map(|d| norm(d)).fold(0.0, f64::max);
        self.place = match status {
            ReducedStatus::Converged => Place::At(depth),
            ReducedStatus::OutOfTime => Place::UnderWay,
            ReducedStatus::StepTooSmall | ReducedStatus::TooManyIterations => Place::Nowhere,
        };
        let is_settled = status == ReducedStatus::Converged;
        let mut stiffness = Vec::new();
        if with_stiffness && is_settled {
            stiffness = self.solver.stiffness(&mut search);
        }
        if is_settled
            && self.contacts.is_within(depth)
            && let Some(background) = &mut self.background
        {
            background.ask(&self.contacts, &self.solver.q, displacements);
        }
        let force = |f: &[f64]| {
            let is_known = f.iter().all(|x| x.is_finite());
            if is_known { [f[0], f[1], f[2]] } else { [0.0; 3] }
        };
        Ok(Solution {
            coordinates: self.solver.q.clone(),
            forces: self.solver.forces.chunks_exact(3).map(force).collect(),
            stiffness,
            energy: self.solver.reduced.energy,
            depth,
            status,
            smallest_jacobian: self.solver.reduced.jacobian,
            iterations: search.iterations,
            tangents: search.tangents,
            residual: search.residual,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }
}

/// The search for equilibrium in a span, on cells and weights that training finds; the first so many states of it are
/// equilibria.
fn solver(
    ReducedContacts { owner, subspace, .. }: &ReducedContacts,
    training: &[State],
    known: usize,
) -> ReducedNewton {
    let sampled = sampled(&owner.origin, subspace, training, owner.sampling.tolerance);
    let squares: f64 = training.iter().map(State::square).sum();
    let unit = (squares / training.len() as f64).sqrt();
    let constraints = subspace.constraints.clone();
    ReducedNewton::new(sampled, subspace.len(), constraints, unit, &training[..known])
}

/// Sampling units and weights that give the forces of the whole body in training: those of all states together to the
/// tolerance, and those of weighty states better than others.
fn sampled(origin: &Origin, subspace: &Subspace, training: &[State], tolerance: f64) -> Sampled {
    let all: Vec<usize> = (0..origin.body.n_sampling_units()).collect();
    let sizes = Forces::new(origin, &all, subspace, &training[..FIRST_STATES]).sizes();
    let candidates = systematic(&sizes, CANDIDATES);
    let forces = Forces::new(origin, &candidates, subspace, training);
    let columns = Columns { rows: forces.rows, values: &forces.units };
    let weight = training.iter().map(|state| state.weight.powi(2)).sum::<f64>().sqrt();
    let tolerance = tolerance * (training.len() as f64).sqrt() / weight;
    let chosen = greedy(&columns, &forces.body, tolerance);
    let (units, weights): (Vec<usize>, Vec<f64>) =
        chosen.into_iter().map(|(place, weight)| (candidates[place], weight)).unzip();
    Sampled::new(origin, &units, &weights, &subspace.basis.modes)
}
