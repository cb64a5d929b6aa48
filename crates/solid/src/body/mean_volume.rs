//! The linear element with mean dilatation: cells in [clusters](super::clusters) that share one volume ratio.

use super::blocks::{BlockPattern, SymmetricBlocks};
use super::cells::CellBatches;
use super::clusters::{Clusters, SharedTangent};
use super::curvature::Curvature;
use super::integrals::ElementIntegrals;
use super::layout::Layout;
use super::outliers::Outlier;
use super::partition::Partition;
use super::programmed::ClusterNodes;
use super::quadrature_points::Cluster;
use super::series::{Along, AroundSeries, SeriesIntegrals};
use crate::element::{Geometry, Tet4};
use crate::law::{LawKernels, Material, SeriesKernels};
use crate::number::Real;
use crate::tensor::Mat3;

/// Linear cells whose clusters share one volume ratio.
pub(super) struct MeanVolume {
    cells: CellBatches<Tet4, 4>,
    clusters: Clusters,
}

impl MeanVolume {
    /// In these clusters; and the pairs of nodes that its tangent has.
    pub fn new(layout: &Layout<'_>, parts: &Partition) -> (BlockPattern, Self) {
        let Layout { cells, geometry, material, .. } = *layout;
        let n = layout.n_nodes();
        let pattern = BlockPattern::new(n, parts.pairs().chain(layout.ties.pairs()));
        let batches = CellBatches::new(cells.to_vec(), geometry, material, &pattern, n);
        let slots = &batches.slots;
        let clusters = Clusters::new(parts, cells, slots, geometry, material, &pattern);
        (pattern, MeanVolume { cells: batches, clusters })
    }
}

impl ElementIntegrals for MeanVolume {
    fn n_tasks(&self) -> usize {
        self.cells.n_tasks()
    }

    fn gradients(&self, geometry: &[Geometry], u: &[f64]) -> Vec<Mat3<f64>> {
        self.cells.gradients(geometry, u)
    }

    fn outliers(&self, geometry: &[Geometry], u: &[f64], range: [f64; 2]) -> Vec<Outlier> {
        self.cells.outliers(geometry, u, range)
    }

    fn add_body_force(&self, of_cell: &dyn Fn(usize) -> [f64; 3], force: &mut [f64]) {
        self.cells.add_body_force(of_cell, force);
    }

    fn energy(&self, law: &dyn LawKernels, u: &[f64]) -> f64 {
        let MeanVolume { cells, clusters } = self;
        let local = cells.energy(law, clusters.around(&[]), u);
        if local.is_infinite() {
            return local;
        }
        local + clusters.energy(law, &clusters.volumes(law, cells, u))
    }

    fn force(&self, law: &dyn LawKernels, at: (&[f64], [f64; 2]), force: &mut [f64]) -> f64 {
        let MeanVolume { cells, clusters } = self;
        let volumes = clusters.volumes(law, cells, at.0);
        let (pressures, _) = clusters.pressures(law, &volumes);
        let local = cells.force(law, clusters.around(&pressures), at, force);
        if local.is_infinite() { local } else { local + clusters.energy(law, &volumes) }
    }

    fn force_and_tangent(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        force: &mut [f64],
        tangent: &mut SymmetricBlocks,
    ) {
        let MeanVolume { cells, clusters } = self;
        let shared = self.shared(law, at);
        let products =
            |block: usize, out: &mut [f64; 9]| clusters.add_products(&shared, block, out);
        let around = clusters.around(&shared.pressures);
        cells.force_and_tangent(law, around, at, force, tangent, products);
    }

    fn shared(&self, law: &dyn LawKernels, (u, curvature): (&[f64], Curvature)) -> SharedTangent {
        let volumes = self.clusters.volumes(law, &self.cells, u);
        self.clusters.tangent(law, &volumes, curvature)
    }

    fn tangent_times(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        shared: &SharedTangent,
        x: &[f64],
        y: &mut [f64],
    ) {
        let around = self.clusters.around(&shared.pressures);
        self.cells.tangent_times(law, around, at, x, y);
        self.clusters.add_products_times(shared, x, y);
    }

    fn tangent_diagonal(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        shared: &SharedTangent,
    ) -> Vec<[f64; 9]> {
        let around = self.clusters.around(&shared.pressures);
        let mut blocks = self.cells.tangent_diagonal(law, around, at);
        self.clusters.add_diagonal(shared, &mut blocks);
        blocks
    }

    fn clusters(&self, law: &dyn LawKernels, u: &[f64]) -> Vec<Cluster> {
        let MeanVolume { cells, clusters } = self;
        let volumes = clusters.volumes(law, cells, u);
        let (pressures, _) = clusters.pressures(law, &volumes);
        let mut of_cells = vec![Cluster { ratio: 1.0, pressure: 0.0 }; cells.nodes.len()];
        for cluster in 0..clusters.members.len() {
            let (ratio, pressure) = (volumes.clusters[cluster], pressures[cluster]);
            for member in clusters.members.of(cluster) {
                of_cells[member.cell as usize] = Cluster { ratio, pressure };
            }
        }
        of_cells
    }

    fn cluster_nodes(&self) -> Option<ClusterNodes> {
        Some(self.clusters.nodes())
    }

    fn n_units(&self) -> usize {
        self.clusters.volume.len()
    }

    fn cells_of(&self, unit: usize) -> Vec<usize> {
        self.clusters.members.of(unit).iter().map(|member| member.cell as usize).collect()
    }
}

impl<T: Real> SeriesIntegrals<T> for MeanVolume
where
    dyn LawKernels: SeriesKernels<T>,
{
    fn add_force_series(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        force: &mut [T],
    ) {
        let MeanVolume { cells, clusters } = self;
        let mut series = vec![T::default(); clusters.volume.len() * along.table.len()];
        cells.add_volume_series(material, geometry, along, clusters, &mut series);
        clusters.pressure_series(material, along.table, &mut series);
        cells.force_series(
            material,
            geometry,
            along,
            AroundSeries(Some((clusters, &series))),
            force,
        );
    }
}
