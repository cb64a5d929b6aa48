//! Elements and solvers by their rows in the core: names, settings, bounds, defaults.

use crate::convert;
use crate::gpu;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use viscera_core::element::Element;
use viscera_core::equilibrium::{ConjugateGradients, Method, Newton, Preconditioner};
use viscera_core::pgd::Enrichment;
use viscera_core::settings::{self, Setting, Values};

/// A linear solver: "cholesky", "auto", or the preconditioner of conjugate gradients with their settings and where they run.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Solver {
    name: String,
    settings: BTreeMap<String, f64>,
    device: String,
}

impl Solver {
    /// The core's method.
    pub fn method(&self) -> PyResult<Method> {
        match self.name.as_str() {
            "cholesky" => return Ok(Method::Cholesky),
            "auto" => return Ok(Method::Automatic),
            _ => {}
        }
        let preconditioner = Preconditioner::named(&self.name).map_err(convert::error)?;
        let mut cg = ConjugateGradients { preconditioner, ..ConjugateGradients::default() };
        choose(&ConjugateGradients::SETTINGS, &mut cg, "conjugate gradients", &self.settings)?;
        cg.device = if self.device == "gpu" { Some(gpu::device()?) } else { None };
        Ok(Method::ConjugateGradients(cg))
    }
}

/// Gives settings their values by name, `of` being whose they are.
pub fn choose<S>(
    rows: &[Setting<S>],
    chosen: &mut S,
    of: &str,
    values: &BTreeMap<String, f64>,
) -> PyResult<()> {
    let mut set = |(name, &value): (&String, &f64)| settings::set(rows, chosen, of, name, value);
    values.iter().try_for_each(&mut set).map_err(convert::error)
}

/// Names of the elements, and what each is.
#[pyfunction]
pub fn elements() -> Vec<(&'static str, &'static str)> {
    Element::ROWS.iter().map(|row| (row.name, row.means)).collect()
}

/// Names of the preconditioners of conjugate gradients.
#[pyfunction]
pub fn preconditioners() -> Vec<&'static str> {
    Preconditioner::NAMES.iter().map(|(name, _)| *name).collect()
}

/// The settings of each solver: name, what it is, kind, bounds, default.
#[pyfunction]
pub fn solver_settings(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    all.set_item("newton", rows(py, &Newton::SETTINGS)?)?;
    all.set_item("conjugate_gradients", rows(py, &ConjugateGradients::SETTINGS)?)?;
    all.set_item("enrichment", rows(py, &Enrichment::SETTINGS)?)?;
    Ok(all)
}

fn rows<'py, S: Default>(
    py: Python<'py>,
    rows: &[Setting<S>],
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let default = S::default();
    let about = |row: &Setting<S>| {
        let about = PyDict::new(py);
        about.set_item("name", row.name)?;
        about.set_item("means", row.means)?;
        let (kind, low, high) = match row.values {
            Values::Fraction => ("fraction", 0.0, 1.0),
            Values::Part => ("part", 0.0, 1.0),
            Values::Whole(low, high) => ("whole", f64::from(low), f64::from(high)),
            Values::Flag => ("flag", 0.0, 1.0),
        };
        about.set_item("kind", kind)?;
        about.set_item("low", low)?;
        about.set_item("high", high)?;
        about.set_item("default", (row.get)(&default))?;
        Ok(about)
    };
    rows.iter().map(about).collect()
}
