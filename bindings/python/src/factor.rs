//! The direct solvers of the core on matrices of one's own.

use crate::convert::{self, VisceraError};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use viscera_core::linear::{Cholesky, FactorError, Factorization, Ldlt, Pattern};

/// A direct solver with a symbolic analysis done once.
#[pyclass(module = "viscera._core")]
pub struct Factor {
    kind: Kind,
}

enum Kind {
    Cholesky(Box<Cholesky>),
    Ldlt(Box<Ldlt>),
}

impl Factor {
    fn solver(&self) -> &dyn Factorization {
        match &self.kind {
            Kind::Cholesky(factor) => factor.as_ref(),
            Kind::Ldlt(factor) => factor.as_ref(),
        }
    }

    fn solver_mut(&mut self) -> &mut dyn Factorization {
        match &mut self.kind {
            Kind::Cholesky(factor) => factor.as_mut(),
            Kind::Ldlt(factor) => factor.as_mut(),
        }
    }
}

#[pymethods]
impl Factor {
    #[new]
    fn new(
        kind: &str,
        column_start: PyReadonlyArray1<u32>,
        row: PyReadonlyArray1<u32>,
    ) -> PyResult<Self> {
        let column_start = column_start.as_array().to_vec();
        let n = column_start.len().saturating_sub(1);
        let pattern = Pattern { n, column_start, row: row.as_array().to_vec() };
        let kind = match kind {
            "cholesky" => Kind::Cholesky(Box::new(Cholesky::analyze(&pattern).map_err(error)?)),
            "ldlt" => Kind::Ldlt(Box::new(Ldlt::analyze(&pattern).map_err(error)?)),
            other => {
                return Err(VisceraError::new_err(format!(
                    "a factor is \"cholesky\" or \"ldlt\", got {other:?}"
                )));
            }
        };
        Ok(Factor { kind })
    }

    #[getter]
    fn fill(&self) -> usize {
        self.solver().fill()
    }

    #[getter]
    fn negative(&self) -> PyResult<usize> {
        match &self.kind {
            Kind::Cholesky(_) => Ok(0),
            Kind::Ldlt(factor) => Ok(factor.inertia().map_err(error)?.negative),
        }
    }

    fn factorize(&mut self, py: Python<'_>, values: PyReadonlyArray1<f64>) -> PyResult<()> {
        let values = values.as_array().to_vec();
        let solver = self.solver_mut();
        py.detach(|| solver.factorize(&values)).map_err(error)
    }

    fn solve<'py>(
        &self,
        py: Python<'py>,
        rhs: PyReadonlyArray1<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mut x = rhs.as_array().to_vec();
        let solver = self.solver();
        py.detach(|| solver.solve(&mut x, 1)).map_err(error)?;
        Ok(PyArray1::from_vec(py, x))
    }
}

fn error(error: FactorError) -> PyErr {
    convert::error(error.into())
}
