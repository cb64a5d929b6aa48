//! Progress that is asked for within one step, while conjugate gradients iterate, on a device or here.

use crate::clock::Instant;
use crate::equilibrium::ending::Cut;
use crate::equilibrium::system::Until;
use std::cell::{Cell, RefCell};
use std::time::Duration;

/// Least time between two questions: the caller may be an interpreter.
const EVERY: Duration = Duration::from_millis(100);

/// Who wants the solution, asked now and then by a solver that does not know who that is.
struct Listener<'a> {
    progress: RefCell<&'a mut dyn FnMut(f64) -> bool>,
    load: f64,
    asked: Cell<Instant>,
    is_stopped: Cell<bool>,
}

/// What a solver finds, unless the caller says meanwhile that it wants no more; `load` is the part of the load that has
/// been reached.
pub(super) fn while_wanted<T>(
    progress: &mut dyn FnMut(f64) -> bool,
    load: f64,
    find: impl FnOnce(Until<'_>) -> T,
) -> Result<T, Cut> {
    let listener = Listener::new(progress, load);
    let found = find(Until { deadline: None, is_wanted: &|| listener.is_wanted() });
    if listener.is_stopped() { Err(Cut::Cancelled) } else { Ok(found) }
}

impl<'a> Listener<'a> {
    /// `load` is the part of the load that has been reached.
    fn new(progress: &'a mut dyn FnMut(f64) -> bool, load: f64) -> Self {
        Listener {
            progress: RefCell::new(progress),
            load,
            asked: Cell::new(Instant::now()),
            is_stopped: Cell::new(false),
        }
    }

    /// Whether to go on; once it is no, it stays so.
    fn is_wanted(&self) -> bool {
        if !self.is_stopped.get() && self.asked.get().elapsed() >= EVERY {
            self.is_stopped.set(!(self.progress.borrow_mut())(self.load));
            self.asked.set(Instant::now());
        }
        !self.is_stopped.get()
    }

    /// Whether it has been no.
    fn is_stopped(&self) -> bool {
        self.is_stopped.get()
    }
}
