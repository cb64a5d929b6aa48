//! One Newton iteration a frame.

use crate::{body::Body, convert, mesh::Patch};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use viscera_core::equilibrium::{self, PatchLoad, Pressure, Problem};

/// A body in the hands of a simulator.
#[pyclass(module = "viscera._core")]
pub struct Stepper {
    body: Py<Body>,
    stepper: equilibrium::Stepper,
}

#[pymethods]
impl Stepper {
    #[new]
    #[pyo3(signature = (body, *, prescribed, patches, start))]
    fn new(
        body: Py<Body>,
        prescribed: PyReadonlyArray1<u32>,
        patches: Vec<PyRef<'_, Patch>>,
        start: Option<PyReadonlyArray2<f64>>,
    ) -> PyResult<Self> {
        let held = body.get();
        let n = held.body.points().len();
        let free = prescribed.as_array();
        let dofs = held.fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i));
        let at_rest = |patch: &PyRef<'_, Patch>| PatchLoad {
            patch: patch.patch.clone(),
            displacement: [0.0; 3],
        };
        let problem = Problem {
            body: &held.body,
            prescribed: dofs.chain(free.iter().copied()).map(|dof| (dof, 0.0)).collect(),
            force: vec![0.0; 3 * n],
            pressure: Pressure::default(),
            patches: patches.iter().map(at_rest).collect(),
            start: start.map(|u| convert::dofs("start", &u, n)).transpose()?,
        };
        let stepper = equilibrium::Stepper::new(&problem).map_err(convert::error)?;
        Ok(Stepper { body, stepper })
    }

    #[pyo3(signature = (*, values, means, force))]
    fn frame<'py>(
        &mut self,
        py: Python<'py>,
        values: PyReadonlyArray1<f64>,
        means: PyReadonlyArray2<f64>,
        force: PyReadonlyArray2<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let held = self.body.get();
        let fixed = std::iter::repeat_n(0.0, 3 * held.fixed.len());
        let values: Vec<f64> = fixed.chain(values.as_array().iter().copied()).collect();
        let means = convert::points("means", &means)?;
        let force = convert::dofs("force", &force, held.body.points().len())?;
        let stepper = &mut self.stepper;
        let frame = py
            .detach(|| stepper.frame(&held.body, &values, &means, &force))
            .map_err(convert::error)?;
        let dict = PyDict::new(py);
        dict.set_item("displacement", convert::field(py, self.stepper.displacement().to_vec())?)?;
        dict.set_item(
            "internal_force",
            convert::field(py, self.stepper.internal_force().to_vec())?,
        )?;
        dict.set_item("patch_forces", convert::table(py, &frame.patch_forces)?)?;
        dict.set_item("residual", frame.residual)?;
        dict.set_item("taken", frame.taken)?;
        dict.set_item("is_unstable", frame.is_unstable)?;
        Ok(dict)
    }
}
