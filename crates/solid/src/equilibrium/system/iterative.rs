//! Conjugate gradients for one tangent after another, on all degrees of freedom at once: held ones are zero.
//!
//! With patches the iteration runs in the space of steps that leave their means alone: residuals are projected,
//! preconditioned residuals closed by the border. Every solve sets out from where the last steps lead.

mod forcing;
mod guess;
mod refinement;
mod solution;

use super::border::Border;
use super::device::{Remote, Until};
use super::lagged::Lagged;
use super::operand::Operand;
use super::{ConjugateGradients, Preconditioner, Solved, absolute};
use crate::body::Body;
use crate::equilibrium::Tangent;
use crate::linear::conjugate_gradients::{
    self as cg, BlockJacobi, IncompleteCholesky, Operator, Workspace,
};
use crate::linear::{BlockMatrix, FactorError, Multigrid, Numbering};
use crate::number::dot;
use forcing::Forcing;
use guess::Guess;

/// A right-hand side counts as zero if only this part of it remains after the tools have carried their share.
const ROUNDING: f64 = 1e-14;

/// Iterations with a fresh factor beyond which its precision is not enough.
const DOUBTFUL: usize = 12;

/// Iterations of multigrid that take the time of a new hierarchy.
const MAKING: usize = 10;

/// Iterations beyond those with a fresh factor that may have taken the time of a new one, which nobody makes beside them.
const REPAID: usize = 15;

enum Inverse {
    BlockJacobi(BlockJacobi),
    IncompleteCholesky(Box<Incomplete>),
    Lagged(Lagged),
    Multigrid(Box<Multigrid>),
}

/// An incomplete factor, and the matrix that it is made from.
struct Incomplete {
    matrix: BlockMatrix,
    factor: IncompleteCholesky,
}

/// Conjugate gradients with their matrix, preconditioner and vectors.
pub(super) struct Iterative {
    settings: ConjugateGradients,
    operand: Operand,
    inverse: Inverse,
    remote: Remote,
    /// Whether the preconditioner must be renewed.
    is_stale: bool,
    /// The shift of the tangent that it was made from. It does not serve a tangent with a smaller one.
    shift: f64,
    /// Iterations of the first solve after the preconditioner was made.
    fresh_iterations: Option<usize>,
    /// Iterations beyond that number since then.
    further_iterations: usize,
    /// The least that a solve has taken, one or more.
    fewest_iterations: usize,
    workspace: Workspace,
    residual: Vec<f64>,
    correction: Vec<f64>,
    /// What the guess leaves of the residual.
    left: Vec<f64>,
    guess: Guess,
    /// Of frames.
    forcing: Option<Forcing>,
}

impl Iterative {
    /// In an order of its own where there is a `numbering`; all of its vectors are in that.
    pub fn new(
        settings: ConjugateGradients,
        body: &Body,
        free: &[u32],
        numbering: Option<&Numbering>,
    ) -> Result<Self, FactorError> {
        let n_dofs = body.n_dofs();
        let operand = Operand::new(body, settings.is_matrix_free, numbering);
        let pattern = operand.pattern().unwrap_or(body.pattern());
        let inverse = match settings.preconditioner {
            Preconditioner::BlockJacobi => Inverse::BlockJacobi(BlockJacobi::new(n_dofs / 3)),
            Preconditioner::IncompleteCholesky => {
                let matrix = BlockMatrix::new(n_dofs / 3, pattern.pairs());
                let factor = IncompleteCholesky::new(&matrix);
                Inverse::IncompleteCholesky(Box::new(Incomplete { matrix, factor }))
            }
            Preconditioner::LaggedCholesky => {
                Inverse::Lagged(Lagged::new(body.pattern(), free, n_dofs)?)
            }
            Preconditioner::Multigrid => {
                let points = |numbering: &Numbering| -> Vec<[f64; 3]> {
                    numbering.order().iter().map(|&node| body.points()[node as usize]).collect()
                };
                let points = numbering.map_or_else(|| body.points().to_vec(), points);
                Inverse::Multigrid(Box::new(Multigrid::new(&points, pattern.pairs())?))
            }
        };
        Ok(Iterative {
            settings,
            operand,
            inverse,
            remote: Remote::new(settings.device, body),
            is_stale: true,
            shift: 0.0,
            fresh_iterations: None,
            further_iterations: 0,
            fewest_iterations: usize::MAX,
            workspace: Workspace::new(n_dofs),
            residual: vec![0.0; n_dofs],
            correction: vec![0.0; n_dofs],
            left: vec![0.0; n_dofs],
            guess: Guess::new(n_dofs),
            forcing: None,
        })
    }

    /// Solves follow each other as the frames of a motion: they set out from the last steps, go no farther than Newton's
    /// method gains from, and a factor is renewed while the last one stays in use.
    pub fn serve_frames(&mut self) {
        self.guess.follow_motion();
        self.forcing = Some(Forcing::default());
        if let Inverse::Lagged(lagged) = &mut self.inverse {
            lagged.renew_beside();
        }
    }

    /// The next solve is the first of a frame; see [`Forcing::begin_frame`].
    pub fn begin_frame(&mut self, enough: f64, balanced: f64) {
        self.guess.begin_frame();
        if let Some(forcing) = &mut self.forcing {
            forcing.begin_frame(enough, balanced);
        }
    }

    pub fn hold(&mut self, is_held: &[bool]) {
        self.operand.hold(is_held);
        self.remote.hold(is_held);
        match &mut self.inverse {
            Inverse::BlockJacobi(_) => {}
            Inverse::IncompleteCholesky(incomplete) => incomplete.matrix.hold(is_held),
            Inverse::Lagged(lagged) => lagged.hold(is_held),
            Inverse::Multigrid(multigrid) => multigrid.hold(is_held),
        }
        self.fewest_iterations = usize::MAX;
        // The last step moved what is held now, or left alone what is free.
        self.guess.forget();
        self.is_stale = true;
    }

    /// Another border: the steps from which the next solve sets out must leave its means alone.
    pub fn bind(&mut self, border: &Border) {
        self.remote.bind();
        self.guess.bind(border);
    }

    /// Tells where the nodes are, in the order of the vectors.
    pub fn move_to(&mut self, points: impl Iterator<Item = [f64; 3]>) {
        if let Inverse::Multigrid(multigrid) = &mut self.inverse
            && self.is_stale
        {
            multigrid.move_to(points);
        }
    }

    /// Solves to this tolerance from now on; returns the one before.
    pub fn set_tolerance(&mut self, tolerance: f64) -> f64 {
        std::mem::replace(&mut self.settings.tolerance, tolerance)
    }

    /// Takes a new tangent over; whether the preconditioner changed. With patches a change of it costs a solve for each of
    /// their rows, so it is then not corrected for what has changed since it was made.
    pub fn prepare(
        &mut self,
        tangent: &Tangent,
        shift: f64,
        has_patches: bool,
    ) -> Result<bool, FactorError> {
        let shift = self.operand.take(tangent, shift)?;
        let is_stale = std::mem::take(&mut self.is_stale) || shift < self.shift;
        let is_formed = self.is_formed();
        let renewed = match &mut self.inverse {
            // The device has its own; this one only leads to steps that move the patches.
            Inverse::BlockJacobi(_) if !is_stale && is_formed => Ok(false),
            Inverse::BlockJacobi(inverse) => self.operand.factorize(inverse).map(|()| true),
            Inverse::IncompleteCholesky(incomplete) if is_stale => {
                incomplete.matrix.fill(self.operand.values()?, shift);
                incomplete.factor.factorize(&incomplete.matrix).map(|()| true)
            }
            Inverse::Multigrid(multigrid) if is_stale => {
                multigrid.factorize(self.operand.values()?, shift).map(|()| true)
            }
            Inverse::IncompleteCholesky(_) | Inverse::Multigrid(_) => Ok(false),
            Inverse::Lagged(inverse) => inverse.renew(self.operand.values()?, shift, is_stale),
        };
        self.remote.renew();
        self.is_stale = is_stale && renewed.is_err();
        if *renewed.as_ref().unwrap_or(&false) {
            (self.fresh_iterations, self.further_iterations) = (None, 0);
            self.shift = shift;
        }
        Ok(renewed? | self.correct(shift, has_patches))
    }

    /// Whether what has changed since the preconditioner was made changes it now.
    fn correct(&mut self, shift: f64, has_patches: bool) -> bool {
        match (&mut self.inverse, self.operand.values()) {
            (Inverse::Lagged(inverse), _) if has_patches => inverse.forget_corrections(),
            (Inverse::Lagged(inverse), Ok(values)) => inverse.correct(values, shift),
            _ => false,
        }
    }

    /// Makes the preconditioner of the last tangent with another shift, if it has none with its own; none if its kind
    /// does not take one.
    pub fn lift(&mut self, shift: f64) -> Option<Result<bool, FactorError>> {
        let values = self.operand.values().ok()?;
        let shift = absolute(shift, || self.operand.mean_diagonal());
        let renewed = match &mut self.inverse {
            Inverse::Lagged(inverse) => inverse.renew(values, shift, true),
            Inverse::Multigrid(multigrid) => multigrid.factorize(values, shift).map(|()| true),
            Inverse::BlockJacobi(_) | Inverse::IncompleteCholesky(_) => return None,
        };
        self.is_stale &= renewed.is_err();
        Some(renewed)
    }

    /// The requested device.
    pub fn remote(&self) -> &Remote {
        &self.remote
    }

    /// Whether the device forms the tangent.
    fn is_formed(&self) -> bool {
        self.operand.is_product() && self.remote.can_form()
    }

    /// `z = M⁻¹ r`.
    pub fn precondition(&mut self, r: &[f64], z: &mut [f64]) {
        self.inverse.apply(r, z);
    }

    pub fn solve(
        &mut self,
        border: &Border,
        b: &[f64],
        c: &[f64],
        step: &mut [f64],
        forces: &mut Vec<f64>,
        until: Until<'_>,
    ) -> Result<Solved, FactorError> {
        // The step that moves the patches, and what is left to balance.
        border.close(step, c, forces);
        self.residual.copy_from_slice(b);
        if step.iter().any(|&s| s != 0.0) {
            self.operand.apply(step, &mut self.correction);
            self.residual.iter_mut().zip(&self.correction).for_each(|(r, k)| *r -= k);
        }
        // Twice: the force of a tool may be many times what is left without it, and so would be its rounding.
        border.project(&mut self.residual);
        border.project(&mut self.residual);
        let is_rounding = dot(&self.residual, &self.residual) <= ROUNDING * ROUNDING * dot(b, b);
        let solved = if is_rounding {
            Solved { is_complete: true, ..Solved::default() }
        } else {
            let solved = self.iterate(border, until)?;
            self.note(&solved);
            self.guess.keep(&self.correction);
            step.iter_mut().zip(&self.correction).for_each(|(s, x)| *s += x);
            solved
        };
        if !border.is_empty() {
            self.operand.apply(step, &mut self.correction);
            let products = b.iter().zip(&self.correction);
            self.residual.iter_mut().zip(products).for_each(|(r, (b, k))| *r = b - k);
            *forces = border.forces(&self.residual);
        }
        Ok(solved)
    }

    /// A frame leaves so large a residual that one iteration reaches it with a fresh factor in single precision. Of the
    /// softest motion of a slender body that may leave more than the residual tells; the second iteration finds it.
    fn least_iterations(&self) -> usize {
        let is_fresh = self.forcing.is_some() && self.fresh_iterations.is_none();
        match &self.inverse {
            Inverse::Lagged(lagged) if is_fresh && lagged.is_single() => 2,
            _ => 1,
        }
    }

    /// Requests a new preconditioner if iterations are far above those of a fresh one, or did not converge; where the
    /// iterations would wait for it, only if they have already lost the time that it takes.
    fn note(&mut self, solved: &Solved) {
        let is_first = self.fresh_iterations.is_none();
        // The least are made whether or not the residual asks for them.
        let made_anyway = self.least_iterations() - 1;
        let fresh =
            *self.fresh_iterations.get_or_insert(solved.iterations.saturating_sub(made_anyway));
        if let Inverse::Lagged(lagged) = &mut self.inverse
            && is_first
            && solved.iterations > DOUBTFUL
        {
            lagged.distrust();
        }
        self.further_iterations += solved.iterations.saturating_sub(fresh);
        self.fewest_iterations = self.fewest_iterations.min(solved.iterations.max(1));
        let is_slow = match &mut self.inverse {
            // A new hierarchy takes the time of so many iterations.
            Inverse::Multigrid(_) => solved.iterations > fresh + MAKING,
            // Begun in time: meanwhile iterations grow.
            Inverse::Lagged(lagged) if lagged.is_renewed_in_parts() => {
                if !solved.is_complete || solved.iterations > self.fewest_iterations + REPAID {
                    lagged.abandon();
                }
                solved.iterations > self.fewest_iterations
            }
            Inverse::Lagged(lagged) if !lagged.is_renewed_beside() => {
                solved.iterations > 2 * fresh + 2 && self.further_iterations > REPAID
            }
            _ => solved.iterations > 2 * fresh + 2,
        };
        self.is_stale |= !solved.is_complete || is_slow;
    }
}

impl Inverse {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        match self {
            Inverse::BlockJacobi(inverse) => cg::Preconditioner::apply(inverse, r, z),
            Inverse::IncompleteCholesky(incomplete) => {
                cg::Preconditioner::apply(&mut incomplete.factor, r, z);
            }
            Inverse::Lagged(inverse) => inverse.apply(r, z),
            Inverse::Multigrid(multigrid) => cg::Preconditioner::apply(&mut **multigrid, r, z),
        }
    }
}
