//! How far an expansion holds: as far as its forms agree, and its end is in equilibrium to the tolerance.
//!
//! The series of a law with a switch (fibres that bear no compression, `max` and `min` of a formula) is that of the side on
//! which each point starts. It does not know where one turns over; the residual does. Just beyond that place the expansion
//! ends, and the next begins on the other side. Where points are at their switch already, as all are at rest, no series
//! is defined, and a chord takes its place, the straight line to Newton's equilibrium a little further on.

use super::correction::Corrected;
use super::{Expansion, Follower};
use crate::error::Error;
use crate::linear::FactorError;
use crate::number::norm;
use crate::number::pade::{Pade, pade_range, taylor_range};

/// Newton's corrections at the end of an expansion, and at that of a chord, which may find many points on the other side.
const MAX_CORRECTIONS: usize = 8;
const MAX_CHORD_CORRECTIONS: usize = 30;

/// Halvings of a range before a chord takes its place, which gets farther than so short a series; and those of the
/// bisection for the last place where a series holds, and trials of a chord.
const HALVINGS: i32 = 14;
const TRIALS: usize = 34;

/// Smallest part of a chord that is tried after it.
const SHORTEST_PART: f64 = 1e-3;

/// Part of the load to be reached, to which the residual of a chord is relative at least: a law may tell its sides apart by
/// strains so small that nothing shorter gets across.
const LEAST_LOAD: f64 = 1e-3;

/// Part of the tolerance that a shortened expansion makes use of, so that it ends beyond the switch that ends it.
const USED: f64 = 0.3;

impl Follower<'_> {
    /// How far the forms of a series agree, cut where the load is reached or a cell would turn inside out.
    pub(super) fn reach(&self, series: &[Vec<f64>]) -> f64 {
        let taylor_range = taylor_range(series, self.settings.tolerance);
        let reach = if taylor_range.is_finite() {
            pade_range(series, self.settings.tolerance, taylor_range)
        } else {
            2.0 * self.settings.until / series[1][self.body.n_dofs()].abs().max(1e-12)
        };
        self.end_of_range(series, &Pade::new(series, 0), reach)
    }

    fn end_of_range(&self, series: &[Vec<f64>], pade: &Pade, reach: f64) -> f64 {
        let n = self.body.n_dofs();
        let mut range = reach;
        let is_valid = |a: f64| self.body.energy(&pade.evaluate(series, a)[..n]).is_finite();
        while range > 1e-6 * reach && !is_valid(range) {
            range *= 0.5;
        }
        let load = |a: f64| pade.evaluate(series, a)[n];
        if load(range) <= self.settings.until {
            return range;
        }
        let (mut low, mut high) = (0.0, range);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if load(middle) < self.settings.until { low = middle } else { high = middle }
        }
        high
    }

    /// The expansion that ends here, with the state at its end and in equilibrium; none if it does not hold so far. What
    /// is missing of a series without a switch may be less than its residual says, which stiff cells enlarge.
    pub(super) fn end_at(
        &mut self,
        series: &[Vec<f64>],
        range: f64,
    ) -> Result<Option<Expansion>, Error> {
        let (n, tolerance) = (self.body.n_dofs(), self.settings.tolerance);
        let pade = Pade::new(series, 0);
        let holds = self.worst(series, &pade, range) <= tolerance;
        if self.has_switch && !holds {
            return Ok(None);
        }
        self.state = pade.evaluate(series, range);
        let way: Vec<f64> = self.state[..n].iter().zip(&series[0]).map(|(u, s)| u - s).collect();
        if let Some(Corrected { residual, moved }) = self.balance(&series[1], MAX_CORRECTIONS)?
            && (holds || moved <= tolerance * norm(&way))
        {
            self.previous = Some(series[1].clone());
            let (series, taylor_range) = (series.to_vec(), taylor_range(series, tolerance));
            return Ok(Some(Expansion { series, range, taylor_range, residual, is_stable: false }));
        }
        self.state.copy_from_slice(&series[0]);
        Ok(None)
    }

    /// The larger of the residuals of a series at the end and in the middle of a range.
    fn worst(&self, series: &[Vec<f64>], pade: &Pade, range: f64) -> f64 {
        let rest = |a: f64| self.out_of_balance(&pade.evaluate(series, a), 0.0);
        let end = rest(range);
        if end > self.settings.tolerance { end } else { end.max(rest(0.5 * range)) }
    }

    /// Corrections of the state; none if they do not lead to equilibrium. They may turn a cell inside out, and a state that a
    /// switch has led astray may have no tangent that can be factorised.
    fn balance(&mut self, direction: &[f64], steps: usize) -> Result<Option<Corrected>, Error> {
        match self.correct(direction, steps) {
            Err(Error::Factor(FactorError::NotFinite { .. })) => Ok(None),
            Err(Error::Factor(_)) if self.has_switch => Ok(None),
            corrected => corrected,
        }
    }

    /// The longest range below `reach` at whose end and middle a series is in equilibrium to the tolerance.
    pub(super) fn shorter(&self, series: &[Vec<f64>], reach: f64) -> Option<f64> {
        let (pade, tolerance) = (Pade::new(series, 0), self.settings.tolerance);
        let mut lengths = (1..HALVINGS).map(|k| reach * 0.5f64.powi(k));
        let mut low = lengths.find(|&a| self.worst(series, &pade, a) <= tolerance)?;
        let mut high = 2.0 * low;
        for _ in 0..TRIALS {
            let middle = 0.5 * (low + high);
            let worst = self.worst(series, &pade, middle);
            if worst > tolerance {
                high = middle;
                continue;
            }
            low = middle;
            if worst > USED * tolerance {
                break;
            }
        }
        Some(low)
    }

    /// The straight line to Newton's equilibrium a little further along a direction, no longer than `longest`; none if
    /// there is no such equilibrium.
    pub(super) fn chord(
        &mut self,
        direction: &[f64],
        longest: f64,
    ) -> Result<Option<Expansion>, Error> {
        let (start, tolerance) = (self.state.clone(), self.settings.tolerance);
        let least = LEAST_LOAD * self.settings.until;
        let mut range = longest;
        for _ in 0..TRIALS {
            self.state = along(&start, direction, range);
            let is_balanced = self.balance(direction, MAX_CHORD_CORRECTIONS)?.is_some();
            let way = self.state.iter().zip(&start);
            let slope: Vec<f64> = way.map(|(end, start)| (end - start) / range).collect();
            let middle = self.out_of_balance(&along(&start, &slope, 0.5 * range), least);
            if is_balanced && middle <= tolerance {
                return Ok(Some(self.straight(start, slope, range)));
            }
            // What is out of balance grows with the length, or its square.
            let part = if is_balanced { USED * tolerance / middle } else { 0.25 };
            range *= part.clamp(SHORTEST_PART, 0.5);
        }
        self.state = start;
        Ok(None)
    }

    /// The expansion of a chord.
    fn straight(&mut self, start: Vec<f64>, slope: Vec<f64>, range: f64) -> Expansion {
        self.previous = Some(slope.clone());
        let none = vec![0.0; start.len()];
        let mut series = vec![start, slope];
        series.resize(self.settings.order + 1, none);
        Expansion { series, range, taylor_range: range, residual: 0.0, is_stable: false }
    }

    /// The residual of a state, relative to the load there, or to a larger one; infinite where a cell is inside out.
    fn out_of_balance(&self, state: &[f64], least_load: f64) -> f64 {
        let (u, load) = state.split_at(self.body.n_dofs());
        let mut force = vec![0.0; u.len()];
        if !self.body.internal_force(u, &mut force).is_finite() {
            return f64::INFINITY;
        }
        let mut unit = self.force.to_vec();
        self.pressure.add_force(self.body, u, 1.0, &mut unit);
        force.iter_mut().zip(&unit).for_each(|(f, unit)| *f = load[0] * unit - *f);
        let loads = norm(&unit) * load[0].abs().max(least_load);
        let rest = norm(&self.system.gather(&force));
        self.rounding.relative(rest, loads, self.settings.tolerance)
    }
}

/// `start + a direction`.
fn along(start: &[f64], direction: &[f64], a: f64) -> Vec<f64> {
    start.iter().zip(direction).map(|(start, by)| start + a * by).collect()
}
