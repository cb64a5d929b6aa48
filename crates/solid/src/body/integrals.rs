//! The interface of an element: the integrals over all cells of a body. One implementation serves every element whose
//! cells have an energy of their own (P1, P2), another the [linear cells that share](super::mean_volume) their change
//! of volume.

use super::blocks::SymmetricBlocks;
use super::cells::CellBatches;
use super::clusters::{Around, SharedTangent};
use super::curvature::Curvature;
use super::outliers::Outlier;
use super::programmed::ClusterNodes;
use super::quadrature_points::Cluster;
use super::series::{Along, AroundSeries, CellSeries, SeriesIntegrals};
use super::workspace::Workspace;
use crate::element::{Geometry, Shape};
use crate::law::{LawKernels, Material};
use crate::number::Wide;
use crate::tensor::{Mat3, cofactor, determinant};

/// The integrals over the cells of a body. Displacements `u` and forces are of all degrees of freedom; geometries come
/// cell by cell.
pub trait ElementIntegrals: SeriesIntegrals<f64> + SeriesIntegrals<Wide> + Send + Sync {
    /// Number of tasks that its loops make.
    fn n_tasks(&self) -> usize;

    /// Runs through `F` at the quadrature points, cell by cell.
    fn for_each_gradient(&self, geometry: &[Geometry], u: &[f64], run: &mut dyn FnMut(&Mat3<f64>));

    /// The quadrature points whose volume ratio is outside a range.
    fn outliers(&self, geometry: &[Geometry], u: &[f64], range: [f64; 2]) -> Vec<Outlier>;

    /// Adds the nodal forces of a force density that is constant in each cell.
    fn add_body_force(&self, of_cell: &dyn Fn(usize) -> [f64; 3], force: &mut [f64]);

    /// Strain energy, infinite if a volume ratio is out of a range.
    fn energy(&self, law: &dyn LawKernels, at: (&[f64], [f64; 2])) -> f64;

    /// Internal force, in place; returns the energy, infinite if a volume ratio is out of a range.
    fn force(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], [f64; 2]),
        workspace: &mut Workspace,
        force: &mut [f64],
    ) -> f64;

    /// Internal force and tangent, in place.
    fn force_and_tangent(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        workspace: &mut Workspace,
        force: &mut [f64],
        tangent: &mut SymmetricBlocks,
    );

    /// The part of the tangent that cells share, at a displacement.
    fn shared(&self, _law: &dyn LawKernels, _at: (&[f64], Curvature)) -> SharedTangent {
        SharedTangent::default()
    }

    /// `y = K x`, with what is shared there.
    fn tangent_times(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        shared: &SharedTangent,
        x: &[f64],
        y: &mut [f64],
    );

    /// The block of each node with itself.
    fn tangent_diagonal(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        shared: &SharedTangent,
    ) -> Vec<[f64; 9]>;

    /// The cluster of each cell at a displacement; none if cells share nothing.
    fn clusters(&self, _law: &dyn LawKernels, _u: &[f64]) -> Vec<Cluster> {
        Vec::new()
    }

    /// Which cells share their volume ratio; none if none do.
    fn cluster_nodes(&self) -> Option<ClusterNodes> {
        None
    }

    /// Number of the smallest units that have an energy of their own.
    fn n_units(&self) -> usize;

    /// The cells of such a unit.
    fn cells_of(&self, unit: usize) -> Vec<usize> {
        vec![unit]
    }
}

impl dyn ElementIntegrals {
    /// `F` at the quadrature points, cell by cell.
    pub(super) fn gradients(&self, geometry: &[Geometry], u: &[f64]) -> Vec<Mat3<f64>> {
        let mut gradients = Vec::with_capacity(geometry.len());
        self.for_each_gradient(geometry, u, &mut |f| gradients.push(*f));
        gradients
    }

    /// `det F` at the quadrature points, cell by cell.
    pub(super) fn jacobians(&self, geometry: &[Geometry], u: &[f64]) -> Vec<f64> {
        let mut jacobians = Vec::with_capacity(geometry.len());
        self.for_each_gradient(geometry, u, &mut |f| jacobians.push(determinant(f, &cofactor(f))));
        jacobians
    }

    /// The smallest `det F` at a quadrature point, and its cell; infinite if none is known.
    pub(super) fn smallest_jacobian(&self, geometry: &[Geometry], u: &[f64]) -> (f64, usize) {
        let (mut smallest, mut at, mut count) = (f64::INFINITY, 0, 0);
        self.for_each_gradient(geometry, u, &mut |f| {
            let jacobian = determinant(f, &cofactor(f));
            if jacobian < smallest {
                (smallest, at) = (jacobian, count);
            }
            count += 1;
        });
        (smallest, at * geometry.len() / count.max(1))
    }
}

impl<E: Shape<N>, const N: usize> ElementIntegrals for CellBatches<E, N> {
    fn n_tasks(&self) -> usize {
        CellBatches::n_tasks(self)
    }

    fn for_each_gradient(&self, geometry: &[Geometry], u: &[f64], run: &mut dyn FnMut(&Mat3<f64>)) {
        CellBatches::for_each_gradient(self, geometry, u, run);
    }

    fn outliers(&self, geometry: &[Geometry], u: &[f64], range: [f64; 2]) -> Vec<Outlier> {
        CellBatches::outliers(self, geometry, u, range)
    }

    fn add_body_force(&self, of_cell: &dyn Fn(usize) -> [f64; 3], force: &mut [f64]) {
        for (cell, nodes) in self.nodes.iter().enumerate() {
            let whole = of_cell(cell);
            for (&node, part) in nodes.iter().zip(E::LOADS) {
                (0..3).for_each(|i| force[3 * node as usize + i] += part * whole[i]);
            }
        }
    }

    fn energy(&self, law: &dyn LawKernels, at: (&[f64], [f64; 2])) -> f64 {
        CellBatches::energy(self, law, Around::default(), at)
    }

    fn force(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], [f64; 2]),
        workspace: &mut Workspace,
        force: &mut [f64],
    ) -> f64 {
        CellBatches::force(self, law, Around::default(), at, &mut workspace.of_cells, force)
    }

    fn force_and_tangent(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        workspace: &mut Workspace,
        force: &mut [f64],
        tangent: &mut SymmetricBlocks,
    ) {
        let nothing = |_: usize, _: &mut [f64; 9]| ();
        let (law, workspace) = ((law, Around::default()), &mut workspace.of_cells);
        CellBatches::force_and_tangent(self, law, at, workspace, force, tangent, nothing);
    }

    fn tangent_times(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        _shared: &SharedTangent,
        x: &[f64],
        y: &mut [f64],
    ) {
        CellBatches::tangent_times(self, law, Around::default(), at, x, y);
    }

    fn tangent_diagonal(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        _shared: &SharedTangent,
    ) -> Vec<[f64; 9]> {
        CellBatches::tangent_diagonal(self, law, Around::default(), at)
    }

    fn n_units(&self) -> usize {
        self.nodes.len()
    }
}

impl<T, E: Shape<N>, const N: usize> SeriesIntegrals<T> for CellBatches<E, N>
where
    CellBatches<E, N>: CellSeries<T>,
{
    fn add_force_series(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        force: &mut [T],
    ) {
        self.force_series(material, geometry, along, AroundSeries(None), force);
    }
}
