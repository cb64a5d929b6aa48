//! Places inside the organ, whose displacement a touch tells.

use crate::load::write_message;
use crate::model::{Model, finite_or_zero, status_of};
use crate::status::{self, viscera_status};
use crate::{put, vector};
use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// `viscera_places`, opaque to C.
pub struct Places {
    /// It outlives the places by the caller's contract.
    model: *const Model,
    pub(crate) inside: viscera_touch::Places,
}

impl Places {
    /// Displacement of the places; zero if there is no answer.
    fn displace(
        &mut self,
        model: &Model,
        point: [f64; 3],
        displacement: [f64; 3],
        out: &mut [[f64; 3]],
    ) -> viscera_status {
        let frame = &model.frame;
        let d = frame.length_in(displacement);
        let status = match model.touch(frame.point_in(point), d) {
            Ok((contact, response)) => {
                model.reduced.move_places(&mut self.inside, &contact, d, out);
                status_of(response.shape_trust)
            }
            Err(status) => {
                out.fill([0.0; 3]);
                status
            }
        };
        out.iter_mut().for_each(|u| *u = frame.length_out(*u));
        finite_or_zero(status, out.as_flattened_mut())
    }
}

/// Places at points of the untouched organ.
///
/// # Safety
/// `model` is null or loaded, and freed after the places; `points` is readable for `count` points or null, `places`
/// null or writable, `message` writable for `message_len` or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_places_at(
    model: *const Model,
    points: *const f64,
    count: usize,
    places: *mut *mut Places,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    let find = |model: &Model| {
        // SAFETY: not null, and readable for `count` points by the caller's contract.
        let points = unsafe { std::slice::from_raw_parts(points.cast::<[f64; 3]>(), count) };
        let points: Vec<_> = points.iter().map(|&x| model.frame.point_in(x)).collect();
        model.reduced.places_at(&points).map_err(|error| error.to_string())
    };
    let is_given = !points.is_null() && count <= isize::MAX as usize / size_of::<[f64; 3]>();
    // SAFETY: the caller's contract.
    unsafe { finish(model, is_given, find, places, message, message_len) }
}

/// Places at nodes.
///
/// # Safety
/// As above; `nodes` is readable for `count` numbers or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_places_of_nodes(
    model: *const Model,
    nodes: *const u32,
    count: usize,
    places: *mut *mut Places,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    let find = |model: &Model| {
        // SAFETY: not null, and readable for `count` numbers by the caller's contract.
        let nodes = unsafe { std::slice::from_raw_parts(nodes, count) };
        model.reduced.places_of_nodes(nodes).map_err(|error| error.to_string())
    };
    let is_given = !nodes.is_null() && count <= isize::MAX as usize / size_of::<u32>();
    // SAFETY: the caller's contract.
    unsafe { finish(model, is_given, find, places, message, message_len) }
}

/// Hands out either places or a sentence.
unsafe fn finish(
    model: *const Model,
    is_given: bool,
    find: impl FnOnce(&Model) -> Result<viscera_touch::Places, String>,
    out: *mut *mut Places,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    unsafe { put(out, std::ptr::null_mut()) };
    let found = match unsafe { model.as_ref() } {
        None => Err((status::NULL_POINTER, "no model for the places to lie in".to_string())),
        Some(_) if out.is_null() => Err((status::NULL_POINTER, "no place to put places".into())),
        Some(_) if !is_given => Err((status::NULL_POINTER, "no places to look for".into())),
        Some(model) => match catch_unwind(AssertUnwindSafe(|| find(model))) {
            Ok(found) => found.map_err(|sentence| (status::BAD_SETTING, sentence)),
            Err(_) => Err((status::BAD_SETTING, "looking failed inside the library".into())),
        },
    };
    let (status, sentence) = match found {
        Ok(inside) => {
            unsafe { out.write(Box::into_raw(Box::new(Places { model, inside }))) };
            (status::OK, String::new())
        }
        Err(told) => told,
    };
    unsafe { write_message(&sentence, message, message_len) };
    status
}

/// Frees places; null is nothing to do.
///
/// # Safety
/// `places` is null or was made here and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_places_free(places: *mut Places) {
    if !places.is_null() {
        // SAFETY: made by `Box::into_raw` in `finish`, and given back once.
        drop(unsafe { Box::from_raw(places) });
    }
}

/// Displacement of the places under a touch.
///
/// # Safety
/// `places` is null or made, `point` and `displacement` null or readable, `moved` null or writable for its length.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_places_displacement(
    places: *mut Places,
    point: *const f64,
    displacement: *const f64,
    moved: *mut f64,
    moved_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let given = unsafe { (places.as_mut(), vector(point), vector(displacement)) };
    let (Some(places), Some(point), Some(d)) = given else {
        return status::NULL_POINTER;
    };
    let count = places.inside.len();
    if moved.is_null() {
        return status::NULL_POINTER;
    }
    if moved_len < 3 * count {
        return status::SHORT_BUFFER;
    }
    // SAFETY: not null, and at least as long as what is taken; the model outlives the places.
    let (model, moved) = unsafe {
        (&*places.model, std::slice::from_raw_parts_mut(moved.cast::<[f64; 3]>(), count))
    };
    places.displace(model, point, d, moved)
}
