//! Expansions of an equilibrium path, and their rational form.

use crate::convert::{self, VisceraError};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use viscera_core::series::{Expansion, Pade};

/// Value at `a` of the vector Pade form of a series (order + 1, k).
#[pyfunction]
pub fn vector_pade<'py>(
    py: Python<'py>,
    series: PyReadonlyArray2<f64>,
    a: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let rows: Vec<Vec<f64>> = series.as_array().rows().into_iter().map(|r| r.to_vec()).collect();
    if rows.len() < 2 {
        return Err(VisceraError::new_err("a series needs at least its constant and one order"));
    }
    Ok(PyArray1::from_vec(py, Pade::new(&rows, 0).evaluate(&rows, a)))
}

pub fn expansion_dict(py: Python<'_>, expansion: Expansion) -> PyResult<Bound<'_, PyDict>> {
    let terms = expansion.series.len();
    let n = expansion.series[0].len() - 1;
    let load: Vec<f64> = expansion.series.iter().map(|u| u[n]).collect();
    let displacement = expansion.series.iter().flat_map(|u| u[..n].iter().copied()).collect();
    let dict = PyDict::new(py);
    dict.set_item("displacement", convert::field(py, displacement)?.reshape([terms, n / 3, 3])?)?;
    dict.set_item("load", PyArray1::from_vec(py, load))?;
    dict.set_item("range", expansion.range)?;
    dict.set_item("taylor_range", expansion.taylor_range)?;
    dict.set_item("residual", expansion.residual)?;
    dict.set_item("is_stable", expansion.is_stable)?;
    Ok(dict)
}
