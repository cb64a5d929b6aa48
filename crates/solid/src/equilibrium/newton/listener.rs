//! Progress that is asked for within one step, while conjugate gradients iterate, on a device or here.

use crate::clock::Instant;
use std::cell::{Cell, RefCell};
use std::time::Duration;

/// Least time between two questions: the caller may be an interpreter.
const EVERY: Duration = Duration::from_millis(100);

/// Who wants the solution, asked now and then by a solver that does not know who that is.
pub(super) struct Listener<'a> {
    progress: RefCell<&'a mut dyn FnMut(f64) -> bool>,
    load: f64,
    asked: Cell<Instant>,
    is_stopped: Cell<bool>,
}

impl<'a> Listener<'a> {
    /// `load` is the part of the load that has been reached.
    pub fn new(progress: &'a mut dyn FnMut(f64) -> bool, load: f64) -> Self {
        Listener {
            progress: RefCell::new(progress),
            load,
            asked: Cell::new(Instant::now()),
            is_stopped: Cell::new(false),
        }
    }

    /// Whether to go on; once it is no, it stays so.
    pub fn is_wanted(&self) -> bool {
        if !self.is_stopped.get() && self.asked.get().elapsed() >= EVERY {
            self.is_stopped.set(!(self.progress.borrow_mut())(self.load));
            self.asked.set(Instant::now());
        }
        !self.is_stopped.get()
    }

    /// Whether it has been no.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped.get()
    }
}
