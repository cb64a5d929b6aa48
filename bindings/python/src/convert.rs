//! Conversion of arrays and errors between Python and the core.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use viscera_core::Error;
use viscera_core::equilibrium::Pressure;

pyo3::import_exception!(viscera.errors, VisceraError);

/// The one map from errors of the core and of the evaluator to Python exceptions.
pub fn error(error: impl Into<Error>) -> PyErr {
    match error.into() {
        error @ Error::Cancelled => PyKeyboardInterrupt::new_err(error.to_string()),
        other => VisceraError::new_err(other.to_string()),
    }
}

/// An (n, 3) float64 array as points.
pub fn points(name: &str, array: &PyReadonlyArray2<f64>) -> PyResult<Vec<[f64; 3]>> {
    rows(name, array)
}

/// An (m, 4) uint32 array as cells.
pub fn cells(array: &PyReadonlyArray2<u32>) -> PyResult<Vec<[u32; 4]>> {
    rows("cells", array)
}

/// A (t, 3) uint32 array as triangles.
pub fn triangles(array: &PyReadonlyArray2<u32>) -> PyResult<Vec<[u32; 3]>> {
    rows("triangles", array)
}

fn rows<T: numpy::Element + Copy + Default, const N: usize>(
    name: &str,
    array: &PyReadonlyArray2<T>,
) -> PyResult<Vec<[T; N]>> {
    let view = array.as_array();
    if view.ncols() != N {
        return Err(VisceraError::new_err(format!(
            "{name} has shape ({}, {}); it must be (n, {N})",
            view.nrows(),
            view.ncols()
        )));
    }
    Ok(view.rows().into_iter().map(|row| std::array::from_fn(|i| row[i])).collect())
}

/// An (n, 3) array as a flat vector of degrees of freedom.
pub fn dofs(name: &str, array: &PyReadonlyArray2<f64>, n_points: usize) -> PyResult<Vec<f64>> {
    let rows = points(name, array)?;
    if rows.len() != n_points {
        return Err(VisceraError::new_err(format!(
            "{name} has {} rows; it needs one for each of the {n_points} points",
            rows.len()
        )));
    }
    Ok(rows.into_iter().flatten().collect())
}

/// Faces (t, 3) or (t, 6) under pressure, and the pressure on each (t,).
pub fn pressure(faces: &PyReadonlyArray2<u32>, values: &PyReadonlyArray1<f64>) -> Pressure {
    Pressure {
        faces: faces.as_array().rows().into_iter().map(|row| row.to_vec()).collect(),
        values: values.as_array().to_vec(),
    }
}

/// A vector in space.
pub fn vector(name: &str, array: &PyReadonlyArray1<f64>) -> PyResult<[f64; 3]> {
    let values = array.as_array();
    if values.len() != 3 {
        return Err(VisceraError::new_err(format!(
            "{name} has {} components; it needs 3",
            values.len()
        )));
    }
    Ok([values[0], values[1], values[2]])
}

/// Flat degrees of freedom as an (n, 3) array.
pub fn field<'py>(py: Python<'py>, values: Vec<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let n = values.len() / 3;
    PyArray1::from_vec(py, values).reshape([n, 3])
}

/// Rows of fixed length as a two-dimensional array.
pub fn table<'py, T: numpy::Element + Copy, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_vec(py, rows.iter().flatten().copied().collect()).reshape([rows.len(), N])
}
