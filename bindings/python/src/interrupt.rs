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

/// Runs work on another thread, without the interpreter, and cancels it when a signal, such as Ctrl-C, has raised an
/// exception.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let (is_wanted, mut raised) = (AtomicBool::new(true), None);
    let outcome = threads::detached(py, || {
        thread::scope(|scope| {
            let (wanted, (say, done)) = (&is_wanted, channel());
            // Whoever waits for it is there until it comes.
            scope.spawn(move || _ = say.send(work(&|| wanted.load(Ordering::Relaxed))));
            loop {
                match done.recv_timeout(EVERY) {
                    Ok(outcome) => return Some(outcome),
                    Err(RecvTimeoutError::Disconnected) => return None,
                    Err(RecvTimeoutError::Timeout) => {}
                }
                if let Err(error) = Python::attach(|py| py.check_signals()) {
                    is_wanted.store(false, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
        })
    })?;
    match (raised, outcome) {
        (Some(error), _) => Err(error),
        (None, Some(outcome)) => outcome.map_err(convert::error),
        (None, None) => Err(convert::VisceraError::new_err("the work broke off; begin anew")),
    }
}
