//! Series in the three components of a contact displacement.
//!
//! A tool prescribes the weighted mean `sum_i w_i u_i = d` of a patch. With `K` the tangent of the
//! base state, `G = K^-1 W^T` and `C = W G`, every coefficient of
//!   u(d) = sum_a d^a u_a,   F(d) = sum_a d^a F_a      (1 <= |a| <= order)
//! follows from lower ones and one factorisation:
//!   v = -K^-1 N_a,   F_a = C^-1 (e_a - W v),   u_a = v + G F_a,
//! where `N_a` is the coefficient of the internal force with `u_a = 0`, and `e_a` is the unit vector of a first-order
//! term and zero otherwise. Several load positions are processed side by side.

mod directions;
mod fields;
mod on_device;

pub use self::fields::Fields;
pub use self::on_device::SeriesDevice;
use crate::body::Body;
use crate::equilibrium::{ConstrainedSystem, require_series_about_rest};
use crate::error::Error;
use crate::mesh::Patch;
use crate::number::{Lanes, Monomials, WIDTH, Wide};
use crate::tensor::{Mat3, inverse};
use crate::unroll::tabulate;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// The series of one load position.
pub struct TouchSeries {
    /// `u_a` for each monomial but the constant.
    pub displacement: Fields,
    /// `F_a`, the force of the tool on the body, for the same monomials [N / m^|a|].
    pub force: Vec<[f64; 3]>,
    /// Compliance `C = W K^-1 W^T` [m/N].
    pub compliance: Mat3<f64>,
}

/// One base state with its factorised tangent, from which any load position is expanded.
pub struct TouchExpansion<'a> {
    body: &'a Body,
    system: ConstrainedSystem,
    base: Vec<f64>,
    order: usize,
    device: Option<on_device::Expanded>,
}

impl<'a> TouchExpansion<'a> {
    /// Expansions of the given order about the equilibrium `base` with `fixed` nodes held.
    ///
    /// # Errors
    /// An order outside 1..=8; a law without a power series about rest; a base state that is not stable.
    pub fn new(body: &'a Body, fixed: &[u32], base: Vec<f64>, order: usize) -> Result<Self, Error> {
        if !(1..=8).contains(&order) {
            return Err(Error::input(format!("order {order}; it must be between 1 and 8")));
        }
        require_series_about_rest(body)?;
        let system = ConstrainedSystem::at(body, &base, fixed)?;
        Ok(TouchExpansion { body, system, base, order, device: None })
    }

    /// The same with the internal force expanded on a device, in single precision. Where the device does not take the body,
    /// or fails, the processor goes on, and [`SeriesDevice::fault`] says why.
    pub fn on_device(mut self, device: &Arc<SeriesDevice>) -> Self {
        self.device = on_device::Expanded::new(device, self.body, &self.base);
        self
    }

    /// Highest order.
    pub fn order(&self) -> usize {
        self.order
    }

    /// The body.
    pub fn body(&self) -> &'a Body {
        self.body
    }

    /// The series of some load positions, to an order not above that of the expansion.
    ///
    /// # Errors
    /// A patch that lies on fixed nodes only, or values that overflow.
    pub fn expand(&self, patches: &[&Patch], order: usize) -> Result<Vec<TouchSeries>, Error> {
        self.expand_while(&|| true, patches, order, 1)
    }

    /// As [`TouchExpansion::expand`], so many blocks of [`WIDTH`] positions at once, with a function that is called before
    /// every order of every block and may cancel.
    ///
    /// # Errors
    /// Those of [`TouchExpansion::expand`]; [`Error::Cancelled`].
    pub fn expand_while(
        &self,
        is_wanted: &(dyn Fn() -> bool + Sync),
        patches: &[&Patch],
        order: usize,
        at_once: usize,
    ) -> Result<Vec<TouchSeries>, Error> {
        let order = order.clamp(1, self.order);
        let mut series = Vec::with_capacity(patches.len());
        for some in patches.chunks(WIDTH * at_once.max(1)) {
            let blocks = some.par_chunks(WIDTH);
            let of = |block| Block::new(self, block, order)?.series(is_wanted);
            let done = blocks.map(of).collect::<Result<Vec<_>, Error>>()?;
            series.extend(done.into_iter().flatten());
        }
        Ok(series)
    }
}

/// Up to [`WIDTH`] load positions in progress.
struct Block<'a> {
    expansion: &'a TouchExpansion<'a>,
    order: usize,
    /// Monomials of the series, the constant included.
    terms: usize,
    patches: &'a [&'a Patch],
    /// Coefficients of each degree of freedom, the base state first.
    displacement: Vec<Wide>,
    forces: Vec<Vec<[f64; 3]>>,
    compliance: Vec<Mat3<f64>>,
    stiffness: Vec<Mat3<f64>>,
    /// Columns of `G` on the free degrees of freedom, three for each position.
    influence: Vec<f64>,
}

impl<'a> Block<'a> {
    fn new(
        expansion: &'a TouchExpansion,
        patches: &'a [&'a Patch],
        order: usize,
    ) -> Result<Self, Error> {
        let terms = Monomials::of(3, order).len();
        let mut displacement = vec![Wide::default(); expansion.body.n_dofs() * terms];
        for (dof, &u) in expansion.base.iter().enumerate() {
            displacement[dof * terms] = Lanes([u; WIDTH]);
        }
        let mut block = Block {
            expansion,
            order,
            terms,
            patches,
            displacement,
            forces: vec![Vec::with_capacity(terms - 1); patches.len()],
            compliance: Vec::new(),
            stiffness: Vec::new(),
            influence: Vec::new(),
        };
        block.solve_first_order()?;
        Ok(block)
    }

    /// `G`, `C`, and the first-order terms `u = G C^-1`, `F = C^-1`.
    fn solve_first_order(&mut self) -> Result<(), Error> {
        let system = &self.expansion.system;
        let n = system.n_free();
        let mut influence = vec![0.0; 3 * n * self.patches.len()];
        for (lane, patch) in self.patches.iter().enumerate() {
            for (row, i, w) in system.weights_of(patch) {
                influence[(3 * lane + i) * n + row] = w;
            }
        }
        system.solve_columns(&mut influence)?;
        self.influence = influence;
        for lane in 0..self.patches.len() {
            let columns: [[f64; 3]; 3] = std::array::from_fn(|k| {
                self.mean(lane, &self.influence[(3 * lane + k) * n..(3 * lane + k + 1) * n])
            });
            let compliance = tabulate!(|i, k| columns[k][i]);
            let stiffness = inverse(&compliance).ok_or_else(|| {
                Error::input(format!(
                    "the patch around point {} does not move: it lies on fixed points only",
                    self.patches[lane].nodes[0]
                ))
            })?;
            self.compliance.push(compliance);
            self.stiffness.push(stiffness);
        }
        let mut fields = vec![0.0; self.influence.len()];
        for (column, field) in fields.chunks_exact_mut(n).enumerate() {
            let (lane, k) = (column / 3, column % 3);
            let force = std::array::from_fn(|i| self.stiffness[lane][i][k]);
            self.add_influence(lane, force, field);
            self.forces[lane].push(force);
        }
        self.keep(&fields, 1..4);
        Ok(())
    }

    /// `W s` of a vector on the free degrees of freedom.
    fn mean(&self, lane: usize, s: &[f64]) -> [f64; 3] {
        let mut mean = [0.0; 3];
        for (row, i, w) in self.expansion.system.weights_of(self.patches[lane]) {
            mean[i] += w * s[row];
        }
        mean
    }

    /// Adds `G force` to a vector on the free degrees of freedom.
    fn add_influence(&self, lane: usize, force: [f64; 3], field: &mut [f64]) {
        let n = field.len();
        let [x, y, z] = std::array::from_fn(|k| &self.influence[(3 * lane + k) * n..][..n]);
        for (((u, x), y), z) in field.iter_mut().zip(x).zip(y).zip(z) {
            *u += x * force[0] + y * force[1] + z * force[2];
        }
    }

    /// Keeps coefficients on the free degrees of freedom, position by position, as those of some terms.
    fn keep(&mut self, fields: &[f64], terms: Range<usize>) {
        let (n, count) = (self.expansion.system.n_free(), terms.len());
        for rows in blocks(n) {
            for lane in 0..self.patches.len() {
                for (c, term) in terms.clone().enumerate() {
                    let field = &fields[(lane * count + c) * n..][rows.clone()];
                    for (u, &dof) in field.iter().zip(&self.expansion.system.free()[rows.clone()]) {
                        self.displacement[dof as usize * self.terms + term][lane] = *u;
                    }
                }
            }
        }
    }

    /// All higher orders, then the coefficients position by position.
    fn series(mut self, is_wanted: &(dyn Fn() -> bool + Sync)) -> Result<Vec<TouchSeries>, Error> {
        for degree in 2..=self.order {
            if !is_wanted() {
                return Err(Error::Cancelled);
            }
            self.solve_degree(degree)?;
        }
        Ok(self.by_position())
    }

    fn by_position(self) -> Vec<TouchSeries> {
        let (terms, n_dofs) = (self.terms, self.expansion.body.n_dofs());
        let mut fields = vec![Fields::zeros(n_dofs, terms - 1); self.patches.len()];
        for dofs in blocks(n_dofs) {
            for (lane, fields) in fields.iter_mut().enumerate() {
                for c in 1..terms {
                    let field = &mut fields[c - 1][dofs.clone()];
                    for (u, dof) in field.iter_mut().zip(dofs.clone()) {
                        *u = self.displacement[dof * terms + c][lane];
                    }
                }
            }
        }
        let series = fields.into_iter().zip(self.forces).zip(self.compliance);
        series
            .map(|((displacement, force), compliance)| TouchSeries {
                displacement,
                force,
                compliance,
            })
            .collect()
    }

    fn solve_degree(&mut self, degree: usize) -> Result<(), Error> {
        let TouchExpansion { system, body, device, .. } = self.expansion;
        let (terms, n) = (self.terms, system.n_free());
        let table = Monomials::of(3, degree);
        let top = table.of_degree(degree);
        let mut nonlinear = vec![Wide::default(); body.n_dofs() * top.len()];
        let of_device = device
            .as_ref()
            .is_some_and(|device| device.force(degree, &self.displacement, terms, &mut nonlinear));
        if !of_device {
            body.force_series(table, &self.displacement, terms, &mut nonlinear);
        }

        let mut fields = vec![0.0; n * top.len() * self.patches.len()];
        for rows in blocks(n) {
            for (column, field) in fields.chunks_exact_mut(n).enumerate() {
                let (lane, c) = (column / top.len(), column % top.len());
                for (u, &dof) in field[rows.clone()].iter_mut().zip(&system.free()[rows.clone()]) {
                    *u = -nonlinear[dof as usize * top.len() + c][lane];
                }
            }
        }
        drop(nonlinear);
        system.solve_columns(&mut fields)?;
        for (column, v) in fields.chunks_exact_mut(n).enumerate() {
            let lane = column / top.len();
            let (mean, stiffness) = (self.mean(lane, v), self.stiffness[lane]);
            let force =
                std::array::from_fn(|i| -(0..3).map(|k| stiffness[i][k] * mean[k]).sum::<f64>());
            self.add_influence(lane, force, v);
            self.forces[lane].push(force);
        }
        self.keep(&fields, top);
        Ok(())
    }
}

/// Runs of rows that are turned from one order of the coefficients into the other within the cache.
fn blocks(n: usize) -> impl Iterator<Item = Range<usize>> {
    const BLOCK: usize = 32;
    (0..n).step_by(BLOCK).map(move |start| start..n.min(start + BLOCK))
}

#[cfg(test)]
mod tests;
