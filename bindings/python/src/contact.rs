//! Rigid tools: their shapes, their motion and their forces.

use crate::convert;
use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::sync::Arc;
use viscera_core::body::Body;
use viscera_core::contact::{self, Friction, Pose, Solid};

/// A rigid shape in axes of its own.
#[pyclass(frozen, module = "viscera._core")]
pub struct Shape {
    shape: contact::Shape,
}

#[pymethods]
impl Shape {
    #[staticmethod]
    fn rounded(half: [f64; 3], radius: f64) -> Self {
        Shape { shape: contact::Shape::Rounded { half, radius } }
    }

    #[staticmethod]
    fn half_space() -> Self {
        Shape { shape: contact::Shape::HalfSpace }
    }

    #[staticmethod]
    fn solid(points: PyReadonlyArray2<f64>, triangles: PyReadonlyArray2<u32>) -> PyResult<Self> {
        let (points, triangles) =
            (convert::points("points", &points)?, convert::triangles(&triangles)?);
        let solid = Solid::new(points, triangles).map_err(convert::error)?;
        Ok(Shape { shape: contact::Shape::Solid(Arc::new(solid)) })
    }

    fn distance<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = convert::points("points", &points)?;
        let gaps = points.into_iter().map(|x| self.shape.distance(x).gap).collect();
        Ok(PyArray1::from_vec(py, gaps))
    }
}

/// Shape, friction (None if bonded), stiffness of the layer, rotation, position, displacement and turn.
pub type Tool<'py> =
    (PyRef<'py, Shape>, Option<f64>, f64, [[f64; 3]; 3], [f64; 3], [f64; 3], [f64; 3]);

/// Where a sample sticks to a tool: its number, area, pressure and point, as [`contact::Anchored`].
pub type Anchored = (usize, f64, f64, [f64; 3]);

/// Adds tools to a displaced body, with what sticks to each since an earlier solve.
pub fn add(
    contact: &mut contact::Contact,
    body: &Body,
    tools: &[Tool],
    anchored: &[Vec<Anchored>],
    u: &[f64],
) -> PyResult<()> {
    for (number, told) in tools.iter().enumerate() {
        let of = |&(sample, area, pressure, point): &Anchored| contact::Anchored {
            sample,
            area,
            pressure,
            point,
        };
        let anchored: Vec<_> = anchored.get(number).into_iter().flatten().map(of).collect();
        contact.add_anchored(body, tool(told), &anchored, u).map_err(convert::error)?;
    }
    Ok(())
}

/// Where samples stick to each tool, in their order.
pub fn anchored(contact: &contact::Contact, n_tools: usize) -> Vec<Vec<Anchored>> {
    let told = |one: contact::Anchored| (one.sample, one.area, one.pressure, one.point);
    (0..n_tools).map(|tool| contact.anchored(tool).into_iter().map(told).collect()).collect()
}

/// The core's tool.
pub fn tool(
    (shape, friction, stiffness, rotation, position, displacement, turn): &Tool,
) -> contact::Tool {
    contact::Tool {
        shape: shape.shape.clone(),
        friction: friction.map_or(Friction::Bonded, Friction::Coulomb),
        stiffness: *stiffness,
        pose: Pose { rotation: *rotation, position: *position },
        displacement: *displacement,
        turn: *turn,
    }
}

/// The report of each tool, in their order.
pub fn reports<'py>(
    py: Python<'py>,
    contact: &contact::Contact,
    tools: impl IntoIterator<Item = usize>,
    n_nodes: usize,
) -> PyResult<Bound<'py, PyList>> {
    let of = |tool| (contact.report(tool).unwrap_or_default(), contact.pressures(tool, n_nodes));
    listed(py, tools.into_iter().map(of))
}

/// The report of each contact pair of the body, in their order.
pub fn pair_reports<'py>(
    py: Python<'py>,
    contact: &contact::Contact,
    n_nodes: usize,
) -> PyResult<Bound<'py, PyList>> {
    let of = |pair| Some((contact.pair_report(pair)?, contact.pair_pressures(pair, n_nodes)));
    listed(py, (0..).map_while(of))
}

fn listed(
    py: Python<'_>,
    reports: impl Iterator<Item = (contact::Report, Vec<f64>)>,
) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for (report, pressures) in reports {
        let dict = PyDict::new(py);
        dict.set_item("force", PyArray1::from_slice(py, &report.force))?;
        dict.set_item("torque", PyArray1::from_slice(py, &report.torque))?;
        dict.set_item("area", report.area)?;
        dict.set_item("gap", report.gap)?;
        dict.set_item("energy", report.energy)?;
        dict.set_item("dissipation", report.dissipation)?;
        dict.set_item("touching", report.touching)?;
        dict.set_item("sliding", report.sliding)?;
        dict.set_item("is_inside", report.is_inside)?;
        dict.set_item("pressures", PyArray1::from_vec(py, pressures))?;
        list.append(dict)?;
    }
    Ok(list)
}
