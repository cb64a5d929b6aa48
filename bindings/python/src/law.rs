//! Laws at single deformation gradients: what plots and tests of a law need.

use crate::convert::{self, VisceraError};
use numpy::{
    PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3,
};
use pyo3::prelude::*;
use viscera_core::law::{self, LawVisitor, Material};
use viscera_core::tensor::Mat3;

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

    #[pyo3(name = "energy")]
    #[allow(non_snake_case)]
    fn energy<'py>(
        &self,
        py: Python<'py>,
        F: PyReadonlyArray3<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = gradients(&F)?.iter().map(|f| self.material.visit(Energy(self, f))).collect();
        Ok(PyArray1::from_vec(py, values))
    }

    #[allow(non_snake_case)]
    fn stress<'py>(
        &self,
        py: Python<'py>,
        F: PyReadonlyArray3<f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let gradients = gradients(&F)?;
        let values: Vec<f64> =
            gradients.iter().flat_map(|f| self.material.visit(Stress(self, f)).concat()).collect();
        PyArray1::from_vec(py, values).reshape([gradients.len(), 3, 3])
    }

    #[allow(non_snake_case)]
    fn tangent<'py>(
        &self,
        py: Python<'py>,
        F: PyReadonlyArray3<f64>,
    ) -> PyResult<Bound<'py, PyArray<f64, numpy::ndarray::Dim<[usize; 5]>>>> {
        let gradients = gradients(&F)?;
        let values: Vec<f64> =
            gradients.iter().flat_map(|f| self.material.visit(Tangent(self, f))).collect();
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

struct Energy<'a>(&'a Law, &'a Mat3<f64>);
struct Stress<'a>(&'a Law, &'a Mat3<f64>);
struct Tangent<'a>(&'a Law, &'a Mat3<f64>);

impl LawVisitor for Energy<'_> {
    type Output = f64;
    fn visit<L: law::Law>(self, make: fn(&[f64]) -> L) -> f64 {
        make(self.0.material.of_cell(0)).energy(self.1)
    }
}

impl LawVisitor for Stress<'_> {
    type Output = Mat3<f64>;
    fn visit<L: law::Law>(self, make: fn(&[f64]) -> L) -> Mat3<f64> {
        make(self.0.material.of_cell(0)).stress(self.1)
    }
}

impl LawVisitor for Tangent<'_> {
    type Output = Vec<f64>;

    /// `dP_iJ/dF_kL` from the contraction with the unit vectors and, for `J > L`, symmetry.
    fn visit<L: law::Law>(self, make: fn(&[f64]) -> L) -> Vec<f64> {
        let units = std::array::from_fn(|a| std::array::from_fn(|i| (a == i) as u8 as f64));
        let (_, blocks) = make(self.0.material.of_cell(0)).tangent(self.1, &units);
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
}
