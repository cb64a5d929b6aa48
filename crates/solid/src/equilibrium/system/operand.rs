//! The matrix of conjugate gradients, in double precision: the tangent's blocks, or its cells. Slender and nearly
//! incompressible bodies need double precision: their softest motions are smaller than the rounding of their largest
//! stiffnesses in single precision.

use super::absolute;
use super::device::Given;
use crate::body::{BlockPattern, Body, Source, SymmetricBlocks};
use crate::equilibrium::Tangent;
use crate::equilibrium::tangent::{Product, ProductOperator};
use crate::linear::conjugate_gradients::{BlockJacobi, Operator};
use crate::linear::{FactorError, Numbering};
use crate::threads::for_parts;

/// Rows that a thread takes at once.
const PART: usize = 16_384;

/// A tangent with a multiple of the identity added; held rows are zero.
pub(super) struct Operand {
    kind: Kind,
    shift: f64,
    is_held: Vec<bool>,
}

enum Kind {
    Matrix(SymmetricBlocks),
    /// In another order than the body's, and where its blocks are in that.
    Renumbered(SymmetricBlocks, Vec<Source>),
    Product(ProductOperator),
}

impl Operand {
    pub fn new(body: &Body, is_matrix_free: bool, numbering: Option<&Numbering>) -> Self {
        let kind = if is_matrix_free {
            Kind::Product(Product::new(body).operator())
        } else if let Some(numbering) = numbering {
            let (matrix, sources) = SymmetricBlocks::renumbered(body.pattern(), numbering);
            Kind::Renumbered(matrix, sources)
        } else {
            Kind::Matrix(body.zero_tangent())
        };
        Operand { kind, shift: 0.0, is_held: vec![false; body.n_dofs()] }
    }

    pub fn hold(&mut self, is_held: &[bool]) {
        self.is_held.copy_from_slice(is_held);
    }

    /// Takes a new tangent, with a shift given over its mean diagonal; returns the shift.
    pub fn take(&mut self, tangent: &Tangent, shift: f64) -> Result<f64, FactorError> {
        match (&mut self.kind, tangent.product_part()) {
            (Kind::Product(operator), Some(product)) => *operator = product.operator(),
            (Kind::Renumbered(matrix, sources), _) => {
                matrix.copy_renumbered(tangent.blocks()?, sources);
            }
            // A device forms one tangent, and takes the next assembled.
            (kind @ Kind::Matrix(_), Some(product)) if matches!(tangent, Tangent::Either(_)) => {
                *kind = Kind::Product(product.operator());
            }
            (kind @ Kind::Product(_), None) if matches!(tangent, Tangent::Either(_)) => {
                *kind = Kind::Matrix(tangent.blocks()?.clone());
            }
            (Kind::Matrix(matrix), _) => matrix.copy_from(tangent.blocks()?),
            (Kind::Product(_), None) => return Err(FactorError::NotFactorized),
        }
        self.shift = absolute(shift, || self.mean_diagonal());
        Ok(self.shift)
    }

    /// The tangent as a device takes it.
    pub fn given(&self) -> Given<'_> {
        match &self.kind {
            Kind::Matrix(matrix) | Kind::Renumbered(matrix, _) => {
                Given::Assembled(matrix.values(), self.shift)
            }
            Kind::Product(operator) => Given::Product(operator, self.shift),
        }
    }

    /// Whether it multiplies cell by cell.
    pub fn is_product(&self) -> bool {
        matches!(self.kind, Kind::Product(_))
    }

    /// Values of the assembled matrix.
    ///
    /// # Errors
    /// [`FactorError::NotFactorized`]: there is none.
    pub fn values(&self) -> Result<&[f64], FactorError> {
        self.blocks().map(SymmetricBlocks::values).ok_or(FactorError::NotFactorized)
    }

    /// Mean of the diagonal entries, without the shift.
    pub fn mean_diagonal(&self) -> f64 {
        mean(&self.diagonal())
    }

    /// Tasks of a product that threads share.
    pub fn n_shared(&self) -> usize {
        match &self.kind {
            Kind::Matrix(matrix) | Kind::Renumbered(matrix, _) => matrix.pattern().n_stretches(),
            Kind::Product(operator) => operator.n_tasks(),
        }
    }

    /// The blocks that it has, where it is assembled.
    pub fn pattern(&self) -> Option<&BlockPattern> {
        self.blocks().map(SymmetricBlocks::pattern)
    }

    fn blocks(&self) -> Option<&SymmetricBlocks> {
        match &self.kind {
            Kind::Matrix(matrix) | Kind::Renumbered(matrix, _) => Some(matrix),
            Kind::Product(_) => None,
        }
    }

    /// The block of each node with itself, without the shift.
    fn diagonal(&self) -> Vec<[f64; 9]> {
        match &self.kind {
            Kind::Matrix(matrix) | Kind::Renumbered(matrix, _) => {
                matrix.diagonal().copied().collect()
            }
            Kind::Product(operator) => operator.diagonal(),
        }
    }

    /// Inverts the diagonal blocks.
    pub fn factorize(&self, inverse: &mut BlockJacobi) -> Result<(), FactorError> {
        let is_held = |row: usize| self.is_held[row];
        let blocks = self.diagonal().into_iter().enumerate().map(|(node, block)| {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let on_diagonal = f64::from(i == j);
                    if is_held(3 * node + i) || is_held(3 * node + j) {
                        on_diagonal
                    } else {
                        block[3 * i + j] + self.shift * on_diagonal
                    }
                })
            })
        });
        inverse.factorize(blocks, is_held)
    }
}

impl Operator for Operand {
    fn n(&self) -> usize {
        self.is_held.len()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        match &self.kind {
            Kind::Matrix(matrix) | Kind::Renumbered(matrix, _) => matrix.multiply(x, y),
            Kind::Product(operator) => operator.multiply(x, y),
        }
        for_parts(y, PART, |number, y| {
            let own = number * PART..number * PART + y.len();
            for ((y, x), &held) in y.iter_mut().zip(&x[own.clone()]).zip(&self.is_held[own]) {
                *y = if held { 0.0 } else { *y + self.shift * x };
            }
        });
    }
}

/// Mean of the diagonal entries.
fn mean(diagonal: &[[f64; 9]]) -> f64 {
    let sum: f64 = diagonal.iter().map(|block| block[0] + block[4] + block[8]).sum();
    sum / (3 * diagonal.len()) as f64
}
