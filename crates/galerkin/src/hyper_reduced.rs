//! Contacts that hold an organ, ready to be displaced: sampled cells with weights, and the search for equilibrium.

use super::background::BackgroundTraining;
use super::contacts::ReducedContacts;
use super::model::{Galerkin, MOST_SNAPSHOTS};
use super::newton::{ReducedStatus, Search};
use super::solution::Solution;
use super::trained::{Trained, train};
use super::training::Training;
use crate::clock::Instant;
use crate::error::Error;
use crate::number::norm;
use crate::reduced::Contact;
use std::sync::Arc;
use std::time::Duration;

/// State of the coordinates after the last search.
#[derive(Clone, Copy, PartialEq)]
enum Reached {
    /// Unusable as a start.
    Nothing,
    /// On the way to an equilibrium.
    AnIterate,
    /// At an equilibrium of this depth [m].
    Equilibrium(f64),
}

/// Some contacts of an organ, ready to be displaced.
pub struct HyperReducedModel {
    now: Trained,
    reached: Reached,
    /// Source of better models, if training goes on in the background.
    background: Option<BackgroundTraining>,
    /// Room for the prescribed means.
    means: Vec<f64>,
    is_alone: bool,
}

/// How an equilibrium is looked for.
#[derive(Clone, Copy, Debug, Default)]
pub struct Asked {
    /// From the last solution, for a moving hand, in place of the superposed series.
    pub from_last: bool,
    /// With the stiffness, which costs one more tangent.
    pub with_stiffness: bool,
    /// Time for the search. When it is over, the status is [`ReducedStatus::OutOfTime`], and the next search from the
    /// last solution continues. One step is always taken, with a new tangent if it needs one.
    pub budget: Option<Duration>,
}

impl HyperReducedModel {
    /// A model whose training is complete.
    fn new(now: Trained) -> Self {
        let means = vec![0.0; 3 * now.contacts.places().len()];
        HyperReducedModel {
            now,
            reached: Reached::Nothing,
            background: None,
            means,
            is_alone: false,
        }
    }

    /// A model in the span of the series; snapshots follow while it is in use.
    fn in_training(mut contacts: ReducedContacts, since: Instant) -> Result<Self, Error> {
        let background = (contacts.owner.sampling.snapshots > 0)
            .then(|| BackgroundTraining::start(contacts.clone(), since))
            .transpose()?;
        let training = Training::new(&mut contacts, 0, &|| true)?;
        let now = Trained::new(contacts, training, since);
        Ok(HyperReducedModel { background, ..HyperReducedModel::new(now) })
    }

    /// Whether better models may still follow. One that is ready replaces this one.
    ///
    /// # Errors
    /// The error that ended the training in the background.
    pub fn is_training(&mut self) -> Result<bool, Error> {
        self.improve()?;
        Ok(self.background.as_ref().is_some_and(BackgroundTraining::is_busy))
    }

    /// Compares the last answer with the nearest equilibrium of the whole body, and adds that as a snapshot if the
    /// answer is wrong. Returns whether a snapshot was added: solve again then, since nothing more is added until there is
    /// a new answer. Takes some tenths of a second, or seconds.
    ///
    /// # Errors
    /// No memory for a solver; a model that trains in the background, which does it by itself.
    pub fn add_snapshot(&mut self) -> Result<bool, Error> {
        if self.background.is_some() {
            return Err(Error::input("this model trains in the background by itself; wait for it"));
        }
        let (Reached::Equilibrium(depth), since) = (self.reached, Instant::now()) else {
            return Ok(false);
        };
        let (mut contacts, mut training) =
            (ReducedContacts::clone(&self.now.contacts), self.now.training.clone());
        let is_wrong = training.correct(&mut contacts, &self.field(), depth)?;
        if is_wrong {
            let mut better = Trained::new(contacts, training, since);
            go_on(&self.now, &mut better, self.reached, self.is_alone);
            self.now = better;
            // The coordinates are still those of the old answer, which is no equilibrium of the better model.
            self.reached = Reached::AnIterate;
        }
        Ok(is_wrong)
    }

    /// Searches stay on the thread that asks and allocate nothing, for loops that wait for nobody. Answers are the same.
    pub fn stay_on_one_thread(&mut self) {
        self.is_alone = true;
        self.now.solver.share(false);
    }

    /// Replaces this model by a better one that is ready.
    fn improve(&mut self) -> Result<(), Error> {
        let Some(background) = self.background.take() else { return Ok(()) };
        let (is_alone, reached) = (self.is_alone, self.reached);
        let go_on = |old: &Trained, better: &mut Trained| go_on(old, better, reached, is_alone);
        background.improve(&mut self.now, go_on)?; // a training that fails is over
        self.background = Some(background);
        Ok(())
    }

    /// Displacement of all nodes.
    fn field(&self) -> Vec<f64> {
        self.now.contacts.subspace.basis.field(&self.now.solver.q)
    }

    /// What does not change from one solution to the next.
    pub fn contacts(&self) -> &Arc<ReducedContacts> {
        &self.now.contacts
    }

    /// Number of sampled cells.
    pub fn n_cells(&self) -> usize {
        self.now.solver.n_cells()
    }

    /// Number of states solved on the whole body that the modes contain.
    pub fn n_snapshots(&self) -> usize {
        self.now.training.n_snapshots()
    }

    /// Time [s] from taking hold to the present modes, or the time that the last of them took.
    pub fn seconds(&self) -> f64 {
        self.now.seconds
    }

    /// What it is trained with.
    #[cfg(test)]
    pub(super) fn training(&self) -> &Training {
        &self.now.training
    }

    /// What is solved.
    #[cfg(test)]
    pub(super) fn solver_mut(&mut self) -> &mut super::newton::ReducedNewton {
        &mut self.now.solver
    }

    /// Equilibrium with the mean of each patch displaced by its `displacements` [m].
    ///
    /// The search starts from the superposed series, or from rest where that has less energy, and goes up in load steps
    /// where it fails, so the answer does not depend on earlier ones; or, with `from_last`, it starts from the last
    /// solution, for a moving hand. `with_stiffness` costs one more tangent.
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
        let mut solution = self.room();
        let asked = Asked { from_last, with_stiffness, budget: None };
        self.solve_into(displacements, asked, &mut solution)?;
        Ok(solution)
    }

    /// Room for the solutions of this model and of those that replace it.
    pub fn room(&self) -> Solution {
        let contacts = Arc::clone(&self.now.contacts);
        Solution::with_room(contacts, self.now.contacts.n_modes() + MOST_SNAPSHOTS)
    }

    /// As [`HyperReducedModel::solve`], into a [`HyperReducedModel::room`].
    ///
    /// # Errors
    /// As [`HyperReducedModel::solve`]; the solution is then as it was.
    pub fn solve_into(
        &mut self,
        displacements: &[[f64; 3]],
        Asked { from_last, with_stiffness, budget }: Asked,
        out: &mut Solution,
    ) -> Result<(), Error> {
        let clock = Instant::now();
        self.now.contacts.check(displacements)?;
        self.improve()?;
        let d = displacements.as_flattened();
        let limit = budget.map(|budget| (clock, budget));
        let mut search = Search { limit, ..Search::default() };
        let Trained { solver, contacts, .. } = &mut self.now;
        let status = if from_last && self.reached != Reached::Nothing {
            solver.solve(d, &mut search)
        } else {
            solver.find(d, contacts.subspace.guess(d, &mut self.means), &mut search)
        };
        let depth = displacements.iter().map(|d| norm(d)).fold(0.0, f64::max);
        self.reached = match status {
            ReducedStatus::Converged => Reached::Equilibrium(depth),
            ReducedStatus::OutOfTime => Reached::AnIterate,
            ReducedStatus::StepTooSmall | ReducedStatus::TooManyIterations => Reached::Nothing,
        };
        let is_settled = status == ReducedStatus::Converged;
        out.stiffness.clear();
        if with_stiffness && is_settled {
            self.now.solver.stiffness(&mut search, &mut out.stiffness);
        }
        if is_settled
            && self.now.contacts.is_within(depth)
            && let Some(background) = &mut self.background
        {
            background.ask(&self.now.contacts, &self.now.solver.q, displacements);
        }
        let force = |f: &[f64]| {
            let is_known = f.iter().all(|x| x.is_finite());
            if is_known { [f[0], f[1], f[2]] } else { [0.0; 3] }
        };
        let Trained { solver, contacts, .. } = &self.now;
        out.coordinates.clear();
        out.coordinates.extend_from_slice(&solver.q);
        out.forces.clear();
        out.forces.extend(solver.forces.chunks_exact(3).map(force));
        out.contacts = Arc::clone(contacts);
        (out.energy, out.depth, out.status) = (solver.reduced.energy, depth, status);
        out.smallest_jacobian = solver.reduced.jacobian;
        (out.iterations, out.tangents) = (search.iterations, search.tangents);
        (out.residual, out.seconds) = (search.residual, clock.elapsed().as_secs_f64());
        Ok(())
    }
}

/// Readies a better model to continue from the present field: modes are only ever added, and the present field has no
/// part in the new ones.
fn go_on(old: &Trained, better: &mut Trained, reached: Reached, is_alone: bool) {
    better.solver.share(!is_alone);
    if reached != Reached::Nothing {
        better.solver.start(|share, q| {
            q.fill(0.0);
            q.iter_mut().zip(&old.solver.q).for_each(|(q, old)| *q = share * old);
        });
    }
}

impl Galerkin {
    /// Contacts take hold: makes basis, cells and weights. Takes some tenths of a second without snapshots, seconds
    /// with them.
    ///
    /// # Errors
    /// No contact; one off the surface; contacts that cannot be told apart; no memory for a solver.
    pub fn grasp(self: &Arc<Self>, points: &[[f64; 3]]) -> Result<HyperReducedModel, Error> {
        self.grasp_while(points, &|| true)
    }

    /// As [`Galerkin::grasp`], with a function that may cancel it.
    ///
    /// # Errors
    /// As [`Galerkin::grasp`]; [`Error::Cancelled`].
    pub fn grasp_while(
        self: &Arc<Self>,
        points: &[[f64; 3]],
        is_wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<HyperReducedModel, Error> {
        let (since, mut best) = (Instant::now(), None);
        let hand_over = &mut |trained| best = Some(trained);
        train(&mut self.contacts(points)?, since, is_wanted, hand_over)?;
        Ok(HyperReducedModel::new(best.expect("training hands over a search or an error")))
    }

    /// Contacts take hold without snapshots and can be used while a thread solves these. Better models replace the
    /// first when they are ready.
    ///
    /// # Errors
    /// As [`Galerkin::grasp`]; no thread.
    pub fn grasp_in_background(
        self: &Arc<Self>,
        points: &[[f64; 3]],
    ) -> Result<HyperReducedModel, Error> {
        let since = Instant::now();
        HyperReducedModel::in_training(self.contacts(points)?, since)
    }

    fn contacts(self: &Arc<Self>, points: &[[f64; 3]]) -> Result<ReducedContacts, Error> {
        if points.is_empty() {
            return Err(Error::input(
                "no contact; give at least one point of the touchable surface",
            ));
        }
        let contacts = points
            .iter()
            .enumerate()
            .map(|(k, &point)| self.contact(k, point))
            .collect::<Result<Vec<_>, _>>()?;
        ReducedContacts::new(Arc::clone(self), contacts)
    }

    pub(super) fn contact(&self, k: usize, point: [f64; 3]) -> Result<Contact, Error> {
        let found = self.model.locate(point).filter(|c| self.model.is_on_surface(c));
        found.ok_or_else(|| {
            Error::input(format!(
                "contact {k} at {point:?} is more than {:.4} m off the touchable surface; move it there",
                self.model.edge_length()
            ))
        })
    }
}
