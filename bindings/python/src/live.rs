//! A case in real time for a page.

use crate::convert;
use crate::exclusive::Exclusive;
use crate::threads;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// A case that one page steps.
#[pyclass(frozen, module = "viscera._core")]
pub struct Live {
    live: Exclusive<viscera_live::Live>,
}

#[pymethods]
impl Live {
    #[new]
    fn new(py: Python<'_>, case: &[u8]) -> PyResult<Self> {
        let live =
            threads::detached(py, || viscera_live::Live::open(case))?.map_err(convert::error)?;
        Ok(Live { live: Exclusive::new("live case", live) })
    }

    fn describe(&self) -> PyResult<String> {
        Ok(self.live.claim()?.describe())
    }

    fn answer<'py>(&self, py: Python<'py>, request: &str) -> PyResult<Bound<'py, PyBytes>> {
        let mut claimed = self.live.claim()?;
        let live = &mut *claimed;
        let frame = threads::detached(py, || live.answer(request))?.map_err(convert::error)?;
        let bytes: Vec<u8> = frame.iter().flat_map(|x| x.to_le_bytes()).collect();
        Ok(PyBytes::new(py, &bytes))
    }
}
