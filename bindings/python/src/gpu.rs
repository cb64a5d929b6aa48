//! The library that computes on a graphics processor, as the core's device. It is loaded when it is first needed.

use crate::convert::VisceraError;
use pyo3::prelude::*;
use std::ptr::null_mut;
use std::sync::OnceLock;
use viscera_core::body::ProgrammedCells;
use viscera_core::equilibrium::{
    Device, DeviceEnd, DeviceSolution, DeviceSystem, DeviceTangent, OnDevice,
};
use viscera_device::{
    About, Answer, Cells, Entry, Handle, Interface, RestBlock, SYMBOL, Slice, Tangent, Task, Text,
    Traffic, VERSION, law,
};

/// The library, once it is loaded; it stays.
static LIBRARY: OnceLock<Library> = OnceLock::new();

struct Library(&'static Interface);

/// A system on the device, and its number of degrees of freedom.
struct System {
    of: &'static Interface,
    handle: Handle,
    n_dofs: usize,
}

// SAFETY: the library takes calls from any thread, one at a time.
unsafe impl Send for System {}
// SAFETY: every method takes it exclusively.
unsafe impl Sync for System {}

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

/// The sentence of a call that failed.
fn spoken(call: impl FnOnce(&mut Text) -> bool) -> Result<(), String> {
    let mut fault = Text::new();
    if call(&mut fault) { Ok(()) } else { Err(fault.read()) }
}

impl Device for Library {
    fn system(
        &self,
        n: usize,
        pairs: &[(u32, u32)],
        cells: Option<&ProgrammedCells<'_>>,
    ) -> Result<Box<dyn DeviceSystem>, String> {
        let pairs: Vec<[u32; 2]> = pairs.iter().map(|&(row, column)| [row, column]).collect();
        let (of, mut handle, pairs) = (self.0, null_mut(), Slice::new(&pairs));
        let Some(ProgrammedCells { points, cells, program, clusters }) = cells else {
            // SAFETY: the slice lives until the call returns.
            spoken(|fault| unsafe { (of.new)(n, pairs, &mut handle, fault) })?;
            return Ok(Box::new(System { of, handle, n_dofs: 3 * n }));
        };
        let (operations, parameters) = (law::operations(program)?, program.rows.concat());
        let clusters = clusters.as_ref();
        let cells = Cells {
            points: Slice::new(points),
            cells: Slice::new(cells),
            model: law::model(program),
            operations: Slice::new(&operations),
            parameters: Slice::new(&parameters),
            n_parameters: program.rows.first().map_or(0, Vec::len),
            cluster_of: Slice::new(clusters.map_or(&[][..], |c| &c.of)),
            cluster_starts: Slice::new(clusters.map_or(&[][..], |c| &c.starts)),
            cluster_nodes: Slice::new(clusters.map_or(&[][..], |c| &c.nodes)),
        };
        // SAFETY: the slices live until the call returns.
        spoken(|fault| unsafe { (of.new_with_cells)(n, pairs, &cells, &mut handle, fault) })?;
        Ok(Box::new(System { of, handle, n_dofs: 3 * n }))
    }
}

impl DeviceSystem for System {
    fn hold(&mut self, is_held: &[bool], means: &[Vec<(u32, f64)>]) -> Result<(), String> {
        let (dofs, weights): (Vec<u32>, Vec<f64>) = means.iter().flatten().copied().unzip();
        let mut starts = vec![0];
        starts.extend(means.iter().scan(0, |end, mean| {
            *end += mean.len();
            Some(*end)
        }));
        let (is_held, starts) = (Slice::new(is_held), Slice::new(&starts));
        let (dofs, weights) = (Slice::new(&dofs), Slice::new(&weights));
        // SAFETY: the handle is of this library; the slices live until the call returns.
        spoken(|fault| unsafe {
            (self.of.hold)(self.handle, is_held, starts, dofs, weights, fault)
        })
    }

    fn load(&mut self, values: &[f64], shift: f64) -> Result<(), String> {
        // SAFETY: as in `hold`.
        spoken(|fault| unsafe { (self.of.load)(self.handle, Slice::new(values), shift, fault) })
    }

    fn form(&mut self, tangent: &DeviceTangent<'_>) -> Result<(), String> {
        let block = |&(row, column, values)| RestBlock { row, column, values };
        let rest: Vec<RestBlock> = tangent.rest.unwrap_or_default().iter().map(block).collect();
        let tangent = Tangent {
            u: Slice::new(tangent.u),
            pressures: Slice::new(tangent.pressures),
            slopes: Slice::new(tangent.slopes[0]),
            weighted: Slice::new(tangent.slopes[1]),
            factor: tangent.factor,
            rest: Slice::new(&rest),
            is_rest_new: tangent.rest.is_some(),
            shift: tangent.shift,
        };
        // SAFETY: as in `hold`.
        spoken(|fault| unsafe { (self.of.form)(self.handle, &tangent, fault) })
    }

    fn multiply(&mut self, x: &[f64]) -> Result<Vec<f64>, String> {
        let mut product = vec![0.0; x.len()];
        let out = product.as_mut_ptr();
        // SAFETY: as in `hold`; there is room for as many values as `x` has.
        spoken(|fault| unsafe { (self.of.multiply)(self.handle, Slice::new(x), out, fault) })?;
        Ok(product)
    }

    fn solve(
        &mut self,
        b: &[f64],
        steps: &[&[f64]],
        start: &[f64],
        end: &DeviceEnd,
    ) -> Result<DeviceSolution, String> {
        let left = |deadline: std::time::Instant| {
            deadline.saturating_duration_since(std::time::Instant::now()).as_secs_f64()
        };
        let steps: Vec<Slice<f64>> = steps.iter().map(|step| Slice::new(step)).collect();
        let task = Task {
            b: Slice::new(b),
            steps: Slice::new(&steps),
            start: Slice::new(start),
            tolerance: end.tolerance,
            max_iterations: end.max_iterations,
            seconds: end.deadline.map_or(f64::INFINITY, left),
        };
        let mut x = vec![0.0; self.n_dofs];
        let mut answer = Answer {
            x: x.as_mut_ptr(),
            iterations: 0,
            residual: 0.0,
            magnitude: 0.0,
            is_indefinite: false,
        };
        // SAFETY: as in `hold`; the answer has room for as many values as there are degrees of freedom.
        spoken(|fault| unsafe { (self.of.solve)(self.handle, &task, &mut answer, fault) })?;
        let Answer { iterations, residual, magnitude, is_indefinite, .. } = answer;
        Ok(DeviceSolution { x, iterations, residual, magnitude, is_indefinite })
    }

    fn direction(&mut self) -> Result<Vec<f64>, String> {
        let mut direction = vec![0.0; self.n_dofs];
        let out = direction.as_mut_ptr();
        // SAFETY: as in `hold`; there is room for as many values as there are degrees of freedom.
        spoken(|fault| unsafe { (self.of.direction)(self.handle, out, fault) })?;
        Ok(direction)
    }
}

impl Drop for System {
    fn drop(&mut self) {
        // SAFETY: the handle is of this library, and nobody has it any more.
        unsafe { (self.of.free)(self.handle) };
    }
}
