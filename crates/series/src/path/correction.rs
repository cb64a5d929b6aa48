//! Newton's corrections back to equilibrium, at constant load or constant arc.

use super::{Follower, Parameter};
use crate::equilibrium::{Iteration, Limits, iterate};
use crate::error::Error;
use crate::number::{dot, norm};

/// What corrections have done.
pub(super) struct Corrected {
    /// Relative residual before the first.
    pub residual: f64,
    /// Displacement of the first [m].
    pub moved: f64,
}

impl Follower<'_> {
    /// Up to so many corrections of the state, across a direction of the path; none if they do not lead to equilibrium.
    pub(super) fn correct(
        &mut self,
        direction: &[f64],
        steps: usize,
    ) -> Result<Option<Corrected>, Error> {
        // What is left here stays in the next expansion's base state.
        let tolerance = 1e-3 * self.settings.tolerance;
        let limits = Limits { tolerance, steps, waits: false };
        let (unit, out) = (Vec::new(), Vec::new());
        let (first, moved, last) = (None, None, f64::INFINITY);
        let mut correction =
            Correction { path: self, direction, tolerance, unit, out, first, moved, last };
        iterate(&mut correction, limits)?;
        let (residual, moved) = (correction.first.unwrap_or(0.0), correction.moved.unwrap_or(0.0));
        let is_balanced = correction.last <= self.settings.tolerance;
        Ok(is_balanced.then_some(Corrected { residual, moved }))
    }
}

/// Corrections in progress.
struct Correction<'a, 'b> {
    path: &'a mut Follower<'b>,
    direction: &'a [f64],
    tolerance: f64,
    /// Dead force and pressure of load 1, and what is out of balance.
    unit: Vec<f64>,
    out: Vec<f64>,
    /// Relative residual at the start.
    first: Option<f64>,
    /// Displacement of the first step.
    moved: Option<f64>,
    /// Relative residual now.
    last: f64,
}

impl Iteration for Correction<'_, '_> {
    type Failure = Error;

    fn residual(&mut self) -> Result<f64, Error> {
        let (load, internal) = (self.path.load(), self.path.linearize());
        self.unit = self.path.unit_load();
        self.out = self.unit.iter().zip(&internal).map(|(f, i)| load * f - i).collect();
        let size = norm(&self.path.system.gather(&self.out));
        let loads = norm(&self.unit) * load.abs();
        self.last = self.path.rounding.relative(size, loads, self.tolerance);
        self.first.get_or_insert(self.last);
        Ok(self.last)
    }

    fn step(&mut self) -> Result<(), Error> {
        let Correction { path, direction, unit, .. } = self;
        let n = unit.len();
        path.system.prepare(&path.tangent, 0.0)?;
        let mut step = path.solve(&self.out)?;
        if path.settings.parameter == Parameter::ArcLength {
            let influence = path.solve(unit)?;
            let along = |v: &[f64]| path.scale * dot(v, &direction[..n]);
            let load_step = -along(&step) / (along(&influence) + direction[n]);
            step.iter_mut().zip(&influence).for_each(|(s, i)| *s += load_step * i);
            path.state[n] += load_step;
        }
        self.moved.get_or_insert_with(|| norm(&step));
        path.state[..n].iter_mut().zip(&step).for_each(|(u, s)| *u += s);
        Ok(())
    }
}
