//! This crate as a library that is loaded at run time: the functions of `viscera-device`. Panics are caught.

use crate::{
    CellBuffers, Clusters, Dilatation, Ending, Error, Gpu, Law, Mean, Program, RestBlock,
    SeriesBuffers, Settings, Solid, System, Tangent, traffic,
};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use viscera_clock::Instant;
use viscera_device::{
    About, Answer, Cells, Handle, Interface, Series, Slice, Task, Text, Traffic, VERSION,
};

/// Fewest iterations between two checks whether the device has finished.
const CHECK_EVERY: usize = 16;

/// Environment variable that limits the size of a binding.
const BINDING: &str = "VISCERA_GPU_BINDING";

/// A later deadline than this counts as none [s].
const FAR: f64 = 1e6;

/// The graphics processor of this machine, opened on first use, and again after it was lost.
static DEVICE: Mutex<Option<Arc<Gpu>>> = Mutex::new(None);

static INTERFACE: Interface = Interface {
    version: VERSION,
    about,
    lose,
    new,
    new_with_cells,
    free,
    hold,
    load,
    form,
    multiply,
    direction,
    traffic: read_traffic,
    solve,
    new_series,
    free_series,
    expand,
};

/// The object behind a handle.
struct Body {
    system: System,
    /// The cells, if the device assembles the tangent.
    cells: Option<CellBuffers>,
}

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
    let gpu = Arc::new(Gpu::open_with(largest_binding()?)?);
    *known = Some(gpu.clone());
    Ok(gpu)
}

/// Largest binding of a buffer [bytes]: that of the device, or less if the environment says so, to try how a smaller
/// device behaves.
fn largest_binding() -> Result<u64, Error> {
    let Ok(words) = std::env::var(BINDING) else { return Ok(u64::MAX) };
    words
        .parse()
        .map_err(|_| Error::Input(format!("{BINDING} is {words:?}; it must be a number of bytes")))
}

/// Runs a function and returns whether it succeeded; if not, writes the reason as a sentence.
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
        *handle = Box::into_raw(Box::new(Body { system, cells: None })).cast();
        Ok(())
    })
}

unsafe extern "C" fn new_with_cells(
    n_nodes: usize,
    pairs: Slice<[u32; 2]>,
    cells: &Cells,
    handle: &mut Handle,
    fault: &mut Text,
) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's slices live until this returns.
        let (pairs, given) = unsafe { (pairs.get(), Given::of(cells)?) };
        if given.points.len() != n_nodes {
            return Err(Error::Input(format!("{} points for {n_nodes} nodes", given.points.len())));
        }
        let pairs: Vec<(u32, u32)> = pairs.iter().map(|&[row, column]| (row, column)).collect();
        let (cells, system) = CellBuffers::new(&device()?, &given.solid(), &pairs)?;
        *handle = Box::into_raw(Box::new(Body { system, cells: Some(cells) })).cast();
        Ok(())
    })
}

/// Cells as the caller gives them.
struct Given<'a> {
    points: &'a [[f64; 3]],
    corners: &'a [[u32; 4]],
    law: Law,
    parameters: Vec<Vec<f64>>,
    clusters: Option<Clusters<'a>>,
}

impl<'a> Given<'a> {
    /// # Safety
    /// The slices must live that long.
    unsafe fn of(cells: &Cells) -> Result<Self, Error> {
        // SAFETY: see above.
        let (points, corners) = unsafe { (cells.points.get(), cells.cells.get()) };
        // SAFETY: the same.
        let (operations, parameters) = unsafe { (cells.operations.get(), cells.parameters.get()) };
        // SAFETY: the same.
        let (of, starts) = unsafe { (cells.cluster_of.get(), cells.cluster_starts.get()) };
        // SAFETY: the same.
        let nodes = unsafe { cells.cluster_nodes.get() };
        let law = Law::of(cells.model, operations)?;
        let clusters = (!of.is_empty()).then_some(Clusters { of, starts, nodes });
        let parameters = rows_of(parameters, cells.n_parameters);
        Ok(Given { points, corners, law, parameters, clusters })
    }

    fn solid(&self) -> Solid<'_> {
        let Given { points, corners: cells, law, parameters, clusters } = self;
        Solid { points, cells, law, parameters, clusters: *clusters }
    }
}

fn rows_of(parameters: &[f64], length: usize) -> Vec<Vec<f64>> {
    match length {
        0 => vec![Vec::new()],
        n => parameters.chunks(n).map(<[f64]>::to_vec).collect(),
    }
}

unsafe extern "C" fn new_series(series: &Series, handle: &mut Handle, fault: &mut Text) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's slices live until this returns.
        let (given, base) = unsafe { (Given::of(&series.cells)?, series.base.get()) };
        // SAFETY: the same.
        let operations = unsafe { series.dilatation.get() };
        // SAFETY: the same.
        let parameters = unsafe { series.dilatation_parameters.get() };
        let (energy, parameters) =
            (Program::of(operations)?, rows_of(parameters, series.n_dilatation_parameters));
        let dilatation = (!operations.is_empty())
            .then_some(Dilatation { energy: &energy, parameters: &parameters });
        let buffers = SeriesBuffers::new(&device()?, &given.solid(), dilatation, base)?;
        *handle = Box::into_raw(Box::new(buffers)).cast();
        Ok(())
    })
}

unsafe extern "C" fn free_series(handle: Handle) {
    // SAFETY: the handle is one of `new_series`, and not used again.
    let buffers = unsafe { Box::from_raw(handle.cast::<SeriesBuffers>()) };
    let _ = catch_unwind(AssertUnwindSafe(|| drop(buffers)));
}

unsafe extern "C" fn expand(
    handle: Handle,
    degree: usize,
    displacement: Slice<f32>,
    force: *mut f32,
    fault: &mut Text,
) -> bool {
    attempt(fault, || {
        // SAFETY: the handle is one of `new_series`, used by one thread at a time; the slice lives until this returns.
        let (buffers, given) =
            unsafe { (&mut *handle.cast::<SeriesBuffers>(), displacement.get()) };
        let mut found = vec![0.0; given.len() / degree.saturating_sub(1).max(1)];
        buffers.force(degree, given, &mut found)?;
        // SAFETY: there is room for a force of each series.
        unsafe { force.copy_from_nonoverlapping(found.as_ptr(), found.len()) };
        Ok(())
    })
}

unsafe extern "C" fn free(handle: Handle) {
    // SAFETY: the handle is one of `new`, and not used again.
    let body = unsafe { Box::from_raw(handle.cast::<Body>()) };
    let _ = catch_unwind(AssertUnwindSafe(|| drop(body)));
}

/// The object behind a handle.
///
/// # Safety
/// The handle comes from `new` and was not passed to `free`; no other thread uses it.
unsafe fn body<'a>(handle: Handle) -> &'a mut Body {
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
        let (body, is_held) = unsafe { (body(handle), is_held.get()) };
        // SAFETY: the same.
        let (starts, dofs, weights) = unsafe { (starts.get(), dofs.get(), weights.get()) };
        let rows: Vec<(u32, f64)> = dofs.iter().copied().zip(weights.iter().copied()).collect();
        let means: Vec<Mean> = starts.windows(2).map(|w| rows[w[0]..w[1]].to_vec()).collect();
        body.system.hold(is_held, &means)
    })
}

unsafe extern "C" fn load(
    handle: Handle,
    values: Slice<f64>,
    shift: f64,
    fault: &mut Text,
) -> bool {
    // SAFETY: the caller's handle and slice live until this returns.
    attempt(fault, || unsafe { body(handle).system.load(values.get(), shift) })
}

unsafe extern "C" fn form(
    handle: Handle,
    tangent: &viscera_device::Tangent,
    fault: &mut Text,
) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's handle and slices live until this returns.
        let (body, u) = unsafe { (body(handle), tangent.u.get()) };
        // SAFETY: the same.
        let (pressures, rest) = unsafe { (tangent.pressures.get(), tangent.rest.get()) };
        // SAFETY: the same.
        let slopes = unsafe { [tangent.slopes.get(), tangent.weighted.get()] };
        let rest: Vec<RestBlock> =
            rest.iter().map(|block| (block.row, block.column, block.values)).collect();
        let Body { system, cells } = body;
        let cells = cells.as_mut();
        let cells =
            cells.ok_or_else(|| Error::Input("the system was made without cells".to_string()))?;
        let rest = tangent.is_rest_new.then_some(&rest[..]);
        let (factor, shift) = (tangent.factor, tangent.shift);
        cells.form(system, &Tangent { u, pressures, slopes, factor, rest, shift })
    })
}

unsafe extern "C" fn multiply(
    handle: Handle,
    x: Slice<f64>,
    product: *mut f64,
    fault: &mut Text,
) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's handle and slice live until this returns.
        let (body, x) = unsafe { (body(handle), x.get()) };
        let found = body.system.multiply(x)?;
        // SAFETY: there is room for as many values as the vector has.
        unsafe { product.copy_from_nonoverlapping(found.as_ptr(), x.len()) };
        Ok(())
    })
}

unsafe extern "C" fn direction(handle: Handle, found: *mut f64, fault: &mut Text) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's handle lives until this returns.
        let direction = unsafe { body(handle) }.system.direction()?;
        // SAFETY: there is room for as many values as the system has degrees of freedom.
        unsafe { found.copy_from_nonoverlapping(direction.as_ptr(), direction.len()) };
        Ok(())
    })
}

extern "C" fn read_traffic(found: &mut Traffic) {
    *found = traffic();
}

unsafe extern "C" fn solve(
    handle: Handle,
    task: &Task,
    answer: &mut Answer,
    fault: &mut Text,
) -> bool {
    attempt(fault, || {
        // SAFETY: the caller's handle and slices live until this returns.
        let (body, b, start) = unsafe { (body(handle), task.b.get(), task.start.get()) };
        // SAFETY: the same.
        let steps: Vec<&[f64]> =
            unsafe { task.steps.get().iter().map(|step| step.get()).collect() };
        let has_deadline = task.seconds < FAR;
        let settings = Settings {
            tolerance: task.tolerance,
            max_iterations: task.max_iterations,
            check_every: CHECK_EVERY,
            deadline: has_deadline
                .then(|| Instant::now() + Duration::from_secs_f64(task.seconds.max(0.0))),
        };
        // SAFETY: the caller answers as long as this runs.
        let is_wanted = || unsafe { (task.is_wanted)(task.caller) };
        let found = body.system.solve_while(b, &steps, start, &settings, &is_wanted)?;
        // SAFETY: there is room for as many values as the right-hand side has.
        unsafe { answer.x.copy_from_nonoverlapping(found.x.as_ptr(), found.x.len()) };
        answer.iterations = found.iterations;
        answer.residual = found.residual;
        answer.magnitude = found.magnitude;
        answer.is_indefinite = found.ending == Ending::Indefinite;
        Ok(())
    })
}
