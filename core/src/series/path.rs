//! Equilibrium paths under a growing force: the asymptotic numerical method of paper A.
//!
//! `u(a) = sum a^p u_p`, `load(a) = sum a^p load_p`, and at every order the same tangent,
//!   K u_p = load_p f - N_p,
//! with `N_p` the order-p coefficient of the internal force for `u_p = 0`. The
//! parameter `a` is the load, or an arc length that passes limit points. An expansion reaches as
//! far as its Pade form holds; there one correction returns to equilibrium and the next begins.

use super::pade::{Pade, dot, norm, pade_range, taylor_range};
use crate::body::Body;
use crate::equilibrium::System;
use crate::error::Error;
use crate::number::Monomials;

/// What the series are expanded in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// `a = load - load_0`.
    Load,
    /// `a = <u - u_0, u_1> + (load - load_0) load_1` (Cochelin), displacements scaled by the first
    /// tangent's.
    ArcLength,
}

/// Settings of a continuation.
#[derive(Clone, Copy, Debug)]
pub struct Continuation {
    /// Order of the series.
    pub order: usize,
    /// The path parameter.
    pub parameter: Parameter,
    /// Load factor to reach.
    pub until: f64,
    /// Relative accuracy of an expansion over its range.
    pub tolerance: f64,
    /// Expansions at most.
    pub max_expansions: usize,
}

/// One stretch of a path.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// `u_p` and, as the last entry of each, the load coefficient.
    pub series: Vec<Vec<f64>>,
    /// Where the stretch ends: the reach of the Pade form, or less when the load is reached.
    pub range: f64,
    /// Reach of the polynomial.
    pub taylor_range: f64,
    /// Out-of-balance force at the end of the range, relative to the load, before correction.
    pub residual: f64,
}

/// A path in progress.
struct Follower<'a> {
    settings: Continuation,
    body: &'a Body,
    force: &'a [f64],
    system: System,
    /// Displacement, then the load.
    state: Vec<f64>,
    /// `1 / |u|^2` of the first tangent: makes displacement and load comparable.
    scale: f64,
    /// First-order terms of the expansion before, for the direction of travel.
    previous: Option<Vec<f64>>,
}

impl Continuation {
    /// Follows the path of `load * force` from rest, `fixed` nodes held.
    ///
    /// # Errors
    /// Bad settings or force; a singular tangent. A path that ends early (its load never reached
    /// in `max_expansions`) is returned as far as it goes.
    pub fn follow(
        &self,
        body: &Body,
        fixed: &[u32],
        force: &[f64],
    ) -> Result<Vec<Expansion>, Error> {
        self.check(body, force)?;
        let tangent = body.zero_tangent();
        let dofs = fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i));
        let mut follower = Follower {
            settings: *self,
            body,
            force,
            system: System::indefinite(&tangent, body.n_dofs(), dofs)?,
            state: vec![0.0; body.n_dofs() + 1],
            scale: 0.0,
            previous: None,
        };
        let mut expansions = Vec::new();
        for _ in 0..self.max_expansions {
            let expansion = follower.expand()?;
            let is_last = follower.load() >= self.until * (1.0 - 1e-9);
            let stuck = !(expansion.range > 0.0);
            expansions.push(expansion);
            if is_last || stuck {
                break;
            }
        }
        Ok(expansions)
    }

    fn check(&self, body: &Body, force: &[f64]) -> Result<(), Error> {
        if !(2..=30).contains(&self.order) {
            return Err(Error::input(format!("order {}; it must be between 2 and 30", self.order)));
        }
        if !(self.until > 0.0 && self.until.is_finite()) {
            return Err(Error::input(format!("load factor {}; it must be positive", self.until)));
        }
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return Err(Error::input(format!(
                "tolerance {}; it must be between 0 and 1",
                self.tolerance
            )));
        }
        if force.len() != body.n_dofs() || force.iter().any(|f| !f.is_finite()) {
            return Err(Error::input("the force must be finite, three components for each point"));
        }
        if force.iter().all(|&f| f == 0.0) {
            return Err(Error::input("the force is zero; there is no path to follow"));
        }
        Ok(())
    }
}

impl Follower<'_> {
    fn load(&self) -> f64 {
        self.state[self.state.len() - 1]
    }

    /// Builds an expansion at the state and moves the state to its end.
    fn expand(&mut self) -> Result<Expansion, Error> {
        let (mut force, mut tangent) = (vec![0.0; self.body.n_dofs()], self.body.zero_tangent());
        let u = &self.state[..self.body.n_dofs()];
        self.body.internal_force_and_tangent(u, &mut force, &mut tangent);
        self.system.factorize(&tangent, 0.0)?;
        let series = self.series()?;
        let taylor_range = taylor_range(&series, self.settings.tolerance);
        let reach = if taylor_range.is_finite() {
            pade_range(&series, self.settings.tolerance, taylor_range)
        } else {
            2.0 * self.settings.until / series[1][self.body.n_dofs()].abs().max(1e-12)
        };
        let pade = Pade::new(&series, 0);
        let range = self.end_of_range(&series, &pade, reach);
        self.state = pade.evaluate(&series, range);
        let residual = self.correct(&series[1])?;
        self.previous = Some(series[1].clone());
        Ok(Expansion { series, range, taylor_range, residual })
    }

    /// All orders on one tangent.
    fn series(&mut self) -> Result<Vec<Vec<f64>>, Error> {
        let n = self.body.n_dofs();
        let tangent = self.solve(self.force)?;
        if self.scale == 0.0 {
            self.scale = 1.0 / dot(&tangent, &tangent);
        }
        let first_load = self.first_load(&tangent);
        let mut first: Vec<f64> = tangent.iter().map(|t| first_load * t).collect();
        first.push(first_load);

        let stride = self.settings.order + 1;
        let mut coefficients = vec![0.0; n * stride];
        for dof in 0..n {
            coefficients[dof * stride] = self.state[dof];
            coefficients[dof * stride + 1] = first[dof];
        }
        let mut series = vec![self.state.clone(), first];
        for p in 2..=self.settings.order {
            let mut nonlinear = vec![0.0; n];
            self.body.force_series(Monomials::of(1, p), &coefficients, stride, &mut nonlinear);
            nonlinear.iter_mut().for_each(|f| *f = -*f);
            let mut u = self.solve(&nonlinear)?;
            let load = match self.settings.parameter {
                Parameter::Load => 0.0,
                Parameter::ArcLength => -first_load * self.scale * dot(&u, &series[1][..n]),
            };
            let share = load / first_load;
            u.iter_mut().zip(&series[1]).for_each(|(u, first)| *u += share * first);
            for dof in 0..n {
                coefficients[dof * stride + p] = u[dof];
            }
            u.push(load);
            series.push(u);
        }
        Ok(series)
    }

    /// First-order load: 1, or that of a unit arc, in the direction of travel.
    fn first_load(&self, tangent: &[f64]) -> f64 {
        if self.settings.parameter == Parameter::Load {
            return 1.0;
        }
        let size = 1.0 / (1.0 + self.scale * dot(tangent, tangent)).sqrt();
        let along = self.previous.as_ref().map_or(1.0, |previous| {
            let n = tangent.len();
            self.scale * dot(tangent, &previous[..n]) + previous[n]
        });
        size * along.signum()
    }

    /// `K^-1 b` with zero at fixed nodes.
    fn solve(&self, b: &[f64]) -> Result<Vec<f64>, Error> {
        let mut rhs: Vec<f64> = self.system.free().iter().map(|&dof| b[dof as usize]).collect();
        self.system.solve_free(&mut rhs, 1)?;
        let mut out = vec![0.0; b.len()];
        for (&dof, x) in self.system.free().iter().zip(rhs) {
            out[dof as usize] = x;
        }
        Ok(out)
    }

    /// The reach, cut where the load is reached or a cell would turn inside out.
    fn end_of_range(&self, series: &[Vec<f64>], pade: &Pade, reach: f64) -> f64 {
        let n = self.body.n_dofs();
        let mut range = reach;
        let is_valid = |a: f64| self.body.energy(&pade.evaluate(series, a)[..n]).is_finite();
        while range > 1e-6 * reach && !is_valid(range) {
            range *= 0.5;
        }
        let load = |a: f64| pade.evaluate(series, a)[n];
        if load(range) <= self.settings.until {
            return range;
        }
        let (mut low, mut high) = (0.0, range);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if load(middle) < self.settings.until { low = middle } else { high = middle }
        }
        high
    }

    /// Newton corrections back to equilibrium, at constant load or constant arc; returns the
    /// relative residual found at the start.
    fn correct(&mut self, direction: &[f64]) -> Result<f64, Error> {
        let n = self.body.n_dofs();
        let (mut force, mut tangent) = (vec![0.0; n], self.body.zero_tangent());
        let mut first = None;
        for _ in 0..8 {
            let load = self.load();
            self.body.internal_force_and_tangent(&self.state[..n], &mut force, &mut tangent);
            let mut residual: Vec<f64> =
                self.force.iter().zip(&force).map(|(f, i)| load * f - i).collect();
            let free = self.system.free();
            let size = free.iter().map(|&d| residual[d as usize].powi(2)).sum::<f64>().sqrt();
            let relative = size / (norm(self.force) * load.abs().max(f64::MIN_POSITIVE));
            first.get_or_insert(relative);
            // What is left here stays in the next expansion's base state.
            if relative <= 1e-3 * self.settings.tolerance {
                break;
            }
            self.system.factorize(&tangent, 0.0)?;
            let is_arc = self.settings.parameter == Parameter::ArcLength;
            let mut step = self.solve(&residual)?;
            let mut load_step = 0.0;
            if is_arc {
                residual.copy_from_slice(self.force);
                let influence = self.solve(&residual)?;
                let along = |v: &[f64]| self.scale * dot(v, &direction[..n]);
                load_step = -along(&step) / (along(&influence) + direction[n]);
                step.iter_mut().zip(&influence).for_each(|(s, i)| *s += load_step * i);
            }
            self.state[..n].iter_mut().zip(&step).for_each(|(u, s)| *u += s);
            self.state[n] += load_step;
        }
        Ok(first.unwrap_or(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::equilibrium::{Newton, Pressure, Problem};
    use crate::law::Material;
    use crate::mesh::samples::block;

    fn cantilever(law: &str) -> (Body, Vec<u32>, Vec<f64>) {
        let (points, cells) = block([6, 1, 1], [1.5, 0.25, 0.25]);
        let fixed = (0..points.len() as u32).filter(|&n| points[n as usize][0] == 0.0).collect();
        let tip: Vec<usize> = (0..points.len()).filter(|&n| points[n][0] == 1.5).collect();
        let mut force = vec![0.0; 3 * points.len()];
        tip.iter().for_each(|&n| force[3 * n + 2] = -60.0 / tip.len() as f64);
        let material = Material::new(law, vec![vec![1e5, 1.5e5]]).unwrap();
        (Body::new(points, cells, material).unwrap(), fixed, force)
    }

    fn newton(body: &Body, fixed: &[u32], force: &[f64], load: f64) -> Vec<f64> {
        let held = fixed.iter().flat_map(|&node| (0..3).map(move |i| (3 * node + i, 0.0)));
        let force = force.iter().map(|f| load * f).collect();
        let problem = Problem {
            pressure: Pressure::default(),
            body,
            prescribed: held.collect(),
            force,
            patches: vec![],
            start: None,
        };
        let settings = Newton { tolerance: 1e-12, ..Newton::default() };
        settings.solve(&problem, &mut |_| true).unwrap().displacement
    }

    fn relative(a: &[f64], b: &[f64]) -> f64 {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        norm(&difference) / norm(b)
    }

    fn settings(parameter: Parameter) -> Continuation {
        Continuation { order: 12, parameter, until: 1.0, tolerance: 1e-6, max_expansions: 20 }
    }

    #[test]
    fn both_parameters_reach_newtons_equilibrium() {
        for law in ["saint_venant_kirchhoff", "neo_hookean"] {
            let (body, fixed, force) = cantilever(law);
            let exact = newton(&body, &fixed, &force, 1.0);
            for parameter in [Parameter::Load, Parameter::ArcLength] {
                let path = settings(parameter).follow(&body, &fixed, &force).unwrap();
                let last = path.last().unwrap();
                let end = Pade::new(&last.series, 0).evaluate(&last.series, last.range);
                let (u, load) = end.split_at(end.len() - 1);
                assert!((load[0] - 1.0).abs() < 1e-8, "load {}", load[0]);
                assert!(relative(u, &exact) < 1e-5, "{law} {parameter:?} {}", relative(u, &exact));
            }
        }
    }

    /// Order by order the truncated series gains a power of the load.
    #[test]
    fn coefficients_are_those_of_the_path() {
        let (body, fixed, force) = cantilever("neo_hookean");
        let continuation = Continuation { order: 5, ..settings(Parameter::Load) };
        let series = &continuation.follow(&body, &fixed, &force).unwrap()[0].series;
        let (small, large) = (0.02, 0.04);
        for order in 1..=4 {
            let error = |load: f64| {
                let u = newton(&body, &fixed, &force, load);
                let sum: Vec<f64> = (0..u.len())
                    .map(|d| (1..=order).map(|p| load.powi(p as i32) * series[p][d]).sum())
                    .collect();
                relative(&sum, &u)
            };
            let rate = (error(large) / error(small)).log2();
            assert!((rate - order as f64).abs() < 0.3, "order {order}: rate {rate}");
        }
    }

    #[test]
    fn bad_settings_are_refused() {
        let (body, fixed, force) = cantilever("neo_hookean");
        let good = settings(Parameter::Load);
        for bad in [
            Continuation { order: 1, ..good },
            Continuation { until: f64::NAN, ..good },
            Continuation { tolerance: 0.0, ..good },
        ] {
            assert!(bad.follow(&body, &fixed, &force).is_err());
        }
        assert!(good.follow(&body, &fixed, &vec![0.0; force.len()]).is_err());
    }
}
