//! The library that computes on a graphics processor, as the core's device. It is loaded when it is first needed.

use crate::convert::VisceraError;
use pyo3::prelude::*;
use std::sync::OnceLock;
use viscera_core::equilibrium::OnDevice;
use viscera_device::library::{Library, spoken};
use viscera_device::{About, Entry, SYMBOL, Traffic, VERSION};

/// The library, once it is loaded; it stays.
static LIBRARY: OnceLock<Library> = OnceLock::new();

/// The device of settings that ask for it.
pub fn device() -> PyResult<OnDevice> {
    Ok(OnDevice(library()?))
}

/// Loads the library of this path, unless it is already loaded.
#[pyfunction]
pub fn load_gpu(path: &str) -> PyResult<()> {
    if LIBRARY.get().is_some() {
        return Ok(());
    }
    let refused = |why: String| VisceraError::new_err(format!("{path} cannot be loaded: {why}"));
    // SAFETY: loading it runs no code but that of the Rust standard library.
    let library =
        unsafe { libloading::Library::new(path) }.map_err(|error| refused(error.to_string()))?;
    // SAFETY: a function of this name in this library has this type; the version below tells of another one.
    let entry = unsafe { library.get::<Entry>(SYMBOL) };
    // SAFETY: it takes nothing and returns a static.
    let interface = unsafe { entry.map_err(|error| refused(error.to_string()))?() };
    if interface.version != VERSION {
        return Err(refused(format!(
            "its interface has version {}, that of viscera is {VERSION}; build both anew with `make GPU=1 setup`",
            interface.version
        )));
    }
    std::mem::forget(library);
    LIBRARY.get_or_init(|| Library(interface));
    Ok(())
}

/// Name, driver and interface of the graphics processor, and whether it is software.
#[pyfunction]
pub fn gpu(py: Python<'_>) -> PyResult<(String, String, String, bool)> {
    let library = library()?;
    let mut about = About::default();
    // SAFETY: both are ours.
    let told = py.detach(|| spoken(|fault| unsafe { (library.0.about)(&mut about, fault) }));
    told.map_err(VisceraError::new_err)?;
    Ok((about.name.read(), about.driver.read(), about.backend.read(), about.is_software))
}

/// Bytes written to graphics processors since the library was loaded, after their buffers were made; bytes read; kernels
/// dispatched.
#[pyfunction]
pub fn gpu_traffic() -> PyResult<(u64, u64, u64)> {
    let mut traffic = Traffic::default();
    // SAFETY: it is ours.
    unsafe { (library()?.0.traffic)(&mut traffic) };
    Ok((traffic.written, traffic.read, traffic.dispatches))
}

/// Shuts the graphics processor down as its driver would after a fault: every system on it is lost.
#[pyfunction]
pub fn lose_gpu() -> PyResult<()> {
    // SAFETY: it takes nothing.
    unsafe { (library()?.0.lose)() };
    Ok(())
}

fn library() -> PyResult<&'static Library> {
    LIBRARY.get().ok_or_else(|| {
        VisceraError::new_err("the library of the graphics processor is not loaded; call load_gpu")
    })
}
