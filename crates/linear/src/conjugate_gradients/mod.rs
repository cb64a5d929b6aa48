//! Preconditioned conjugate gradients for positive definite systems, matrix-free, without allocation.
//!
//! Where it differs from the textbook: it starts from the caller's guess; the residual that ends it is computed
//! anew from the solution, not carried by the recurrence; and every failure leaves the last iterate in `x`.

mod block_jacobi;
mod error;
mod incomplete_cholesky;
#[cfg(test)]
mod tests;
mod vectors;

use super::Pattern;
use crate::clock::Instant;
use vectors::{advance, dot, norm, turn};

pub use block_jacobi::BlockJacobi;
pub use error::Error;
pub use incomplete_cholesky::IncompleteCholesky;

/// A symmetric linear map.
pub trait Operator {
    /// Number of rows.
    fn n(&self) -> usize;

    /// `y = A x`.
    fn apply(&self, x: &[f64], y: &mut [f64]);
}

/// An approximate inverse, symmetric and positive definite.
pub trait Preconditioner {
    /// Number of rows.
    fn n(&self) -> usize;

    /// `z = M⁻¹ r`.
    fn apply(&mut self, r: &[f64], z: &mut [f64]);
}

/// The symmetric matrix with `values` on `pattern`.
#[derive(Clone, Copy)]
pub struct Matrix<'a> {
    /// Where the entries of the upper triangle are.
    pub pattern: &'a Pattern,
    /// The entries, parallel to [`Pattern::row`].
    pub values: &'a [f64],
}

impl Operator for Matrix<'_> {
    fn n(&self) -> usize {
        self.pattern.n
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        self.pattern.multiply(self.values, x, y);
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Residual to reach, `|b - A x| <= relative_tolerance |b|`; default 1e-8.
    pub relative_tolerance: f64,
    /// Budget of iterations, each one product with the operator; default 1000.
    pub max_iterations: usize,
    /// Iterations made once the first one is, however small its residual; default 1. A small residual may leave much of the
    /// softest motion, of which a preconditioner of few digits gives a first share only.
    pub least_iterations: usize,
    /// Time at which to stop with what there is; default none.
    pub deadline: Option<Instant>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { relative_tolerance: 1e-8, max_iterations: 1000, least_iterations: 1, deadline: None }
    }
}

/// How a solve went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Info {
    /// Iterations used.
    pub iterations: usize,
    /// `|b - A x| / |b|` of the iterate returned.
    pub relative_residual: f64,
}

/// The vectors of an iteration, made once and used for any number of solves.
#[derive(Clone, Debug)]
pub struct Workspace {
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
}

impl Workspace {
    /// Room for systems of `n` rows.
    pub fn new(n: usize) -> Self {
        let zeros = vec![0.0; n];
        Self {
            residual: zeros.clone(),
            preconditioned: zeros.clone(),
            direction: zeros.clone(),
            image: zeros,
        }
    }

    /// The direction of the last iteration: where an indefinite operator has its negative curvature.
    pub fn direction(&self) -> &[f64] {
        &self.direction
    }

    /// Sets out from `x` afresh: computes the residual and returns its norm.
    fn restart(&mut self, operator: &(impl Operator + ?Sized), b: &[f64], x: &[f64]) -> f64 {
        if x.iter().all(|&x| x == 0.0) {
            self.residual.copy_from_slice(b);
        } else {
            operator.apply(x, &mut self.residual);
            self.residual.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        }
        self.direction.fill(0.0);
        norm(&self.residual)
    }
}

/// Solves `A x = b` from the guess in `x`.
///
/// # Errors
/// Every [`Error`] but the first two leaves the last iterate in `x`; [`Error::BudgetSpent`] says how good it is.
pub fn solve(
    x: &mut [f64],
    operator: &(impl Operator + ?Sized),
    preconditioner: &mut (impl Preconditioner + ?Sized),
    b: &[f64],
    settings: &Settings,
    workspace: &mut Workspace,
) -> Result<Info, Error> {
    let mut solve = Solve::begin(x, operator, preconditioner, b, settings, workspace)?;
    solve.iterate(x, operator, preconditioner, b, workspace, None)?;
    Ok(solve.info)
}

/// A solve in progress: it may pause between iterations and go on with the same vectors, to the same result.
#[derive(Clone, Copy, Debug)]
pub struct Solve {
    settings: Settings,
    info: Info,
    /// Norms of the right-hand side and of the residual, and `rᵀ M⁻¹ r` of the last iteration.
    scale: f64,
    residual: f64,
    energy: f64,
    /// Whether the residual is to be computed from the solution, and the directions begin anew.
    restarts: bool,
}

impl Solve {
    /// A solve of `A x = b` from the guess in `x`, without an iteration yet.
    ///
    /// # Errors
    /// A tolerance that is not positive, lengths that differ, values that are not finite.
    pub fn begin(
        x: &mut [f64],
        operator: &(impl Operator + ?Sized),
        preconditioner: &(impl Preconditioner + ?Sized),
        b: &[f64],
        settings: &Settings,
        workspace: &Workspace,
    ) -> Result<Self, Error> {
        check_settings(settings)?;
        let n = operator.n();
        Error::expect_length("x", n, x.len())?;
        Error::expect_length("b", n, b.len())?;
        Error::expect_length("preconditioner", n, preconditioner.n())?;
        Error::expect_length("workspace", n, workspace.residual.len())?;
        if x.iter().chain(b).any(|value| !value.is_finite()) {
            return Err(Error::NotFinite { iterations: 0 });
        }
        let scale = norm(b);
        if scale == 0.0 {
            x.fill(0.0);
        }
        let info = Info::default();
        let energy = f64::INFINITY;
        Ok(Solve { settings: *settings, info, scale, residual: 0.0, energy, restarts: true })
    }

    /// How it goes so far.
    pub fn info(&self) -> Info {
        self.info
    }

    /// Goes on until it ends, or until the first iteration that ends after `pause`; returns whether it has ended. The deadline
    /// leaves at least one iteration, so that there is always a step.
    ///
    /// # Errors
    /// Those of [`solve`].
    pub fn iterate(
        &mut self,
        x: &mut [f64],
        operator: &(impl Operator + ?Sized),
        preconditioner: &mut (impl Preconditioner + ?Sized),
        b: &[f64],
        workspace: &mut Workspace,
        pause: Option<Instant>,
    ) -> Result<bool, Error> {
        let is_past = |time: Option<Instant>| time.is_some_and(|time| Instant::now() >= time);
        let Settings { max_iterations, deadline, .. } = self.settings;
        loop {
            if self.scale == 0.0 || self.restarts && self.restart(x, operator, b, workspace)? {
                return Ok(true);
            }
            // The recurrence drifts from the true residual by rounding only, so that more than one round is rare.
            while self.goes_on() {
                let Info { iterations, .. } = self.info;
                if iterations == max_iterations || iterations > 0 && is_past(deadline) {
                    if self.is_solved() {
                        break;
                    }
                    return Err(Error::BudgetSpent(self.info));
                }
                let energy = &mut self.energy;
                self.residual = step(x, operator, preconditioner, energy, iterations, workspace)?;
                self.info.iterations += 1;
                self.info.relative_residual = self.residual / self.scale;
                if is_past(pause) {
                    return Ok(false);
                }
            }
            self.restarts = true;
        }
    }

    /// Whether the residual is as small as was asked for.
    fn is_solved(&self) -> bool {
        self.residual <= self.settings.relative_tolerance * self.scale
    }

    /// Whether another iteration is due, if the budget allows it.
    fn goes_on(&self) -> bool {
        let are_enough = self.info.iterations >= self.settings.least_iterations;
        self.residual > 0.0 && !(are_enough && self.is_solved())
    }

    /// Computes the residual from the solution; returns whether that is solved.
    fn restart(
        &mut self,
        x: &[f64],
        operator: &(impl Operator + ?Sized),
        b: &[f64],
        workspace: &mut Workspace,
    ) -> Result<bool, Error> {
        self.residual = workspace.restart(operator, b, x);
        (self.energy, self.restarts) = (f64::INFINITY, false);
        self.info.relative_residual = self.residual / self.scale;
        if !self.info.relative_residual.is_finite() {
            return Err(Error::NotFinite { iterations: self.info.iterations });
        }
        Ok(self.info.relative_residual <= self.settings.relative_tolerance)
    }
}

/// One iteration; `energy` is `rᵀ M⁻¹ r` of the step before. Returns the norm of the new residual.
fn step(
    x: &mut [f64],
    operator: &(impl Operator + ?Sized),
    preconditioner: &mut (impl Preconditioner + ?Sized),
    energy: &mut f64,
    iterations: usize,
    workspace: &mut Workspace,
) -> Result<f64, Error> {
    let Workspace { residual, preconditioned, direction, image } = workspace;
    preconditioner.apply(residual, preconditioned);
    let previous = std::mem::replace(energy, dot(residual, preconditioned));
    if *energy <= 0.0 {
        return Err(Error::IndefinitePreconditioner { iterations });
    }
    turn(direction, preconditioned, *energy / previous);
    operator.apply(direction, image);
    let curvature = dot(direction, image);
    if !(curvature.is_finite() && energy.is_finite()) {
        return Err(Error::NotFinite { iterations });
    }
    if curvature <= 0.0 {
        return Err(Error::IndefiniteOperator {
            iterations,
            curvature: curvature / dot(direction, direction),
        });
    }
    let length = *energy / curvature;
    advance(x, length, direction);
    advance(residual, -length, image);
    Ok(norm(residual))
}

fn check_settings(&Settings { relative_tolerance, .. }: &Settings) -> Result<(), Error> {
    let is_valid = relative_tolerance > 0.0 && relative_tolerance.is_finite();
    if is_valid { Ok(()) } else { Err(Error::InvalidTolerance { relative_tolerance }) }
}
