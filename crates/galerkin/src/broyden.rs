//! Broyden's updates: corrections of a factorised tangent from the steps taken since.
//!
//! A step `s` by an approximate tangent `B` ought to leave no residual; the step `z` that it would still take from where
//! it got to tells how wrong `B` was along `s`. Broyden's update, of least change, has the inverse
//!   B+^-1 = (1 + w s^T / s.s) B^-1,   w = z / (1 - s.z / s.s)
//! (C. G. Broyden, Math. Comp. 19 (1965) 577; C. T. Kelley, Iterative methods, SIAM 1995, section 7.3), so an
//! update is two vectors. It holds whatever is asked of the contacts next, since that enters the residual linearly.

use crate::number::dot;

/// Largest number of updates; then they are discarded.
const MOST: usize = 40;
/// An update that would lengthen steps by more than the inverse of this is skipped.
const SMALLEST: f64 = 0.1;

/// `w` and `s / s.s` of each update.
#[derive(Clone)]
pub(super) struct BroydenUpdates {
    r: usize,
    pairs: Vec<f64>,
}

impl BroydenUpdates {
    /// No updates yet, with memory for steps of `r` coordinates.
    pub fn new(r: usize) -> Self {
        BroydenUpdates { r, pairs: Vec::with_capacity(2 * r * MOST) }
    }

    /// Discards all updates.
    pub fn forget(&mut self) {
        self.pairs.clear();
    }

    /// Turns the step of the factorised tangent into that of the updated one.
    pub fn correct(&self, step: &mut [f64]) {
        for pair in self.pairs.chunks_exact(2 * self.r) {
            let (w, s) = pair.split_at(self.r);
            let part = dot(s, step);
            step.iter_mut().zip(w).for_each(|(x, w)| *x += part * w);
        }
    }

    /// Adds the update for a `step` that was taken in full and is followed by `next`, and turns `next` into the step of
    /// the updated tangent.
    pub fn update(&mut self, step: &[f64], next: &mut [f64]) {
        let square = dot(step, step);
        let share = 1.0 - dot(step, next) / square;
        // Written so that what is not a number is left out.
        if !(share > SMALLEST) {
            return;
        }
        next.iter_mut().for_each(|x| *x /= share);
        if self.pairs.len() == 2 * self.r * MOST {
            self.forget();
        }
        self.pairs.extend_from_slice(next);
        self.pairs.extend(step.iter().map(|s| s / square));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::samples::noise;
    use crate::number::norm;

    /// `x` after so many steps towards the root of `A x - b`, with the identity for `A`.
    fn residual_after(steps: usize, with_updates: bool) -> f64 {
        let (r, noise) = (6, noise(42, 7));
        let residual = |x: &[f64]| -> Vec<f64> {
            let row = |i: usize| x[i] + 0.3 * dot(&noise[i * r..(i + 1) * r], x) - noise[36 + i];
            (0..r).map(row).collect()
        };
        let (mut updates, mut x, mut last) = (BroydenUpdates::new(r), vec![0.0; r], None);
        for _ in 0..steps {
            let mut step: Vec<f64> = residual(&x).iter().map(|f| -f).collect();
            updates.correct(&mut step);
            if let Some(last) = last.as_deref().filter(|_| with_updates) {
                updates.update(last, &mut step);
            }
            x.iter_mut().zip(&step).for_each(|(x, s)| *x += s);
            last = Some(step);
        }
        norm(&residual(&x))
    }

    #[test]
    fn a_linear_system_is_solved_in_twice_as_many_steps_as_it_has_rows() {
        assert!(residual_after(12, true) < 1e-12, "Gay, SIAM J. Numer. Anal. 16 (1979) 623");
        assert!(residual_after(12, false) > 1e-6, "the tangent alone does not get there");
    }

    #[test]
    fn a_step_that_leads_nowhere_teaches_nothing() {
        let mut updates = BroydenUpdates::new(2);
        for next in [[1.0, 0.0], [f64::NAN, 0.0]] {
            let mut same = next;
            updates.update(&[1.0, 0.0], &mut same);
            let mut step = [1.0, 2.0];
            updates.correct(&mut step);
            assert_eq!(step, [1.0, 2.0]);
        }
    }
}
