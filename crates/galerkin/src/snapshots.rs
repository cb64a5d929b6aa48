//! Solutions on the whole body: snapshots, which contain what no series field has, and Newton steps from an answer.
//!
//! Newton's method starts from the superposed series, or from what the model answers, and keeps a tangent while steps
//! shrink fast: few factorisations a snapshot, then forces and substitutions. The means of the patches keep their start
//! values, so that an equilibrium is a minimum of the energy.

use super::model::Galerkin;
use super::origin::Origin;
use crate::body::Curvature;
use crate::equilibrium::{ConstrainedSystem, Iteration, Limits, Tangent, backtrack, iterate};
use crate::error::Error;
use crate::mesh::Patch;
use crate::number::norm;

/// A step below this part of the field is the last one.
const SMALLEST_STEP: f64 = 1e-3;
/// A new tangent is made when steps shrink by less than this.
const SHRINKS: f64 = 0.3;

/// When a search is given up.
pub(super) struct Patience {
    tangents: usize,
    /// Halvings of a step.
    cuts: usize,
}

impl Patience {
    /// For one of many states, of which some may be missed.
    pub const OF_MANY: Self = Patience { tangents: 8, cuts: 5 };
    /// For the state at the position of the tools.
    pub const OF_ONE: Self = Patience { tangents: 40, cuts: 11 };
}

impl Galerkin {
    /// The equilibrium near a field `u` with the same means of the patches; none if none is found.
    ///
    /// # Errors
    /// No memory for a solver.
    pub(super) fn snapshot(
        &self,
        patches: &[Patch],
        u: &[f64],
        patience: &Patience,
    ) -> Result<Option<Vec<f64>>, Error> {
        let (origin, n_means) = (&self.origin, 3 * patches.len());
        self.solvers.lend(origin, patches, |solver| settle(origin, solver, n_means, u, patience))
    }

    /// Two Newton steps on the whole body from a field, with the means of the patches kept; none if they cannot be found.
    ///
    /// # Errors
    /// No memory for a solver.
    pub(super) fn correction(
        &self,
        patches: &[Patch],
        u: &[f64],
    ) -> Result<Option<Correction>, Error> {
        let (origin, n_means) = (&self.origin, 3 * patches.len());
        self.solvers.lend(origin, patches, |solver| correction(origin, solver, n_means, u))
    }
}

/// Two steps of Newton's method on the whole body by one tangent.
pub(super) struct Correction {
    /// Norms of the steps [m].
    pub steps: [f64; 2],
    /// Forces of the tools on the organ after each, to first order [N].
    pub forces: [Vec<f64>; 2],
    /// Whether the tangent is positive definite, so that the state is stable.
    pub is_stable: bool,
}

/// The steps from `u`, the means of the patches kept, by the tangent there, made convex where it is not; none if they
/// are not finite.
fn correction(
    origin: &Origin,
    solver: &mut ConstrainedSystem,
    n_means: usize,
    u: &[f64],
) -> Option<Correction> {
    let (mut force, mut step) = (vec![0.0; u.len()], vec![0.0; u.len()]);
    let is_stable = prepare(origin, solver, &mut Tangent::matrix(&origin.body), u, &mut force)?;
    let stay = vec![0.0; n_means];
    let mut solve = |force: &mut [f64], step: &mut [f64]| {
        let mut of_tools = Vec::new();
        force.iter_mut().for_each(|f| *f = -*f);
        solver.solve(force, &stay, step, &mut of_tools, None).ok()?;
        Some((norm(step), of_tools))
    };
    let (first, by_first) = solve(&mut force, &mut step)?;
    let there: Vec<f64> = u.iter().zip(&step).map(|(u, s)| u + s).collect();
    // A step that turns a cell inside out leaves no force to go on with.
    let (second, by_second) = match origin.internal_force(&there, &mut force).is_finite() {
        true => solve(&mut force, &mut step)?,
        false => (f64::INFINITY, by_first.clone()),
    };
    Some(Correction { steps: [first, second], forces: [by_first, by_second], is_stable })
}

/// Readies the solver for the tangent at `u`, made convex where it is not positive definite, and says whether it is;
/// none if that does not help. `force` is then the internal one.
fn prepare(
    origin: &Origin,
    solver: &mut ConstrainedSystem,
    tangent: &mut Tangent,
    u: &[f64],
    force: &mut [f64],
) -> Option<bool> {
    origin.linearize(u, Curvature::Exact, force, tangent);
    if solver.prepare(tangent, 0.0).is_ok() {
        return Some(true);
    }
    origin.linearize(u, Curvature::Projected, force, tangent);
    solver.prepare(tangent, 0.0).is_ok().then_some(false)
}

/// Minimises the energy from a guess, with the means of the patches kept, by Newton's method with few tangents.
fn settle(
    origin: &Origin,
    solver: &mut ConstrainedSystem,
    n_means: usize,
    guess: &[f64],
    patience: &Patience,
) -> Option<Vec<f64>> {
    let mut force = vec![0.0; guess.len()];
    let mut settling = Settling {
        origin,
        solver,
        stay: vec![0.0; n_means],
        patience,
        tangent: Tangent::matrix(&origin.body),
        tangents: 0,
        is_stale: true,
        energy: origin.internal_force(guess, &mut force),
        force,
        u: guess.to_vec(),
        trial: guess.to_vec(),
        step: vec![0.0; guess.len()],
        last: f64::INFINITY,
        residual: f64::INFINITY,
    };
    // The tangents are what is limited.
    let limits = Limits { tolerance: SMALLEST_STEP, steps: usize::MAX, waits: false };
    iterate(&mut settling, limits).ok()?;
    Some(settling.u)
}

/// A search for a minimum of the energy, in progress.
struct Settling<'a> {
    origin: &'a Origin,
    solver: &'a mut ConstrainedSystem,
    stay: Vec<f64>,
    patience: &'a Patience,
    tangent: Tangent,
    tangents: usize,
    /// The next step asks for a new tangent.
    is_stale: bool,
    energy: f64,
    force: Vec<f64>,
    u: Vec<f64>,
    trial: Vec<f64>,
    step: Vec<f64>,
    /// Norm of the last step, and a whole step relative to the field.
    last: f64,
    residual: f64,
}

/// No tangent, no step that lowers the energy, or no more patience.
struct LeadsNowhere;

impl Iteration for Settling<'_> {
    type Failure = LeadsNowhere;

    fn residual(&mut self) -> Result<f64, LeadsNowhere> {
        Ok(self.residual)
    }

    fn step(&mut self) -> Result<(), LeadsNowhere> {
        let Settling { origin, solver, tangent, force, step, u, trial, .. } = self;
        if self.is_stale {
            if self.tangents == self.patience.tangents {
                return Err(LeadsNowhere);
            }
            prepare(origin, solver, tangent, u, force).ok_or(LeadsNowhere)?;
            (self.tangents, self.last) = (self.tangents + 1, f64::INFINITY);
        }
        force.iter_mut().for_each(|f| *f = -*f);
        let solved = solver.solve(force, &self.stay, step, &mut Vec::new(), None);
        solved.map_err(|_| LeadsNowhere)?;
        let lower = |length: f64| {
            trial.iter_mut().zip(&*u).zip(&*step).for_each(|((t, u), s)| *t = u + length * s);
            let energy = origin.internal_force(trial, force);
            origin.is_no_higher(energy, self.energy).then_some(energy)
        };
        let (length, energy) = backtrack(1.0, self.patience.cuts, lower).ok_or(LeadsNowhere)?;
        self.energy = energy;
        std::mem::swap(u, trial);
        let (length_of_step, is_whole) = (norm(step), length == 1.0);
        let size = norm(u).max(f64::MIN_POSITIVE);
        self.residual = if is_whole { length_of_step / size } else { f64::INFINITY };
        self.is_stale = !is_whole || length_of_step > SHRINKS * self.last;
        self.last = length_of_step;
        Ok(())
    }
}
