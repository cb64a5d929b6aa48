//! Several rigid probes on one model that feel each other.

use crate::load::write_message;
use crate::model::Model;
use crate::probe::{Felt, Probe};
use crate::put;
use crate::status::{self, viscera_status};
use std::ffi::c_char;
use std::ops::{Deref, DerefMut};
use viscera_touch::ProbeGroup;

/// `viscera_probes`, opaque to C.
pub struct Probes {
    /// The probes, and with them their model, outlive it by the caller's contract.
    probes: Vec<Handle>,
    model: *const Model,
    together: ProbeGroup,
    /// Where the centres or the devices are to be, in the frame of the model.
    places: Vec<[f64; 3]>,
}

/// A probe of the caller's.
struct Handle(*mut Probe);

impl Deref for Handle {
    type Target = viscera_touch::Probe;

    fn deref(&self) -> &viscera_touch::Probe {
        // SAFETY: it was not null, outlives the group, and is used by one thread at a time, by the caller's contract.
        unsafe { (*self.0).sphere() }
    }
}

impl DerefMut for Handle {
    fn deref_mut(&mut self) -> &mut viscera_touch::Probe {
        // SAFETY: as above.
        unsafe { (*self.0).sphere() }
    }
}

/// Makes a group of probes.
///
/// # Safety
/// `probes` is null or holds `count` probes that are null or made, and freed after the group; `group` is null or writable,
/// `message` writable for `message_len` or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probes_new(
    probes: *mut *mut Probe,
    count: usize,
    group: *mut *mut Probes,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    unsafe { put(group, std::ptr::null_mut()) };
    let made = if probes.is_null() || group.is_null() {
        Err((status::NULL_POINTER, "no probes, or no place to put their group".to_string()))
    } else {
        unsafe { together(std::slice::from_raw_parts(probes, count)) }
    };
    let (status, sentence) = match made {
        Ok(made) => {
            unsafe { group.write(Box::into_raw(Box::new(made))) };
            (status::OK, String::new())
        }
        Err(told) => told,
    };
    unsafe { write_message(&sentence, message, message_len) };
    status
}

/// # Safety
/// The probes are null or made.
unsafe fn together(probes: &[*mut Probe]) -> Result<Probes, (viscera_status, String)> {
    let refused = |status, sentence: String| Err((status, sentence));
    let Some(&first) = probes.first() else {
        return refused(status::BAD_SETTING, "a group of no probes; give at least one".into());
    };
    for (k, &probe) in probes.iter().enumerate() {
        if probe.is_null() {
            return refused(status::NULL_POINTER, format!("probe {k} of the group is null"));
        }
        if probes[..k].contains(&probe) {
            return refused(status::BAD_SETTING, format!("probe {k} of the group is in it twice"));
        }
        // SAFETY: neither is null.
        if unsafe { (*probe).model() != (*first).model() } {
            let sentence = format!("probe {k} of the group is on another model than the first");
            return refused(status::BAD_SETTING, sentence);
        }
    }
    // SAFETY: it is not null, and its model outlives it.
    let model = unsafe { (*first).model() };
    Ok(Probes {
        probes: probes.iter().map(|&probe| Handle(probe)).collect(),
        model,
        together: ProbeGroup::new(unsafe { &(*model).reduced }, probes.len()),
        places: vec![[0.0; 3]; probes.len()],
    })
}

/// Frees a group, not its probes; null is nothing to do.
///
/// # Safety
/// `group` is null or comes from [`viscera_probes_new`] and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probes_free(group: *mut Probes) {
    if !group.is_null() {
        // SAFETY: made by `Box::into_raw`, and given back once.
        drop(unsafe { Box::from_raw(group) });
    }
}

/// Puts the centres at places.
///
/// # Safety
/// `group` is null or made, `centers` null or three numbers for each probe, `felt` and `status` null or writable for each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probes_place(
    group: *mut Probes,
    centers: *const f64,
    felt: *mut Felt,
    status: *mut viscera_status,
) -> viscera_status {
    // SAFETY: the caller's contract.
    unsafe { step(group, centers, None, felt, status) }
}

/// Draws the probes towards devices.
///
/// # Safety
/// As above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_probes_follow(
    group: *mut Probes,
    devices: *const f64,
    dt: f64,
    felt: *mut Felt,
    status: *mut viscera_status,
) -> viscera_status {
    // SAFETY: the caller's contract.
    unsafe { step(group, devices, Some(dt), felt, status) }
}

/// # Safety
/// That of the callers.
unsafe fn step(
    group: *mut Probes,
    places: *const f64,
    dt: Option<f64>,
    felt: *mut Felt,
    told: *mut viscera_status,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(group) = (unsafe { group.as_mut() }) else { return status::NULL_POINTER };
    let Probes { probes, model, together, places: here } = group;
    let model = unsafe { &**model };
    if places.is_null() || felt.is_null() || told.is_null() {
        return status::NULL_POINTER;
    }
    let places = unsafe { std::slice::from_raw_parts(places.cast::<[f64; 3]>(), probes.len()) };
    here.iter_mut().zip(places).for_each(|(here, place)| *here = model.frame.point_in(*place));
    let count = probes.len();
    let found = match dt {
        None => Some(together.place(&model.reduced, probes, here)),
        Some(dt) => together.follow(&model.reduced, probes, here, dt),
    };
    for k in 0..count {
        let (what, status) = match found {
            Some(found) => Felt::told(found[k], model),
            None => (Felt::NONE, status::BAD_SETTING),
        };
        unsafe { (felt.add(k).write(what), told.add(k).write(status)) };
    }
    if found.is_some() { status::OK } else { status::BAD_SETTING }
}
