//! A search that depends on no earlier one: from the best start, and where that fails up from rest in load steps.

use super::newton::{ReducedNewton, ReducedStatus, Search};

/// Share of the displacements in the first load step.
const FIRST: f64 = 0.25;
/// The smallest share; a search that fails with it has no way up.
const SMALLEST: f64 = 1.0 / 64.0;

impl ReducedNewton {
    /// Looks for the equilibrium under `A q = d` from the best start, then in load steps.
    pub fn find(
        &mut self,
        d: &[f64],
        guess: impl FnMut(f64, &mut [f64]),
        search: &mut Search,
    ) -> ReducedStatus {
        self.start_at(d, guess);
        match self.solve(d, search) {
            ReducedStatus::StepTooSmall | ReducedStatus::TooManyIterations => self.climb(d, search),
            ended => ended,
        }
    }

    /// Goes from rest to `A q = d` in load steps, which a search that fails halves. After a failure, the coordinates
    /// are those of the last that was reached.
    fn climb(&mut self, d: &[f64], search: &mut Search) -> ReducedStatus {
        let mut means = std::mem::take(&mut self.step_means);
        let mut reached = std::mem::take(&mut self.reached);
        reached.fill(0.0);
        let (mut share, mut step) = (0.0, FIRST);
        let status = loop {
            self.start(|_, q| q.copy_from_slice(&reached));
            let next = f64::min(share + step, 1.0);
            means.iter_mut().zip(d).for_each(|(mean, d)| *mean = next * d);
            match self.solve(&means, search) {
                ReducedStatus::Converged if next == 1.0 => break ReducedStatus::Converged,
                ReducedStatus::Converged => {
                    reached.copy_from_slice(&self.q);
                    share = next;
                }
                ReducedStatus::OutOfTime => break ReducedStatus::OutOfTime,
                failed if step <= SMALLEST => {
                    self.start(|_, q| q.copy_from_slice(&reached));
                    break failed;
                }
                _ => step *= 0.5,
            }
        };
        (self.step_means, self.reached) = (means, reached);
        status
    }
}
