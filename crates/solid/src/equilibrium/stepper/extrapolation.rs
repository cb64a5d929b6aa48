//! Where a frame sets out from: hands and tools mostly go on as they went, and so does the body. The motion of the last
//! frame, as far as the hands repeat theirs, leads to a place whose distance from the equilibrium is of second order in the
//! motion; Newton's step from there leaves what from the last state would take two.

use super::{Input, Stepper};
use crate::body::Body;
use crate::number::norm;

/// Part of the last motion below which a frame sets out from the last state.
const LEAST: f64 = 0.01;

/// The motion of the last frame.
#[derive(Default)]
pub(super) struct Extrapolation {
    /// Of the body [m]; empty where it is not to be continued.
    increment: Vec<f64>,
    /// Where hands and tools were at its end [m], and how far they had moved.
    hands: Vec<f64>,
    moved: Vec<f64>,
    /// Force that it has balanced [N], to first order: the right-hand sides of its linear systems, and that of the motion which
    /// it continued. Empty where the tangent is a matrix, whose product with a motion takes no time.
    balanced: Vec<f64>,
}

impl Extrapolation {
    /// The part of the last motion that hands repeat on their way to these places, between 0 and 1: the nearest multiple.
    fn part(&self, hands: &[f64]) -> f64 {
        if self.increment.is_empty() || hands.len() != self.moved.len() {
            return 0.0;
        }
        let products = hands.iter().zip(&self.hands).zip(&self.moved);
        let common: f64 = products.map(|((now, then), moved)| (now - then) * moved).sum();
        let square: f64 = self.moved.iter().map(|moved| moved * moved).sum();
        // Not a number where they have not moved: not a motion to be continued.
        let part = common / square;
        if part > LEAST { part.min(1.0) } else { 0.0 }
    }

    /// The motion goes on by the part `part`, or not at all.
    fn go_on(&mut self, part: f64) {
        self.balanced.iter_mut().for_each(|force| *force *= part);
    }

    /// Adds the right-hand side of a linear system.
    pub fn balance(&mut self, residual: &[f64]) {
        self.balanced.resize(residual.len(), 0.0);
        self.balanced.iter_mut().zip(residual).for_each(|(force, r)| *force += r);
    }

    /// Keeps a motion with hands and tools at these places at its end.
    fn keep(&mut self, hands: Vec<f64>, [from, to]: [&[f64]; 2]) {
        self.increment.clear();
        self.moved.clear();
        if hands.len() == self.hands.len() {
            self.increment.extend(to.iter().zip(from).map(|(to, from)| to - from));
            self.moved.extend(hands.iter().zip(&self.hands).map(|(now, then)| now - then));
        }
        self.hands = hands;
    }

    /// Whether hands and tools have stayed where they were.
    pub fn are_at(&self, hands: &[f64]) -> bool {
        self.hands == hands
    }

    /// The last motion is not to be continued.
    pub fn forget(&mut self) {
        self.increment.clear();
    }
}

impl Stepper {
    /// Moves the body on as in the last frame, as far as hands and tools repeat their motion, and returns that part of it.
    /// None where this would lead through a tool, a cell next to a bound, or to where the body has no energy.
    pub(super) fn extrapolate(&mut self, body: &Body, hands: &[f64]) -> f64 {
        let wanted = self.extrapolation.part(hands);
        let part = if self.move_on(body, wanted) { wanted } else { 0.0 };
        self.extrapolation.go_on(part);
        part
    }

    fn move_on(&mut self, body: &Body, part: f64) -> bool {
        if !self.settings.extrapolates || self.motion.is_some() || part == 0.0 {
            return false;
        }
        let moves = self.extrapolation.increment.iter();
        self.step.iter_mut().zip(moves).for_each(|(step, by)| *step = part * by);
        if self.contact.longest(&self.displacement, &self.step) < 1.0 {
            return false;
        }
        self.try_at(1.0);
        let energy = body.energy_within(&self.trial, self.barrier.inner());
        let is_sound = self.is_within_energies(body, energy);
        if is_sound {
            self.barrier.forget();
            std::mem::swap(&mut self.displacement, &mut self.trial);
        }
        is_sound
    }

    /// Norm of the force that the extrapolation has balanced [N]: by the tangent of its end, or as far as linear systems
    /// have told, where a product takes as long as a tangent.
    pub(super) fn extrapolated_force(&mut self) -> f64 {
        if self.ahead == 0.0 {
            return 0.0;
        }
        if self.tangent.product_part().is_some() && !self.extrapolation.balanced.is_empty() {
            self.residual.copy_from_slice(&self.extrapolation.balanced);
            self.solver.project(&mut self.residual);
            return norm(&self.residual);
        }
        let solver = &self.solver;
        let moves = self.displacement.iter().zip(&self.start).enumerate();
        self.step.iter_mut().zip(moves).for_each(|(step, (dof, (u, start)))| {
            *step = if solver.is_held(dof) { 0.0 } else { u - start };
        });
        self.tangent.multiply(&self.step, &mut self.residual);
        self.solver.project(&mut self.residual);
        norm(&self.residual)
    }

    /// Keeps the motion of the frame that ends, if hands and body are where they were to be.
    pub(super) fn keep_motion(&mut self, hands: Vec<f64>, is_whole: bool) {
        self.extrapolation.keep(hands, [&self.start, &self.displacement]);
        if !is_whole {
            self.extrapolation.forget();
        }
    }

    /// Where hands and tools are to be [m].
    pub(super) fn places_of_hands(&self, input: &Input<'_>) -> Vec<f64> {
        let means = input.means.iter().flatten();
        let arms = input.turns.iter().flat_map(|turn| turn.arms.iter().flatten());
        let places = input.values.iter().chain(means).chain(arms).copied();
        places.chain(self.contact.places()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After a motion of the hands from the origin to `moved`.
    fn after(moved: [f64; 2]) -> Extrapolation {
        let mut extrapolation = Extrapolation::default();
        extrapolation.keep(vec![0.0; 2], [&[0.0], &[0.0]]);
        extrapolation.keep(moved.to_vec(), [&[1.0], &[3.0]]);
        extrapolation
    }

    #[test]
    fn the_part_is_that_of_the_motion_which_hands_repeat() {
        let last = after([2.0, 0.0]);
        assert_eq!(last.increment, [2.0]);
        for (hands, part) in [
            ([4.0, 0.0], 1.0),
            ([3.0, 0.5], 0.5),
            ([9.0, 0.0], 1.0), // farther: not beyond what is known
            ([2.0, 0.0], 0.0), // at rest
            ([1.0, 0.0], 0.0), // back
            ([2.0, 3.0], 0.0), // across
            ([2.01, 0.0], 0.0),
        ] {
            assert_eq!(last.part(&hands), part, "{hands:?}");
        }
    }

    #[test]
    fn nothing_is_continued_where_there_is_no_motion_or_it_is_not_comparable() {
        assert_eq!(Extrapolation::default().part(&[1.0]), 0.0);
        assert_eq!(after([0.0, 0.0]).part(&[1.0, 1.0]), 0.0);
        assert_eq!(after([1.0, 0.0]).part(&[2.0]), 0.0, "another hand");
        let mut last = after([1.0, 0.0]);
        last.forget();
        assert_eq!(last.part(&[2.0, 0.0]), 0.0);
        last.keep(vec![2.0], [&[1.0], &[3.0]]);
        assert_eq!(last.part(&[3.0]), 0.0, "a hand has come or gone");
    }
}
