//! The body that an organ of Python holds.

use pyo3::prelude::*;
use viscera_core::{body, mesh};

/// Mesh + law + fixed nodes.
#[pyclass(frozen, module = "viscera._core")]
pub struct Body {
    pub body: body::Body,
    pub surface: mesh::Surface,
    pub fixed: Vec<u32>,
}
