//! Contacts that hold an organ, ready to be displaced: which cells count how much, and the search for equilibrium.

use super::hold::Hold;
use super::model::Galerkin;
use super::nnls::{Columns, greedy, norm};
use super::sample::Sample;
use super::solver::{Search, Solver, Status};
use super::subspace::Subspace;
use super::training::{Forces, State, Training, systematic};
use crate::body::Body;
use crate::error::Error;
use crate::reduced::Contact;
use std::sync::Arc;
use std::time::Instant;

/// States of training that show which cells come into question.
const FIRST_STATES: usize = 4;
/// Cells that come into question.
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

/// Some contacts of an organ, ready to be displaced.
pub struct Grasp {
    hold: Arc<Hold>,
    solver: Solver,
    n_snapshots: usize,
    seconds: f64,
    /// Whether it is at an equilibrium, to start the next from.
    is_settled: bool,
}

impl Grasp {
    pub(super) fn new(owner: Arc<Galerkin>, contacts: Vec<Contact>) -> Result<Self, Error> {
        let clock = Instant::now();
        let mut hold = Hold::new(Arc::clone(&owner), contacts)?;
        let patches = hold.patches();
        let mut training = Training::new(&owner, &patches, &mut hold.subspace)?;
        let solver = loop {
            let states = training.states(&owner.rest, &hold.subspace);
            let solver = solver(&owner, &hold.subspace, &states);
            if training.is_complete(&owner)
                || training.examine(&owner, &patches, &mut hold.subspace, &solver)?
            {
                break solver;
            }
        };
        let seconds = clock.elapsed().as_secs_f64();
        let n_snapshots = training.n_snapshots();
        Ok(Grasp { hold: Arc::new(hold), solver, n_snapshots, seconds, is_settled: false })
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
        self.n_snapshots
    }

    /// Time that taking hold has taken [s].
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// What is solved.
    #[cfg(test)]
    pub(super) fn solver(&mut self) -> &mut Solver {
        &mut self.solver
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
        self.hold.check(displacements)?;
        let d = displacements.as_flattened();
        if !(from_last && self.is_settled) {
            let subspace = &self.hold.subspace;
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
        Ok(Solution {
            coordinates: self.solver.q.clone(),
            forces: self.solver.forces.chunks_exact(3).map(force).collect(),
            stiffness,
            energy: self.solver.reduced.energy,
            depth: displacements.iter().map(|d| norm(d)).fold(0.0, f64::max),
            status,
            smallest_jacobian: self.solver.reduced.jacobian,
            iterations: search.iterations,
            tangents: search.tangents,
            residual: search.residual,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }
}

/// The search for equilibrium in a span, on cells and weights that training finds.
fn solver(owner: &Galerkin, subspace: &Subspace, training: &[State]) -> Solver {
    let sample = sample(&owner.rest.body, subspace, training, owner.sampling.tolerance);
    let squares: f64 = training.iter().map(State::square).sum();
    let unit = (squares / training.len() as f64).sqrt();
    Solver::new(sample, &subspace.basis.modes, subspace.means.clone(), unit)
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
