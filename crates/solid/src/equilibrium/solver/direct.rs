//! Direct solves. A positive definite tangent has a Cholesky factor. One that is not may still be positive definite on
//! all steps that leave the means of the patches alone, `W s = 0`, and no other steps are possible where tools hold them:
//! it is so exactly if `K` has as many negative eigenvalues as the compliance `W K⁻¹ Wᵀ` of the patches, by the inertia
//! of the bordered matrix (Haynsworth, Linear Algebra Appl. 1, 1968, 73). `L D Lᵀ` counts those of `K`, and solves.

use super::border::Border;
use super::factor::TangentFactor;
use crate::body::SymmetricBlocks;
use crate::linear::{FactorError, Factorization, Ldlt};

/// Shifts of an indefinite tangent, over its mean diagonal, by which a factor without pivoting gets past a pivot that
/// vanishes: too small to be seen in a step.
const NUDGES: [f64; 3] = [0.0, 1e-10, 1e-8];

/// A factor of the tangent, Cholesky's wherever there is one.
pub(super) struct Direct {
    cholesky: TangentFactor<f64>,
    /// Free degrees of freedom, ascending.
    free: Vec<u32>,
    /// Analysed when it is first needed.
    indefinite: Option<Box<Indefinite>>,
    is_definite: bool,
}

/// A factor `L D Lᵀ` on the free degrees of freedom.
struct Indefinite {
    ldlt: Ldlt,
    /// For every entry of Cholesky's elimination order its place in the pattern.
    entries: Vec<u32>,
    /// Diagonal entries of the pattern.
    diagonal: Vec<usize>,
    values: Vec<f64>,
    column: Vec<f64>,
}

impl Direct {
    /// Analyses the pattern of a body's tangents on the `free` degrees of freedom, ascending.
    pub fn new(cholesky: TangentFactor<f64>, free: Vec<u32>) -> Self {
        Direct { cholesky, free, indefinite: None, is_definite: true }
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
        border: &mut Border,
    ) -> Result<(), FactorError> {
        let factorized = self.cholesky.factorize(tangent.values(), shift);
        self.is_definite = factorized.is_ok();
        match factorized {
            Ok(()) => border.influence(|b, x| self.cholesky.solve(b, x)),
            Err(error) if error.is_of_a_pivot() && !border.is_empty() => {
                self.prepare_indefinite(tangent, shift, border, error)
            }
            Err(error) => Err(error),
        }
    }

    /// The same by `L D Lᵀ`; `verdict` where the border does not make up for the negative eigenvalues.
    fn prepare_indefinite(
        &mut self,
        tangent: &SymmetricBlocks,
        shift: f64,
        border: &mut Border,
        verdict: FactorError,
    ) -> Result<(), FactorError> {
        let Direct { cholesky, free, indefinite, .. } = self;
        if indefinite.is_none() {
            *indefinite = Some(Box::new(Indefinite::new(tangent, free, cholesky)?));
        }
        let Some(indefinite) = indefinite else { return Err(verdict) };
        indefinite.load(cholesky.load(tangent.values(), shift));
        for nudge in NUDGES {
            let modes = indefinite.factorize(nudge * tangent.mean_diagonal());
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
    pub fn solve(&mut self, b: &[f64], x: &mut [f64]) -> Result<(), FactorError> {
        match &mut self.indefinite {
            Some(indefinite) if !self.is_definite => indefinite.solve(&self.free, b, x),
            _ => self.cholesky.solve(b, x),
        }
    }
}

impl Indefinite {
    fn new(
        tangent: &SymmetricBlocks,
        free: &[u32],
        cholesky: &TangentFactor<f64>,
    ) -> Result<Self, FactorError> {
        let (pattern, _) = tangent.pattern().restrict(free);
        Ok(Indefinite {
            ldlt: Ldlt::analyze(&pattern)?,
            entries: cholesky.entries(),
            diagonal: pattern.column_start[1..].iter().map(|&end| end as usize - 1).collect(),
            values: vec![0.0; pattern.len()],
            column: vec![0.0; free.len()],
        })
    }

    /// Takes a matrix over, its values in Cholesky's elimination order.
    fn load(&mut self, placed: &[f64]) {
        for (&entry, value) in self.entries.iter().zip(placed) {
            self.values[entry as usize] = *value;
        }
    }

    /// The number of negative eigenvalues; the nudge stays for the next.
    fn factorize(&mut self, nudge: f64) -> Result<usize, FactorError> {
        self.diagonal.iter().for_each(|&k| self.values[k] += nudge);
        self.ldlt.factorize(&self.values)?;
        let inertia = self.ldlt.inertia()?;
        // A solve says which row it is.
        Ok(inertia.negative)
    }

    fn solve(&mut self, free: &[u32], b: &[f64], x: &mut [f64]) -> Result<(), FactorError> {
        self.column.iter_mut().zip(free).for_each(|(c, &dof)| *c = b[dof as usize]);
        self.ldlt.solve(&mut self.column, 1)?;
        self.column.iter().zip(free).for_each(|(c, &dof)| x[dof as usize] = *c);
        Ok(())
    }
}
