//! What the law answers at the quadrature points: the stress that the internal force is the integral of.

use super::cells::{Cells, deformation};
use super::clusters::averaged_part;
use super::{Assembly, Body};
use crate::element::{Geometry, Shape};
use crate::law::{Law, LawVisitor, Material};
use crate::tensor::Mat3;
use crate::unroll::tabulate;

/// A quadrature point of a deformed body.
#[derive(Clone, Copy, Debug)]
pub struct Response {
    /// Deformation gradient `F`.
    pub gradient: Mat3<f64>,
    /// First Piola-Kirchhoff stress `P` [Pa] of the element: where clusters share their change of volume, with the
    /// pressure of the cluster.
    pub stress: Mat3<f64>,
    /// Strain energy per rest volume [J/m^3], with the cell's share of that of its cluster.
    pub energy: f64,
}

/// The cluster of a cell: `J_c`, and `s U'(J_c)` [Pa].
#[derive(Clone, Copy)]
struct Shared {
    ratio: f64,
    pressure: f64,
}

impl Body {
    /// `F`, `P` and energy density at the quadrature points of every cell, cell by cell; of equal weight within one.
    /// `f_int` is the integral of `P grad N`, [`Body::energy`] that of the energy density.
    pub fn responses(&self, u: &[f64]) -> Vec<Response> {
        let (gradients, shared) = match &*self.assembly {
            Assembly::P1(cells) => (cells.gradients(&self.geometry, u), Vec::new()),
            Assembly::P2(cells) => (cells.gradients(&self.geometry, u), Vec::new()),
            Assembly::P1MeanVolume(cells, clusters) => {
                let volumes = clusters.volumes(&self.material, &cells.batches, u);
                let (pressures, _) = clusters.pressures(&self.material, &volumes);
                let mut shared = vec![Shared { ratio: 1.0, pressure: 0.0 }; self.cells.len()];
                for cluster in 0..clusters.members.len() {
                    let (ratio, pressure) = (volumes.clusters[cluster], pressures[cluster]);
                    for member in clusters.members.of(cluster) {
                        shared[member.cell as usize] = Shared { ratio, pressure };
                    }
                }
                (cells.gradients(&self.geometry, u), shared)
            }
        };
        let points = gradients.len() / self.cells.len();
        self.material.visit(Responses { material: &self.material, gradients, points, shared })
    }
}

impl<E: Shape<N>, const N: usize> Cells<E, N> {
    /// `F` at the quadrature points, cell by cell.
    pub(super) fn gradients(&self, geometry: &[Geometry], u: &[f64]) -> Vec<Mat3<f64>> {
        let at = |nodes: &[u32; N], geometry: &Geometry, point: usize| {
            let value = |a: usize, i: usize| u[3 * nodes[a] as usize + i];
            deformation(E::slopes(point), &geometry.gradients, value)
        };
        let cells = self.nodes.iter().zip(geometry);
        cells.flat_map(|(nodes, g)| (0..E::POINTS).map(move |point| at(nodes, g, point))).collect()
    }
}

struct Responses<'a> {
    material: &'a Material,
    gradients: Vec<Mat3<f64>>,
    points: usize,
    shared: Vec<Shared>,
}

impl LawVisitor for Responses<'_> {
    type Output = Vec<Response>;

    fn visit<L: Law>(self, make: fn(&[f64]) -> L) -> Vec<Response> {
        let at = |(point, gradient): (usize, &Mat3<f64>)| {
            let cell = point / self.points;
            let law = make(self.material.of_cell(cell));
            let (mut energy, mut stress) = law.energy_and_stress(gradient);
            if let Some(shared) = self.shared.get(cell) {
                let part = averaged_part(self.material, cell);
                let (ratio, slope) = law.volume_ratio(gradient);
                let q = shared.pressure - part * law.pressure(&ratio);
                stress = tabulate!(|i, j| stress[i][j] + q * slope[i][j]);
                energy += part * (law.dilatation(&shared.ratio) - law.dilatation(&ratio));
            }
            Response { gradient: *gradient, stress, energy }
        };
        self.gradients.iter().enumerate().map(at).collect()
    }
}
