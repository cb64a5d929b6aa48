//! The linear systems of equilibrium behind one interface: a tangent `K` on the degrees of freedom that nothing
//! holds, bordered by the prescribed means of patches,
//!   K s - W^T F = b,   W s = c,
//! by sparse Cholesky, by `L D Lᵀ` or by conjugate gradients; a factor serves many right-hand sides at once. Fixed degrees of freedom are left out once and for all; what hands
//! hold may change at any time.

mod automatic;
mod border;
mod conjugate_gradients;
mod device;
mod direct;
mod factor;
mod indefinite;
mod iterative;
mod lagged;
mod local_correction;
mod method;
mod numbered;
mod operand;
#[cfg(test)]
mod tests;

use super::tangent::Tangent;
use crate::body::{Body, Curvature};
use crate::clock::Instant;
use crate::error::Error;
use crate::linear::FactorError;
use crate::mesh::Patch;
pub use automatic::{Choice, NegativeCurvature, waves};
use border::Border;
pub use border::{Row, mean_rows};
pub use conjugate_gradients::{ConjugateGradients, Preconditioner};
use device::Remote;
pub use device::{
    Device, DeviceEnd, DeviceSeries, DeviceSolution, DeviceSystem, DeviceTangent, OnDevice, Origin,
    SERIES_LANES, Until,
};
use direct::{Direct, Excluded};
use factor::TangentFactor;
use indefinite::Indefinite;
pub use method::Method;
use numbered::Numbered;

/// First shift of a tangent that is not positive definite, over its mean diagonal, to make a preconditioner of it.
const FIRST_SHIFT: f64 = 1e-4;

/// How a solve went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solved {
    /// Iterations of conjugate gradients; 0 for a direct solve.
    pub iterations: usize,
    /// `|b - K s + W^T F| / |b|`; 0 for a direct solve.
    pub residual: f64,
    /// Whether the tolerance was reached within the budget.
    pub is_complete: bool,
    /// Degree of freedom that moves most in a direction of negative curvature, where one was met: the tangent is
    /// not positive definite, and the step is the descent made before.
    pub indefinite: Option<usize>,
    /// Residual that single precision alone would leave; 0 in double precision.
    pub floor: f64,
}

/// The constrained linear system of one body's tangents.
pub struct ConstrainedSystem {
    /// Degrees of freedom that are not fixed, ascending, and the row of each among them.
    free: Vec<u32>,
    rows: Vec<Option<u32>>,
    is_held: Vec<bool>,
    border: Border,
    solver: Solver,
}

enum Solver {
    Direct(Box<Direct>),
    Indefinite(Box<Indefinite>),
    Iterative(Box<Numbered>),
}

impl ConstrainedSystem {
    /// For the tangents of a body; the `fixed` degrees of freedom never move.
    ///
    /// # Errors
    /// Settings out of range; a pattern the solver refuses.
    pub fn new(
        method: Method,
        body: &Body,
        fixed: impl Iterator<Item = u32>,
        patches: Vec<Patch>,
    ) -> Result<Self, Error> {
        method.check()?;
        let n_dofs = body.n_dofs();
        let mut is_held = vec![false; n_dofs];
        fixed.for_each(|dof| is_held[dof as usize] = true);
        let free: Vec<u32> = (0..n_dofs as u32).filter(|&d| !is_held[d as usize]).collect();
        let mut rows = vec![None; n_dofs];
        (0..).zip(&free).for_each(|(row, &dof)| rows[dof as usize] = Some(row));
        let solver = match method {
            Method::Cholesky => {
                Solver::Direct(Box::new(Direct::new(TangentFactor::new(body.pattern(), &free)?)))
            }
            Method::Ldlt => Solver::Indefinite(Box::new(Indefinite::new(body.pattern(), &free)?)),
            Method::ConjugateGradients(settings) => {
                Solver::Iterative(Box::new(Numbered::new(settings, body, &free)?))
            }
            Method::Automatic => {
                return Err(Error::input(
                    "\"auto\" chooses a solver for a whole solution; frames take \"cholesky\", \"cg\", \"multigrid\" or \"gpu\"",
                ));
            }
        };
        let border = Border::new(Vec::new(), n_dofs);
        let mut system = ConstrainedSystem { free, rows, is_held, border, solver };
        system.hold(&[], mean_rows(&patches));
        Ok(system)
    }

    /// For frames: conjugate gradients follow their motion, and renew their factor while the last one stays in use, since
    /// frames may not wait for it. On a second thread, where there is one, how many frames that takes is not the same from
    /// run to run.
    pub fn for_frames(mut self) -> Self {
        if let Solver::Iterative(iterative) = &mut self.solver {
            iterative.serve_frames();
        }
        self
    }

    /// The next system is the first of a frame: conjugate gradients set out from those that came first in the last ones, and
    /// may leave a residual of the norm `enough` [N]; of the first system also the tolerance times `balanced`, the norm of the
    /// force [N] that the extrapolated motion has balanced before.
    pub fn begin_frame(&mut self, enough: f64, balanced: f64) {
        if let Solver::Iterative(iterative) = &mut self.solver {
            iterative.begin_frame(enough, balanced);
        }
    }

    /// The factorised tangent of a stable state `u`, `fixed` nodes held: for many right-hand sides.
    ///
    /// # Errors
    /// A tangent that is not positive definite; a pattern the solver refuses.
    pub fn at(body: &Body, u: &[f64], fixed: &[u32]) -> Result<Self, Error> {
        let mut tangent = Tangent::matrix(body);
        tangent.linearize(body, u, Curvature::Exact, &mut vec![0.0; u.len()]);
        let mut system = Self::new(Method::Cholesky, body, dofs_of(fixed), Vec::new())?;
        system.prepare(&tangent, 0.0)?;
        Ok(system)
    }

    /// Holds `dofs`, beside the fixed ones, and prescribes `W s` for these rows of `W`, until the next call.
    pub fn hold(&mut self, dofs: &[u32], rows: Vec<Row>) {
        self.is_held.iter_mut().zip(&self.rows).for_each(|(held, row)| *held = row.is_none());
        dofs.iter().for_each(|&dof| self.is_held[dof as usize] = true);
        match &mut self.solver {
            Solver::Direct(direct) => direct.hold(&self.is_held),
            Solver::Indefinite(_) => {}
            Solver::Iterative(iterative) => iterative.hold(&self.is_held),
        }
        self.bind(rows);
    }

    /// Prescribes `W s` for these rows of `W` in place of those before; what is held stays so.
    pub fn bind(&mut self, mut rows: Vec<Row>) {
        rows.iter_mut().for_each(|row| row.retain(|&(dof, _)| !self.is_held[dof as usize]));
        if let Solver::Iterative(iterative) = &mut self.solver {
            iterative.bind(rows.clone());
        }
        self.border = Border::new(rows, self.is_held.len());
    }

    /// The rows that patches add, without what is held.
    pub fn rows(&self) -> &[Row] {
        self.border.rows()
    }

    /// Whether a degree of freedom is fixed or held.
    pub fn is_held(&self, dof: usize) -> bool {
        self.is_held[dof]
    }

    /// Why the requested device is not used, if it is not.
    pub fn device_fault(&self) -> Option<&str> {
        self.remote().and_then(Remote::fault)
    }

    /// Where the last tangent on the requested device came from; none without a device.
    pub fn origin(&self) -> Option<Origin> {
        self.remote().and_then(Remote::origin)
    }

    /// Whether a device forms the matrix of tangents that are left to it.
    pub fn forms_tangents(&self) -> bool {
        self.remote().is_some_and(Remote::can_form)
    }

    fn remote(&self) -> Option<&Remote> {
        match &self.solver {
            Solver::Direct(_) | Solver::Indefinite(_) => None,
            Solver::Iterative(iterative) => Some(iterative.remote()),
        }
    }

    /// Tells where the tangent that is prepared next was made: at a displacement of the body.
    pub fn move_to(&mut self, body: &Body, u: &[f64]) {
        if let Solver::Iterative(iterative) = &mut self.solver {
            iterative.move_to(body, u);
        }
    }

    /// Turns a force into a residual: zeroes held entries, and removes the part that the patches' tools carry.
    pub fn project(&self, residual: &mut [f64]) {
        for (r, &held) in residual.iter_mut().zip(&self.is_held) {
            *r = if held { 0.0 } else { *r };
        }
        self.border.project(residual);
    }

    /// The forces of the patches' tools that balance a residual best [N]; zero on what is held.
    pub fn patch_forces(&self, residual: &[f64]) -> Vec<f64> {
        self.border.forces(residual)
    }

    /// Prepares solves with `K + shift * mean(diag K) * I`; the tangent is one that [`Method::tangent`] made.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`] with the degree of freedom as its row: the tangent is not positive definite
    /// on the steps that leave the means of the patches alone, and the state not stable; other factorisation errors.
    pub fn prepare(&mut self, tangent: &Tangent, shift: f64) -> Result<(), FactorError> {
        let ConstrainedSystem { free, is_held, border, .. } = self;
        match &mut self.solver {
            Solver::Direct(direct) => {
                let tangent = tangent.blocks()?;
                let shift = absolute(shift, || tangent.mean_diagonal());
                direct.prepare(tangent, shift, Excluded { free, is_held }, border)
            }
            Solver::Indefinite(factor) => {
                let tangent = tangent.blocks()?;
                let shift = absolute(shift, || tangent.mean_diagonal());
                factor.factorize(tangent.values(), shift, is_held)?;
                border.influence(|b, x| factor.solve(free, b, x))
            }
            Solver::Iterative(iterative) => iterative.prepare(tangent, shift),
        }
    }

    /// A degree of freedom in which the tangent is not positive definite under what holds it; none if it is, as far as the
    /// method can tell: a factor counts signs, conjugate gradients meet a direction of negative curvature on their way to
    /// the answer to a random load, or do not within their budget.
    ///
    /// # Errors
    /// Those of [`prepare`](Self::prepare) and [`solve`](Self::solve), but for a pivot, which is the answer.
    pub fn find_instability(
        &mut self,
        tangent: &Tangent,
        until: Until<'_>,
    ) -> Result<Option<usize>, FactorError> {
        match self.prepare(tangent, 0.0) {
            Err(FactorError::NotPositiveDefinite { row } | FactorError::Singular { row }) => {
                return Ok(Some(row));
            }
            prepared => prepared?,
        }
        if !matches!(self.solver, Solver::Iterative(_)) {
            return Ok(None);
        }
        let mut step = vec![0.0; self.is_held.len()];
        let (mut load, mut forces) = (random_load(step.len()), Vec::new());
        let still = self.border.zeros();
        Ok(self.solve_until(&mut load, &still, &mut step, &mut forces, until)?.indefinite)
    }

    /// Solves for the step `s` (held degrees of freedom stay zero) and the change of the patch forces, `b` being
    /// the force on all degrees of freedom, `c` the change of the patch means. At the `deadline` an iterative
    /// solver stops with what it has.
    ///
    /// # Errors
    /// Values that are not finite; no matrix prepared.
    pub fn solve(
        &mut self,
        b: &mut [f64],
        c: &[f64],
        step: &mut [f64],
        forces: &mut Vec<f64>,
        deadline: Option<Instant>,
    ) -> Result<Solved, FactorError> {
        self.solve_until(b, c, step, forces, Until::time(deadline))
    }

    /// As [`solve`](Self::solve), which a device also leaves where it is not wanted any more.
    ///
    /// # Errors
    /// Those of [`solve`](Self::solve).
    pub fn solve_until(
        &mut self,
        b: &mut [f64],
        c: &[f64],
        step: &mut [f64],
        forces: &mut Vec<f64>,
        until: Until<'_>,
    ) -> Result<Solved, FactorError> {
        for (b, &held) in b.iter_mut().zip(&self.is_held) {
            *b = if held { 0.0 } else { *b };
        }
        step.fill(0.0);
        let direct = Solved { is_complete: true, ..Solved::default() };
        let solved = match &mut self.solver {
            Solver::Direct(factor) => factor.solve(&self.free, b, step).map(|()| direct)?,
            Solver::Indefinite(factor) => factor.solve(&self.free, b, step).map(|()| direct)?,
            Solver::Iterative(iterative) => iterative.solve(b, c, step, forces, until)?,
        };
        if !matches!(self.solver, Solver::Iterative(_)) {
            self.border.close(step, c, forces);
        }
        match step.iter().position(|s| !s.is_finite()) {
            Some(row) => Err(FactorError::SolutionNotFinite { row, column: 0 }),
            None => Ok(solved),
        }
    }

    /// Conjugate gradients solve to this residual from now on, relative to the right-hand side; a factor is exact anyway.
    pub fn set_tolerance(&mut self, tolerance: f64) {
        if let Solver::Iterative(iterative) = &mut self.solver {
            iterative.set_tolerance(tolerance);
        }
    }

    /// The step by which a further force changes the last one, the means of the patches staying where they are: conjugate
    /// gradients leave part of the force unanswered. Returns their iterations.
    ///
    /// # Errors
    /// Those of [`solve`](Self::solve).
    pub fn respond(
        &mut self,
        b: &[f64],
        step: &mut [f64],
        deadline: Option<Instant>,
    ) -> Result<usize, FactorError> {
        let mut b = b.to_vec();
        b.iter_mut().zip(&self.is_held).for_each(|(b, &held)| *b = if held { 0.0 } else { *b });
        if let Solver::Iterative(iterative) = &mut self.solver {
            return iterative.respond(&b, step, deadline);
        }
        let still = self.border.zeros();
        self.solve(&mut b, &still, step, &mut Vec::new(), deadline).map(|_| 0)
    }

    /// Number of negative eigenvalues of the tangent prepared last, the patches left out; none unless the method is
    /// [`Method::Ldlt`].
    pub fn n_negative(&self) -> Option<usize> {
        match &self.solver {
            Solver::Indefinite(factor) => factor.n_negative(),
            Solver::Direct(_) | Solver::Iterative(_) => None,
        }
    }

    /// Whether conjugate gradients meet no negative curvature on the way to a residual of `tolerance` for this force,
    /// which should hold something of every motion; none if they did not get there.
    pub fn is_definite_along(
        &mut self,
        force: &[f64],
        tolerance: f64,
        until: Until<'_>,
    ) -> Option<bool> {
        let Solver::Iterative(iterative) = &mut self.solver else { return None };
        let mut b: Vec<f64> = force.to_vec();
        b.iter_mut().zip(&self.is_held).for_each(|(b, &held)| *b = if held { 0.0 } else { *b });
        let solved = iterative.probe(&b, tolerance, until).ok()?;
        (solved.is_complete || solved.indefinite.is_some()).then_some(solved.indefinite.is_none())
    }

    /// `K⁻¹` in place, the patches left out: for columns on the free degrees of freedom, one after the other. Any number
    /// of threads may solve with one factor at once.
    ///
    /// # Errors
    /// Values that are not finite; no factor prepared, or a method that makes none.
    pub fn solve_columns(&self, columns: &mut [f64]) -> Result<(), FactorError> {
        match &self.solver {
            Solver::Direct(factor) => factor.solve_columns(columns),
            Solver::Indefinite(factor) => factor.solve_columns(columns),
            Solver::Iterative(_) => Err(FactorError::NotFactorized),
        }
    }

    /// Number of free degrees of freedom.
    pub fn n_free(&self) -> usize {
        self.free.len()
    }

    /// The free degrees of freedom, ascending.
    pub fn free(&self) -> &[u32] {
        &self.free
    }

    /// The row of a degree of freedom, if it is free.
    pub fn row_of(&self, dof: usize) -> Option<usize> {
        self.rows[dof].map(|row| row as usize)
    }

    /// The entries of the means of a patch, `sum_i w_i u_i`: row of a free degree of freedom, component, weight.
    pub fn weights_of<'a>(
        &'a self,
        patch: &'a Patch,
    ) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
        let entries = patch.nodes.iter().zip(&patch.weights);
        entries.flat_map(move |(&node, &w)| {
            (0..3).filter_map(move |i| Some((self.row_of(3 * node as usize + i)?, i, w)))
        })
    }

    /// The entries of a vector at the free degrees of freedom.
    pub fn gather(&self, all: &[f64]) -> Vec<f64> {
        self.free.iter().map(|&dof| all[dof as usize]).collect()
    }

    /// A vector on the free degrees of freedom as one on all, zero where it is fixed.
    pub fn scatter(&self, free: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.rows.len()];
        self.free.iter().zip(free).for_each(|(&dof, u)| all[dof as usize] = *u);
        all
    }
}

/// The degrees of freedom of some nodes.
pub fn dofs_of(nodes: &[u32]) -> impl Iterator<Item = u32> + '_ {
    nodes.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i))
}

/// Pseudo-random numbers between -1 and 1, the same at every call: SplitMix64 (Steele, Lea and Flood, 2014).
fn random_load(n: usize) -> Vec<f64> {
    let number = |i: u64| {
        let mut z = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / 2f64.powi(63) - 1.0
    };
    (1..=n as u64).map(number).collect()
}

/// A shift given over the mean of a tangent's diagonal.
fn absolute(shift: f64, mean_diagonal: impl FnOnce() -> f64) -> f64 {
    if shift > 0.0 { shift * mean_diagonal() } else { 0.0 }
}
