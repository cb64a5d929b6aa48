//! Several touches at once: the hyper-reduced Galerkin model.

use crate::convert::{self, VisceraError};
use crate::interrupt::interruptible;
use crate::mesh::Patch;
use crate::model::Model;
use crate::threads;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use viscera_core::Error;
use viscera_core::galerkin::{self, Asked, ReducedStatus, Sampling, Solution, Trust};

/// The series model of an organ and its body.
#[pyclass(frozen, module = "viscera._core")]
pub struct Galerkin {
    galerkin: Arc<galerkin::Galerkin>,
}

#[pymethods]
impl Galerkin {
    #[new]
    #[pyo3(signature = (model, *, order, tolerance, depth, snapshots))]
    fn new(
        py: Python<'_>,
        model: &Model,
        order: usize,
        tolerance: f64,
        depth: f64,
        snapshots: usize,
    ) -> PyResult<Self> {
        let series = model.model.clone();
        let sampling = Sampling { order, tolerance, depth, snapshots };
        let made = threads::detached(py, || galerkin::Galerkin::new(series, sampling))?;
        Ok(Galerkin { galerkin: Arc::new(made.map_err(convert::error)?) })
    }

    fn grasp(
        &self,
        py: Python<'_>,
        points: PyReadonlyArray2<f64>,
        wait: bool,
    ) -> PyResult<HyperReducedModel> {
        let points = convert::points("contacts", &points)?;
        let grasp = if wait {
            interruptible(py, |is_wanted| self.galerkin.grasp_while(&points, is_wanted))?
        } else {
            threads::detached(py, || self.galerkin.grasp_in_background(&points))?
                .map_err(convert::error)?
        };
        Ok(HyperReducedModel { grasp: Mutex::new(grasp) })
    }
}

/// Contacts that hold the organ.
#[pyclass(frozen, module = "viscera._core")]
pub struct HyperReducedModel {
    grasp: Mutex<galerkin::HyperReducedModel>,
}

impl HyperReducedModel {
    /// The result of `ask` on the grasp. Waits for the grasp without the interpreter, which the thread that holds the
    /// grasp may need.
    fn ask<T: Send>(
        &self,
        py: Python<'_>,
        ask: impl FnOnce(&mut galerkin::HyperReducedModel) -> T + Send,
    ) -> PyResult<T> {
        let broken = || VisceraError::new_err("this grasp broke off; take hold anew");
        threads::detached(py, || Some(ask(&mut *self.grasp.lock().ok()?)))?.ok_or_else(broken)
    }
}

#[pymethods]
impl HyperReducedModel {
    #[getter]
    fn modes(&self, py: Python<'_>) -> PyResult<usize> {
        self.ask(py, |grasp| grasp.contacts().n_modes())
    }

    #[getter]
    fn cells(&self, py: Python<'_>) -> PyResult<usize> {
        self.ask(py, |grasp| grasp.n_cells())
    }

    #[getter]
    fn snapshots(&self, py: Python<'_>) -> PyResult<usize> {
        self.ask(py, |grasp| grasp.n_snapshots())
    }

    #[getter]
    fn seconds(&self, py: Python<'_>) -> PyResult<f64> {
        self.ask(py, |grasp| grasp.seconds())
    }

    /// Whether better modes may still follow; those that are ready are taken over.
    fn is_training(&self, py: Python<'_>) -> PyResult<bool> {
        self.ask(py, galerkin::HyperReducedModel::is_training)?.map_err(convert::error)
    }

    /// Adds the equilibrium nearest to the last answer as a snapshot, if the answer is wrong; returns whether it was.
    fn add_snapshot(&self, py: Python<'_>) -> PyResult<bool> {
        self.ask(py, galerkin::HyperReducedModel::add_snapshot)?.map_err(convert::error)
    }

    fn patches(&self, py: Python<'_>) -> PyResult<Vec<Patch>> {
        let patches = self.ask(py, |grasp| grasp.contacts().patches())?;
        Ok(patches.into_iter().map(|patch| Patch { patch }).collect())
    }

    fn solve(
        &self,
        py: Python<'_>,
        displacements: PyReadonlyArray2<f64>,
        from_last: bool,
        with_stiffness: bool,
        budget: Option<f64>,
    ) -> PyResult<GalerkinAnswer> {
        let d = convert::points("displacements", &displacements)?;
        let budget = budget.map(duration).transpose().map_err(convert::error)?;
        let solve = |grasp: &mut galerkin::HyperReducedModel| -> Result<GalerkinAnswer, Error> {
            let mut solution = grasp.room();
            grasp.solve_into(&d, Asked { from_last, with_stiffness, budget }, &mut solution)?;
            Ok(GalerkinAnswer { solution })
        };
        self.ask(py, solve)?.map_err(convert::error)
    }

    fn superposed<'py>(
        &self,
        py: Python<'py>,
        displacements: PyReadonlyArray2<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let d = convert::points("displacements", &displacements)?;
        let field = self.ask(py, |grasp| grasp.contacts().superposed(&d))?;
        convert::field(py, field.map_err(convert::error)?)
    }
}

/// An answer, with the data for its field and its assessment.
#[pyclass(frozen, module = "viscera._core")]
pub struct GalerkinAnswer {
    solution: Solution,
}

#[pymethods]
impl GalerkinAnswer {
    /// Everything that is known at once.
    #[getter]
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let solution = &self.solution;
        let facts = PyDict::new(py);
        facts.set_item("force", convert::table(py, &solution.forces)?)?;
        if !solution.stiffness.is_empty() {
            let n = 3 * solution.forces.len();
            let stiffness = PyArray1::from_slice(py, &solution.stiffness).reshape([n, n])?;
            facts.set_item("stiffness", stiffness)?;
        }
        facts.set_item("energy", solution.energy)?;
        facts.set_item("status", status(solution.status))?;
        facts.set_item("is_converged", solution.status == ReducedStatus::Converged)?;
        facts.set_item("smallest_jacobian", solution.smallest_jacobian)?;
        facts.set_item("iterations", solution.iterations)?;
        facts.set_item("tangents", solution.tangents)?;
        facts.set_item("residual", solution.residual)?;
        facts.set_item("seconds", solution.seconds)?;
        Ok(facts)
    }

    fn displacement<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        convert::field(py, threads::detached(py, || self.solution.displacement())?)
    }

    /// Error estimates of forces and field, and the reason if the answer is not trusted.
    fn assess(&self, py: Python<'_>) -> PyResult<(f64, f64, &'static str)> {
        let assessment =
            threads::detached(py, || self.solution.assess())?.map_err(convert::error)?;
        Ok((assessment.force_error, assessment.shape_error, reason(assessment.trust)))
    }
}

fn duration(budget: f64) -> Result<Duration, Error> {
    let refused = |_| {
        Error::input(format!("a budget of {budget} s; give a number of seconds from 0 on, or None"))
    };
    Duration::try_from_secs_f64(budget).map_err(refused)
}

fn status(status: ReducedStatus) -> &'static str {
    match status {
        ReducedStatus::Converged => "converged",
        ReducedStatus::StepTooSmall => "step too small",
        ReducedStatus::TooManyIterations => "too many iterations",
        ReducedStatus::OutOfTime => "out of time",
    }
}

fn reason(trust: Trust) -> &'static str {
    match trust {
        Trust::Trusted => "",
        Trust::NotConverged => "no equilibrium was found",
        Trust::OutOfTime => "the time for the search was over before there was an equilibrium",
        Trust::Inverted => "a sampled cell is inside out",
        Trust::BeyondDepth => "a contact is displaced by more than in training",
        Trust::Unstable => "the whole organ would not stay there",
        Trust::ErrorTooLarge => "the expected error is larger than allowed at this depth",
    }
}
