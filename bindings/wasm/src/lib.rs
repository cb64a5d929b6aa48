//! The core in a page: plain functions over the page's memory. Translation only: all numbers come from viscera-core.
//!
//! Two modules are built of it: the on-line evaluator (viewer/src/model/evaluator.ts), small enough for every page, and the
//! stepper with all solvers (viewer/src/live/stepper.ts), which a page loads when it steps a case.

#[cfg(feature = "stepper")]
mod device;
#[cfg(feature = "evaluator")]
mod evaluator;
#[cfg(feature = "evaluator")]
mod model;
#[cfg(feature = "evaluator")]
mod pair;
#[cfg(feature = "stepper")]
mod stepper;

use std::sync::Mutex;

/// The message of the last call that leaves one.
static MESSAGE: Mutex<String> = Mutex::new(String::new());

fn say(text: String) {
    if let Ok(mut message) = MESSAGE.lock() {
        *message = text;
    }
}

/// Address of the last message (UTF-8).
#[unsafe(no_mangle)]
pub extern "C" fn page_message() -> *const u8 {
    MESSAGE.lock().map_or(std::ptr::null(), |message| message.as_ptr())
}

/// Length of the last message in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn page_message_len() -> usize {
    MESSAGE.lock().map_or(0, |message| message.len())
}

/// Memory for bytes that the page brings: a file, a request.
#[unsafe(no_mangle)]
pub extern "C" fn page_allocate(len: usize) -> *mut u8 {
    Box::into_raw(vec![0u8; len].into_boxed_slice()).cast()
}

/// Frees memory.
///
/// # Safety
/// `bytes` comes from [`page_allocate`] with the same `len`, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn page_release(bytes: *mut u8, len: usize) {
    // SAFETY: the caller's contract.
    drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(bytes, len)) });
}
