//! The tangent of an equilibrium, `d(f_int - f_ext)/du`, with the contributions of frames and loads beside that of the
//! law: a matrix, or an operator that multiplies like one.

use crate::body::{Body, Curvature, SymmetricBlocks, TangentProduct, add_block_product};
use crate::linear::FactorError;

/// A tangent to linearise into, to add to, and to hand to a solver.
pub enum Tangent {
    /// All of it, assembled.
    Matrix(SymmetricBlocks),
    /// The law's part cell by cell.
    Product(Box<Product>),
}

/// `factor K + rest`, with the law's tangent `K` evaluated at every product.
pub struct Product {
    cells: TangentProduct,
    factor: f64,
    /// What loads, inertia and history added since the last linearisation; none while nothing does.
    rest: Option<SymmetricBlocks>,
}

impl Tangent {
    /// An assembled one, zero.
    pub fn matrix(body: &Body) -> Self {
        Tangent::Matrix(body.zero_tangent())
    }

    /// One without a matrix, at rest.
    pub fn product(body: &Body) -> Self {
        Tangent::Product(Box::new(Product::new(body)))
    }

    /// The law's internal force, in place, and its tangent, which replaces all earlier contributions.
    pub fn linearize(&mut self, body: &Body, u: &[f64], curvature: Curvature, force: &mut [f64]) {
        match self {
            Tangent::Matrix(blocks) => body.linearize(u, curvature, force, blocks),
            Tangent::Product(product) => {
                body.internal_force(u, force);
                product.cells.move_to(u, curvature);
                product.factor = 1.0;
                if let Some(rest) = &mut product.rest {
                    rest.values_mut().fill(0.0);
                }
            }
        }
    }

    /// Multiplies all of it by a factor.
    pub fn scale(&mut self, factor: f64) {
        let blocks = match self {
            Tangent::Matrix(blocks) => Some(blocks),
            Tangent::Product(product) => {
                product.factor *= factor;
                product.rest.as_mut()
            }
        };
        if let Some(blocks) = blocks {
            blocks.values_mut().iter_mut().for_each(|k| *k *= factor);
        }
    }

    /// The blocks to which contributions are added.
    pub fn blocks_mut(&mut self) -> &mut SymmetricBlocks {
        match self {
            Tangent::Matrix(blocks) => blocks,
            Tangent::Product(product) => {
                let Product { cells, rest, .. } = &mut **product;
                rest.get_or_insert_with(|| cells.zero_blocks())
            }
        }
    }

    /// The matrix.
    ///
    /// # Errors
    /// [`FactorError::Length`]: it has none.
    pub fn blocks(&self) -> Result<&SymmetricBlocks, FactorError> {
        match self {
            Tangent::Matrix(blocks) => Ok(blocks),
            Tangent::Product(product) => {
                let expected = product.cells.zero_blocks().values().len();
                Err(FactorError::Length { argument: "a matrix-free tangent", expected, found: 0 })
            }
        }
    }

    /// `y = K x` over all degrees of freedom.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        match self {
            Tangent::Matrix(blocks) => blocks.multiply(x, y),
            Tangent::Product(product) => product.operator().multiply(x, y),
        }
    }
}

impl Product {
    /// The law's tangent at rest.
    pub fn new(body: &Body) -> Self {
        Product { cells: body.tangent_product(), factor: 1.0, rest: None }
    }

    /// A copy of its present state for products, while the tangent may change.
    pub fn operator(&self) -> ProductOperator {
        let rest = self.rest.as_ref().map_or_else(Vec::new, |rest| {
            let blocks = rest.pattern().pairs().zip(rest.values().as_chunks::<9>().0);
            let filled = blocks.filter(|(_, block)| block.iter().any(|&k| k != 0.0));
            filled.map(|((row, column), block)| (row, column, *block)).collect()
        });
        ProductOperator { cells: self.cells.clone(), factor: self.factor, rest }
    }
}

/// A tangent that multiplies cell by cell, with the blocks added to it.
pub struct ProductOperator {
    cells: TangentProduct,
    factor: f64,
    /// Row and column node, row <= column, and entries `[i][k]`.
    rest: Vec<(u32, u32, [f64; 9])>,
}

impl ProductOperator {
    /// `y = K x` over all degrees of freedom.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        self.cells.multiply(x, y);
        if self.factor != 1.0 {
            y.iter_mut().for_each(|y| *y *= self.factor);
        }
        for (row, column, block) in &self.rest {
            add_block_product(block, (*row as usize, *column as usize), x, y);
        }
    }

    /// The block of each node with itself, entries `[i][k]`.
    pub fn diagonal(&self) -> Vec<[f64; 9]> {
        let mut diagonal = self.cells.diagonal();
        diagonal.iter_mut().flatten().for_each(|k| *k *= self.factor);
        for (row, _, block) in self.rest.iter().filter(|(row, column, _)| row == column) {
            let sum = &mut diagonal[*row as usize];
            sum.iter_mut().zip(block).for_each(|(sum, k)| *sum += k);
        }
        diagonal
    }
}
