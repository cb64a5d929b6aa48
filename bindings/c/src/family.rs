//! The parameter that a model covers a range of.

use crate::load::write_message;
use crate::model::Model;
use crate::put;
use crate::status::{self, viscera_status};
use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// `struct viscera_parameter`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parameter {
    pub low: f64,
    pub high: f64,
    pub value: f64,
}

const _: () = assert!(size_of::<Parameter>() == 24);

impl Model {
    /// SI for one unit of the parameter: a length, a number or a stress.
    fn parameter_unit(&self) -> f64 {
        let length = self.frame.metres_per_unit;
        match self.parameter.to_bytes() {
            b"radius" => length,
            b"poisson" => 1.0,
            _ => self.frame.newtons_per_unit / (length * length),
        }
    }

    fn parameter(&self) -> Option<Parameter> {
        let unit = self.parameter_unit();
        self.reduced.metadata().parameter.as_ref().map(|parameter| Parameter {
            low: parameter.range[0] / unit,
            high: parameter.range[1] / unit,
            value: parameter.value / unit,
        })
    }

    /// The whole model at another value, or none of it.
    fn set_parameter(&mut self, value: f64) -> Result<(), String> {
        let (unit, ends) = (self.parameter_unit(), self.parameter());
        // In other units the ends of the range may be rounded past themselves.
        let [low, high] = self.reduced.metadata().parameter.as_ref().map_or([0.0; 2], |p| p.range);
        let value = match ends {
            Some(ends) if ends.low <= value && value <= ends.high => {
                (unit * value).clamp(low, high)
            }
            _ => unit * value,
        };
        let mut reduced = self.reduced.clone();
        reduced.set_parameter(value).map_err(|error| error.to_string())?;
        self.reduced = reduced;
        Ok(())
    }
}

/// Name of the parameter: empty if there is none, never null.
///
/// # Safety
/// `model` is null or loaded.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_parameter_name(model: *const Model) -> *const c_char {
    // SAFETY: the caller's contract.
    unsafe { model.as_ref() }.map_or(c"".as_ptr(), |model| model.parameter.as_ptr())
}

/// Range and value of the parameter.
///
/// # Safety
/// `model` is null or loaded, `parameter` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_get_parameter(
    model: *const Model,
    parameter: *mut Parameter,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let (told, status) = match unsafe { model.as_ref() } {
        None => (None, status::NULL_POINTER),
        Some(_) if parameter.is_null() => (None, status::NULL_POINTER),
        Some(model) => match model.parameter() {
            None => (None, status::BAD_SETTING),
            told => (told, status::OK),
        },
    };
    unsafe { put(parameter, told.unwrap_or_default()) };
    status
}

/// Sets the parameter; one that is refused leaves the model as it was.
///
/// # Safety
/// `model` is null or loaded and used by nobody else during the call, `message` writable for `message_len` or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_set_parameter(
    model: *mut Model,
    value: f64,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let set = match unsafe { model.as_mut() } {
        None => Err((status::NULL_POINTER, "no model to set a parameter of".to_string())),
        Some(model) => match catch_unwind(AssertUnwindSafe(|| model.set_parameter(value))) {
            Ok(set) => set.map_err(|sentence| (status::BAD_SETTING, sentence)),
            Err(_) => Err((status::BAD_SETTING, "setting failed inside the library".into())),
        },
    };
    let (status, sentence) = set.err().unwrap_or((status::OK, String::new()));
    unsafe { write_message(&sentence, message, message_len) };
    status
}
