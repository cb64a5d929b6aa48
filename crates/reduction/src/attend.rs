//! Runs work on the pool while the calling thread reports progress and can cancel the work.

use crate::error::Error;
use rayon::Yield;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

const EVERY: Duration = Duration::from_millis(50);

/// Runs `work`, which reads the flag between its steps and ends if it is set. Meanwhile calls `is_wanted` several times
/// a second; false sets the flag.
///
/// # Errors
/// Those of the work; [`Error::Cancelled`] if it was cancelled.
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
