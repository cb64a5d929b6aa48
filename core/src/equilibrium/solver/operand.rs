//! What conjugate gradients multiply with: the tangent's blocks in single precision, or its cells.

use super::absolute;
use crate::body::Body;
use crate::equilibrium::Tangent;
use crate::equilibrium::tangent::{Product, ProductOperator};
use crate::linear::conjugate_gradients::{BlockJacobi, Operator};
use crate::linear::{BlockMatrix, FactorError};

/// A tangent to multiply with; held rows are zero.
pub(super) enum Operand {
    Matrix(BlockMatrix),
    Product(Cells),
}

/// A tangent that multiplies cell by cell.
pub(super) struct Cells {
    tangent: ProductOperator,
    /// The block of each node with itself.
    diagonal: Vec<[f64; 9]>,
    shift: f64,
    is_held: Vec<bool>,
}

impl Operand {
    pub fn new(body: &Body, is_matrix_free: bool) -> Self {
        let n_dofs = body.n_dofs();
        if !is_matrix_free {
            return Operand::Matrix(BlockMatrix::new(n_dofs / 3, body.pattern().pairs()));
        }
        let tangent = Product::new(body).operator();
        let (diagonal, is_held) = (Vec::new(), vec![false; n_dofs]); // until there is a tangent
        Operand::Product(Cells { tangent, diagonal, shift: 0.0, is_held })
    }

    pub fn hold(&mut self, is_held: &[bool]) {
        match self {
            Operand::Matrix(matrix) => matrix.hold(is_held),
            Operand::Product(cells) => cells.is_held.copy_from_slice(is_held),
        }
    }

    /// Takes a new tangent over, with a shift given over its mean diagonal; that shift.
    pub fn take(&mut self, tangent: &Tangent, shift: f64) -> Result<f64, FactorError> {
        match (self, tangent) {
            (Operand::Product(cells), Tangent::Product(product)) => {
                cells.tangent = product.operator();
                cells.diagonal = cells.tangent.diagonal();
                cells.shift = absolute(shift, || mean(&cells.diagonal));
                Ok(cells.shift)
            }
            (Operand::Product(_), Tangent::Matrix(_)) => Err(FactorError::NotFactorized),
            (Operand::Matrix(matrix), tangent) => {
                let blocks = tangent.blocks()?;
                let shift = absolute(shift, || blocks.mean_diagonal());
                matrix.fill(blocks.values(), shift);
                Ok(shift)
            }
        }
    }
}

impl Operator for Operand {
    fn n(&self) -> usize {
        match self {
            Operand::Matrix(matrix) => matrix.n(),
            Operand::Product(cells) => cells.is_held.len(),
        }
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        match self {
            Operand::Matrix(matrix) => matrix.apply(x, y),
            Operand::Product(cells) => cells.apply(x, y),
        }
    }
}

impl Cells {
    /// Inverts the diagonal blocks.
    pub fn factorize(&self, inverse: &mut BlockJacobi) -> Result<(), FactorError> {
        let is_held = |row: usize| self.is_held[row];
        let blocks = self.diagonal.iter().enumerate().map(|(node, block)| {
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
        inverse.factorize_blocks(blocks, is_held)
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        self.tangent.multiply(x, y);
        for ((y, x), &held) in y.iter_mut().zip(x).zip(&self.is_held) {
            *y = if held { 0.0 } else { *y + self.shift * x };
        }
    }
}

/// Mean of the diagonal entries.
fn mean(diagonal: &[[f64; 9]]) -> f64 {
    let sum: f64 = diagonal.iter().map(|block| block[0] + block[4] + block[8]).sum();
    sum / (3 * diagonal.len()) as f64
}
