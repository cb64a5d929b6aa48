//! The direct solvers of the core, for any matrix.

use crate::convert::{self, VisceraError};
use crate::exclusive::Exclusive;
use crate::threads;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use viscera_core::linear::{Cholesky, FactorError, Factorization, Ldlt, Pattern};

/// A direct solver with a symbolic analysis done once.
#[pyclass(frozen, module = "viscera._core")]
pub struct Factor {
    kind: Exclusive<Kind>,
}

enum Kind {
    Cholesky(Box<Cholesky>),
    Ldlt(Box<Ldlt>),
}

impl Kind {
    fn cholesky(pattern: &Pattern) -> Result<Self, FactorError> {
        Ok(Kind::Cholesky(Box::new(Cholesky::analyze(pattern)?)))
    }

    fn ldlt(pattern: &Pattern) -> Result<Self, FactorError> {
        Ok(Kind::Ldlt(Box::new(Ldlt::analyze(pattern)?)))
    }

    fn solver(&self) -> &dyn Factorization {
        match self {
            Kind::Cholesky(factor) => factor.as_ref(),
            Kind::Ldlt(factor) => factor.as_ref(),
        }
    }

    fn solver_mut(&mut self) -> &mut dyn Factorization {
        match self {
            Kind::Cholesky(factor) => factor.as_mut(),
            Kind::Ldlt(factor) => factor.as_mut(),
        }
    }
}

#[pymethods]
impl Factor {
    #[new]
    fn new(
        py: Python<'_>,
        kind: &str,
        column_start: PyReadonlyArray1<u32>,
        row: PyReadonlyArray1<u32>,
    ) -> PyResult<Self> {
        let column_start = column_start.as_array().to_vec();
        let n = column_start.len().saturating_sub(1);
        let pattern = Pattern { n, column_start, row: row.as_array().to_vec() };
        let analyzed = match kind {
            "cholesky" => threads::detached(py, || Kind::cholesky(&pattern))?,
            "ldlt" => threads::detached(py, || Kind::ldlt(&pattern))?,
            other => {
                return Err(VisceraError::new_err(format!(
                    "a factor is \"cholesky\" or \"ldlt\", got {other:?}"
                )));
            }
        };
        Ok(Factor { kind: Exclusive::new("factor", analyzed.map_err(error)?) })
    }

    #[getter]
    fn fill(&self) -> PyResult<usize> {
        Ok(self.kind.claim()?.solver().fill())
    }

    /// The rows in the order in which they are eliminated.
    #[getter]
    fn order<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u32>>> {
        Ok(PyArray1::from_slice(py, self.kind.claim()?.solver().order()))
    }

    #[getter]
    fn negative(&self) -> PyResult<usize> {
        match &*self.kind.claim()? {
            Kind::Cholesky(_) => Ok(0),
            Kind::Ldlt(factor) => Ok(factor.inertia().map_err(error)?.negative),
        }
    }

    fn factorize(&self, py: Python<'_>, values: PyReadonlyArray1<f64>) -> PyResult<()> {
        let values = values.as_array().to_vec();
        let mut claimed = self.kind.claim()?;
        let solver = claimed.solver_mut();
        threads::detached(py, || solver.factorize(&values))?.map_err(error)
    }

    fn solve<'py>(
        &self,
        py: Python<'py>,
        rhs: PyReadonlyArray1<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mut x = rhs.as_array().to_vec();
        let claimed = self.kind.claim()?;
        let solver = claimed.solver();
        threads::detached(py, || solver.solve(&mut x, 1))?.map_err(error)?;
        Ok(PyArray1::from_vec(py, x))
    }
}

fn error(error: FactorError) -> PyErr {
    convert::error(viscera_core::Error::from(error))
}
