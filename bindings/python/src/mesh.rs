//! Mesh topology and contact patches.

use crate::convert::{self, VisceraError};
use crate::threads;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use rayon::prelude::*;
use viscera_core::mesh;

/// Triangles (k,) and weights of their corners (k, 3).
type ClosestPoints<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<f64>>);

type PointsAndCells = (Vec<[f64; 3]>, Vec<[u32; 4]>);

/// Points and cells with every index in range.
fn checked(
    points: &PyReadonlyArray2<f64>,
    cells: &PyReadonlyArray2<u32>,
) -> PyResult<PointsAndCells> {
    let (points, cells) = (convert::points("points", points)?, convert::cells(cells)?);
    if let Some((cell, node)) = mesh::index_out_of_range(points.len(), &cells) {
        return Err(VisceraError::new_err(format!(
            "cell {cell} uses point {node}; there are {} points",
            points.len()
        )));
    }
    Ok((points, cells))
}

#[pyfunction]
pub fn surface<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<f64>,
    cells: PyReadonlyArray2<u32>,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let (points, cells) = checked(&points, &cells)?;
    convert::table(py, &mesh::surface(&points, &cells))
}

/// Rows of indices.
type Table<'py> = Bound<'py, PyArray2<u32>>;
/// Cells by place, and the weights of their corners there.
type Places<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray2<f64>>);

#[pyfunction]
pub fn quadratic<'py>(
    py: Python<'py>,
    n_points: usize,
    cells: PyReadonlyArray2<u32>,
) -> PyResult<(Table<'py>, Table<'py>)> {
    let cells = convert::cells(&cells)?;
    let edges = mesh::edges(&cells);
    let nodes = mesh::quadratic_cells(n_points, &cells, &edges);
    Ok((convert::table(py, &edges)?, convert::table(py, &nodes)?))
}

#[pyfunction]
pub fn quadratic_surface<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<f64>,
    cells: PyReadonlyArray2<u32>,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let (points, cells) = checked(&points, &cells)?;
    let (triangles, edges) = (mesh::surface(&points, &cells), mesh::edges(&cells));
    let n_corners = points.len().saturating_sub(edges.len());
    convert::table(py, &mesh::quadratic_surface(n_corners, &triangles, &edges))
}

/// Triangles of both surfaces, barycentric coordinates of the corners, areas, depths.
type Overlaps<'py> =
    (Table<'py>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

#[pyfunction]
pub fn overlap<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<f64>,
    first: PyReadonlyArray2<u32>,
    second: PyReadonlyArray2<u32>,
    reach: f64,
) -> PyResult<Overlaps<'py>> {
    let points = convert::points("points", &points)?;
    let [first, second] = [convert::triangles(&first)?, convert::triangles(&second)?];
    if let Some(node) = first.iter().chain(&second).flatten().find(|n| **n as usize >= points.len())
    {
        return Err(VisceraError::new_err(format!(
            "a triangle uses point {node}; there are {} points",
            points.len()
        )));
    }
    let pieces = py.detach(|| mesh::overlap(&points, &first, &second, reach));
    let triangles: Vec<[u32; 2]> = pieces.iter().map(|piece| piece.triangles).collect();
    let corners: Vec<[f64; 18]> = pieces
        .iter()
        .map(|piece| std::array::from_fn(|k| piece.corners[k / 6][k / 3 % 2][k % 3]))
        .collect();
    let areas = PyArray1::from_vec(py, pieces.iter().map(|piece| piece.area).collect());
    let depths = PyArray1::from_vec(py, pieces.iter().map(|piece| piece.depth).collect());
    Ok((convert::table(py, &triangles)?, convert::table(py, &corners)?, areas, depths))
}

#[pyfunction]
pub fn inspect<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<f64>,
    cells: PyReadonlyArray2<u32>,
) -> PyResult<Bound<'py, PyDict>> {
    let (points, cells) = checked(&points, &cells)?;
    let report = py.detach(|| mesh::inspect(&points, &cells));
    let facts = PyDict::new(py);
    facts.set_item("volume", report.volume)?;
    facts.set_item("cell_volumes", PyArray1::from_vec(py, report.cell_volumes))?;
    facts.set_item("quality", PyArray1::from_vec(py, report.quality))?;
    facts.set_item("inverted", PyArray1::from_vec(py, report.inverted))?;
    facts.set_item("degenerate", PyArray1::from_vec(py, report.degenerate))?;
    facts.set_item("duplicate", PyArray1::from_vec(py, report.duplicate))?;
    facts.set_item("loose_points", PyArray1::from_vec(py, report.loose_points))?;
    facts.set_item("overlapping", PyArray1::from_vec(py, report.overlapping))?;
    facts.set_item("crowded", PyArray1::from_vec(py, report.crowded))?;
    facts.set_item("hanging", convert::table(py, &report.hanging)?)?;
    facts.set_item("pinches", PyArray1::from_vec(py, report.pinches))?;
    facts.set_item("body", PyArray1::from_vec(py, report.body))?;
    facts.set_item("part", PyArray1::from_vec(py, report.part))?;
    facts.set_item("n_parts", report.n_parts)?;
    Ok(facts)
}

/// Finds cells by points.
#[pyclass(frozen, module = "viscera._core")]
pub struct Locator {
    locator: mesh::Locator,
}

#[pymethods]
impl Locator {
    #[new]
    fn new(points: PyReadonlyArray2<f64>, cells: PyReadonlyArray2<u32>) -> PyResult<Self> {
        let (points, cells) = checked(&points, &cells)?;
        Ok(Locator { locator: mesh::Locator::new(&points, &cells) })
    }

    fn find<'py>(&self, py: Python<'py>, places: PyReadonlyArray2<f64>) -> PyResult<Places<'py>> {
        let places = convert::points("places", &places)?;
        let found = threads::detached(py, || {
            let find = |x| self.locator.find(x);
            places.par_iter().with_min_len(1024).map(find).collect::<Vec<_>>()
        })?;
        let cells = found.iter().map(|at| at.map_or(-1, |at| i64::from(at.cell))).collect();
        let weights: Vec<[f64; 4]> =
            found.iter().map(|at| at.map_or([0.0; 4], |at| at.weights)).collect();
        Ok((PyArray1::from_vec(py, cells), convert::table(py, &weights)?))
    }
}

/// The type of a patch and its arguments, for pickle and copy.
type PatchAgain<'py> = (Bound<'py, PyType>, (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<f64>>));

/// A weighted mean over surface nodes.
#[pyclass(frozen, module = "viscera._core")]
pub struct Patch {
    pub patch: mesh::Patch,
}

#[pymethods]
impl Patch {
    #[new]
    fn new(nodes: PyReadonlyArray1<u32>, weights: PyReadonlyArray1<f64>) -> Self {
        let (nodes, weights) = (nodes.as_array().to_vec(), weights.as_array().to_vec());
        Patch { patch: mesh::Patch { nodes, weights } }
    }

    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.patch.nodes)
    }

    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.patch.weights)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PatchAgain<'py> {
        (py.get_type::<Self>(), (self.nodes(py), self.weights(py)))
    }
}

/// Triangles to find the closest point on.
#[pyclass(frozen, module = "viscera._core")]
pub struct Surface {
    surface: mesh::Surface,
}

#[pymethods]
impl Surface {
    #[new]
    fn new(points: PyReadonlyArray2<f64>, triangles: PyReadonlyArray2<u32>) -> PyResult<Self> {
        let points = convert::points("points", &points)?;
        let triangles = convert::triangles(&triangles)?;
        if let Some(node) = triangles.iter().flatten().find(|&&n| n as usize >= points.len()) {
            return Err(VisceraError::new_err(format!(
                "a triangle uses point {node}; there are {} points",
                points.len()
            )));
        }
        Ok(Surface { surface: mesh::Surface::new(&points, &triangles) })
    }

    /// Triangle, weights of its corners, and distance [m] of the closest point.
    fn closest(&self, point: PyReadonlyArray1<f64>) -> PyResult<(u32, [f64; 3], f64)> {
        let point = convert::vector("point", &point)?;
        let closest = self.surface.closest(point).ok_or_else(|| {
            VisceraError::new_err(format!("there is no triangle, or {point:?} is not finite"))
        })?;
        Ok((closest.triangle, closest.barycentric, closest.distance))
    }

    /// Triangles and weights of their corners of the points closest to each of many.
    fn closest_to_each<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<f64>,
    ) -> PyResult<ClosestPoints<'py>> {
        let points = convert::points("points", &points)?;
        let found: Option<Vec<_>> = threads::detached(py, || {
            points.par_iter().with_min_len(256).map(|&x| self.surface.closest(x)).collect()
        })?;
        let found = found.ok_or_else(|| {
            VisceraError::new_err("there is no triangle, or one of the points is not finite")
        })?;
        let triangles = found.iter().map(|closest| closest.triangle).collect();
        let weights: Vec<[f64; 3]> = found.iter().map(|closest| closest.barycentric).collect();
        Ok((PyArray1::from_vec(py, triangles), convert::table(py, &weights)?))
    }
}
