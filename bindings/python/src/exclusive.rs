//! State that one thread at a time may use. The interpreter is released during the work, so another thread could call.

use crate::convert::VisceraError;
use pyo3::PyResult;
use std::sync::{Mutex, MutexGuard, TryLockError};

/// Something that works for one thread at a time, and refuses the others in a sentence.
pub struct Exclusive<T> {
    name: &'static str,
    value: Mutex<T>,
}

impl<T> Exclusive<T> {
    /// `name` is the name that users know.
    pub fn new(name: &'static str, value: T) -> Self {
        Exclusive { name, value: Mutex::new(value) }
    }

    /// The right to use it until the guard is dropped.
    pub fn claim(&self) -> PyResult<MutexGuard<'_, T>> {
        match self.value.try_lock() {
            Ok(guard) => Ok(guard),
            Err(TryLockError::WouldBlock) => Err(VisceraError::new_err(format!(
                "this {} is at work in another thread; give every thread one of its own, or let them take turns with \
                 a threading.Lock",
                self.name
            ))),
            Err(TryLockError::Poisoned(_)) => Err(VisceraError::new_err(format!(
                "this {} broke down at work and is of no use any more; make a new one",
                self.name
            ))),
        }
    }
}
