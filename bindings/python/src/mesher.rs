//! Labels and surfaces to tetrahedra.

use crate::body_methods::Watch;
use crate::convert::{self, VisceraError};
use crate::threads;
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use viscera_mesher::{Error, Labels, Winding};

#[pyfunction]
#[pyo3(signature = (values, affine, labels, *, volumes, edges, on_progress))]
pub fn mesh_labels<'py>(
    py: Python<'py>,
    values: PyReadonlyArray3<u16>,
    affine: PyReadonlyArray2<f64>,
    labels: Vec<(u16, String)>,
    volumes: Option<Vec<f64>>,
    edges: Vec<f64>,
    on_progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (labels, names): (Vec<u16>, Vec<String>) = labels.into_iter().unzip();
    let [i, j, k] = dims(values.as_array().shape());
    let voxels: Vec<u16> = values.as_array().iter().copied().collect();
    let (affine, volumes) = (rows(&affine)?, volumes.as_deref());
    let map = Labels { dims: [i, j, k], values: &voxels, affine, volumes };
    let mut watch = Watch::new(on_progress);
    let made = threads::detached(py, || {
        viscera_mesher::mesh(&map, &labels, &edges, |done, total| watch.report((done, total)))
    })?;
    if let Err(Error::Missed(label)) = made
        && let (Some(name), Some(edge)) = (names.get(label), edges.get(label))
    {
        return Err(VisceraError::new_err(format!(
            "the edge, {} mm, is too long for '{name}': no cell of it is left; give a shorter one",
            (1e3 * edge) as f32 // without the last digits, which the factor makes
        )));
    }
    let mesh = outcome(watch, made)?;
    let facts = PyDict::new(py);
    facts.set_item("points", convert::table(py, &mesh.points)?)?;
    facts.set_item("cells", convert::table(py, &mesh.cells)?)?;
    let owner = mesh.owner.iter().map(|&label| label as u32).collect();
    facts.set_item("owner", PyArray1::from_vec(py, owner))?;
    facts.set_item("cut", PyArray1::from_vec(py, mesh.cut))?;
    facts.set_item("edges", PyArray1::from_vec(py, mesh.edges))?;
    facts.set_item("volumes", PyArray1::from_vec(py, mesh.volumes))?;
    for (name, lost) in [("dropped", mesh.dropped), ("missed", mesh.missed)] {
        facts.set_item(name, PyArray1::from_vec(py, lost.volumes))?;
        facts.set_item(format!("n_{name}"), lost.count)?;
    }
    Ok(facts)
}

#[pyfunction]
#[pyo3(signature = (points, triangles, shape, affine, *, on_progress))]
pub fn winding_numbers<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<f64>,
    triangles: PyReadonlyArray2<u32>,
    shape: [usize; 3],
    affine: PyReadonlyArray2<f64>,
    on_progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let (points, triangles) =
        (convert::points("points", &points)?, convert::triangles(&triangles)?);
    let affine = rows(&affine)?;
    let mut watch = Watch::new(on_progress);
    let numbers = threads::detached(py, || {
        let winding = Winding::new(&points, &triangles);
        winding.on_grid(shape, &affine, |done, total| watch.report((done, total)))
    })?;
    let numbers = outcome(watch, numbers.ok_or(Error::Cancelled))?;
    PyArray1::from_vec(py, numbers).reshape(shape)
}

fn dims(shape: &[usize]) -> [usize; 3] {
    std::array::from_fn(|k| shape[k])
}

/// The result, or what the watcher raised.
fn outcome<T>(watch: Watch, made: Result<T, Error>) -> PyResult<T> {
    match made {
        Err(Error::Cancelled) => watch.outcome(Err(viscera_core::Error::Cancelled)),
        made => made.map_err(|error| VisceraError::new_err(error.to_string())),
    }
}

fn rows(affine: &PyReadonlyArray2<f64>) -> PyResult<[[f64; 4]; 3]> {
    let given = affine.as_array();
    if given.dim() != (3, 4) {
        let shape = given.dim();
        return Err(VisceraError::new_err(format!(
            "the affine map has shape {shape:?}; it must be (3, 4)"
        )));
    }
    Ok(std::array::from_fn(|i| std::array::from_fn(|j| given[(i, j)])))
}
