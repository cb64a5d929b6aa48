//! Training: states that the superposed series predicts, and states solved on the whole body where answers are wrong.

use super::contacts::ReducedContacts;
use super::forces::{State, with_forces};
use super::guesses::{Guess, guesses};
use super::model::{Galerkin, MOST_SNAPSHOTS};
use super::newton::ReducedNewton;
use super::snapshots::Patience;
use crate::error::Error;
use crate::number::norm;
use crate::reduced::allowance;
use rayon::prelude::*;

/// States by which cells and weights of a grasp are found, at least.
const STATES: usize = 24;
/// Snapshots before the model is asked what it lacks, and displacements that it is asked for at a time.
const FIRST: usize = 24;
const ROUND: usize = 32;
/// Part of the error allowed to a trusted answer that the model may have in a round to pass it.
const PASS: f64 = 0.1;
/// Part of the sampling's tolerance that is no reason for a snapshot: no mode mends it.
const OF_SAMPLING: f64 = 0.5;
/// How much the forces where tools are count beside those elsewhere.
const OF_PLACES: f64 = 10.0;
/// What a snapshot has beyond the span is left out below this part of the largest snapshot.
const SMALLEST_PART: f64 = 1e-3;

/// The states that a grasp is trained by. As many of them as snapshots are wanted are solved on the whole body, and the
/// span takes in what it lacks of them: the first are spread evenly, others follow in rounds as long as the model's
/// answers are wrong somewhere; and where the tools are in the end, on demand.
#[derive(Clone)]
pub(super) struct Training {
    /// Fields of the states solved on the whole body; the last `places` of them where the tools were.
    solved: Vec<Vec<f64>>,
    places: usize,
    /// Coordinates of others, as the superposed series predicts them.
    predicted: Vec<Vec<f64>>,
    /// Displacements tried as snapshots, and how many may be.
    tried: usize,
    most: usize,
}

/// Asked before every solution on the whole body.
pub(super) type IsWanted<'a> = &'a (dyn Fn() -> bool + Sync);

impl Training {
    /// The first states, and `most` that may be snapshots.
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

    /// The states in the span as it is.
    pub fn states(&self, ReducedContacts { owner, subspace, .. }: &ReducedContacts) -> Vec<State> {
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

    /// A round of new displacements: asks the `model`, solves on the whole body from its answers, and takes in what they
    /// lack. Whether the model passed, and nothing was taken in.
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

    /// Takes in the equilibrium next to the model's answer `u` under displacements up to `depth` [m], if the answer is
    /// wrong; whether it was.
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
