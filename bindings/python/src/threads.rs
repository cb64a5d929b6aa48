//! Work of the core's threads, which a fork of the process that they were started in lacks: it would wait for them for ever.
//!
//! Each factor asks the threads for its order, whatever its size, so all that solves is [`detached`].

use crate::convert::VisceraError;
use pyo3::prelude::*;
use std::process;
use std::sync::atomic::{AtomicU32, Ordering};
use viscera_core::body::Body;

/// The process that the threads were started in; 0 before there are any.
static OWNER: AtomicU32 = AtomicU32::new(0);

/// Runs work of the core's threads, without the interpreter.
///
/// # Errors
/// This process is a fork of the one that has the threads.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    own()?;
    Ok(py.detach(work))
}

/// Runs integrals over the cells of a body, of which threads take their share if it is large, without the interpreter.
///
/// # Errors
/// Those of [`detached`], if it is large.
pub fn integrated<T: Send>(
    py: Python<'_>,
    body: &Body,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    // To ask how many threads there are starts them, so they have an owner before.
    match own() {
        Err(error) if body.is_shared() => Err(error),
        _ => Ok(py.detach(work)),
    }
}

/// Makes this process the owner of the threads, if none is.
fn own() -> PyResult<()> {
    let here = process::id();
    match OWNER.compare_exchange(0, here, Ordering::Relaxed, Ordering::Relaxed) {
        Err(owner) if owner != here => Err(VisceraError::new_err(format!(
            "process {here} is a fork of process {owner}, whose threads the core needs here; start processes afresh: \
             ProcessPoolExecutor(mp_context=multiprocessing.get_context(\"spawn\"))"
        ))),
        _ => Ok(()),
    }
}
