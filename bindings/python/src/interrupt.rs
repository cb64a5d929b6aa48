//! Long work that Ctrl-C ends.

use crate::convert;
use crate::threads;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;
use viscera_core::Error;

/// How often Python's signals are looked at.
const EVERY: Duration = Duration::from_millis(50);

/// The exception that a signal has raised, and what the work has found, unless it broke off.
type Watched<T> = (Option<PyErr>, Option<Result<T, Error>>);

/// Runs work on another thread, without the interpreter, and cancels it when a signal, such as Ctrl-C, has raised an
/// exception.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> Result<T, Error> + Send,
) -> PyResult<T> {
    outcome(threads::detached(py, || watched(work))?)
}

/// Waits for work on another thread, and looks at the signals meanwhile.
fn watched<T: Send>(
    work: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> Result<T, Error> + Send,
) -> Watched<T> {
    let (is_wanted, mut raised) = (AtomicBool::new(true), None);
    let found = thread::scope(|scope| {
        let (wanted, (say, done)) = (&is_wanted, channel());
        // Whoever waits for it is there until it comes.
        scope.spawn(move || _ = say.send(work(&|| wanted.load(Ordering::Relaxed))));
        loop {
            match done.recv_timeout(EVERY) {
                Ok(found) => return Some(found),
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Err(error) = Python::attach(|py| py.check_signals()) {
                is_wanted.store(false, Ordering::Relaxed);
                raised = Some(error);
            }
        }
    });
    (raised, found)
}

/// An exception comes before what was found.
fn outcome<T>(watched: Watched<T>) -> PyResult<T> {
    match watched {
        (Some(error), _) => Err(error),
        (None, Some(found)) => found.map_err(convert::error),
        (None, None) => Err(convert::VisceraError::new_err("the work broke off; begin anew")),
    }
}
