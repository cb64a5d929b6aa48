//! Right-hand sides of the asymptotic numerical method: the highest-degree coefficients of the
//! internal force along a series of displacements (paper A; docs/architecture.md).

use super::Body;
use crate::law::{Law, LawVisitor};
use crate::number::{Monomials, Real};
use crate::simd::{Kernel, dispatch};

impl Body {
    /// Degree-p coefficients of the internal force, p being the order of `table`.
    ///
    /// `displacement` holds `stride >= table.len()` coefficients for each degree of freedom (the
    /// displacement of the base state first); only those of degree below p are read, so that the
    /// result is the nonlinear right-hand side with `u_p = 0`. `force` receives
    /// `table.of_degree(p).len()` coefficients for each degree of freedom.
    pub fn force_series<T: Real>(
        &self,
        table: &'static Monomials,
        displacement: &[T],
        stride: usize,
        force: &mut [T],
    ) {
        force.fill(T::default());
        self.material.visit(Series { body: self, table, displacement, stride, force });
    }
}

struct Series<'a, T> {
    body: &'a Body,
    table: &'static Monomials,
    displacement: &'a [T],
    stride: usize,
    force: &'a mut [T],
}

impl<T: Real> LawVisitor for Series<'_, T> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        dispatch(SeriesKernel { series: self, make });
    }
}

struct SeriesKernel<'a, T, L> {
    series: Series<'a, T>,
    make: fn(&[f64]) -> L,
}

impl<T: Real, L: Law> Kernel for SeriesKernel<'_, T, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Series { body, table, displacement, stride, force } = self.series;
        let (n, top) = (table.len(), table.of_degree(table.order()).len());
        let mut deformation = vec![T::default(); 9 * n];
        let mut stress = vec![T::default(); 9 * top];
        for (cell, (nodes, element)) in body.cells.iter().zip(&body.elements).enumerate() {
            deformation_series(
                nodes,
                &element.gradients,
                displacement,
                stride,
                n - top,
                n,
                &mut deformation,
            );
            stress.fill(T::default());
            let law = (self.make)(body.material.of_cell(cell));
            law.stress_series(table, &deformation, &mut stress);
            for (a, &node) in nodes.iter().enumerate() {
                for i in 0..3 {
                    let dof = 3 * node as usize + i;
                    let out = &mut force[dof * top..(dof + 1) * top];
                    for j in 0..3 {
                        let weight = element.gradients[a][j] * element.volume;
                        let p = &stress[(3 * i + j) * top..(3 * i + j + 1) * top];
                        for (out, &p) in out.iter_mut().zip(p) {
                            *out = *out + p * weight;
                        }
                    }
                }
            }
        }
    }
}

/// Series of `F = I + sum_a u_a (x) g_a`, the first `known` coefficients of each run of `n`.
#[inline(always)]
fn deformation_series<T: Real>(
    nodes: &[u32; 4],
    gradients: &[[f64; 3]; 4],
    displacement: &[T],
    stride: usize,
    known: usize,
    n: usize,
    deformation: &mut [T],
) {
    deformation.fill(T::default());
    for (a, &node) in nodes.iter().enumerate() {
        for i in 0..3 {
            let dof = 3 * node as usize + i;
            let u = &displacement[dof * stride..dof * stride + known];
            for j in 0..3 {
                let run = &mut deformation[(3 * i + j) * n..(3 * i + j) * n + known];
                for (f, &u) in run.iter_mut().zip(u) {
                    *f = *f + u * gradients[a][j];
                }
            }
        }
    }
    for i in 0..3 {
        deformation[4 * i * n] = deformation[4 * i * n] + 1.0;
    }
}
