//! The on-line evaluator, for viewer/src/model/evaluator.ts.
//!
//! A page holds one or more organs by their address. Every pointer handed out stays valid until the organ is closed;
//! what it points to is overwritten by the next call of the same function (and slot).

use crate::model::Model;
use crate::say;

/// Reads a model file; null where it is refused, and the message says why.
///
/// # Safety
/// `bytes` is readable for `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_open(bytes: *const u8, len: usize) -> *mut Model {
    // SAFETY: the caller's contract.
    match Model::read(unsafe { std::slice::from_raw_parts(bytes, len) }) {
        Ok(organ) => Box::into_raw(Box::new(organ)),
        Err(sentence) => {
            say(sentence);
            std::ptr::null_mut()
        }
    }
}

/// Frees an organ.
///
/// # Safety
/// `organ` comes from [`organ_open`] and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_close(organ: *mut Model) {
    // SAFETY: the caller's contract.
    drop(unsafe { Box::from_raw(organ) });
}

/// Metadata and sizes as JSON, in the message.
///
/// # Safety
/// As for every function below: `organ` comes from [`organ_open`] and has not been closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_describe(organ: *const Model) {
    // SAFETY: the caller's contract, here and below.
    say(unsafe { &*organ }.describe());
}

/// An array of the organ by its number in `organ::Table`; what it holds is written there.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_table(organ: *const Model, number: usize) -> *const u32 {
    unsafe { &*organ }.table(number)
}

/// Rest positions of the surface nodes (s, 3) [m].
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_rest(organ: *const Model) -> *const f32 {
    unsafe { &*organ }.rest().as_ptr()
}

/// Touches the point of the touchable surface closest to (x, y, z): its distance [m], negative
/// where the point is no contact. The contact point is in [`organ_answer`].
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_touch(organ: *mut Model, x: f64, y: f64, z: f64) -> f64 {
    unsafe { &mut *organ }.touch([x, y, z])
}

/// Evaluates the contact displaced by d [m]; returns of the force: 0 trusted, 1 beyond the depth, 2 error too large,
/// 3 no number. The numbers are in [`organ_answer`].
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_evaluate(organ: *mut Model, x: f64, y: f64, z: f64) -> u32 {
    unsafe { &mut *organ }.evaluate([x, y, z])
}

/// The same of the shape that was evaluated last.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_shape_trust(organ: *const Model) -> u32 {
    unsafe { &*organ }.shape_trust()
}

/// Contact point (3) [m], force (3) [N], stiffness (9) [N/m], error estimates of force and shape: 17 numbers.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_answer(organ: *const Model) -> *const f64 {
    unsafe { &*organ }.answer().as_ptr()
}

/// Moves the centre of a sphere to (x, y, z) [m], as wide as the patch and without friction; returns as
/// [`organ_evaluate`]. The contact is the one that the sphere holds. The numbers are in [`organ_answer`] and
/// [`organ_felt`].
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_place(organ: *mut Model, x: f64, y: f64, z: f64) -> u32 {
    unsafe { &mut *organ }.place([x, y, z])
}

/// Displacement of the contact (3) [m], gap [m] between sphere and surface at rest, and grip: 0 free, 1 sticks,
/// 2 slides, 3 inside, 4 lost; what else the sphere touches: 0 nothing, 1 a support, 2 the organ at a second place,
/// 3 beside its touchable surface; the estimated error that decides, the largest that is trusted, and the part of it that
/// is the contact's, 0 if it is the model's own: 9 numbers.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_felt(organ: *const Model) -> *const f64 {
    unsafe { &*organ }.felt().as_ptr()
}

/// Takes the sphere from the organ: the next place is a first one.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_lift(organ: *mut Model) {
    unsafe { &mut *organ }.lift();
}

/// A second probe joins the one of [`organ_place`], which is in a hand, 0 or 1; both feel each other.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_pair_begin(organ: *mut Model, hand: usize) {
    unsafe { &mut *organ }.begin_pair(hand);
}

/// Moves the centres of both probes, to (ax, ay, az) and (bx, by, bz) [m].
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_pair_place(
    organ: *mut Model,
    ax: f64,
    ay: f64,
    az: f64,
    bx: f64,
    by: f64,
    bz: f64,
) {
    unsafe { &mut *organ }.place_pair([[ax, ay, az], [bx, by, bz]]);
}

/// The probe in a hand, whose contact every other function is about from now on; returns as [`organ_place`].
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_pair_choose(organ: *mut Model, hand: usize) -> u32 {
    unsafe { &mut *organ }.choose_of_pair(hand)
}

/// The probe in a hand goes on alone, as that of [`organ_place`].
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_pair_end(organ: *mut Model, hand: usize) {
    unsafe { &mut *organ }.end_pair(hand);
}

/// Force (3) [N] of the series cut after an order.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_force(
    organ: *mut Model,
    x: f64,
    y: f64,
    z: f64,
    order: usize,
) -> *const f64 {
    unsafe { &mut *organ }.force([x, y, z], order).as_ptr()
}

/// Displacement (s, 3) [m] of the surface nodes for the series cut after an order, kept in one of two slots.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_surface(
    organ: *mut Model,
    x: f64,
    y: f64,
    z: f64,
    order: usize,
    slot: usize,
) -> *const f32 {
    unsafe { &mut *organ }.surface([x, y, z], order, slot).as_ptr()
}

/// Volume [m^3] inside the surface displaced as in a slot.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_volume(organ: *const Model, slot: usize) -> f64 {
    unsafe { &*organ }.volume(slot)
}

/// A spatial mode F at the surface nodes (s, 3), largest component 1.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_mode(organ: *mut Model, mode: usize) -> *const f32 {
    unsafe { &mut *organ }.mode(mode).as_ptr()
}

/// The function G of a mode over the load positions (p): its amplitude [m] in one term of the series at full depth; 0 at
/// positions of other regions.
///
/// # Safety
/// See [`organ_describe`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn organ_mode_amplitude(
    organ: *mut Model,
    mode: usize,
    term: usize,
) -> *const f32 {
    unsafe { &mut *organ }.mode_amplitude(mode, term).as_ptr()
}
