//! The reduced model and its evaluator.

use crate::{
    convert::{self, VisceraError},
    interrupt::interruptible,
    mesh::Patch,
};
use numpy::{Element, PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use viscera_core::reduced::{
    Contact, Notes, ReducedModel, Trust, View, recompressed_while, refused,
};

/// A loaded reduced model.
#[pyclass(frozen, module = "viscera._core")]
pub struct Model {
    pub model: ReducedModel,
}

#[pymethods]
impl Model {
    #[staticmethod]
    fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        let model = py
            .detach(|| ReducedModel::from_bytes(data).map_err(refused))
            .map_err(convert::error)?;
        Ok(Model { model })
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.model.to_bytes().map_err(refused)).map_err(convert::error)?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[getter]
    fn metadata(&self) -> PyResult<String> {
        serde_json::to_string(self.model.metadata())
            .map_err(|e| VisceraError::new_err(format!("metadata cannot be written: {e}")))
    }

    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        match self.model.array(name) {
            Some(View::F64(values, _)) if name == "law_parameters" => {
                let columns = self.model.metadata().law_parameter_names.len();
                array(py, values, columns)
            }
            Some(View::F64(values, columns)) => array(py, values, columns),
            Some(View::F32(values, columns)) => array(py, values, columns),
            Some(View::U32(values, columns)) => array(py, values, columns),
            Some(View::I16(values, columns)) => array(py, values, columns),
            None => Err(PyKeyError::new_err(format!("a model has no array {name:?}"))),
        }
    }

    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        point: PyReadonlyArray1<f64>,
        displacement: PyReadonlyArray1<f64>,
        field: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let contact = self.contact(&point)?;
        let d = finite("displacement", &displacement)?;
        let response = self.model.respond(&contact, d);
        let answer = PyDict::new(py);
        answer.set_item("force", PyArray1::from_slice(py, &response.force))?;
        answer.set_item("stiffness", convert::table(py, &response.stiffness)?)?;
        answer.set_item("error_estimate", response.error_estimate)?;
        answer.set_item("is_trusted", response.trust == Trust::Trusted)?;
        let (force, shape) = (response.error_estimate, response.shape_error_estimate);
        let why = reason(response.trust, "the estimated error", force, &self.model, d);
        answer.set_item("reason", why)?;
        answer.set_item("shape_error_estimate", shape)?;
        answer.set_item("is_shape_trusted", response.shape_trust == Trust::Trusted)?;
        let shape_error = "the estimated error of the shape";
        let why = reason(response.shape_trust, shape_error, shape, &self.model, d);
        answer.set_item("shape_reason", why)?;
        answer.set_item("contact_point", PyArray1::from_slice(py, &contact.point))?;
        if field {
            let mut workspace = vec![0.0; self.model.field_workspace_len()];
            let mut u = vec![0.0; 3 * self.model.n_points()];
            py.detach(|| self.model.displacement(&contact, d, &mut workspace, &mut u));
            answer.set_item(
                "displacement",
                convert::field(py, u.into_iter().map(f64::from).collect())?,
            )?;
        }
        Ok(answer)
    }

    fn energy(
        &self,
        point: PyReadonlyArray1<f64>,
        displacement: PyReadonlyArray1<f64>,
    ) -> PyResult<f64> {
        Ok(self.model.energy(&self.contact(&point)?, finite("displacement", &displacement)?))
    }

    fn surface_displacement<'py>(
        &self,
        py: Python<'py>,
        point: PyReadonlyArray1<f64>,
        displacement: PyReadonlyArray1<f64>,
        order: usize,
    ) -> PyResult<Bound<'py, numpy::PyArray2<f64>>> {
        let contact = self.contact(&point)?;
        let d = finite("displacement", &displacement)?;
        let mut workspace = vec![0.0; self.model.workspace_len()];
        let mut u = vec![0.0; 3 * self.model.arrays().surface_nodes.len()];
        self.model.surface_displacement_to_order(&contact, d, order, &mut workspace, &mut u);
        convert::field(py, u.into_iter().map(f64::from).collect())
    }

    fn at(&self, py: Python<'_>, value: f64, law_parameters: Vec<f64>) -> PyResult<Self> {
        let mut model = self.model.clone();
        py.detach(|| model.set_parameter(value).map_err(refused)).map_err(convert::error)?;
        model.set_law_parameters(law_parameters).map_err(refused).map_err(convert::error)?;
        Ok(Model { model })
    }

    fn compressed(&self, py: Python<'_>, tolerance: f64) -> PyResult<Self> {
        let model =
            interruptible(py, |is_wanted| recompressed_while(&self.model, tolerance, is_wanted))?;
        Ok(Model { model })
    }

    fn surface_alone(&self, py: Python<'_>, inside: Vec<u32>) -> PyResult<Self> {
        let model = py
            .detach(|| self.model.surface_alone(&inside).map_err(refused))
            .map_err(convert::error)?;
        Ok(Model { model })
    }

    fn with_user(&self, user: &str) -> PyResult<Self> {
        let mut model = self.model.clone();
        let user = Notes::new(user)
            .map_err(|e| VisceraError::new_err(format!("notes that are no JSON: {e}")))?;
        model.set_user(user);
        Ok(Model { model })
    }

    fn weights(&self, point: PyReadonlyArray1<f64>) -> PyResult<Patch> {
        Ok(Patch { patch: self.model.patch(&self.contact(&point)?) })
    }
}

impl Model {
    fn contact(&self, point: &PyReadonlyArray1<f64>) -> PyResult<Contact> {
        let point = finite("point", point)?;
        let contact = self.model.locate(point).filter(|c| self.model.is_on_surface(c));
        contact.ok_or_else(|| {
            let distance = self.model.locate(point).map_or(f64::INFINITY, |c| c.distance);
            VisceraError::new_err(format!(
                "point {point:?} is {:.1} mm from the touchable surface; touch within {:.1} mm of it",
                1e3 * distance,
                1e3 * self.model.edge_length()
            ))
        })
    }
}

/// Why an answer of a model, displaced by `d` [m], is not trusted; empty if it is. `error` says what of it the estimate is.
pub fn reason(
    trust: Trust,
    error: &str,
    estimate: f64,
    model: &ReducedModel,
    d: [f64; 3],
) -> String {
    let depth = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    match trust {
        Trust::Trusted => String::new(),
        Trust::BeyondDepth => format!(
            "displaced by {:.1} mm, the model is made for {:.1} mm",
            1e3 * depth,
            1e3 * model.metadata().depth
        ),
        Trust::ErrorTooLarge => too_large(error, estimate, model, depth),
    }
}

/// What the estimate is, and what is allowed of it. Where the range of a parameter alone brings more, that is the reason.
fn too_large(error: &str, estimate: f64, model: &ReducedModel, depth: f64) -> String {
    let (allowed, of_range) = (model.allowed(depth), model.metadata().errors.parameter);
    let is_above =
        format!("above the {:.1} % that is allowed at {:.1} mm", 100.0 * allowed, 1e3 * depth);
    if of_range <= allowed {
        return format!("{error} is {:.1} %, {is_above}", 100.0 * estimate);
    }
    let name = model.metadata().parameter.as_ref().map_or("the parameter", |of| &of.name);
    format!(
        "between the values of {name} that were solved, answers are up to {:.1} % off, {is_above}; give Vary more nodes",
        100.0 * of_range
    )
}

fn finite(name: &str, array: &PyReadonlyArray1<f64>) -> PyResult<[f64; 3]> {
    let vector = convert::vector(name, array)?;
    if vector.iter().all(|x| x.is_finite()) {
        return Ok(vector);
    }
    Err(VisceraError::new_err(format!("{name} is {vector:?}; it must be finite")))
}

fn array<'py, T: Element + Copy>(
    py: Python<'py>,
    values: &[T],
    columns: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let flat = PyArray1::from_slice(py, values);
    if columns == 1 {
        return Ok(flat.into_any());
    }
    Ok(flat.reshape([values.len() / columns, columns])?.into_any())
}
