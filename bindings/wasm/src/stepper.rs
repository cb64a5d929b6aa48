//! A case stepped in the page, for viewer/src/live/stepper.ts: requests in, frames out, as on the server.

use crate::{device, say};
use viscera_live::{Case, Live};

/// A case and its last frame.
pub struct Stepped {
    live: Live,
    frame: Vec<f32>,
}

/// Reads a case and says what the page has to know of it, as JSON in the message; null where it is refused, and the
/// message says why. Should the stepper ever trap, the message says where. From so many cells on, the organ is stepped on
/// the page's graphics processor, if there is one.
///
/// # Safety
/// `bytes` is readable for `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn case_open(
    bytes: *const u8,
    len: usize,
    cells_on_device: usize,
) -> *mut Stepped {
    std::panic::set_hook(Box::new(|panic| say(panic.to_string())));
    // SAFETY: the caller's contract.
    let case = Case::read(unsafe { std::slice::from_raw_parts(bytes, len) });
    let live = case.and_then(|case| {
        let device = (case.n_cells() >= cells_on_device).then(device::open).flatten();
        Live::new(case, device)
    });
    match live {
        Ok(live) => {
            say(live.describe());
            Box::into_raw(Box::new(Stepped { live, frame: Vec::new() }))
        }
        Err(error) => {
            say(error.to_string());
            std::ptr::null_mut()
        }
    }
}

/// The frame that a request (UTF-8) asks for, valid until the next one; null where it is refused, and the message says
/// why. With a frame, the message says why the graphics processor is not used any more, or nothing.
///
/// # Safety
/// `case` comes from [`case_open`]; `request` is readable for `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn case_answer(
    case: *mut Stepped,
    request: *const u8,
    len: usize,
) -> *const f32 {
    // SAFETY: the caller's contract.
    let (case, request) = unsafe { (&mut *case, std::slice::from_raw_parts(request, len)) };
    match case.live.answer(&String::from_utf8_lossy(request)) {
        Ok(frame) => {
            say(case.live.take_device_fault().unwrap_or_default());
            case.frame = frame;
            case.frame.as_ptr()
        }
        Err(error) => {
            say(error.to_string());
            std::ptr::null()
        }
    }
}

/// Numbers of the last frame.
///
/// # Safety
/// `case` comes from [`case_open`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn case_frame_len(case: *const Stepped) -> usize {
    // SAFETY: the caller's contract.
    unsafe { &*case }.frame.len()
}
