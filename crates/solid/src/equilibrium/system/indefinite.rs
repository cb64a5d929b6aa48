//! `L D Lᵀ` of the tangent on the degrees of freedom that are not fixed, whatever the signs of its eigenvalues.

use super::factor::{TangentFactor, ends, held_diagonal};
use crate::body::BlockPattern;
use crate::linear::{FactorError, Factorization, Ldlt};

/// A factor with the way from the values of the tangent to its own.
pub(super) struct Indefinite {
    ldlt: Ldlt,
    /// For every entry of its pattern the place in the values of the tangent, and its row and column.
    positions: Vec<u32>,
    ends: Vec<[u32; 2]>,
    values: Vec<f64>,
    column: Vec<f64>,
}

impl Indefinite {
    /// Analyses the pattern of a body's tangents on the `free` degrees of freedom, ascending.
    pub fn new(blocks: &BlockPattern, free: &[u32]) -> Result<Self, FactorError> {
        let (pattern, positions) = blocks.restrict(free);
        Ok(Indefinite {
            ldlt: Ldlt::analyze(&pattern)?,
            values: vec![0.0; pattern.len()],
            ends: ends(&pattern, free),
            positions,
            column: vec![0.0; free.len()],
        })
    }

    /// Factorises the tangent with these values and `shift` added to its diagonal; the number of negative eigenvalues.
    pub fn factorize(
        &mut self,
        values: &[f64],
        shift: f64,
        is_held: &[bool],
    ) -> Result<usize, FactorError> {
        let entries = self.positions.iter().zip(&self.ends);
        for (value, (&position, &[row, column])) in self.values.iter_mut().zip(entries) {
            let is_diagonal = row == column;
            *value = values[position as usize] + if is_diagonal { shift } else { 0.0 };
            if is_held[row as usize] || is_held[column as usize] {
                *value = if is_diagonal { held_diagonal(*value) } else { 0.0 };
            }
        }
        self.ldlt.factorize(&self.values)?;
        self.negative()
    }

    /// Goes on where a Cholesky factor of the same tangent ended; the number of negative eigenvalues.
    pub fn go_on(&mut self, begun: &mut TangentFactor<f64>) -> Result<usize, FactorError> {
        self.ldlt.go_on(&mut begun.cholesky)?;
        self.negative()
    }

    /// Where there is a zero eigenvalue, a solve says which row it is of.
    fn negative(&self) -> Result<usize, FactorError> {
        Ok(self.ldlt.inertia()?.negative)
    }

    /// Number of negative eigenvalues of what was factorised last.
    pub fn n_negative(&self) -> Option<usize> {
        self.ldlt.inertia().ok().map(|inertia| inertia.negative)
    }

    /// `x = K⁻¹ b` on the free degrees of freedom; where `b` is zero on what is held, so is `x`.
    pub fn solve(&mut self, free: &[u32], b: &[f64], x: &mut [f64]) -> Result<(), FactorError> {
        self.column.iter_mut().zip(free).for_each(|(c, &dof)| *c = b[dof as usize]);
        self.ldlt.solve(&mut self.column, 1)?;
        self.column.iter().zip(free).for_each(|(c, &dof)| x[dof as usize] = *c);
        Ok(())
    }

    /// The same in place for columns of free degrees of freedom.
    pub fn solve_columns(&self, columns: &mut [f64]) -> Result<(), FactorError> {
        self.ldlt.solve(columns, columns.len() / self.column.len().max(1))
    }
}
