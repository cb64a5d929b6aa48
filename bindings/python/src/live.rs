//! A case in real time for a page.

use crate::convert;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// A case on the stage of one page.
#[pyclass(module = "viscera._core")]
pub struct Live {
    live: viscera_live::Live,
}

#[pymethods]
impl Live {
    #[new]
    fn new(py: Python<'_>, case: &[u8]) -> PyResult<Self> {
        let live = py.detach(|| viscera_live::Live::open(case)).map_err(convert::error)?;
        Ok(Live { live })
    }

    fn describe(&self) -> String {
        self.live.describe()
    }

    fn answer<'py>(&mut self, py: Python<'py>, request: &str) -> PyResult<Bound<'py, PyBytes>> {
        let frame = py.detach(|| self.live.answer(request)).map_err(convert::error)?;
        let bytes: Vec<u8> = frame.iter().flat_map(|x| x.to_le_bytes()).collect();
        Ok(PyBytes::new(py, &bytes))
    }
}
