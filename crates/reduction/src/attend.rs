//! Work on the pool while the thread that asked for it stays with the caller: it reports progress, and passes on that
//! the work is wanted no more.

use crate::error::Error;
use rayon::Yield;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

const EVERY: Duration = Duration::from_millis(50);

/// Does `work`, which looks at the flag between its steps and ends where it is set; meanwhile asks `is_wanted` several
/// times a second whether to go on.
///
/// # Errors
/// Those of the work; [`Error::Cancelled`] where it was wanted no more.
pub(super) fn attend<T: Send>(
    is_wanted: &mut dyn FnMut() -> bool,
    work: impl FnOnce(&AtomicBool) -> Result<T, Error> + Send,
) -> Result<T, Error> {
    let (stop, mut outcome) = (AtomicBool::new(false), Err(Error::Cancelled));
    let (working, done) = channel::<()>();
    rayon::in_place_scope(|scope| {
        let (stop, outcome) = (&stop, &mut outcome);
        scope.spawn(move |_| {
            *outcome = work(stop);
            drop(working);
        });
        loop {
            // A thread of the pool that waits must also work: it may be the only one.
            if let Some(Yield::Executed) = rayon::yield_now() {
                continue;
            }
            if let Err(RecvTimeoutError::Disconnected) = done.recv_timeout(EVERY) {
                break;
            }
            if !is_wanted() {
                stop.store(true, Ordering::Relaxed);
            }
        }
    });
    if stop.into_inner() { Err(Error::Cancelled) } else { outcome }
}
