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
    /// Either, for a device that may form the matrix.
    Either(Box<Either>),
}

/// A tangent that is assembled, or left as a product where a device forms the matrix.
pub struct Either {
    matrix: SymmetricBlocks,
    product: Product,
    /// A device wants to form the matrix.
    is_wanted: bool,
    /// It may form this one.
    is_left: bool,
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

    /// One that is either.
    pub fn either(body: &Body) -> Self {
        let (matrix, product) = (body.zero_tangent(), Product::new(body));
        Tangent::Either(Box::new(Either { matrix, product, is_wanted: false, is_left: false }))
    }

    /// Leaves the next matrices to a device, or no longer does.
    pub fn leave_to_device(&mut self, is_wanted: bool) {
        if let Tangent::Either(either) = self {
            either.is_wanted = is_wanted;
        }
    }

    /// The law's internal force, in place, and its tangent, which replaces all earlier contributions.
    pub fn linearize(&mut self, body: &Body, u: &[f64], curvature: Curvature, force: &mut [f64]) {
        match self {
            Tangent::Matrix(blocks) => body.linearize(u, curvature, force, blocks),
            Tangent::Product(product) => product.linearize(body, u, curvature, force),
            Tangent::Either(either) => {
                // A projected one takes eigenvalues of cells, which no device computes.
                either.is_left = either.is_wanted && curvature == Curvature::Exact;
                if either.is_left {
                    either.product.linearize(body, u, curvature, force);
                } else {
                    body.linearize(u, curvature, force, &mut either.matrix);
                }
            }
        }
    }

    /// Multiplies all of it by a factor.
    pub fn scale(&mut self, factor: f64) {
        if let Some(product) = self.product_mut() {
            product.factor *= factor;
            if product.rest.is_none() {
                return;
            }
        }
        self.blocks_mut().values_mut().iter_mut().for_each(|k| *k *= factor);
    }

    /// The blocks to which contributions are added.
    pub fn blocks_mut(&mut self) -> &mut SymmetricBlocks {
        match self {
            Tangent::Matrix(blocks) => blocks,
            Tangent::Product(product) => product.rest_mut(),
            Tangent::Either(either) => {
                let Either { matrix, product, is_left, .. } = &mut **either;
                if *is_left { product.rest_mut() } else { matrix }
            }
        }
    }

    /// The product, where there is no matrix.
    pub fn product_part(&self) -> Option<&Product> {
        match self {
            Tangent::Matrix(_) => None,
            Tangent::Product(product) => Some(product),
            Tangent::Either(either) => either.is_left.then_some(&either.product),
        }
    }

    fn product_mut(&mut self) -> Option<&mut Product> {
        match self {
            Tangent::Matrix(_) => None,
            Tangent::Product(product) => Some(product),
            Tangent::Either(either) => either.is_left.then_some(&mut either.product),
        }
    }

    /// The matrix.
    ///
    /// # Errors
    /// [`FactorError::Length`]: it has none.
    pub fn blocks(&self) -> Result<&SymmetricBlocks, FactorError> {
        match self {
            Tangent::Matrix(blocks) => Ok(blocks),
            Tangent::Either(either) if !either.is_left => Ok(&either.matrix),
            Tangent::Product(_) | Tangent::Either(_) => {
                let rest = self.product_part().map(|product| product.cells.zero_blocks());
                let expected = rest.map_or(0, |rest| rest.values().len());
                Err(FactorError::Length { argument: "a matrix-free tangent", expected, found: 0 })
            }
        }
    }

    /// `y = K x` over all degrees of freedom.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        match self {
            Tangent::Matrix(blocks) => blocks.multiply(x, y),
            Tangent::Product(product) => product.operator().multiply(x, y),
            Tangent::Either(either) if either.is_left => either.product.operator().multiply(x, y),
            Tangent::Either(either) => either.matrix.multiply(x, y),
        }
    }
}

impl Product {
    /// The law's tangent at rest.
    pub fn new(body: &Body) -> Self {
        Product { cells: body.tangent_product(), factor: 1.0, rest: None }
    }

    fn linearize(&mut self, body: &Body, u: &[f64], curvature: Curvature, force: &mut [f64]) {
        body.internal_force(u, force);
        self.cells.move_to(u, curvature);
        self.factor = 1.0;
        if let Some(rest) = &mut self.rest {
            rest.values_mut().fill(0.0);
        }
    }

    fn rest_mut(&mut self) -> &mut SymmetricBlocks {
        let Product { cells, rest, .. } = self;
        rest.get_or_insert_with(|| cells.zero_blocks())
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
    rest: Vec<RestBlock>,
}

/// Row and column node, row <= column, and entries `[i][k]`.
pub type RestBlock = (u32, u32, [f64; 9]);

impl ProductOperator {
    /// Tasks of a product that threads share.
    pub fn n_tasks(&self) -> usize {
        self.cells.n_tasks()
    }

    /// What a device forms it from: the law's tangent, its factor, and what is added to it.
    pub fn parts(&self) -> (&TangentProduct, f64, &[RestBlock]) {
        (&self.cells, self.factor, &self.rest)
    }

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
