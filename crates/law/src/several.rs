//! Several laws in one organ, with the index of its law for each cell.
//!
//! All cells of a call share a row, so the law of a row is looked up once for many cells.

#![allow(non_snake_case)]

use super::expression::Expression;
use super::kernels::{LawKernels, SeriesKernels, Shared, SharedSeries};
use super::{TangentBlocks, TaylorCache, Template};
use std::sync::Arc;
use viscera_number::tensor::{Mat3, Vec3};
use viscera_number::{Lane, Monomials, Wide};

/// Prefix of the name of several laws; their own names follow, separated by [`BETWEEN`].
pub const SEVERAL: &str = "laws ";

/// Separator of the names of several laws; it does not occur in formulas.
pub const BETWEEN: &str = "; ";

/// Laws side by side. A row of parameters begins with the index of its law. The parameters of that law follow, then
/// unused numbers if another law has more of them.
pub(super) struct Several {
    /// Each law, and how many parameters it has.
    pub laws: Vec<(Arc<dyn LawKernels>, usize)>,
}

impl Several {
    /// The law of a row, and its own part of the row.
    fn of<'a>(&'a self, row: &'a [f64]) -> (&'a dyn LawKernels, &'a [f64]) {
        (&*self.laws[row[0] as usize].0, &row[1..])
    }
}

impl LawKernels for Several {
    /// If one of the laws forbids inversion, all do.
    fn forbids_inversion(&self) -> bool {
        self.laws.iter().any(|(law, _)| law.forbids_inversion())
    }

    fn prepare(&self, row: &[f64]) -> Vec<f64> {
        let (law, n) = &self.laws[row[0] as usize];
        [&row[..1], &law.prepare(&row[1..1 + n])].concat()
    }

    fn expression(&self, row: &[f64]) -> Option<Expression> {
        let (law, row) = self.of(row);
        law.expression(row)
    }

    fn template(&self, row: &[f64], part: Option<f64>) -> Option<Template> {
        let (law, row) = self.of(row);
        law.template(row, part)
    }

    fn dilatation_template(&self, row: &[f64], part: f64) -> Option<Template> {
        let (law, row) = self.of(row);
        law.dilatation_template(row, part)
    }

    fn energy(&self, row: &[f64], F: &[Mat3<Lane>], part: f64, psi: &mut [Lane]) {
        let (law, row) = self.of(row);
        law.energy(row, F, part, psi);
    }

    fn stress(
        &self,
        row: &[f64],
        F: &[Mat3<Lane>],
        shared: Shared<'_>,
        psi: &mut [Lane],
        P: &mut [Mat3<Lane>],
    ) {
        let (law, row) = self.of(row);
        law.stress(row, F, shared, psi, P);
    }

    fn tangent(
        &self,
        row: &[f64],
        F: &[Mat3<Lane>],
        g: &[[Vec3<Lane>; 3]],
        shared: Shared<'_>,
        P: &mut [Mat3<Lane>],
        A: &mut [TangentBlocks<Lane>],
    ) {
        let (law, row) = self.of(row);
        law.tangent(row, F, g, shared, P, A);
    }

    fn volume_ratio(&self, row: &[f64], F: &[Mat3<Lane>], J: &mut [Lane], Z: &mut [Mat3<Lane>]) {
        let (law, row) = self.of(row);
        law.volume_ratio(row, F, J, Z);
    }

    fn dilatation(&self, row: &[f64], J: &[Lane], U: &mut [Lane]) {
        let (law, row) = self.of(row);
        law.dilatation(row, J, U);
    }

    fn pressure(&self, row: &[f64], J: &[Lane], out: &mut [[Lane; 2]]) {
        let (law, row) = self.of(row);
        law.pressure(row, J, out);
    }
}

impl SeriesKernels for Several {
    fn stress_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<Wide>,
        table: &'static Monomials,
        deformation: &[Wide],
        shared: SharedSeries<'_, Wide>,
        out: &mut [Wide],
    ) {
        let (law, row) = self.of(row);
        law.stress_series(row, cache, table, deformation, shared, out);
    }

    fn volume_series(
        &self,
        row: &[f64],
        table: &'static Monomials,
        deformation: &[Wide],
        out: &mut [Wide],
    ) {
        let (law, row) = self.of(row);
        law.volume_series(row, table, deformation, out);
    }

    fn pressure_series(
        &self,
        row: &[f64],
        cache: &mut TaylorCache<Wide>,
        table: &'static Monomials,
        ratio: &[Wide],
        out: &mut [Wide],
    ) {
        let (law, row) = self.of(row);
        law.pressure_series(row, cache, table, ratio, out);
    }
}
