//! The status of a call, as the numbers of `enum viscera_status`.

use std::ffi::c_char;

/// Named as in the header: there are other statuses.
#[expect(non_camel_case_types)]
pub type viscera_status = i32;

pub const OK: viscera_status = 0;
pub const BEYOND_DEPTH: viscera_status = 1;
pub const ERROR_TOO_LARGE: viscera_status = 2;
pub const OFF_SURFACE: viscera_status = 3;
pub const NOT_FINITE: viscera_status = 4;
pub const NULL_POINTER: viscera_status = 5;
pub const SHORT_BUFFER: viscera_status = 6;
pub const BAD_MODEL: viscera_status = 7;
pub const BAD_SETTING: viscera_status = 8;
pub const STALE: viscera_status = 9;
pub const INSIDE: viscera_status = 10;
pub const NOT_CONVERGED: viscera_status = 11;
pub const OUT_OF_TIME: viscera_status = 12;
pub const INVERTED: viscera_status = 13;
pub const UNSTABLE: viscera_status = 14;
pub const CANCELLED: viscera_status = 15;

/// A status in words, without end: never null.
#[unsafe(no_mangle)]
pub extern "C" fn viscera_status_text(status: viscera_status) -> *const c_char {
    let text = match status {
        OK => c"trusted",
        BEYOND_DEPTH => c"not trusted: displaced beyond the model's depth",
        ERROR_TOO_LARGE => c"not trusted: the estimated error is too large",
        OFF_SURFACE => c"nothing is touched: off the touchable surface",
        NOT_FINITE => c"a number is infinite or not a number",
        NULL_POINTER => c"a pointer is null",
        SHORT_BUFFER => c"a buffer is too short",
        BAD_MODEL => c"not a readable, usable model file",
        BAD_SETTING => c"a setting is out of its range",
        STALE => c"no new answer",
        INSIDE => c"the probe came into the organ in one step; lift it off",
        NOT_CONVERGED => c"not trusted: no equilibrium was found",
        OUT_OF_TIME => {
            c"not trusted: the time for the search was over before there was an equilibrium"
        }
        INVERTED => c"not trusted: a cell is inside out",
        UNSTABLE => c"not trusted: the whole organ would not stay there",
        CANCELLED => c"cancelled by the caller",
        _ => c"no such status",
    };
    text.as_ptr()
}
