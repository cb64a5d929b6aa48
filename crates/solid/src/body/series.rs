//! Right-hand sides of the asymptotic numerical method: the highest-degree coefficients of the
//! internal force along a series of displacements (paper A; docs/architecture.md). Laws take eight series side by side:
//! those of [load positions](positions), cell after cell, or those of cells along one [path].

mod path;
mod positions;

use super::clusters::Clusters;
use crate::element::Geometry;
use crate::law::Material;
use crate::number::Monomials;

/// The part of an element's integrals that is about series, of coefficients `T`: `f64` along a path, `Wide` for load
/// positions side by side.
pub trait SeriesIntegrals<T> {
    /// Adds the degree-p coefficients of the internal force.
    fn add_force_series(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        force: &mut [T],
    );
}

/// What the integrals are made of, cell by cell.
pub(super) trait CellSeries<T> {
    /// Adds the degree-p forces.
    fn force_series(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        around: AroundSeries<T>,
        force: &mut [T],
    );

    /// Adds the series of each cell's volume ratio, times its part of the volume, to that of its cluster.
    fn add_volume_series(
        &self,
        material: &Material,
        geometry: &[Geometry],
        along: Along<T>,
        clusters: &Clusters,
        ratios: &mut [T],
    );
}

/// What they are made of where cells share their volume ratio.
pub(super) trait ClusterSeries<T> {
    /// From the series of the volume ratio of each cluster to those of its pressure, `sum_t s V_t U_t'(J_c) / V_c` over
    /// its tissues t, in place.
    fn pressure_series(&self, material: &Material, table: &'static Monomials, series: &mut [T]);
}

/// A series of displacements.
pub struct Along<'a, T> {
    pub table: &'static Monomials,
    pub displacement: &'a [T],
    pub stride: usize,
}

impl<T> Clone for Along<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Along<'_, T> {}

impl<T> Along<'_, T> {
    /// How many coefficients are known: all but those of the highest degree.
    fn known(&self) -> usize {
        self.table.of_degree(self.table.order()).start
    }
}

/// The pressures of clusters as series, or nothing where every cell is on its own.
pub struct AroundSeries<'a, T>(pub Option<(&'a Clusters, &'a [T])>);

#[cfg(test)]
mod tests {
    use crate::body::Body;
    use crate::element::Element;
    use crate::law::Material;
    use crate::law::samples::parameters;
    use crate::mesh::samples::{block, noise};
    use crate::number::{Lanes, Monomials, Wide};

    /// Two tissues, neither of which fills the lanes of a series.
    #[test]
    fn cells_side_by_side_give_what_positions_side_by_side_give() {
        let (points, cells) = block([2; 3], [0.03, 0.04, 0.05]);
        let row = |cell: usize| parameters("neo_hookean", if cell % 4 == 1 { 3.0 } else { 1.0 });
        let material = Material::new("neo_hookean", (0..cells.len()).map(row).collect()).unwrap();
        for element in Element::ALL {
            let body = Body::with_element(element, points.clone(), cells.clone(), material.clone());
            let body = body.unwrap();
            for (variables, order) in [(1, 2), (1, 6), (3, 3)] {
                let table = Monomials::of(variables, order);
                let of_cells: Vec<f64> =
                    noise(body.n_dofs() * table.len(), 3).iter().map(|x| 2e-4 * x).collect();
                let of_positions: Vec<Wide> = of_cells.iter().map(|&u| Lanes([u; 8])).collect();
                let n = body.n_dofs() * table.of_degree(order).len();
                let (mut found, mut exact) = (vec![0.0; n], vec![Wide::default(); n]);
                body.force_series(table, &of_cells, table.len(), &mut found);
                body.force_series(table, &of_positions, table.len(), &mut exact);
                let largest = exact.iter().fold(0.0f64, |most, f| most.max(f[0].abs()));
                for (found, exact) in found.iter().zip(&exact) {
                    let (name, error) = (element.name(), (found - exact[0]).abs() / largest);
                    assert!(error < 1e-12, "{name}, {variables}, {order}: {error:e}");
                }
                assert!(largest > 0.0);
            }
        }
    }
}
