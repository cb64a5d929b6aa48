//! All orders on one tangent: `K u_p(s) = load_p f(s) - N_p(s)`, first order first.
//!
//! The right-hand side `N_p`, the order-p coefficient of the internal force for `u_p = 0`, is evaluated at every
//! position from the separated lower orders. That costs a series evaluation of the whole mesh for each position,
//! whichever way its answer is then separated; the fully separated product of paper A has of the order of m^3
//! terms for m pairs (24 000 at order 4 with 20) and is dearer from a few pairs on.

use super::enrichment::{Enriched, Enrichment};
use super::loads::Loads;
use super::separated::Separated;
use crate::body::Body;
use crate::clock::Instant;
use crate::equilibrium::{ConstrainedSystem, require_series_about_rest};
use crate::error::Error;
use crate::number::{Monomials, WIDTH, Wide};
use rayon::prelude::*;

/// How each order is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Route {
    /// Separated pair by pair; higher orders are built from the separated lower ones.
    Greedy(Enrichment),
    /// Solved at every position: `F_i = u_p(., s_i)`, `G_i` one at `s_i` and zero elsewhere.
    Direct,
}

/// Settings.
#[derive(Clone, Copy, Debug)]
pub struct Pgd {
    /// Highest order N, 1 to 15.
    pub order: usize,
    /// The load at `a = 1` [N], along the inward normal where positive.
    pub load: f64,
    /// How each order is solved.
    pub route: Route,
}

/// One order of the series.
#[derive(Clone, Debug)]
pub struct Order {
    /// `u_p(x, s)` [m].
    pub field: Separated,
    /// Energy norm of each pair [J^1/2]; empty for the direct route.
    pub sizes: Vec<f64>,
    /// Fixed-point iterations of each pair; empty for the direct route.
    pub iterations: Vec<usize>,
    /// Whether the largest number of pairs ended the enrichment before its tolerance did.
    pub is_cut: bool,
    /// Time for the right-hand sides [s].
    pub seconds_rhs: f64,
    /// Time for solving and separating [s].
    pub seconds_solve: f64,
}

/// Progress of the work.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// The order in hand, from 1.
    pub order: usize,
    /// Pairs it has so far.
    pub terms: usize,
}

impl Pgd {
    /// The series of all positions; `progress` may return false to stop.
    ///
    /// # Errors
    /// Bad settings, a load that is zero or not finite, nothing fixed, a law without a power series about rest, an unstable
    /// rest state, values that overflow, or a stop on request.
    pub fn run(
        &self,
        body: &Body,
        fixed: &[u32],
        loads: &Loads,
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Vec<Order>, Error> {
        self.check()?;
        let clock = Instant::now();
        if fixed.is_empty() && body.ties().is_none() {
            return Err(Error::input("nothing is fixed; an organ that floats cannot be pushed"));
        }
        require_series_about_rest(body)?;
        let system = ConstrainedSystem::at(body, &vec![0.0; body.n_dofs()], fixed)?;
        let mut orders: Vec<Order> = Vec::with_capacity(self.order);
        let mut setup = clock.elapsed().as_secs_f64();
        for p in 1..=self.order {
            let mut go_on = |terms| progress(Progress { order: p, terms });
            if !go_on(0) {
                return Err(Error::Cancelled);
            }
            let clock = Instant::now();
            let rhs = match p {
                1 => self.first_rhs(&system, loads),
                _ => nonlinear_rhs(body, &system, &orders, loads.len(), &mut || go_on(0))?,
            };
            self.check_finite(p, &rhs, loads)?;
            let seconds_rhs = clock.elapsed().as_secs_f64();
            let clock = Instant::now();
            let found = self.solve(&system, rhs, loads, &mut go_on)?;
            orders.push(Order {
                field: found.field,
                sizes: found.sizes,
                iterations: found.iterations,
                is_cut: found.is_cut,
                seconds_rhs: seconds_rhs + std::mem::take(&mut setup),
                seconds_solve: clock.elapsed().as_secs_f64(),
            });
        }
        Ok(orders)
    }

    fn check(&self) -> Result<(), Error> {
        if !(1..=15).contains(&self.order) {
            return Err(Error::input(format!("order {}; it must be between 1 and 15", self.order)));
        }
        if !(self.load.is_finite() && self.load != 0.0) {
            return Err(Error::input(format!(
                "load {} N; it must be finite and not zero",
                self.load
            )));
        }
        match self.route {
            Route::Greedy(enrichment) => enrichment.check(),
            Route::Direct => Ok(()),
        }
    }

    /// Refuses the right-hand sides of an order that have left the range of finite numbers.
    fn check_finite(&self, order: usize, rhs: &[f64], loads: &Loads) -> Result<(), Error> {
        let mut columns = rhs.chunks_exact(rhs.len() / loads.len());
        match columns.position(|column| column.iter().any(|f| !f.is_finite())) {
            None => Ok(()),
            Some(s) => Err(Error::input(format!(
                "order {order}: the forces are not finite for the load of {:.1e} N at node {}; check its unit and those of the \
                 law",
                self.load, loads.positions[s]
            ))),
        }
    }

    fn solve(
        &self,
        system: &ConstrainedSystem,
        mut rhs: Vec<f64>,
        loads: &Loads,
        go_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Enriched, Error> {
        if let Route::Greedy(enrichment) = self.route {
            return enrichment.separate(system, &mut rhs, &loads.weights, go_on);
        }
        system.solve_columns(&mut rhs)?;
        let m = loads.len();
        let unit = |s: usize| (0..m).map(|k| if k == s { 1.0 } else { 0.0 }).collect();
        let field = Separated {
            space: rhs.chunks_exact(system.n_free()).map(|u| system.scatter(u)).collect(),
            position: (0..m).map(unit).collect(),
        };
        Ok(Enriched { field, ..Enriched::default() })
    }

    /// `load f(s)` of every position.
    fn first_rhs(&self, system: &ConstrainedSystem, loads: &Loads) -> Vec<f64> {
        let mut rhs = vec![0.0; system.n_free() * loads.len()];
        for (column, unit) in rhs.chunks_exact_mut(system.n_free()).zip(&loads.unit) {
            for &(dof, force) in unit {
                if let Some(row) = system.row_of(dof as usize) {
                    column[row] += self.load * force;
                }
            }
        }
        rhs
    }
}

/// `-N_p` of every position, p being one more than the number of orders known. What each thread has in hand is done
/// between two questions whether to go on.
fn nonlinear_rhs(
    body: &Body,
    system: &ConstrainedSystem,
    orders: &[Order],
    positions: usize,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<Vec<f64>, Error> {
    let mut rhs = vec![0.0; system.n_free() * positions];
    let blocks = rayon::current_num_threads();
    for (first, some) in rhs.chunks_mut(blocks * WIDTH * system.n_free()).enumerate() {
        if !go_on() {
            return Err(Error::Cancelled);
        }
        nonlinear_rhs_from(body, system, orders, blocks * first, some);
    }
    Ok(rhs)
}

/// The right-hand sides of some positions, from the given block of `WIDTH` on.
fn nonlinear_rhs_from(
    body: &Body,
    system: &ConstrainedSystem,
    orders: &[Order],
    first: usize,
    rhs: &mut [f64],
) {
    rhs.par_chunks_mut(WIDTH * system.n_free()).enumerate().for_each(|(block, columns)| {
        let block = first + block;
        let (n_dofs, stride) = (body.n_dofs(), orders.len() + 2);
        let mut displacement = vec![Wide::default(); n_dofs * stride];
        for (lane, _) in columns.chunks_exact(system.n_free()).enumerate() {
            for (q, order) in orders.iter().enumerate() {
                order.field.at(WIDTH * block + lane, |f, g| {
                    for (u, f) in displacement[q + 1..].iter_mut().step_by(stride).zip(f) {
                        u[lane] += g * f;
                    }
                });
            }
        }
        let mut force = vec![Wide::default(); n_dofs];
        let table = Monomials::of(1, orders.len() + 1);
        body.force_series(table, &displacement, stride, &mut force);
        for (lane, column) in columns.chunks_exact_mut(system.n_free()).enumerate() {
            for (value, &dof) in column.iter_mut().zip(system.free()) {
                *value = -force[dof as usize][lane];
            }
        }
    });
}
