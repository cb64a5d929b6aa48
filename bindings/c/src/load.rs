//! Loading, copying and freeing a model.

use crate::model::Model;
use crate::status::{self, viscera_status};
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Reads a model from the bytes of its file.
///
/// # Safety
/// `bytes` is readable for `len` bytes, `model` writable, `message` writable for `message_len`;
/// each may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_load(
    bytes: *const u8,
    len: usize,
    model: *mut *mut Model,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    let read = || {
        if bytes.is_null() || len > isize::MAX as usize {
            return Err("no bytes to read a model from".into());
        }
        // SAFETY: not null, of a possible length, readable by the caller's contract.
        Model::from_bytes(unsafe { std::slice::from_raw_parts(bytes, len) })
    };
    let null = if bytes.is_null() { status::NULL_POINTER } else { status::BAD_MODEL };
    // SAFETY: the caller's contract.
    unsafe { finish(read, null, model, message, message_len) }
}

/// Reads a model file.
///
/// # Safety
/// `path` is a C string, `model` writable, `message` writable for `message_len`; each may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_load_file(
    path: *const c_char,
    model: *mut *mut Model,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    let read = || {
        if path.is_null() {
            return Err("no path to read a model from".into());
        }
        // SAFETY: not null, a C string by the caller's contract.
        let path = path_of(unsafe { CStr::from_ptr(path) })?;
        let bytes = std::fs::read(&path).map_err(|e| e.to_string());
        let model = bytes.and_then(|bytes| Model::from_bytes(&bytes));
        model.map_err(|why| of(&path, &why, message_len))
    };
    let null = if path.is_null() { status::NULL_POINTER } else { status::BAD_MODEL };
    // SAFETY: the caller's contract.
    unsafe { finish(read, null, model, message, message_len) }
}

/// Copies a model with its frame and its value of the parameter.
///
/// # Safety
/// `model` is null or loaded, `copy` null or writable, `message` writable for `message_len` or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_copy(
    model: *const Model,
    copy: *mut *mut Model,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let given = unsafe { model.as_ref() };
    let clone = || given.cloned().ok_or_else(|| "no model to copy".into());
    unsafe { finish(clone, status::NULL_POINTER, copy, message, message_len) }
}

/// Frees a model; null is nothing to do.
///
/// # Safety
/// `model` is null or comes from a load and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_free(model: *mut Model) {
    if !model.is_null() {
        // SAFETY: made by `Box::into_raw` in `finish`, and given back once.
        drop(unsafe { Box::from_raw(model) });
    }
}

/// Runs a reader, and hands out either a model or a sentence.
unsafe fn finish(
    read: impl FnOnce() -> Result<Model, String>,
    failure: viscera_status,
    out: *mut *mut Model,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: writable or null by the caller's contract, here and below.
    unsafe { crate::put(out, std::ptr::null_mut()) };
    let (status, sentence) = if out.is_null() {
        (status::NULL_POINTER, "no place to put a model".to_string())
    } else {
        match catch_unwind(AssertUnwindSafe(read)) {
            Ok(Ok(model)) => {
                let warning = model.warning().to_string();
                unsafe { out.write(Box::into_raw(Box::new(model))) };
                (status::OK, warning)
            }
            Ok(Err(sentence)) => (failure, sentence),
            Err(_) => (status::BAD_MODEL, "reading the model failed inside the library".into()),
        }
    };
    unsafe { write_message(&sentence, message, message_len) };
    status
}

/// What is wrong with a file, in a message of so many bytes: `path: why`. If they do not fit, the path loses its beginning,
/// since the reason and the name of the file say more.
fn of(path: &Path, why: &str, message_len: usize) -> String {
    const CUT: &str = "...";
    let (path, why) = (path.display().to_string(), format!(": {why}"));
    let room = message_len.saturating_sub(why.len() + 1); // one byte ends the message
    if path.len() <= room {
        return path + &why;
    }
    let mut start = path.len() - room.saturating_sub(CUT.len());
    while !path.is_char_boundary(start) {
        start += 1;
    }
    format!("{CUT}{}{why}", &path[start..])
}

/// Writes a sentence as a C string, cut at a whole character if the buffer is short.
pub unsafe fn write_message(sentence: &str, message: *mut c_char, message_len: usize) {
    if message.is_null() || message_len == 0 {
        return;
    }
    let mut end = sentence.len().min(message_len - 1);
    while !sentence.is_char_boundary(end) {
        end -= 1;
    }
    // SAFETY: `end + 1 <= message_len` bytes are writable by the caller's contract.
    unsafe {
        std::ptr::copy_nonoverlapping(sentence.as_ptr(), message.cast::<u8>(), end);
        message.add(end).write(0);
    }
}

#[cfg(unix)]
fn path_of(text: &CStr) -> Result<PathBuf, String> {
    use std::os::unix::ffi::OsStrExt;
    Ok(std::ffi::OsStr::from_bytes(text.to_bytes()).into())
}

#[cfg(not(unix))]
fn path_of(text: &CStr) -> Result<PathBuf, String> {
    text.to_str().map(PathBuf::from).map_err(|e| format!("the path is not UTF-8: {e}"))
}
