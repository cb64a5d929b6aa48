//! The elements that a body may be made of. Only this file distinguishes them.

use super::batch::pairs_of;
use super::blocks::BlockPattern;
use super::cells::CellBatches;
use super::integrals::ElementIntegrals;
use super::layout::Layout;
use super::mean_volume::MeanVolume;
use super::partition::Partition;
use crate::element::{Element, Shape, Tet4, Tet10};
use crate::law::Material;
use crate::mesh;
use std::sync::Arc;

/// The pairs of nodes that the tangent of an element has, and its integrals; `partition` puts cells in clusters where it
/// wants some.
pub(super) fn integrals(
    element: Element,
    layout: &Layout<'_>,
    partition: impl FnOnce(&[[u32; 4]], &Material) -> Partition,
) -> (BlockPattern, Arc<dyn ElementIntegrals>) {
    let cells = layout.cells;
    match element {
        Element::P1 => cell_by_cell::<Tet4, 4>(layout, cells.to_vec()),
        Element::P1MeanVolume => {
            let parts = partition(cells, layout.material);
            let (pattern, integrals) = MeanVolume::new(layout, &parts);
            (pattern, Arc::new(integrals))
        }
        Element::P2 => {
            let nodes = mesh::quadratic_cells(layout.n_corners, cells, layout.edges);
            cell_by_cell::<Tet10, 10>(layout, nodes)
        }
    }
}

/// Those of an element whose cells have their energy to themselves.
fn cell_by_cell<E: Shape<N>, const N: usize>(
    layout: &Layout<'_>,
    nodes: Vec<[u32; N]>,
) -> (BlockPattern, Arc<dyn ElementIntegrals>) {
    let n = layout.n_nodes();
    let pattern = BlockPattern::new(n, nodes.iter().flat_map(pairs_of).chain(layout.ties.pairs()));
    let cells = CellBatches::<E, N>::new(nodes, layout.geometry, layout.material, &pattern, n);
    (pattern, Arc::new(cells))
}
