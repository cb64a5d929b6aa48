//! Training: states that the superposed series predicts, some of them solved, and the forces of every cell in them.

use super::assembly::cell_forces;
use super::model::{Galerkin, Sampling};
use super::nnls::norm;
use super::sample::Sample;
use super::sketch::Sketch;
use super::solver::{Search, Solver, Status};
use super::subspace::{Rest, Subspace};
use crate::body::Body;
use crate::error::Error;
use crate::mesh::Patch;
use crate::reduced::allowance;
use rayon::prelude::*;

/// States by which cells and weights of a grasp are found, at least.
const STATES: usize = 24;
/// Snapshots before the model is asked what it lacks, and displacements that it is asked for at a time.
const FIRST: usize = 24;
const ROUND: usize = 32;
/// Part of the error allowed to a trusted answer that the model may have in a round to pass it.
const PASS: f64 = 0.2;
/// Part of the sampling's tolerance that is no reason for a snapshot: no mode mends it.
const OF_SAMPLING: f64 = 0.5;
/// What a snapshot has beyond the span is left out below this part of the largest snapshot.
const SMALLEST_PART: f64 = 1e-3;
/// A state in which some cell keeps less than this part of its volume is drawn back towards rest.
const SMALLEST_RATIO: f64 = 0.3;
/// Cells that a thread takes at once.
const CHUNK: usize = 64;

/// A state of training.
pub(super) struct State {
    /// Its coordinates.
    pub q: Vec<f64>,
    /// `phi . f_int` of the whole body.
    force: Vec<f64>,
}

impl State {
    /// Squared norm of its coordinates.
    pub fn square(&self) -> f64 {
        self.q.iter().map(|q| q * q).sum()
    }
}

/// The states that a grasp is trained by. As many of them as snapshots are wanted are solved on the whole body, and the
/// span takes in what it lacks of them: the first are spread evenly, others follow in rounds as long as the model's
/// answers are wrong somewhere.
pub(super) struct Training {
    /// Fields of the states solved on the whole body.
    solved: Vec<Vec<f64>>,
    /// Coordinates of others, as the superposed series predicts them.
    predicted: Vec<Vec<f64>>,
    /// Displacements tried as snapshots.
    tried: usize,
}

impl Training {
    /// The first states.
    ///
    /// # Errors
    /// No memory for a solver.
    pub fn new(
        owner: &Galerkin,
        patches: &[Patch],
        subspace: &mut Subspace,
    ) -> Result<Self, Error> {
        let Sampling { depth, snapshots, .. } = owner.sampling;
        let tried = snapshots.min(FIRST);
        let mut guesses = guesses(&owner.rest, subspace, depth, 0..STATES.max(tried));
        let predicted = guesses.split_off(tried).into_iter().map(|guess| guess.q).collect();
        let solve = |guess: &Guess| owner.snapshot(patches, &subspace.basis.field(&guess.q));
        let solved: Vec<Option<Vec<f64>>> =
            guesses.par_iter().map(solve).collect::<Result<_, _>>()?;
        let (mut training, mut missed) = (Training { solved: vec![], predicted, tried }, vec![]);
        for (guess, solved) in guesses.into_iter().zip(solved) {
            match solved {
                Some(u) => training.solved.push(u),
                None => missed.push(guess.q),
            }
        }
        training.predicted.extend(missed);
        subspace.enrich(&training.solved, SMALLEST_PART, patches, &owner.rest);
        Ok(training)
    }

    /// Number of states solved on the whole body.
    pub fn n_snapshots(&self) -> usize {
        self.solved.len()
    }

    /// Whether all snapshots that are wanted have been tried.
    pub fn is_complete(&self, owner: &Galerkin) -> bool {
        self.tried >= owner.sampling.snapshots
    }

    /// The states in the span as it is.
    pub fn states(&self, rest: &Rest, subspace: &Subspace) -> Vec<State> {
        let nearest = |u: &Vec<f64>| subspace.basis.nearest(u, &rest.stiffness);
        let mut states: Vec<Vec<f64>> = self.solved.par_iter().map(nearest).collect();
        states.extend(self.predicted.iter().cloned().map(|mut q| {
            q.resize(subspace.len(), 0.0);
            q
        }));
        with_forces(&rest.body, subspace, states)
    }

    /// A round of new displacements: asks the `model`, solves on the whole body from its answers, and takes in what they
    /// lack. Whether the model passed, and nothing was taken in.
    ///
    /// # Errors
    /// No memory for a solver.
    pub fn examine(
        &mut self,
        owner: &Galerkin,
        patches: &[Patch],
        subspace: &mut Subspace,
        model: &Solver,
    ) -> Result<bool, Error> {
        let Sampling { depth, snapshots, tolerance, .. } = owner.sampling;
        let numbers = self.tried..snapshots.min(self.tried + ROUND);
        self.tried = numbers.end;
        let guesses = guesses(&owner.rest, subspace, depth, numbers);
        let diagonal = owner.model.metadata().diagonal;
        let ask = |model: &mut Solver, guess: &Guess| -> Result<Option<(f64, Vec<f64>)>, Error> {
            let answer = subspace.basis.field(&guess.answer(subspace, model));
            let Some(u) = owner.snapshot(patches, &answer)? else { return Ok(None) };
            let gap: Vec<f64> = u.iter().zip(&answer).map(|(u, a)| u - a).collect();
            let allowed = PASS * allowance(guess.depth() / diagonal);
            let allowed = allowed.max(OF_SAMPLING * tolerance);
            Ok(Some((norm(&gap) / (allowed * norm(&u)), u)))
        };
        let found: Vec<Option<(f64, Vec<f64>)>> =
            guesses.par_iter().map_init(|| model.clone(), ask).collect::<Result<_, _>>()?;
        let wrong = found.into_iter().flatten().filter(|(error, _)| *error > 1.0);
        let wrong: Vec<Vec<f64>> = wrong.map(|(_, u)| u).collect();
        subspace.enrich(&wrong, SMALLEST_PART, patches, &owner.rest);
        let has_passed = wrong.is_empty();
        self.solved.extend(wrong);
        Ok(has_passed)
    }
}

/// A superposed series and its displacements of all contacts [m].
struct Guess {
    d: Vec<f64>,
    q: Vec<f64>,
}

impl Guess {
    /// Largest displacement of a contact [m].
    fn depth(&self) -> f64 {
        self.d.chunks_exact(3).map(norm).fold(0.0, f64::max)
    }

    /// Coordinates of the model's answer to the displacements; the guess itself where it finds none.
    fn answer(&self, subspace: &Subspace, model: &mut Solver) -> Vec<f64> {
        let share_of = |share: f64| self.d.iter().map(|x| share * x).collect::<Vec<_>>();
        model.start(|share| subspace.superposed(&share_of(share)));
        match model.solve(&self.d, &mut Search::default()) {
            Status::Converged => model.q.clone(),
            _ => self.q.clone(),
        }
    }
}

/// Superposed series under displacements spread over the ball of radius `depth` [m].
fn guesses(
    rest: &Rest,
    subspace: &Subspace,
    depth: f64,
    numbers: std::ops::Range<usize>,
) -> Vec<Guess> {
    let contacts = subspace.means.len() / 3;
    numbers
        .into_par_iter()
        .map(|number| {
            let mut d: Vec<f64> = (0..contacts)
                .flat_map(|c| spread(contacts * number + c).map(|x| depth * x))
                .collect();
            let mut q = subspace.superposed(&d);
            let is_sound = |q: &[f64]| {
                rest.body.smallest_jacobian(&subspace.basis.field(q)).0 > SMALLEST_RATIO
            };
            while !is_sound(&q) {
                d.iter_mut().for_each(|x| *x *= 0.7);
                q = subspace.superposed(&d);
            }
            Guess { d, q }
        })
        .collect()
}

/// States that the superposed series predicts.
#[cfg(test)]
pub(super) fn states(
    rest: &Rest,
    subspace: &Subspace,
    depth: f64,
    numbers: std::ops::Range<usize>,
) -> Vec<State> {
    let guesses = guesses(rest, subspace, depth, numbers);
    with_forces(&rest.body, subspace, guesses.into_iter().map(|guess| guess.q).collect())
}

fn with_forces(body: &Body, subspace: &Subspace, coordinates: Vec<Vec<f64>>) -> Vec<State> {
    coordinates
        .into_par_iter()
        .map(|q| {
            let u = subspace.basis.field(&q);
            let mut force = vec![0.0; u.len()];
            body.internal_force(&u, &mut force);
            State { q, force: subspace.basis.project(&force) }
        })
        .collect()
}

/// Forces of some cells along the modes in some states, each state in units of the force of the whole body.
pub(super) struct Forces {
    /// Rows: modes of a state after modes of another, or a sketch of them where they are many.
    pub rows: usize,
    /// Cell by cell.
    pub cells: Vec<f64>,
    /// Of the whole body.
    pub body: Vec<f64>,
}

impl Forces {
    /// Of some cells of a body.
    pub fn new(body: &Body, cells: &[usize], subspace: &Subspace, states: &[State]) -> Self {
        let units: Vec<f64> =
            states.iter().map(|s| 1.0 / norm(&s.force).max(f64::MIN_POSITIVE)).collect();
        let (r, rows) = (subspace.len(), subspace.len() * states.len());
        let sketch = Sketch::new(rows);
        let of_some = |some: &[usize]| {
            let sample = Sample::new(body.points(), body.cells(), body.material(), some);
            let modes = sample.restrict(&subspace.basis.modes);
            let mut columns = vec![0.0; rows * some.len()];
            for (k, (state, unit)) in states.iter().zip(&units).enumerate() {
                let forces = sample.by_cell(&cell_forces(&sample, &modes, &state.q), r);
                for (column, force) in columns.chunks_exact_mut(rows).zip(forces.chunks_exact(r)) {
                    let out = &mut column[k * r..(k + 1) * r];
                    out.iter_mut().zip(force).for_each(|(out, f)| *out = unit * f);
                }
            }
            let mut sketched = vec![0.0; sketch.rows() * some.len()];
            let pairs = columns.chunks_exact(rows).zip(sketched.chunks_exact_mut(sketch.rows()));
            pairs.for_each(|(column, out)| sketch.apply(column, out));
            sketched
        };
        let cells = cells.par_chunks(CHUNK).map(of_some).collect::<Vec<_>>().concat();
        let forces = states.iter().zip(&units);
        let forces: Vec<f64> =
            forces.flat_map(|(s, unit)| s.force.iter().map(move |f| unit * f)).collect();
        let mut body = vec![0.0; sketch.rows()];
        sketch.apply(&forces, &mut body);
        Forces { rows: sketch.rows(), cells, body }
    }

    /// The norm of each cell's forces.
    pub fn sizes(&self) -> Vec<f64> {
        self.cells.chunks_exact(self.rows).map(norm).collect()
    }
}

/// About `count` places, evenly spaced along the running sum of their sizes: what counts more is taken more often.
pub(super) fn systematic(sizes: &[f64], count: usize) -> Vec<usize> {
    let step = sizes.iter().sum::<f64>() / count as f64;
    let (mut sum, mut next, mut taken) = (0.0, 0.5 * step, Vec::with_capacity(count));
    for (place, size) in sizes.iter().enumerate() {
        sum += size;
        if sum > next {
            taken.push(place);
            next = step * ((sum / step - 0.5).floor() + 1.5);
        }
    }
    taken
}

/// The points of a sequence that fills the unit ball evenly, more densely towards its centre: direction from two
/// terms of Roberts' R3 sequence, radius from the third.
fn spread(number: usize) -> [f64; 3] {
    const GOLDEN: f64 = 1.220_744_084_605_76;
    let term = |k: i32| (0.5 + (number + 1) as f64 / GOLDEN.powi(k)).fract();
    let (height, turn) = (2.0 * term(1) - 1.0, std::f64::consts::TAU * term(2));
    let radius = 0.2 + 0.8 * term(3);
    let width = (1.0 - height * height).sqrt();
    [radius * width * turn.cos(), radius * width * turn.sin(), radius * height]
}
