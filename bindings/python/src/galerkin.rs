//! Several touches at once: the hyper-reduced Galerkin model.

use crate::mesh::Patch;
use crate::{convert, model::Model};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex};
use viscera_core::galerkin::{self, Sampling, Status, Trust};

/// The series model of an organ and its body.
#[pyclass(frozen, module = "viscera._core")]
pub struct Galerkin {
    galerkin: Arc<galerkin::Galerkin>,
}

#[pymethods]
impl Galerkin {
    #[new]
    #[pyo3(signature = (model, *, order, tolerance, depth))]
    fn new(
        py: Python<'_>,
        model: &Model,
        order: usize,
        tolerance: f64,
        depth: f64,
    ) -> PyResult<Self> {
        let (series, sampling) = (model.model.clone(), Sampling { order, tolerance, depth });
        let made = py.detach(|| galerkin::Galerkin::new(series, sampling));
        Ok(Galerkin { galerkin: Arc::new(made.map_err(convert::error)?) })
    }

    fn grasp(&self, py: Python<'_>, points: PyReadonlyArray2<f64>) -> PyResult<Grasp> {
        let points = convert::points("contacts", &points)?;
        let grasp = py.detach(|| self.galerkin.grasp(&points)).map_err(convert::error)?;
        Ok(Grasp { grasp: Mutex::new(grasp) })
    }
}

/// Contacts that hold the organ.
#[pyclass(frozen, module = "viscera._core")]
pub struct Grasp {
    grasp: Mutex<galerkin::Grasp>,
}

impl Grasp {
    fn lock(&self) -> PyResult<std::sync::MutexGuard<'_, galerkin::Grasp>> {
        self.grasp.lock().map_err(|_| PyValueError::new_err("this grasp broke off; take hold anew"))
    }
}

#[pymethods]
impl Grasp {
    #[getter]
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let grasp = self.lock()?;
        let facts = PyDict::new(py);
        facts.set_item("modes", grasp.n_modes())?;
        facts.set_item("cells", grasp.n_cells())?;
        facts.set_item("errors", (grasp.errors().half_depth, grasp.errors().depth))?;
        facts.set_item("seconds", grasp.seconds())?;
        Ok(facts)
    }

    fn patches(&self) -> PyResult<Vec<Patch>> {
        Ok(self.lock()?.patches().into_iter().map(|patch| Patch { patch }).collect())
    }

    fn solve<'py>(
        &self,
        py: Python<'py>,
        displacements: PyReadonlyArray2<f64>,
        from_last: bool,
        with_stiffness: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let d = convert::points("displacements", &displacements)?;
        let mut guard = self.lock()?;
        let grasp = &mut *guard;
        let solution =
            py.detach(|| grasp.solve(&d, from_last, with_stiffness)).map_err(convert::error)?;
        let answer = PyDict::new(py);
        answer.set_item("force", convert::table(py, &solution.forces)?)?;
        let n = 3 * d.len();
        if !solution.stiffness.is_empty() {
            let stiffness = PyArray1::from_vec(py, solution.stiffness).reshape([n, n])?;
            answer.set_item("stiffness", stiffness)?;
        }
        answer.set_item("coordinates", PyArray1::from_slice(py, grasp.coordinates()))?;
        answer.set_item("energy", solution.energy)?;
        answer.set_item("status", status(solution.status))?;
        answer.set_item("is_converged", solution.status == Status::Converged)?;
        answer.set_item("is_trusted", solution.trust == Trust::Trusted)?;
        answer.set_item("reason", reason(solution.trust))?;
        answer.set_item("error_estimate", solution.error_estimate)?;
        answer.set_item("smallest_jacobian", solution.smallest_jacobian)?;
        answer.set_item("iterations", solution.iterations)?;
        answer.set_item("tangents", solution.tangents)?;
        answer.set_item("residual", solution.residual)?;
        answer.set_item("seconds", solution.seconds)?;
        Ok(answer)
    }

    fn displacement<'py>(
        &self,
        py: Python<'py>,
        coordinates: PyReadonlyArray1<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let field = self.lock()?.displacement(&coordinates.as_array().to_vec());
        convert::field(py, field)
    }

    fn superposed<'py>(
        &self,
        py: Python<'py>,
        displacements: PyReadonlyArray2<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let d = convert::points("displacements", &displacements)?;
        let field = self.lock()?.superposed(&d);
        convert::field(py, field)
    }
}

fn status(status: Status) -> &'static str {
    match status {
        Status::Converged => "converged",
        Status::StepTooSmall => "step too small",
        Status::TooManyIterations => "too many iterations",
    }
}

fn reason(trust: Trust) -> &'static str {
    match trust {
        Trust::Trusted => "",
        Trust::NotConverged => "no equilibrium was found",
        Trust::Inverted => "a sampled cell is inside out",
        Trust::BeyondDepth => "a contact is displaced by more than in training",
        Trust::ErrorTooLarge => "the estimated error is larger than allowed at this depth",
    }
}
