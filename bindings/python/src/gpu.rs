//! The graphics processor as the core's device.

use crate::convert::VisceraError;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use viscera_core::equilibrium::{Device, DeviceSolution, DeviceSystem, OnDevice};
use viscera_gpu::{Ending, Error, Gpu, Settings, System};

/// Iterations between two questions whether the device is done.
const CHECK_EVERY: usize = 16;

/// The machine's graphics processor, opened when it is first needed, and again when it was lost.
struct Graphics(Mutex<Option<Arc<Gpu>>>);

static GRAPHICS: Graphics = Graphics(Mutex::new(None));

/// The device of settings that ask for it.
pub fn device() -> PyResult<OnDevice> {
    Ok(OnDevice(&GRAPHICS))
}

/// Name, driver and interface of the graphics processor, and whether it is software.
#[pyfunction]
pub fn gpu() -> PyResult<(String, String, String, bool)> {
    let gpu = GRAPHICS.open().map_err(|error| VisceraError::new_err(error.to_string()))?;
    let about = gpu.about();
    let words = (about.name.clone(), about.driver.clone(), about.backend.clone());
    Ok((words.0, words.1, words.2, about.is_software))
}

/// Shuts the graphics processor down as its driver would after a fault: every system on it is lost.
#[pyfunction]
pub fn lose_gpu() {
    if let Some(gpu) = GRAPHICS.0.lock().unwrap_or_else(PoisonError::into_inner).take() {
        gpu.destroy();
    }
}

impl Graphics {
    fn open(&self) -> Result<Arc<Gpu>, Error> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(gpu) = known.as_ref().filter(|gpu| gpu.check().is_ok()) {
            return Ok(gpu.clone());
        }
        let gpu = Arc::new(Gpu::open()?);
        *known = Some(gpu.clone());
        Ok(gpu)
    }
}

impl Device for Graphics {
    fn system(
        &self,
        n_nodes: usize,
        pairs: &[(u32, u32)],
    ) -> Result<Box<dyn DeviceSystem>, String> {
        let gpu = self.open().map_err(|error| error.to_string())?;
        let system = System::new(&gpu, n_nodes, pairs).map_err(|error| error.to_string())?;
        Ok(Box::new(OnGpu(system)))
    }
}

struct OnGpu(System);

impl DeviceSystem for OnGpu {
    fn hold(&mut self, is_held: &[bool], means: &[Vec<(u32, f64)>]) -> Result<(), String> {
        self.0.hold(is_held, means).map_err(|error| error.to_string())
    }

    fn load(&mut self, values: &[f64], shift: f64) -> Result<(), String> {
        self.0.load(values, shift).map_err(|error| error.to_string())
    }

    fn solve(
        &mut self,
        b: &[f64],
        tolerance: f64,
        max_iterations: usize,
    ) -> Result<DeviceSolution, String> {
        let settings = Settings { tolerance, max_iterations, check_every: CHECK_EVERY };
        let found = self.0.solve(b, &settings).map_err(|error| error.to_string())?;
        Ok(DeviceSolution {
            is_complete: found.ending == Ending::Solved,
            is_indefinite: found.ending == Ending::Indefinite,
            x: found.x,
            direction: found.direction,
            iterations: found.iterations,
            residual: found.residual,
        })
    }
}
