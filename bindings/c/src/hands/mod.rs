//! Several touches at once: `include/viscera_hands.h` in Rust.
//!
//! Training and what is asked of the whole organ allocate and take locks. The functions of a haptic loop work in memory
//! that was made before, on the thread that calls them.

mod grasp;
mod held;
mod stress;

use crate::frame::Frame;
use crate::load::write_message;
use crate::model::Model;
use crate::put;
use crate::status::{self, viscera_status};
use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use viscera_galerkin::{Galerkin, Sampling};
use viscera_solid::error::Error;

/// `viscera_hands`, opaque to C.
pub struct Hands {
    galerkin: Arc<Galerkin>,
    /// That of the model when this was made.
    frame: Frame,
}

/// `struct viscera_sampling`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SamplingSettings {
    pub order: u64,
    pub snapshots: u64,
    pub tolerance: f64,
    pub depth: f64,
}

const _: () = assert!(size_of::<SamplingSettings>() == 32);

/// As in Python (python/viscera/defaults.py).
const ORDER: usize = 3;
const TOLERANCE: f64 = 0.01;

/// Why something was not made.
type Refusal = (viscera_status, String);

fn refusal(error: Error) -> Refusal {
    let status = match error {
        Error::Cancelled => status::CANCELLED,
        _ => status::BAD_SETTING,
    };
    (status, error.to_string())
}

/// Runs work that may fail, and says in a sentence why it did.
///
/// # Safety
/// `message` is writable for `message_len` or null.
unsafe fn tell(
    work: impl FnOnce() -> Result<(), Refusal>,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    let broken = |_| Err((status::BAD_SETTING, "the work failed inside the library".into()));
    let done = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(broken);
    let (status, sentence) = done.err().unwrap_or((status::OK, String::new()));
    // SAFETY: the caller's contract.
    unsafe { write_message(&sentence, message, message_len) };
    status
}

/// Hands out what is made, or says why not.
///
/// # Safety
/// `out` is null or writable, `message` writable for `message_len` or null.
unsafe fn hand_out<T>(
    make: impl FnOnce() -> Result<T, Refusal>,
    out: *mut *mut T,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    unsafe { put(out, std::ptr::null_mut()) };
    let work = || {
        if out.is_null() {
            return Err((status::NULL_POINTER, "no place to put what is made".into()));
        }
        let made = Box::into_raw(Box::new(make()?));
        unsafe { out.write(made) };
        Ok(())
    };
    unsafe { tell(work, message, message_len) }
}

/// Frees what was handed out; null is nothing to do.
///
/// # Safety
/// `pointer` is null or comes from [`hand_out`], and is not used again.
unsafe fn free<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // SAFETY: made by `Box::into_raw`, and given back once.
        drop(unsafe { Box::from_raw(pointer) });
    }
}

fn missing(what: &str) -> Refusal {
    (status::NULL_POINTER, format!("no {what}"))
}

/// Writes the settings that Python has by default.
///
/// # Safety
/// `model` is null or loaded, `sampling` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_sampling_init(
    model: *const Model,
    sampling: *mut SamplingSettings,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(model) = (unsafe { model.as_ref() }) else {
        unsafe { put(sampling, SamplingSettings::default()) };
        return status::NULL_POINTER;
    };
    let metadata = model.reduced.metadata();
    let settings = SamplingSettings {
        order: metadata.order.min(ORDER) as u64,
        snapshots: 0,
        tolerance: TOLERANCE,
        depth: metadata.depth / model.frame.metres_per_unit,
    };
    unsafe { put(sampling, settings) };
    if sampling.is_null() { status::NULL_POINTER } else { status::OK }
}

/// Makes the model of several touches.
///
/// # Safety
/// `model` is null or loaded, `sampling` null or readable, `hands` null or writable, `message` writable for
/// `message_len` or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_hands_new(
    model: *const Model,
    sampling: *const SamplingSettings,
    hands: *mut *mut Hands,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let make = || {
        let model = unsafe { model.as_ref() }.ok_or_else(|| missing("model to hold"))?;
        let given = unsafe { sampling.as_ref() }.ok_or_else(|| missing("settings"))?;
        let (series, frame) = (model.reduced.clone(), model.frame);
        // A depth in other units may be rounded past itself.
        let own = series.metadata().depth;
        let depth = if given.depth == own / frame.metres_per_unit {
            own
        } else {
            given.depth * frame.metres_per_unit
        };
        let sampling = Sampling {
            order: usize::try_from(given.order).unwrap_or(usize::MAX),
            snapshots: usize::try_from(given.snapshots).unwrap_or(usize::MAX),
            tolerance: given.tolerance,
            depth,
        };
        if series.arrays().cells.is_empty() {
            return Err((
                status::BAD_SETTING,
                "this model has no cells, from which several touches are found; take the model that it was made from"
                    .into(),
            ));
        }
        let galerkin = Arc::new(Galerkin::new(series, sampling).map_err(refusal)?);
        Ok(Hands { galerkin, frame })
    };
    unsafe { hand_out(make, hands, message, message_len) }
}

/// Frees a model of several touches; null is nothing to do.
///
/// # Safety
/// `hands` is null or made, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_hands_free(hands: *mut Hands) {
    // SAFETY: the caller's contract.
    unsafe { free(hands) }
}
