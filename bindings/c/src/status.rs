//! What a call came to, as the numbers of `enum viscera_status`.

use std::ffi::c_char;

pub type Status = i32;

pub const OK: Status = 0;
pub const BEYOND_DEPTH: Status = 1;
pub const ERROR_TOO_LARGE: Status = 2;
pub const OFF_SURFACE: Status = 3;
pub const NOT_FINITE: Status = 4;
pub const NULL_POINTER: Status = 5;
pub const SHORT_BUFFER: Status = 6;
pub const BAD_MODEL: Status = 7;
pub const BAD_SETTING: Status = 8;
pub const STALE: Status = 9;

/// A status in words, without end: never null.
#[unsafe(no_mangle)]
pub extern "C" fn viscera_status_text(status: Status) -> *const c_char {
    let text = match status {
        OK => c"trusted",
        BEYOND_DEPTH => c"not trusted: displaced beyond the model's depth",
        ERROR_TOO_LARGE => c"not trusted: the estimated error is too large",
        OFF_SURFACE => c"the point is more than an edge length off the touchable surface",
        NOT_FINITE => c"a number is infinite or not a number",
        NULL_POINTER => c"a pointer is null",
        SHORT_BUFFER => c"a buffer is too short",
        BAD_MODEL => c"not a readable, usable model file",
        BAD_SETTING => c"a setting is out of its range",
        STALE => c"no new answer",
        _ => c"no such status",
    };
    text.as_ptr()
}
