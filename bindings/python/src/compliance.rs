//! Displacements by small forces about one state after another.

use crate::threads;
use crate::{body::Body, convert, convert::VisceraError, exclusive::Exclusive};
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use viscera_core::equilibrium;

/// The compliance of a body, its pattern analysed once.
#[pyclass(frozen, module = "viscera._core")]
pub struct Compliance {
    body: Py<Body>,
    compliance: Exclusive<equilibrium::Compliance>,
}

#[pymethods]
impl Compliance {
    #[new]
    fn new(body: Py<Body>) -> Self {
        let compliance = equilibrium::Compliance::new(&body.get().body, &body.get().fixed);
        Compliance { body, compliance: Exclusive::new("compliance", compliance) }
    }

    fn responses<'py>(
        &self,
        py: Python<'py>,
        displacement: PyReadonlyArray2<f64>,
        force: PyReadonlyArray3<f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let body = &self.body.get().body;
        let n = body.points().len();
        let u = convert::dofs("displacement", &displacement, n)?;
        let shape = force.as_array().raw_dim();
        if (shape[1], shape[2]) != (n, 3) {
            return Err(VisceraError::new_err(format!(
                "force has shape {:?}; fields (k, {n}, 3) are needed",
                force.as_array().shape()
            )));
        }
        let force: Vec<f64> = force.as_array().iter().copied().collect();
        let mut guard = self.compliance.claim()?;
        let compliance = &mut *guard;
        let found = threads::detached(py, || {
            let system = compliance.at(body, &u)?;
            let mut columns: Vec<f64> =
                force.chunks(3 * n).flat_map(|column| system.gather(column)).collect();
            system.solve_columns(&mut columns)?;
            let fields = columns.chunks(system.n_free()).flat_map(|column| system.scatter(column));
            Ok::<Vec<f64>, viscera_core::Error>(fields.collect())
        })?;
        PyArray1::from_vec(py, found.map_err(convert::error)?).reshape(shape)
    }
}
