//! Training: states that the superposed series predicts, and states solved on the whole body where answers are wrong.

use super::contacts::ReducedContacts;
use super::forces::{TrainingState, with_forces};
use super::guesses::{Guess, guesses};
use super::model::{Galerkin, MOST_SNAPSHOTS};
use super::newton::ReducedNewton;
use super::snapshots::Patience;
use crate::error::Error;
use crate::number::norm;
use crate::reduced::allowance;
use rayon::prelude::*;

/// Smallest number of states from which cells and weights of a grasp are found.
const STATES: usize = 24;
/// Number of snapshots before the first round, and number of displacements in a round.
const FIRST: usize = 24;
const ROUND: usize = 32;
/// The model passes a round if its errors are below this part of the allowance of a trusted answer.
const PASS: f64 = 0.1;
/// An error below this part of the sampling's tolerance is no reason for a snapshot, since no mode can improve it.
const OF_SAMPLING: f64 = 0.5;
/// Weight of the forces at the position of the tools, beside those elsewhere.
const OF_PLACES: f64 = 10.0;
/// The part of a snapshot outside the span is left out below this part of the largest snapshot.
const SMALLEST_PART: f64 = 1e-3;

/// The states that a grasp is trained by. Snapshots are solved on the whole body, and their parts outside the span join
/// it. The first are spread evenly. Others follow in rounds, as long as answers of the model are wrong, and then on
/// demand at the position of the tools.
#[derive(Clone)]
pub(super) struct Training {
    /// Fields of the states solved on the whole body; the last `places` of them are at positions of the tools.
    solved: Vec<Vec<f64>>,
    places: usize,
    /// Coordinates of other states, as the superposed series predicts them.
    predicted: Vec<Vec<f64>>,
    /// Number of displacements tried as snapshots, and its limit.
    tried: usize,
    most: usize,
}

/// Called before every solution on the whole body; false cancels the training.
pub(super) type IsWanted<'a> = &'a (dyn Fn() -> bool + Sync);

impl Training {
    /// The first states; at most `most` become snapshots.
    ///
    /// # Errors
    /// No memory for a solver; [`Error::Cancelled`].
    pub fn new(
        contacts: &mut ReducedContacts,
        most: usize,
        is_wanted: IsWanted<'_>,
    ) -> Result<Self, Error> {
        let (patches, ReducedContacts { owner, subspace, .. }) = (contacts.patches(), contacts);
        let tried = most.min(FIRST);
        let numbers = 0..STATES.max(tried);
        let mut guesses = guesses(&owner.origin, subspace, owner.sampling.depth, numbers);
        let predicted = guesses.split_off(tried).into_iter().map(|guess| guess.q).collect();
        let solve = |guess: &Guess| {
            go_on(is_wanted)?;
            owner.snapshot(&patches, &subspace.basis.field(&guess.q), &Patience::OF_MANY)
        };
        let solved: Vec<Option<Vec<f64>>> =
            guesses.par_iter().map(solve).collect::<Result<_, _>>()?;
        let mut training = Training { solved: vec![], places: 0, predicted, tried, most };
        let mut missed = vec![];
        for (guess, solved) in guesses.into_iter().zip(solved) {
            match solved {
                Some(u) => training.solved.push(u),
                None => missed.push(guess.q),
            }
        }
        training.predicted.extend(missed);
        subspace.enrich(&training.solved, SMALLEST_PART, &patches, &owner.origin);
        Ok(training)
    }

    /// Number of states solved on the whole body.
    pub fn n_snapshots(&self) -> usize {
        self.solved.len()
    }

    /// Whether all snapshots that are wanted have been tried.
    pub fn is_complete(&self) -> bool {
        self.tried >= self.most
    }

    /// The states in the present span.
    pub fn states(
        &self,
        ReducedContacts { owner, subspace, .. }: &ReducedContacts,
    ) -> Vec<TrainingState> {
        let origin = &owner.origin;
        let nearest = |u: &Vec<f64>| subspace.basis.nearest(u, &origin.stiffness);
        let mut states: Vec<Vec<f64>> = self.solved.par_iter().map(nearest).collect();
        states.extend(self.predicted.iter().cloned().map(|mut q| {
            q.resize(subspace.len(), 0.0);
            q
        }));
        let mut states = with_forces(origin, subspace, states);
        let rounds = self.solved.len() - self.places;
        states[rounds..self.solved.len()].iter_mut().for_each(|state| state.weight = OF_PLACES);
        states
    }

    /// A round of new displacements: compares answers of the `model` with solutions on the whole body, and adds
    /// snapshots where they are wrong. Returns whether the model passed, so that nothing was added.
    ///
    /// # Errors
    /// No memory for a solver; [`Error::Cancelled`].
    pub fn examine(
        &mut self,
        contacts: &mut ReducedContacts,
        model: &ReducedNewton,
        is_wanted: IsWanted<'_>,
    ) -> Result<bool, Error> {
        let (patches, ReducedContacts { owner, subspace, .. }) = (contacts.patches(), contacts);
        let numbers = self.tried..self.most.min(self.tried + ROUND);
        self.tried = numbers.end;
        let guesses = guesses(&owner.origin, subspace, owner.sampling.depth, numbers);
        let ask = |model: &mut ReducedNewton, guess: &Guess| -> Result<Option<Vec<f64>>, Error> {
            go_on(is_wanted)?;
            let answer = subspace.basis.field(&guess.answer(subspace, model));
            let Some(u) = owner.snapshot(&patches, &answer, &Patience::OF_MANY)? else {
                return Ok(None);
            };
            Ok(is_wrong(owner, guess.depth(), &answer, &u).then_some(u))
        };
        let found: Vec<Option<Vec<f64>>> =
            guesses.par_iter().map_init(|| model.clone(), ask).collect::<Result<_, _>>()?;
        let wrong: Vec<Vec<f64>> = found.into_iter().flatten().collect();
        subspace.enrich(&wrong, SMALLEST_PART, &patches, &owner.origin);
        let has_passed = wrong.is_empty();
        self.solved.extend(wrong);
        Ok(has_passed)
    }

    /// Adds the equilibrium nearest to the model's answer `u`, under displacements up to `depth` [m], if the answer is
    /// wrong. Returns whether it was.
    ///
    /// # Errors
    /// No memory for a solver.
    pub fn correct(
        &mut self,
        contacts: &mut ReducedContacts,
        u: &[f64],
        depth: f64,
    ) -> Result<bool, Error> {
        let (patches, ReducedContacts { owner, subspace, .. }) = (contacts.patches(), contacts);
        if self.solved.len() >= MOST_SNAPSHOTS {
            return Ok(false);
        }
        let there = owner.snapshot(&patches, u, &Patience::OF_ONE)?;
        let Some(there) = there.filter(|there| is_wrong(owner, depth, u, there)) else {
            return Ok(false);
        };
        let there = [there];
        subspace.enrich(&there, SMALLEST_PART, &patches, &owner.origin);
        self.solved.extend(there);
        self.places += 1;
        Ok(true)
    }
}

/// Whether an answer is a reason for a snapshot.
fn is_wrong(owner: &Galerkin, depth: f64, answer: &[f64], u: &[f64]) -> bool {
    let gap: Vec<f64> = u.iter().zip(answer).map(|(u, a)| u - a).collect();
    let allowed = PASS * allowance(depth / owner.model.metadata().diagonal);
    norm(&gap) > allowed.max(OF_SAMPLING * owner.sampling.tolerance) * norm(u)
}

/// # Errors
/// [`Error::Cancelled`].
pub(super) fn go_on(is_wanted: IsWanted<'_>) -> Result<(), Error> {
    if is_wanted() { Ok(()) } else { Err(Error::Cancelled) }
}
