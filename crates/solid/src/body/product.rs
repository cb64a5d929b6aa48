//! The tangent without a matrix: every product with a vector evaluates the tangents of all cells again.
//!
//! A product costs as much arithmetic as an assembly, and no memory except a vector of each cell's nodes. It is meant
//! for bodies whose matrix does not fit into memory.

use super::blocks::BlockPattern;
use super::cells::CellBatches;
use super::clusters::{Around, SharedTangent};
use super::curvature::Curvature;
use super::integrals::ElementIntegrals;
use super::tangent::{Purpose, TangentLoop};
use super::ties::Tied;
use super::{Body, SymmetricBlocks};
use crate::element::Shape;
use crate::law::{LawKernels, Material};
use crate::number::Lane;
use crate::tensor::{Mat3, Vec3};
use crate::threads::{for_parts, share};
use std::sync::Arc;

/// The tangent of a body at a displacement, as a product with vectors.
#[derive(Clone)]
pub struct TangentProduct {
    material: Arc<Material>,
    integrals: Arc<dyn ElementIntegrals>,
    pattern: Arc<BlockPattern>,
    tied: Option<Arc<Tied>>,
    u: Vec<f64>,
    curvature: Curvature,
    /// What clusters share at `u`.
    shared: SharedTangent,
}

impl Body {
    /// Its tangent at rest, as a product.
    pub fn tangent_product(&self) -> TangentProduct {
        let mut product = TangentProduct {
            material: self.material.clone(),
            integrals: self.integrals.clone(),
            pattern: self.pattern.clone(),
            tied: self.tied.clone(),
            u: Vec::new(),
            curvature: Curvature::Exact,
            shared: SharedTangent::default(),
        };
        product.move_to(&vec![0.0; self.n_dofs()], Curvature::Exact);
        product
    }
}

impl TangentProduct {
    /// Makes it the tangent at `u`.
    pub fn move_to(&mut self, u: &[f64], curvature: Curvature) {
        self.u.clear();
        self.u.extend_from_slice(u);
        self.curvature = curvature;
        self.shared = self.integrals.shared(self.material.law(), (u, curvature));
    }

    /// Tasks of a product that threads share.
    pub fn n_tasks(&self) -> usize {
        self.integrals.n_tasks()
    }

    /// The displacement, and what clusters share there.
    pub fn at(&self) -> (&[f64], &SharedTangent) {
        (&self.u, &self.shared)
    }

    /// Row, column and entries of the blocks that ties add, row <= column.
    pub fn tie_blocks(&self) -> impl Iterator<Item = (u32, u32, [f64; 9])> + '_ {
        self.tied.iter().flat_map(|tied| tied.blocks(&self.u, self.curvature))
    }

    /// `y = K x` over all degrees of freedom.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let at = (self.u.as_slice(), self.curvature);
        self.integrals.tangent_times(self.material.law(), at, &self.shared, x, y);
        self.tied.iter().for_each(|tied| tied.add_product(at, x, y));
    }

    /// The block of each node with itself, entries `[i][k]`, nine per node.
    pub fn diagonal(&self) -> Vec<[f64; 9]> {
        let at = (self.u.as_slice(), self.curvature);
        let mut diagonal = self.integrals.tangent_diagonal(self.material.law(), at, &self.shared);
        self.tied.iter().for_each(|tied| tied.add_diagonal(at, &mut diagonal));
        diagonal
    }

    /// A zero matrix for additions to the tangent.
    pub fn zero_blocks(&self) -> SymmetricBlocks {
        SymmetricBlocks::zeros(&self.pattern)
    }
}

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// `y = K x`.
    pub fn tangent_times(
        &self,
        law: &dyn LawKernels,
        around: Around<'_>,
        (u, curvature): (&[f64], Curvature),
        x: &[f64],
        y: &mut [f64],
    ) {
        let tangents = TangentLoop { cells: self, law, around, u, curvature };
        let of_task = |task: usize, products: &mut [[Vec3<Lane>; N]]| {
            tangents.run(task, products, &mut [], Purpose::Product(x));
            0.0
        };
        if share(self.n_tasks()) {
            self.forces_by_threads(y, of_task);
        } else {
            self.forces_by_one((&mut Vec::new(), &mut Vec::new()), y, of_task);
        }
    }

    /// The blocks of each node with itself.
    pub fn tangent_diagonal(
        &self,
        law: &dyn LawKernels,
        around: Around<'_>,
        (u, curvature): (&[f64], Curvature),
    ) -> Vec<[f64; 9]> {
        let mut of_cells = vec![[Mat3::<Lane>::default(); N]; self.batches.len()];
        let of_task = TangentLoop { cells: self, law, around, u, curvature };
        for_parts(&mut of_cells, Self::TASK, |task, blocks| {
            let mut forces = vec![[[Lane::default(); 3]; N]; blocks.len()];
            let mut tangents = vec![Mat3::default(); Self::PAIRS];
            of_task.run(task, &mut forces, &mut tangents, Purpose::Diagonal(blocks));
        });
        let mut diagonal = vec![[0.0; 9]; self.sums.n_points()];
        for (batch, blocks) in self.batches.iter().zip(&of_cells) {
            for (lane, nodes) in batch.nodes[..batch.n_cells as usize].iter().enumerate() {
                for (block, &node) in blocks.iter().zip(nodes) {
                    let sum = &mut diagonal[node as usize];
                    (0..9).for_each(|entry| sum[entry] += block[entry / 3][entry % 3][lane]);
                }
            }
        }
        diagonal
    }
}
