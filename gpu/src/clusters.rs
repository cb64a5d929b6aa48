//! Clusters of cells that share their volume ratio. The caller computes ratios, pressures and gradients in double
//! precision; the device adds their part of the tangent.

use crate::device::Gpu;
use crate::driver::{Buffer, Group, Kernel};
use crate::gathered::Gathered;
use crate::tangent::Tangent;
use crate::{Error, System};

/// Cells that share their volume ratio. The caller computes pressures and gradients, see [`Tangent`].
#[derive(Clone, Copy, Debug)]
pub struct Clusters<'a> {
    /// The cluster of each cell.
    pub of: &'a [u32],
    /// Where the nodes of each cluster start; the last entry is the end of all.
    pub starts: &'a [u32],
    /// Nodes of the clusters, ascending within each.
    pub nodes: &'a [u32],
}

/// The buffers of all clusters.
pub(crate) struct ClusterBuffers {
    pub kernel: Kernel,
    pub pressures: Buffer,
    slopes: Buffer,
    n_clusters: usize,
    n_places: usize,
}

/// WGSL of the pressure of a cell without clusters.
pub(crate) const ALONE: &str = "fn pressure_of(cell: u32) -> f32 { return 0.0; }";

/// The same with clusters.
pub(crate) const IN_CLUSTERS: &str = "\
@group(0) @binding(6) var<storage, read> pressures: array<f32>;
@group(0) @binding(7) var<storage, read> clusters: array<u32>;
fn pressure_of(cell: u32) -> f32 { return pressures[clusters[cell]]; }";

impl ClusterBuffers {
    pub fn new(gpu: &Gpu, clusters: Clusters<'_>) -> Result<Self, Error> {
        let kernel = gpu.kernel(include_str!("kernels/clusters.wgsl"), "add_clusters")?;
        let (n_clusters, n_places) = (clusters.len(), clusters.nodes.len());
        let pressures = gpu.zeros::<f32>("pressures of clusters", n_clusters)?;
        let slopes = gpu.zeros::<f32>("slopes of clusters", 6 * n_places)?;
        Ok(ClusterBuffers { kernel, pressures, slopes, n_clusters, n_places })
    }

    /// Uploads the pressures and gradients of a displacement.
    pub fn move_to(&self, gpu: &Gpu, tangent: &Tangent<'_>) -> Result<(), Error> {
        let [slopes, weighted] = tangent.slopes;
        let given = [tangent.pressures.len(), slopes.len(), weighted.len()];
        if given != [self.n_clusters, self.n_places, self.n_places] {
            return Err(Error::Input(format!(
                "{given:?} pressures, slopes and weighted slopes for {} clusters with {} nodes",
                self.n_clusters, self.n_places
            )));
        }
        let pressures: Vec<f32> = tangent.pressures.iter().map(|&p| p as f32).collect();
        let both = slopes.iter().zip(weighted).flat_map(|(j, m)| [*j, *m]);
        let both: Vec<f32> = both.flatten().map(|x| x as f32).collect();
        gpu.write(&self.pressures, &pressures);
        gpu.write(&self.slopes, &both);
        Ok(())
    }

    /// Binds the products `m j^T` that are summed at each place of a chunk.
    pub fn commands(
        &self,
        gpu: &Gpu,
        system: &System,
        k: usize,
        clusters: Clusters<'_>,
    ) -> Result<Group, Error> {
        let (chunk, row_of) = (&system.layout.chunks[k], &system.layout.row_of);
        let mut products = Vec::new();
        for places in clusters.places() {
            for row in places.clone() {
                let own = row_of[clusters.nodes[row] as usize];
                if !chunk.rows.contains(&(own as usize)) {
                    continue;
                }
                for column in places.clone() {
                    let other = row_of[clusters.nodes[column] as usize];
                    products.push((chunk.place(own, other)?, [row as u32, column as u32]));
                }
            }
        }
        let products = Gathered::new(chunk.columns.len(), &products);
        let starts = gpu.buffer("products of clusters", &products.starts)?;
        let parts = gpu.buffer("products of clusters", &products.parts)?;
        let size = gpu.uniform(&[chunk.columns.len() as u32, 0, 0, 0]);
        let values = &system.chunks[k].values;
        Ok(gpu.bind(&self.kernel, &[&starts, &parts, &self.slopes, values, &size]))
    }
}

impl Clusters<'_> {
    pub(crate) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// For each cluster, the range of its nodes in `nodes`.
    fn places(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.starts.windows(2).map(|w| w[0] as usize..w[1] as usize)
    }

    /// For each row, the number of products in all its blocks.
    pub(crate) fn products_of_rows(&self, n_nodes: usize) -> Vec<u32> {
        let mut count = vec![0; n_nodes];
        for places in self.places() {
            let more = places.len() as u32;
            self.nodes[places].iter().for_each(|&node| count[node as usize] += more);
        }
        count
    }

    /// Checks that the clusters fit a body.
    pub(crate) fn check(&self, n_nodes: usize, n_cells: usize) -> Result<(), Error> {
        let ascends = self.starts.windows(2).all(|w| w[0] <= w[1]);
        let ends = self.starts.first() == Some(&0)
            && self.starts.last().is_some_and(|&end| end as usize == self.nodes.len());
        let is_sound = self.of.len() == n_cells
            && ascends
            && ends
            && self.of.iter().all(|&cluster| (cluster as usize) < self.len())
            && self.nodes.iter().all(|&node| (node as usize) < n_nodes);
        if is_sound {
            Ok(())
        } else {
            Err(Error::Input("the clusters do not fit the cells and nodes of the body".to_string()))
        }
    }
}
