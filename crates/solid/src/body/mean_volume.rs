//! The linear element with mean dilatation: cells in [clusters](super::clusters) that share one volume ratio.

use super::blocks::{BlockPattern, SymmetricBlocks};
use super::cells::CellBatches;
use super::clusters::{ClusterWorkspace, Clusters, SharedTangent};
use super::curvature::Curvature;
use super::integrals::ElementIntegrals;
use super::layout::Layout;
use super::outliers::Outlier;
use super::partition::Partition;
use super::programmed::ClusterNodes;
use super::quadrature_points::Cluster;
use super::series::{Along, AroundSeries, CellSeries, ClusterSeries, SeriesIntegrals};
use super::workspace::Workspace;
use crate::element::{Geometry, Tet4};
use crate::law::{LawKernels, Material};
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

    /// The volume ratios at a displacement, with room for what follows from them.
    fn at(&self, law: &dyn LawKernels, u: &[f64]) -> ClusterWorkspace {
        let mut workspace = Workspace::default();
        self.find_volumes(law, u, &mut workspace);
        workspace.of_clusters
    }

    fn find_volumes(&self, law: &dyn LawKernels, u: &[f64], workspace: &mut Workspace) {
        let Workspace { of_cells, of_clusters } = workspace;
        let is_shared = of_cells.shares(self.cells.n_tasks());
        self.clusters.volumes((law, &self.cells), u, is_shared, &mut of_clusters.volumes);
    }
}

impl ElementIntegrals for MeanVolume {
    fn n_tasks(&self) -> usize {
        self.cells.n_tasks()
    }

    fn for_each_gradient(&self, geometry: &[Geometry], u: &[f64], run: &mut dyn FnMut(&Mat3<f64>)) {
        self.cells.for_each_gradient(geometry, u, run);
    }

    fn outliers(&self, geometry: &[Geometry], u: &[f64], range: [f64; 2]) -> Vec<Outlier> {
        self.cells.outliers(geometry, u, range)
    }

    fn add_body_force(&self, of_cell: &dyn Fn(usize) -> [f64; 3], force: &mut [f64]) {
        self.cells.add_body_force(of_cell, force);
    }

    fn energy(&self, law: &dyn LawKernels, at: (&[f64], [f64; 2])) -> f64 {
        let MeanVolume { cells, clusters } = self;
        let local = cells.energy(law, clusters.around(&[]), at);
        if local.is_infinite() {
            return local;
        }
        local + clusters.energy(law, &self.at(law, at.0).volumes)
    }

    fn force(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], [f64; 2]),
        workspace: &mut Workspace,
        force: &mut [f64],
    ) -> f64 {
        let MeanVolume { cells, clusters } = self;
        self.find_volumes(law, at.0, workspace);
        let Workspace { of_cells, of_clusters } = workspace;
        clusters.pressures(law, of_clusters);
        let around = clusters.around(&of_clusters.shared.pressures);
        let local = cells.force(law, around, at, of_cells, force);
        if local.is_infinite() {
            return local;
        }
        local + clusters.energy(law, &of_clusters.volumes)
    }

    fn force_and_tangent(
        &self,
        law: &dyn LawKernels,
        at: (&[f64], Curvature),
        workspace: &mut Workspace,
        force: &mut [f64],
        tangent: &mut SymmetricBlocks,
    ) {
        let MeanVolume { cells, clusters } = self;
        self.find_volumes(law, at.0, workspace);
        let Workspace { of_cells, of_clusters } = workspace;
        clusters.tangent(law, at.1, of_clusters);
        let shared = &of_clusters.shared;
        let products = |block: usize, out: &mut [f64; 9]| clusters.add_products(shared, block, out);
        let law = (law, clusters.around(&shared.pressures));
        cells.force_and_tangent(law, at, of_cells, force, tangent, products);
    }

    fn shared(&self, law: &dyn LawKernels, (u, curvature): (&[f64], Curvature)) -> SharedTangent {
        let mut workspace = self.at(law, u);
        self.clusters.tangent(law, curvature, &mut workspace);
        workspace.shared
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
        let mut workspace = self.at(law, u);
        clusters.pressures(law, &mut workspace);
        let ClusterWorkspace { volumes, shared: SharedTangent { pressures, .. }, .. } = workspace;
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
    CellBatches<Tet4, 4>: CellSeries<T>,
    Clusters: ClusterSeries<T>,
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
