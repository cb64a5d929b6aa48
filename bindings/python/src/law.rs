//! Laws at single deformation gradients: what plots and tests of a law need.

use crate::convert::{self, VisceraError};
use numpy::{
    PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use viscera_core::law::{self, Bounds, Kind, Material, Parameter, ROWS};
use viscera_core::tensor::Mat3;

/// The rows of the laws: name, parameters, and whether the energy has a power series at rest.
#[pyfunction]
pub fn laws(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let rows = ROWS.iter().map(|row| {
        let about = PyDict::new(py);
        let parameters: PyResult<Vec<_>> =
            row.parameters.iter().map(|p| parameter(py, p)).collect();
        about.set_item("name", row.name)?;
        about.set_item("parameters", parameters?)?;
        about.set_item("is_analytic", row.is_analytic)?;
        about.set_item("sample", row.sample.to_vec())?;
        Ok(about)
    });
    rows.collect()
}

fn parameter<'py>(py: Python<'py>, p: &Parameter) -> PyResult<Bound<'py, PyDict>> {
    let about = PyDict::new(py);
    about.set_item("name", p.name)?;
    about.set_item("means", p.means)?;
    let kind = match p.kind {
        Kind::Stress => "stress",
        Kind::Number => "number",
        Kind::Fibre => "fibre",
    };
    about.set_item("kind", kind)?;
    about.set_item("unit", p.kind.unit())?;
    let (above, low, high) = match p.bounds {
        Bounds::Any | Bounds::NotZero => (None, None, None),
        Bounds::Positive => (Some(0.0), None, None),
        Bounds::Within(low, high) => (None, Some(low), Some(high)),
    };
    about.set_item("above", above)?;
    about.set_item("low", low)?;
    about.set_item("high", high)?;
    about.set_item("default", p.default)?;
    Ok(about)
}

/// Names of the parameters of a law, a formula's as they appear in it.
#[pyfunction]
pub fn law_parameters(name: &str) -> PyResult<Vec<String>> {
    Material::parameter_names(name).map_err(convert::error)
}

/// A constitutive law by name with its parameters.
#[pyclass(frozen, module = "viscera._core")]
pub struct Law {
    pub material: Material,
}

#[pymethods]
impl Law {
    #[new]
    fn new(name: &str, parameters: PyReadonlyArray2<f64>) -> PyResult<Self> {
        let rows = parameters.as_array().rows().into_iter().map(|row| row.to_vec()).collect();
        let material = Material::new(name, rows).map_err(convert::error)?;
        Ok(Law { material })
    }

    #[getter]
    fn name(&self) -> &str {
        self.material.name()
    }

    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(PyArray2::from_vec2(py, self.material.parameters())?)
    }

    fn moduli<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = self.material.parameters().iter().map(|row| self.material.moduli(row));
        convert::table(py, &rows.collect::<Vec<_>>())
    }

    /// The columns of the parameters to which, together, the energy is proportional.
    fn stresses(&self) -> PyResult<Vec<usize>> {
        self.material.stresses().map_err(convert::error)
    }

    /// Whether the energy grows without bound as the volume vanishes, by row.
    fn resists_collapse(&self) -> Vec<bool> {
        let rows = self.material.parameters().iter();
        rows.map(|row| law::resists_collapse(&self.material, row)).collect()
    }

    #[pyo3(name = "energy")]
    #[allow(non_snake_case)]
    fn energy<'py>(
        &self,
        py: Python<'py>,
        F: PyReadonlyArray3<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let gradients = gradients(&F)?;
        let answers = self.material.energy_and_stress(self.material.of_cell(0), &gradients);
        Ok(PyArray1::from_vec(py, answers.into_iter().map(|(energy, _)| energy).collect()))
    }

    #[allow(non_snake_case)]
    fn stress<'py>(
        &self,
        py: Python<'py>,
        F: PyReadonlyArray3<f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let gradients = gradients(&F)?;
        let answers = self.material.energy_and_stress(self.material.of_cell(0), &gradients);
        let values = answers.into_iter().flat_map(|(_, stress)| stress.concat()).collect();
        PyArray1::from_vec(py, values).reshape([gradients.len(), 3, 3])
    }

    #[allow(non_snake_case)]
    fn tangent<'py>(
        &self,
        py: Python<'py>,
        F: PyReadonlyArray3<f64>,
    ) -> PyResult<Bound<'py, PyArray<f64, numpy::ndarray::Dim<[usize; 5]>>>> {
        let gradients = gradients(&F)?;
        let values: Vec<f64> = gradients.iter().flat_map(|f| tangent(&self.material, f)).collect();
        PyArray1::from_vec(py, values).reshape([gradients.len(), 3, 3, 3, 3])
    }
}

#[allow(non_snake_case)]
fn gradients(F: &PyReadonlyArray3<f64>) -> PyResult<Vec<Mat3<f64>>> {
    let view = F.as_array();
    let (_, rows, columns) = view.dim();
    if (rows, columns) != (3, 3) {
        return Err(VisceraError::new_err(format!(
            "F has shape {:?}; it must be (k, 3, 3)",
            view.shape()
        )));
    }
    Ok(view
        .outer_iter()
        .map(|f| std::array::from_fn(|i| std::array::from_fn(|j| f[[i, j]])))
        .collect())
}

/// `dP_iJ/dF_kL` from the contraction with the unit vectors and, for `J > L`, symmetry.
fn tangent(material: &Material, f: &Mat3<f64>) -> Vec<f64> {
    let (_, blocks) = material.tangent(material.of_cell(0), f);
    let mut out = Vec::with_capacity(81);
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                for l in 0..3 {
                    out.push(if j <= l { blocks[j][l][i][k] } else { blocks[l][j][k][i] });
                }
            }
        }
    }
    out
}
