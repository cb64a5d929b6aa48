//! Equilibrium paths under a growing load: the asymptotic numerical method of paper A.
//!
//! `u(a) = sum a^p u_p`, `load(a) = sum a^p load_p`, and at every order the same tangent,
//!   K u_p = load_p f - N_p,
//! with `f` the dead force and that of the pressure at the start, and `N_p` the order-p coefficient of the internal force
//! less that of the load for `u_p = 0`, `load_p = 0`. The parameter `a` is the load, or an arc length that passes limit
//! points. An expansion reaches as far as its Pade form holds; there corrections return to equilibrium and the next
//! begins.

mod correction;
mod reach;
#[cfg(test)]
mod tests;

use crate::body::{Body, Curvature};
use crate::equilibrium::{
    ConstrainedSystem, Method, Pressure, Rounding, Tangent, dofs_of, require_series_about_rest,
};
use crate::error::Error;
use crate::linear::{FactorError, gmres};
use crate::number::Monomials;
use crate::number::{dot, norm};

/// Residual of a solution where a pressure on a free rim makes the tangent unsymmetric, relative.
const TOLERANCE: f64 = 1e-12;

/// Largest number of iterations of such a solution.
const MAX_ITERATIONS: usize = 60;

/// Range of an expansion over the longest before it, below which the path does not pass: its tangent becomes singular.
const STUCK: f64 = 1e-6;

/// The parameter of the series.
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
    /// Largest number of expansions; a law with a switch may need one for each time that a cell's turns over.
    pub max_expansions: usize,
}

/// One section of a path.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// `u_p` and, as the last entry of each, the load coefficient.
    pub series: Vec<Vec<f64>>,
    /// Where the section ends: the reach of the Padé form, or less if the load is reached.
    pub range: f64,
    /// Reach of the polynomial.
    pub taylor_range: f64,
    /// Out-of-balance force at the end of the range, relative to the load, before correction.
    pub residual: f64,
    /// Whether the equilibrium at the end of the range is stable: its tangent, but for the skew part of a pressure on a
    /// free rim, has no negative eigenvalue, nor does the path end there because the tangent becomes singular.
    pub is_stable: bool,
}

/// A path in progress.
struct Follower<'a> {
    settings: Continuation,
    body: &'a Body,
    force: &'a [f64],
    pressure: &'a Pressure,
    rounding: Rounding,
    system: ConstrainedSystem,
    tangent: Tangent,
    /// Displacement, then the load.
    state: Vec<f64>,
    /// `1 / |u|^2` of the first tangent: makes displacement and load comparable.
    scale: f64,
    /// First-order terms of the expansion before, for the direction of travel.
    previous: Option<Vec<f64>>,
    /// Whether the law has a switch, and whether something has ended an expansion before its forms part.
    has_switch: bool,
    is_hindered: bool,
}

impl Continuation {
    /// Follows the path of `load` times a dead force and a pressure from rest, `fixed` nodes held; `go_on` is asked before
    /// every expansion and may stop it.
    ///
    /// # Errors
    /// Bad settings, force or pressure; a law without a power series about rest; a singular tangent there; a stop on request; switches of the law that let the path
    /// go no further in `max_expansions`, or at all. Any other path that ends early (its load not reached in
    /// `max_expansions`, or a singular tangent) is returned as far as it goes.
    pub fn follow(
        &self,
        body: &Body,
        fixed: &[u32],
        force: &[f64],
        pressure: &Pressure,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Expansion>, Error> {
        self.check(body, force, pressure)?;
        if !body.contact_pairs().is_empty() {
            return Err(Error::input(
                "a series does not know surfaces that touch; leave the contact pairs out, or solve in load steps",
            ));
        }
        if body.has_links() {
            return Err(Error::input(
                "a series does not know springs and cables; leave them out, or solve in load steps",
            ));
        }
        require_series_about_rest(body)?;
        let mut follower = Follower {
            settings: *self,
            body,
            force,
            pressure,
            rounding: Rounding::of(body),
            system: ConstrainedSystem::new(Method::Ldlt, body, dofs_of(fixed), Vec::new())?,
            tangent: Tangent::matrix(body),
            state: vec![0.0; body.n_dofs() + 1],
            scale: 0.0,
            previous: None,
            has_switch: body.material().has_switch(),
            is_hindered: false,
        };
        let (mut expansions, mut prepared) = (Vec::<Expansion>::new(), follower.prepare());
        let mut longest = 0.0f64;
        for _ in 0..self.max_expansions {
            prepared?;
            if !go_on() {
                return Err(Error::Cancelled);
            }
            let mut expansion = match (follower.expand(), expansions.last_mut()) {
                // The steps become shorter towards a bifurcation; one of them may end just there.
                (Err(Error::Factor(FactorError::Singular { .. })), Some(last)) => {
                    last.is_stable = false;
                    return Ok(expansions);
                }
                (Ok(None), Some(last)) if !follower.has_switch => {
                    last.is_stable = false;
                    return Ok(expansions);
                }
                (expansion, _) => expansion?.ok_or_else(|| follower.no_way_on())?,
            };
            prepared = follower.prepare();
            let is_last = follower.load() >= self.until * (1.0 - 1e-9);
            longest = longest.max(expansion.range);
            let least = if follower.has_switch { 0.0 } else { STUCK * longest };
            let stuck = !(expansion.range > least);
            let is_definite = prepared.is_ok() && follower.system.n_negative() == Some(0);
            expansion.is_stable = is_definite && (is_last || !stuck);
            expansions.push(expansion);
            if is_last || stuck {
                return Ok(expansions);
            }
        }
        if follower.has_switch && follower.is_hindered {
            return Err(follower.too_many());
        }
        Ok(expansions)
    }

    fn check(&self, body: &Body, force: &[f64], pressure: &Pressure) -> Result<(), Error> {
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
        pressure.check(body)?;
        if force.iter().chain(&pressure.values).all(|&f| f == 0.0) {
            return Err(Error::input("the load is zero; there is no path to follow"));
        }
        Ok(())
    }
}

impl Follower<'_> {
    fn load(&self) -> f64 {
        self.state[self.state.len() - 1]
    }

    fn no_way_on(&self) -> Error {
        Error::input(format!(
            "the path ends at load {:.4}, since no equilibrium is found beside it; solve in load steps",
            self.load()
        ))
    }

    fn too_many(&self) -> Error {
        let Continuation { max_expansions, until, .. } = self.settings;
        Error::input(format!(
            "switches of the law end the path at load {:.4} of {until} after {max_expansions} expansions; allow more \
             expansions or a larger tolerance, or solve in load steps",
            self.load()
        ))
    }

    /// Factorises the tangent at the state.
    fn prepare(&mut self) -> Result<(), Error> {
        self.linearize();
        Ok(self.system.prepare(&self.tangent, 0.0)?)
    }

    /// Builds an expansion at the state, for which all is prepared, and moves the state to its end, back in equilibrium.
    /// Where a switch of the law turns over too early for a series, the expansion is a chord; none where there is no
    /// equilibrium to go on to.
    fn expand(&mut self) -> Result<Option<Expansion>, Error> {
        let series = self.series()?;
        if !series.iter().flatten().all(|u| u.is_finite()) {
            self.is_hindered = true;
            return self.chord(&series[1], self.settings.until);
        }
        let reach = self.reach(&series);
        if let Some(expansion) = self.end_at(&series, reach)? {
            return Ok(Some(expansion));
        }
        self.is_hindered = true;
        if let Some(range) = self.shorter(&series, reach)
            && let Some(expansion) = self.end_at(&series, range)?
        {
            return Ok(Some(expansion));
        }
        self.chord(&series[1], reach)
    }

    /// The internal force at the state, and the tangent but for its skew part.
    fn linearize(&mut self) -> Vec<f64> {
        let (u, load) = self.state.split_at(self.body.n_dofs());
        let mut internal = vec![0.0; u.len()];
        self.tangent.linearize(self.body, u, Curvature::Exact, &mut internal);
        self.pressure.add_stiffness(self.body, u, load[0], self.tangent.blocks_mut());
        internal
    }

    /// Dead force and pressure at the state, of load 1.
    fn unit_load(&self) -> Vec<f64> {
        let mut force = self.force.to_vec();
        self.pressure.add_force(self.body, &self.state[..force.len()], 1.0, &mut force);
        force
    }

    /// All orders on one tangent.
    fn series(&mut self) -> Result<Vec<Vec<f64>>, Error> {
        let n = self.body.n_dofs();
        let tangent = self.solve(&self.unit_load())?;
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
        let mut loads = vec![self.load(), first_load];
        let mut series = vec![self.state.clone(), first];
        for p in 2..=self.settings.order {
            let mut nonlinear = vec![0.0; n];
            self.body.force_series(Monomials::of(1, p), &coefficients, stride, &mut nonlinear);
            nonlinear.iter_mut().for_each(|f| *f = -*f);
            loads.push(0.0);
            let (body, pressure) = (self.body, self.pressure);
            pressure.add_force_series(body, &loads, &coefficients, stride, &mut nonlinear);
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
            loads[p] = load;
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

    /// `K^-1 b` with zero at fixed nodes; where a pressure has a free rim, with the skew part of the tangent.
    fn solve(&self, b: &[f64]) -> Result<Vec<f64>, Error> {
        let plain = self.solve_symmetric(b)?;
        if self.pressure.is_empty() {
            return Ok(plain);
        }
        let (u, load) = self.state.split_at(b.len());
        let skew = |x: &[f64]| {
            let mut force = vec![0.0; x.len()];
            self.pressure.add_skew(self.body, u, load[0], x, &mut force);
            self.solve_symmetric(&force)
        };
        if norm(&skew(&plain)?) <= TOLERANCE * norm(&plain) {
            return Ok(plain);
        }
        let apply = |x: &[f64]| Ok(x.iter().zip(skew(x)?).map(|(x, s)| x + s).collect());
        gmres(apply, &plain, TOLERANCE, MAX_ITERATIONS)
    }

    fn solve_symmetric(&self, b: &[f64]) -> Result<Vec<f64>, Error> {
        let mut rhs = self.system.gather(b);
        self.system.solve_columns(&mut rhs)?;
        Ok(self.system.scatter(&rhs))
    }
}
