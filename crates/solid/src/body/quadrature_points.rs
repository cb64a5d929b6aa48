//! Stress and energy at the quadrature points; the internal force is the integral of this stress.

use super::Body;
use super::batch::deformation;
use super::cells::CellBatches;
use super::clusters::averaged_part;
use crate::element::{Geometry, Shape};
use crate::law::{Material, Shared};
use crate::number::{LANES, Lane, Lanes};
use crate::tensor::Mat3;
use crate::unroll::tabulate;
use std::ops::Range;

/// A quadrature point of a deformed body.
#[derive(Clone, Copy, Debug)]
pub struct QuadraturePoint {
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
pub struct Cluster {
    pub ratio: f64,
    pub pressure: f64,
}

impl Body {
    /// `F`, `P` and energy density at the quadrature points of every cell, cell by cell; of equal weight within one.
    /// `f_int` is the integral of `P grad N`, [`Body::energy`] that of the energy density.
    pub fn quadrature_points(&self, u: &[f64]) -> Vec<QuadraturePoint> {
        let gradients = self.integrals.gradients(&self.geometry, u);
        let shared = self.integrals.clusters(self.material.law(), u);
        let points = gradients.len() / self.cells.len();
        Points { material: &self.material, gradients, of_cell: points, shared }.quadrature_points()
    }
}

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    /// Runs through `F` at the quadrature points, cell by cell.
    pub(super) fn for_each_gradient(
        &self,
        geometry: &[Geometry],
        u: &[f64],
        run: &mut dyn FnMut(&Mat3<f64>),
    ) {
        for (nodes, geometry) in self.nodes.iter().zip(geometry) {
            let value = |a: usize, i: usize| u[3 * nodes[a] as usize + i];
            for point in 0..E::POINTS {
                run(&deformation(E::slopes(point), &geometry.gradients, value));
            }
        }
    }
}

struct Points<'a> {
    material: &'a Material,
    gradients: Vec<Mat3<f64>>,
    of_cell: usize,
    shared: Vec<Cluster>,
}

impl Points<'_> {
    fn quadrature_points(&self) -> Vec<QuadraturePoint> {
        let (n, one_row) = (self.gradients.len(), self.material.parameters().len() == 1);
        let run = if one_row { LANES } else { self.of_cell };
        let runs = (0..n).step_by(run).map(|first| first..n.min(first + run));
        runs.flat_map(|points| self.of_run(points)).collect()
    }

    /// Of at most [`LANES`] points of one tissue.
    fn of_run(&self, points: Range<usize>) -> Vec<QuadraturePoint> {
        let cell = |point: usize| point / self.of_cell;
        let (law, row) = (self.material.law(), self.material.row(cell(points.start)));
        let at = |lane: usize| (points.start + lane).min(points.end - 1);
        let lanes =
            |value: &dyn Fn(usize) -> f64| Lanes(std::array::from_fn(|lane| value(at(lane))));
        let gradient = [tabulate!(|i, j| lanes(&|point| self.gradients[point][i][j]))];
        let of_cluster = |value: fn(&Cluster) -> f64| {
            [lanes(&|point| self.shared.get(cell(point)).map_or(0.0, value))]
        };
        let (ratio, pressure) = (of_cluster(|c| c.ratio), of_cluster(|c| c.pressure));
        let is_shared = !self.shared.is_empty();
        let part = if is_shared { averaged_part(self.material, cell(points.start)) } else { 0.0 };
        let shared =
            if is_shared { Shared { part, pressure: &pressure } } else { Shared::default() };
        let (mut energy, mut stress) = ([Lane::default()], [Mat3::<Lane>::default()]);
        law.stress(row, &gradient, shared, &mut energy, &mut stress);
        let mut dilatation = [Lane::default()];
        if is_shared {
            law.dilatation(row, &ratio, &mut dilatation);
        }
        let of_lane = |lane: usize| QuadraturePoint {
            gradient: self.gradients[points.start + lane],
            stress: tabulate!(|i, j| stress[0][i][j][lane]),
            energy: energy[0][lane] + part * dilatation[0][lane],
        };
        (0..points.len()).map(of_lane).collect()
    }
}
