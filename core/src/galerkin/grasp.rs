//! Contacts that hold an organ, ready to be displaced: which cells count how much, and the search for equilibrium.

use super::forces::{Forces, State, systematic};
use super::hold::Hold;
use super::lessons::Lessons;
use super::nnls::{Columns, greedy, norm};
use super::origin::Origin;
use super::sampled::Sampled;
use super::solver::{Search, Solver, Status};
use super::subspace::Subspace;
use super::training::Training;
use crate::clock::Instant;
use crate::error::Error;
use std::sync::Arc;
use std::time::Duration;

/// States of training that show which pieces come into question.
const FIRST_STATES: usize = 4;
/// Pieces that come into question.
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
    pub status: Status,
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
pub struct Grasp {
    hold: Arc<Hold>,
    solver: Solver,
    training: Training,
    seconds: f64,
    place: Place,
    /// Where better ones come from, if it learns in the background.
    lessons: Option<Lessons>,
}

impl Grasp {
    /// Trained by the states that are there so far.
    pub(super) fn new(hold: Hold, training: Training, since: Instant) -> Self {
        let states = training.states(&hold);
        Grasp {
            solver: solver(&hold, &states, training.n_snapshots()),
            hold: Arc::new(hold),
            training,
            seconds: since.elapsed().as_secs_f64(),
            place: Place::Nowhere,
            lessons: None,
        }
    }

    /// In the span of the series; snapshots follow while it is in use.
    pub(super) fn learning(mut hold: Hold, since: Instant) -> Result<Self, Error> {
        let lessons = (hold.owner.sampling.snapshots > 0)
            .then(|| Lessons::start(hold.clone(), since))
            .transpose()?;
        let training = Training::new(&mut hold, 0, &|| true)?;
        Ok(Grasp { lessons, ..Grasp::new(hold, training, since) })
    }

    /// Whether better ones are still to come; those that are ready have taken its place.
    ///
    /// # Errors
    /// What ended the lessons in the background.
    pub fn is_learning(&mut self) -> Result<bool, Error> {
        self.improve()?;
        Ok(self.lessons.as_ref().is_some_and(Lessons::is_busy))
    }

    /// Compares the last answer with the equilibrium of the whole body next to it, and takes that in where the answer is
    /// wrong; whether it was, and it found one. Takes some tenths of a second, or seconds.
    ///
    /// # Errors
    /// No memory for a solver; a grasp that learns in the background, which does it by itself.
    pub fn learn(&mut self) -> Result<bool, Error> {
        if self.lessons.is_some() {
            return Err(Error::input(
                "this grasp learns by itself, in the background; wait for it",
            ));
        }
        let (Place::At(depth), since) = (self.place, Instant::now()) else { return Ok(false) };
        let (mut hold, mut training) = (Hold::clone(&self.hold), self.training.clone());
        let is_wrong = training.correct(&mut hold, &self.field(), depth)?;
        if is_wrong {
            self.give_way(Grasp::new(hold, training, since));
        }
        Ok(is_wrong)
    }

    /// A better one takes its place, if it is ready.
    fn improve(&mut self) -> Result<(), Error> {
        let Some(mut lessons) = self.lessons.take() else { return Ok(()) };
        let better = lessons.newest()?; // lessons that fail are over
        self.lessons = Some(lessons);
        if let Some(better) = better {
            self.give_way(better);
        }
        Ok(())
    }

    /// A better one takes its place, and goes on from its field: modes are only ever added, and what is there has nothing
    /// of the new ones. Its memory is given back elsewhere, for that may take longer than a tick.
    fn give_way(&mut self, better: Grasp) {
        let mut q = self.solver.q.clone();
        q.resize(better.hold.n_modes(), 0.0);
        let (lessons, place) = (self.lessons.take(), self.place);
        let old = std::mem::replace(self, Grasp { lessons, place, ..better });
        if place != Place::Nowhere {
            self.solver.start(|share| q.iter().map(|q| share * q).collect());
        }
        rayon::spawn(|| drop(old));
    }

    /// Displacement of all nodes.
    fn field(&self) -> Vec<f64> {
        self.hold.subspace.basis.field(&self.solver.q)
    }

    /// The search, to be asked what it lacks.
    pub(super) fn solver(&self) -> &Solver {
        &self.solver
    }

    /// What does not change from one solution to the next.
    pub fn hold(&self) -> &Arc<Hold> {
        &self.hold
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

    /// What it has learned.
    #[cfg(test)]
    pub(super) fn training(&self) -> &Training {
        &self.training
    }

    /// What is solved.
    #[cfg(test)]
    pub(super) fn solver_mut(&mut self) -> &mut Solver {
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

    /// As [`Grasp::solve`], with a `budget` for the search: when it is over, the status is [`Status::OutOfTime`], and
    /// the next search from the last goes on. One step is always taken, with its tangent where it needs one.
    ///
    /// # Errors
    /// As [`Grasp::solve`].
    pub fn solve_within(
        &mut self,
        displacements: &[[f64; 3]],
        from_last: bool,
        with_stiffness: bool,
        budget: Option<Duration>,
    ) -> Result<Solution, Error> {
        let clock = Instant::now();
        self.hold.check(displacements)?;
        self.improve()?;
        let d = displacements.as_flattened();
        if !from_last || self.place == Place::Nowhere {
            self.solver.start_at(d, self.hold.subspace.guess(d));
        }
        let limit = budget.map(|budget| (clock, budget));
        let mut search = Search { limit, ..Search::default() };
        let status = self.solver.solve(d, &mut search);
        let depth = displacements.iter().map(|d| norm(d)).fold(0.0, f64::max);
        self.place = match status {
            Status::Converged => Place::At(depth),
            Status::OutOfTime => Place::UnderWay,
            Status::StepTooSmall | Status::TooManyIterations => Place::Nowhere,
        };
        let is_settled = status == Status::Converged;
        let mut stiffness = Vec::new();
        if with_stiffness && is_settled {
            stiffness = self.solver.stiffness(&mut search);
        }
        if is_settled
            && self.hold.is_within(depth)
            && let Some(lessons) = &mut self.lessons
        {
            lessons.ask(&self.hold, &self.solver.q, displacements);
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
fn solver(Hold { owner, subspace, .. }: &Hold, training: &[State], known: usize) -> Solver {
    let sampled = sampled(&owner.origin, subspace, training, owner.sampling.tolerance);
    let squares: f64 = training.iter().map(State::square).sum();
    let unit = (squares / training.len() as f64).sqrt();
    let means = subspace.means.clone();
    Solver::new(sampled, subspace.len(), means, unit, &training[..known])
}

/// Pieces and weights that give the forces of the whole body in training: those of all states together to the tolerance,
/// and those of weighty states better than others.
fn sampled(origin: &Origin, subspace: &Subspace, training: &[State], tolerance: f64) -> Sampled {
    let all: Vec<usize> = (0..origin.body.n_pieces()).collect();
    let sizes = Forces::new(origin, &all, subspace, &training[..FIRST_STATES]).sizes();
    let candidates = systematic(&sizes, CANDIDATES);
    let forces = Forces::new(origin, &candidates, subspace, training);
    let columns = Columns { rows: forces.rows, values: &forces.pieces };
    let weight = training.iter().map(|state| state.weight.powi(2)).sum::<f64>().sqrt();
    let tolerance = tolerance * (training.len() as f64).sqrt() / weight;
    let chosen = greedy(&columns, &forces.body, tolerance);
    let (pieces, weights): (Vec<usize>, Vec<f64>) =
        chosen.into_iter().map(|(place, weight)| (candidates[place], weight)).unzip();
    Sampled::new(origin, &pieces, &weights, &subspace.basis.modes)
}
