//! Work of the core's threads, which a fork of the process that they were started in lacks: it would wait for them for ever.

use crate::convert::VisceraError;
use pyo3::prelude::*;
use std::process;
use std::sync::atomic::{AtomicU32, Ordering};
use viscera_core::body::Body;

/// The process that the threads were started in; 0 before there are any.
static OWNER: AtomicU32 = AtomicU32::new(0);

/// Runs work on a body, of which the threads of the core take their share if it is large, without the interpreter.
///
/// # Errors
/// Those of [`detached`], if it is.
pub fn detached_for<T: Send>(
    py: Python<'_>,
    body: &Body,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    if body.is_shared() { detached(py, work) } else { Ok(py.detach(work)) }
}

/// Runs work of the core's threads, without the interpreter.
///
/// # Errors
/// This process is a fork of the one that has the threads.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let here = process::id();
    match OWNER.compare_exchange(0, here, Ordering::Relaxed, Ordering::Relaxed) {
        Err(owner) if owner != here => Err(VisceraError::new_err(format!(
            "process {here} is a fork of process {owner}, whose threads the core needs here; start processes afresh: \
             ProcessPoolExecutor(mp_context=multiprocessing.get_context(\"spawn\"))"
        ))),
        _ => Ok(py.detach(work)),
    }
}
