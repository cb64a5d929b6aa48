//! This crate as a library that is loaded at run time: the functions of `viscera-device`. No panic leaves it.

use crate::{Ending, Error, Gpu, Mean, Settings, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use viscera_device::{About, Answer, Handle, Interface, Slice, Task, Text, VERSION};

/// Iterations between two questions whether the device is done.
const CHECK_EVERY: usize = 16;

/// A deadline further away than this is none [s].
const FAR: f64 = 1e6;

/// The machine's graphics processor, opened when it is first needed, and again when it was lost.
static DEVICE: Mutex<Option<Arc<Gpu>>> = Mutex::new(None);

static INTERFACE: Interface =
    Interface { version: VERSION, about, lose, new, free, hold, load, solve };

/// The functions of this library.
#[unsafe(no_mangle)]
pub extern "C" fn viscera_gpu() -> &'static Interface {
    &INTERFACE
}

fn device() -> Result<Arc<Gpu>, Error> {
    let mut known = DEVICE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(gpu) = known.as_ref().filter(|gpu| gpu.check().is_ok()) {
        return Ok(gpu.clone());
    }
    let gpu = Arc::new(Gpu::open()?);
    *known = Some(gpu.clone());
    Ok(gpu)
}

/// Whether an act succeeds; why not, in a sentence.
fn attempt(fault: &mut Text, act: impl FnOnce() -> Result<(), Error>) -> bool {
    match catch_unwind(AssertUnwindSafe(act)) {
        Ok(Ok(())) => return true,
        Ok(Err(error)) => fault.write(&error.to_string()),
        Err(panic) => {
            let words = panic.downcast_ref::<String>().map(String::as_str);
            let words = words.or_else(|| panic.downcast_ref::<&str>().copied());
            fault.write(&Error::Refused(words.unwrap_or("it panicked").to_string()).to_string());
        }
    }
    false
}

extern "C" fn about(about: &mut About, fault: &mut Text) -> bool {
    attempt(fault, || {
        let gpu = device()?;
        let known = gpu.about();
        about.name.write(&known.name);
        about.driver.write(&known.driver);
        about.backend.write(&known.backend);
        about.is_software = known.is_software;
        Ok(())
    })
}

extern "C" fn lose() {
    if let Some(gpu) = DEVICE.lock().unwrap_or_else(PoisonError::into_inner).take() {
        gpu.destroy();
    }
}

unsafe extern "C" fn new(
    n_nodes: usize,
    pairs: Slice<[u32; 2]>,
    handle: &mut Handle,
    fault: &mut Text,
) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's slice lives until this returns.
        let pairs = unsafe { pairs.get() };
        let pairs: Vec<(u32, u32)> = pairs.iter().map(|&[row, column]| (row, column)).collect();
        let system = System::new(&device()?, n_nodes, &pairs)?;
        *handle = Box::into_raw(Box::new(system)).cast();
        Ok(())
    })
}

unsafe extern "C" fn free(handle: Handle) {
    // SAFETY: the handle is one of `new`, and not used again.
    let system = unsafe { Box::from_raw(handle.cast::<System>()) };
    let _ = catch_unwind(AssertUnwindSafe(|| drop(system)));
}

/// The system of a handle.
///
/// # Safety
/// It is one of `new` that was not given to `free`, and no other thread uses it.
unsafe fn system<'a>(handle: Handle) -> &'a mut System {
    // SAFETY: see above.
    unsafe { &mut *handle.cast() }
}

unsafe extern "C" fn hold(
    handle: Handle,
    is_held: Slice<bool>,
    starts: Slice<usize>,
    dofs: Slice<u32>,
    weights: Slice<f64>,
    fault: &mut Text,
) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's handle and slices live until this returns.
        let (system, is_held) = unsafe { (system(handle), is_held.get()) };
        // SAFETY: the same.
        let (starts, dofs, weights) = unsafe { (starts.get(), dofs.get(), weights.get()) };
        let rows: Vec<(u32, f64)> = dofs.iter().copied().zip(weights.iter().copied()).collect();
        let means: Vec<Mean> = starts.windows(2).map(|w| rows[w[0]..w[1]].to_vec()).collect();
        system.hold(is_held, &means)
    })
}

unsafe extern "C" fn load(
    handle: Handle,
    values: Slice<f64>,
    shift: f64,
    fault: &mut Text,
) -> bool {
    // SAFETY: the caller's handle and slice live until this returns.
    attempt(fault, || unsafe { system(handle).load(values.get(), shift) })
}

unsafe extern "C" fn solve(
    handle: Handle,
    task: &Task,
    answer: &mut Answer,
    fault: &mut Text,
) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's handle and slice live until this returns.
        let (system, b) = unsafe { (system(handle), task.b.get()) };
        let has_deadline = task.seconds < FAR;
        let settings = Settings {
            tolerance: task.tolerance,
            max_iterations: task.max_iterations,
            check_every: CHECK_EVERY,
            deadline: has_deadline
                .then(|| Instant::now() + Duration::from_secs_f64(task.seconds.max(0.0))),
        };
        let found = system.solve(b, &settings)?;
        // SAFETY: both have room for as many values as the right-hand side has.
        unsafe {
            answer.x.copy_from_nonoverlapping(found.x.as_ptr(), found.x.len());
            answer.direction.copy_from_nonoverlapping(found.direction.as_ptr(), b.len());
        }
        answer.iterations = found.iterations;
        answer.is_indefinite = found.ending == Ending::Indefinite;
        Ok(())
    })
}
