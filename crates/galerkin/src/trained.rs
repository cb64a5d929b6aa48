//! The result of training: a search for equilibrium, with the cells and weights that integrate its forces.

use super::contacts::ReducedContacts;
use super::forces::{Forces, TrainingState, systematic};
use super::newton::ReducedNewton;
use super::nnls::{Columns, greedy};
use super::origin::Origin;
use super::sampled::Sampled;
use super::subspace::Subspace;
use super::training::{IsWanted, Training, go_on};
use crate::clock::Instant;
use crate::error::Error;
use std::sync::Arc;

/// Number of training states from which candidate units are chosen.
const FIRST_STATES: usize = 4;
/// Number of candidate sampling units.
const CANDIDATES: usize = 2000;

/// Contacts with a search for their equilibrium.
pub(super) struct Trained {
    pub contacts: Arc<ReducedContacts>,
    pub solver: ReducedNewton,
    pub training: Training,
    /// Time that it took [s].
    pub seconds: f64,
}

impl Trained {
    /// From the present states of training.
    pub fn new(contacts: ReducedContacts, training: Training, since: Instant) -> Self {
        let states = training.states(&contacts);
        Trained {
            solver: solver(&contacts, &states, training.n_snapshots()),
            contacts: Arc::new(contacts),
            training,
            seconds: since.elapsed().as_secs_f64(),
        }
    }
}

/// Rounds of training, until the model passes one. Each round hands over a better search than the last. Returns the
/// training.
///
/// # Errors
/// No memory for a solver; [`Error::Cancelled`].
pub(super) fn train(
    contacts: &mut ReducedContacts,
    since: Instant,
    is_wanted: IsWanted<'_>,
    hand_over: &mut (dyn FnMut(Trained) + Send),
) -> Result<Training, Error> {
    let mut training = Training::new(contacts, contacts.owner.sampling.snapshots, is_wanted)?;
    loop {
        go_on(is_wanted)?;
        let trained = Trained::new(contacts.clone(), training.clone(), since);
        let model = trained.solver.clone();
        hand_over(trained);
        if training.is_complete() || training.examine(contacts, &model, is_wanted)? {
            return Ok(training);
        }
    }
}

/// The search for equilibrium in a span, on cells and weights from training, whose first states are equilibria.
fn solver(
    ReducedContacts { owner, subspace, .. }: &ReducedContacts,
    training: &[TrainingState],
    known: usize,
) -> ReducedNewton {
    let sampled = sampled(&owner.origin, subspace, training, owner.sampling.tolerance);
    let squares: f64 = training.iter().map(TrainingState::square).sum();
    let unit = (squares / training.len() as f64).sqrt();
    let constraints = subspace.constraints.clone();
    ReducedNewton::new(sampled, subspace.len(), constraints, unit, &training[..known])
}

/// Sampling units and weights that give the forces of the whole body in training: those of all states together to the
/// tolerance, and those of weighty states better than others.
fn sampled(
    origin: &Origin,
    subspace: &Subspace,
    training: &[TrainingState],
    tolerance: f64,
) -> Sampled {
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
