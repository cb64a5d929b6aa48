//! A rigid probe: a sphere that presses, sticks, slides and lets go.

use crate::load::write_message;
use crate::model::{Model, status_of};
use crate::status::{self, viscera_status};
use crate::{all_finite, put, vector};
use std::ffi::c_char;
use viscera_touch::{Coupling, Grip, TOLERANCE};

/// `viscera_probe`, opaque to C.
pub struct Probe {
    /// It outlives the probe by the caller's contract.
    model: *const Model,
    sphere: viscera_touch::Probe,
}

/// `struct viscera_felt`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    pub force: [f64; 3],
    pub torque: [f64; 3],
    pub center: [f64; 3],
    pub contact_point: [f64; 3],
    pub displacement: [f64; 3],
    pub gap: f64,
    pub error_estimate: f64,
    pub shape_error_estimate: f64,
    pub grip: i64,
}

const _: () = assert!(size_of::<Felt>() == 152);

pub const PROBE_FREE: i32 = 0;
pub const PROBE_STICKS: i32 = 1;
pub const PROBE_SLIDES: i32 = 2;

impl Felt {
    pub(crate) const NONE: Self = Felt {
        force: [0.0; 3],
        torque: [0.0; 3],
        center: [0.0; 3],
        contact_point: [0.0; 3],
        displacement: [0.0; 3],
        gap: 0.0,
        error_estimate: 1.0,
        shape_error_estimate: 1.0,
        grip: PROBE_FREE as i64,
    };

    /// Whether nothing has overflowed in the caller's units.
    fn is_finite(&self) -> bool {
        let vectors = [self.force, self.torque, self.center, self.contact_point, self.displacement];
        all_finite(vectors.as_flattened()) && self.gap.is_finite()
    }
}

impl Probe {
    /// Makes a step, and tells it in the caller's frame; none is made with a setting that is out of its range.
    fn step(
        &mut self,
        step: impl FnOnce(&mut viscera_touch::Probe, &Model) -> Option<viscera_touch::Felt>,
    ) -> (Felt, viscera_status) {
        // SAFETY: it was not null, and outlives the probe by the caller's contract.
        let model = unsafe { &*self.model };
        match step(&mut self.sphere, model) {
            Some(felt) => Felt::told(felt, model),
            None => (Felt::NONE, status::BAD_SETTING),
        }
    }

    /// The model that it touches.
    pub(crate) fn model(&self) -> *const Model {
        self.model
    }

    /// The sphere itself.
    pub(crate) fn sphere(&mut self) -> &mut viscera_touch::Probe {
        &mut self.sphere
    }
}

impl Felt {
    /// What a probe of a model feels, in the caller's frame.
    pub(crate) fn told(felt: viscera_touch::Felt, model: &Model) -> (Self, viscera_status) {
        let frame = &model.frame;
        let (grip, status) = match felt.grip {
            Grip::Free => (PROBE_FREE, status::OFF_SURFACE),
            Grip::Sticks => (PROBE_STICKS, status_of(felt.trust)),
            Grip::Slides => (PROBE_SLIDES, status_of(felt.trust)),
            Grip::Inside => (PROBE_FREE, status::INSIDE),
            Grip::Lost => (PROBE_FREE, status::NOT_FINITE),
        };
        let told = Felt {
            force: frame.force_out(felt.force),
            torque: frame.torque_out(felt.torque),
            center: frame.point_out(felt.center),
            contact_point: frame.point_out(felt.contact.point),
            displacement: frame.length_out(felt.displacement),
            gap: felt.gap / frame.metres_per_unit,
            error_estimate: felt.error_estimate,
            shape_error_estimate: felt.shape_error_estimate,
            grip: i64::from(grip),
        };
        if told.is_finite() { (told, status) } else { (Felt::NONE, status::NOT_FINITE) }
    }
}

/// Makes a probe.
///
/// # Safety
/// `model` is null or loaded, and freed after the probe; `probe` is null or writable, `message` writable for
/// `message_len` or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probe_new(
    model: *const Model,
    radius: f64,
    friction: f64,
    probe: *mut *mut Probe,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    unsafe { put(probe, std::ptr::null_mut()) };
    let made = match unsafe { model.as_ref() } {
        Some(_) if probe.is_null() => Err((status::NULL_POINTER, "no place to put a probe".into())),
        None => Err((status::NULL_POINTER, "no model for the probe to touch".into())),
        Some(given) => {
            let metres = radius * given.frame.metres_per_unit;
            viscera_touch::Probe::new(&given.reduced, metres, friction, TOLERANCE, None)
                .map_err(|error| (status::BAD_SETTING, error.to_string()))
        }
    };
    let (status, sentence) = match made {
        Ok(sphere) => {
            unsafe { probe.write(Box::into_raw(Box::new(Probe { model, sphere }))) };
            (status::OK, String::new())
        }
        Err(told) => told,
    };
    unsafe { write_message(&sentence, message, message_len) };
    status
}

/// Frees a probe; null is nothing to do.
///
/// # Safety
/// `probe` is null or comes from [`viscera_probe_new`] and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probe_free(probe: *mut Probe) {
    if !probe.is_null() {
        // SAFETY: made by `Box::into_raw`, and given back once.
        drop(unsafe { Box::from_raw(probe) });
    }
}

/// Sets the coupling; one that is refused leaves the old one.
///
/// # Safety
/// `probe` is null or made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probe_couple(
    probe: *mut Probe,
    stiffness: f64,
    damping: f64,
) -> viscera_status {
    // SAFETY: the caller's contract, and that of the model.
    let Some(probe) = (unsafe { probe.as_mut() }) else { return status::NULL_POINTER };
    let frame = unsafe { &(*probe.model).frame };
    let unit = frame.newtons_per_unit / frame.metres_per_unit;
    let coupling = Coupling { stiffness: unit * stiffness, damping: unit * damping };
    match probe.sphere.couple(Some(coupling)) {
        Ok(()) => status::OK,
        Err(_) => status::BAD_SETTING,
    }
}

/// The largest estimated error of a trusted force.
///
/// # Safety
/// `probe` is null or made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probe_tolerate(
    probe: *mut Probe,
    tolerance: f64,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let Some(probe) = (unsafe { probe.as_mut() }) else { return status::NULL_POINTER };
    match probe.sphere.tolerate(tolerance) {
        Ok(()) => status::OK,
        Err(_) => status::BAD_SETTING,
    }
}

/// Puts the centre at a place.
///
/// # Safety
/// `probe` is null or made, `center` null or readable, `felt` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probe_place(
    probe: *mut Probe,
    center: *const f64,
    felt: *mut Felt,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let (told, status) = match unsafe { (probe.as_mut(), vector(center)) } {
        (Some(probe), Some(center)) => probe
            .step(|sphere, model| Some(sphere.place(&model.reduced, model.frame.point_in(center)))),
        _ => (Felt::NONE, status::NULL_POINTER),
    };
    unsafe { put(felt, told) };
    if felt.is_null() { status::NULL_POINTER } else { status }
}

/// Draws the probe towards a device.
///
/// # Safety
/// As above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probe_follow(
    probe: *mut Probe,
    device: *const f64,
    dt: f64,
    felt: *mut Felt,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let (told, status) = match unsafe { (probe.as_mut(), vector(device)) } {
        (Some(probe), Some(device)) => probe
            .step(|sphere, model| sphere.follow(&model.reduced, model.frame.point_in(device), dt)),
        _ => (Felt::NONE, status::NULL_POINTER),
    };
    unsafe { put(felt, told) };
    if felt.is_null() { status::NULL_POINTER } else { status }
}

/// Takes the probe from the organ.
///
/// # Safety
/// `probe` is null or made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probe_lift(probe: *mut Probe) -> viscera_status {
    // SAFETY: the caller's contract.
    let Some(probe) = (unsafe { probe.as_mut() }) else { return status::NULL_POINTER };
    probe.sphere.lift();
    status::OK
}
