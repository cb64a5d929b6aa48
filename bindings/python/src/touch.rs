//! The series of single contacts, for studies.

use crate::body::Body;
use crate::threads;
use crate::{convert, mesh::Patch};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use viscera_core::series::TouchExpansion;

/// Fields (terms, n, 3) and forces (terms, 3).
type Series<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>);

/// The series of contacts about an equilibrium, one tangent for all.
#[pyfunction]
pub fn touch_series<'py>(
    py: Python<'py>,
    body: &Body,
    patches: Vec<PyRef<'py, Patch>>,
    base: PyReadonlyArray2<f64>,
    order: usize,
) -> PyResult<Vec<Series<'py>>> {
    let n = body.body.points().len();
    let base = convert::dofs("base", &base, n)?;
    let patches: Vec<_> = patches.iter().map(|p| p.patch.clone()).collect();
    let result = threads::detached(py, || {
        let expansion = TouchExpansion::new(&body.body, &body.fixed, base, order)?;
        expansion.expand(&patches.iter().collect::<Vec<_>>(), order)
    })?;
    let series = result.map_err(convert::error)?.into_iter().map(|series| {
        let terms = series.force.len();
        let fields = PyArray1::from_vec(py, series.displacement.from_term(0).to_vec());
        Ok((fields.reshape([terms, n, 3])?, convert::table(py, &series.force)?))
    });
    series.collect()
}
