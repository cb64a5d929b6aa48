//! Direct solves. A positive definite tangent has a Cholesky factor. One that is not may still be positive definite on
//! all steps that leave the means of the patches alone, `W s = 0`, and no other steps are possible where tools hold them:
//! it is so exactly if `K` has as many negative eigenvalues as the compliance `W K⁻¹ Wᵀ` of the patches, by the inertia
//! of the bordered matrix (Haynsworth, Linear Algebra Appl. 1, 1968, 73). `L D Lᵀ` counts those of `K`, and solves; it
//! goes on from the pivot at which Cholesky's method stopped.

use super::border::Border;
use super::factor::TangentFactor;
use super::indefinite::Indefinite;
use crate::body::SymmetricBlocks;
use crate::linear::FactorError;

/// Shifts of an indefinite tangent, over its mean diagonal, by which a factor without pivoting gets past a pivot that
/// vanishes: too small to be seen in a step.
const NUDGES: [f64; 3] = [0.0, 1e-10, 1e-8];

/// A factor of the tangent, by Cholesky's method if it exists.
pub(super) struct Direct {
    cholesky: TangentFactor<f64>,
    /// Analysed when it is first needed.
    indefinite: Option<Box<Indefinite>>,
    is_definite: bool,
}

/// The degrees of freedom that are excluded: those that are not `free`, and those that hands hold.
#[derive(Clone, Copy)]
pub(super) struct Excluded<'a> {
    pub free: &'a [u32],
    pub is_held: &'a [bool],
}

impl Direct {
    /// With a factor for the tangents of a body.
    pub fn new(cholesky: TangentFactor<f64>) -> Self {
        Direct { cholesky, indefinite: None, is_definite: true }
    }

    /// Chooses the degrees of freedom that are held from the next factor on.
    pub fn hold(&mut self, is_held: &[bool]) {
        self.cholesky.hold(is_held);
    }

    /// Factorises the tangent with `shift` added to its diagonal, and renews the border.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`] or [`FactorError::Singular`] where it is not positive definite on the steps
    /// that the border leaves; other factorisation errors.
    pub fn prepare(
        &mut self,
        tangent: &SymmetricBlocks,
        shift: f64,
        excluded: Excluded<'_>,
        border: &mut Border,
    ) -> Result<(), FactorError> {
        let factorized = self.cholesky.factorize(tangent.values(), shift);
        self.is_definite = factorized.is_ok();
        match factorized {
            Ok(()) => border.influence_of_all(|columns, n| self.cholesky.solve_each(columns, n)),
            Err(error) if error.is_of_a_pivot() && !border.is_empty() => {
                self.prepare_indefinite(tangent, shift, excluded, border, error)
            }
            Err(error) => Err(error),
        }
    }

    /// The same by `L D Lᵀ`, which goes on where Cholesky's method ended; returns `verdict` if the border does not compensate the negative eigenvalues.
    fn prepare_indefinite(
        &mut self,
        tangent: &SymmetricBlocks,
        shift: f64,
        Excluded { free, is_held }: Excluded<'_>,
        border: &mut Border,
        verdict: FactorError,
    ) -> Result<(), FactorError> {
        if self.indefinite.is_none() {
            self.indefinite = Some(Box::new(Indefinite::new(tangent.pattern(), free)?));
        }
        let Some(indefinite) = &mut self.indefinite else { return Err(verdict) };
        for nudge in NUDGES {
            let modes = if nudge == 0.0 {
                indefinite.go_on(&mut self.cholesky)
            } else {
                let nudged = shift + nudge * tangent.mean_diagonal();
                indefinite.factorize(tangent.values(), nudged, is_held)
            };
            let renewed = modes.and_then(|negative| {
                border.influence(|b, x| indefinite.solve(free, b, x)).map(|()| negative)
            });
            match renewed {
                Ok(negative) if border.n_negative() == Some(negative) => return Ok(()),
                Ok(_) => return Err(verdict),
                // Another nudge.
                Err(_) => {}
            }
        }
        Err(verdict)
    }

    /// `x = K⁻¹ b` on the free degrees of freedom; where `b` is zero on what is held, so is `x`.
    pub fn solve(&mut self, free: &[u32], b: &[f64], x: &mut [f64]) -> Result<(), FactorError> {
        match &mut self.indefinite {
            Some(indefinite) if !self.is_definite => indefinite.solve(free, b, x),
            _ => self.cholesky.solve(b, x),
        }
    }

    /// The same in place for columns of free degrees of freedom.
    pub fn solve_columns(&self, columns: &mut [f64]) -> Result<(), FactorError> {
        match &self.indefinite {
            Some(indefinite) if !self.is_definite => indefinite.solve_columns(columns),
            _ => self.cholesky.solve_columns(columns),
        }
    }
}
