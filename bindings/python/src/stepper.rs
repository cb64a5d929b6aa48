//! Frames in real time, and the settings of solver, inertia and relaxation.

use crate::{body::Body, contact, convert, exclusive::Exclusive, mesh::Patch, settings::Solver};
use crate::{interrupt::interruptible, threads::detached};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use viscera_core::body::{self, Curvature, Ties};
use viscera_core::contact::Pose;
use viscera_core::equilibrium::{
    self, Dynamics, Input, Integration, Mass, Origin, Prony, StepperSettings, Torque, Turn,
};

/// `beta` and `gamma` of Newmark's rule or none for backward Euler; whether the mass is lumped; Rayleigh's damping.
type Inertia = (Option<(f64, f64)>, bool, [f64; 2]);
/// The number of a grasped patch, and where its arms (k, 3) are to point.
type Turned<'py> = (usize, PyReadonlyArray2<'py, f64>);

/// Time [s] up to which a frame need not hear Ctrl-C: another thread, from which it does, takes a part in a thousand of it.
const SHORT: f64 = 0.05;

/// A body in the hands of a simulator.
#[pyclass(frozen, module = "viscera._core")]
pub struct Stepper {
    body: Py<Body>,
    stepper: Exclusive<equilibrium::Stepper>,
}

#[pymethods]
impl Stepper {
    #[new]
    #[pyo3(signature = (body, *, start, solver, iterations, settled, extrapolate, budget, density, time_step, dynamics, relaxation))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        body: Py<Body>,
        start: Option<PyReadonlyArray2<f64>>,
        solver: Solver,
        iterations: usize,
        settled: f64,
        extrapolate: bool,
        budget: Option<f64>,
        density: PyReadonlyArray1<f64>,
        time_step: Option<f64>,
        dynamics: Option<Inertia>,
        relaxation: Option<(Vec<f64>, Vec<f64>)>,
    ) -> PyResult<Self> {
        let held = body.get();
        let n = held.body.points().len();
        let settings = StepperSettings {
            method: solver.method()?,
            iterations,
            settled,
            extrapolates: extrapolate,
            budget,
            time_step,
            density: density.as_array().to_vec(),
            dynamics: dynamics.map(|(newmark, is_lumped, damping)| Dynamics {
                integration: newmark.map_or(Integration::BackwardEuler, |(beta, gamma)| {
                    Integration::Newmark { beta, gamma }
                }),
                mass: if is_lumped { Mass::Lumped } else { Mass::Consistent },
                damping,
            }),
            relaxation: relaxation.map(|(g, tau)| Prony { g, tau }),
        };
        let fixed: Vec<u32> =
            held.fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i)).collect();
        let start = start.map(|u| convert::dofs("start", &u, n)).transpose()?;
        let stepper =
            detached(py, || equilibrium::Stepper::new(&held.body, &fixed, start, settings))?
                .map_err(convert::error)?;
        Ok(Stepper { body, stepper: Exclusive::new("stepper", stepper) })
    }

    fn grasp(
        &self,
        py: Python<'_>,
        prescribed: PyReadonlyArray1<u32>,
        patches: Vec<PyRef<'_, Patch>>,
    ) -> PyResult<()> {
        let dofs = prescribed.as_array().to_vec();
        let patches: Vec<_> = patches.iter().map(|patch| patch.patch.clone()).collect();
        let body = &self.body.get().body;
        let mut claimed = self.stepper.claim()?;
        let stepper = &mut *claimed;
        detached(py, || stepper.grasp(body, &dofs, &patches))?.map_err(convert::error)
    }

    fn press(
        &self,
        pressed: PyReadonlyArray2<u32>,
        pressure: PyReadonlyArray1<f64>,
    ) -> PyResult<()> {
        let pressure = convert::pressure(&pressed, &pressure);
        self.stepper.claim()?.set_pressure(&self.body.get().body, pressure).map_err(convert::error)
    }

    fn add_tool(&self, tool: contact::Tool) -> PyResult<usize> {
        let tool = contact::tool(&tool);
        self.stepper.claim()?.add_tool(&self.body.get().body, tool).map_err(convert::error)
    }

    fn place_tool(&self, tool: usize, rotation: [[f64; 3]; 3], position: [f64; 3]) -> PyResult<()> {
        let pose = Pose { rotation, position };
        self.stepper.claim()?.place_tool(tool, pose).map_err(convert::error)
    }

    fn remove_tool(&self, tool: usize) -> PyResult<()> {
        self.stepper.claim()?.remove_tool(tool);
        Ok(())
    }

    fn contact<'py>(&self, py: Python<'py>, tools: Vec<usize>) -> PyResult<Bound<'py, PyList>> {
        let n = self.body.get().body.points().len();
        contact::reports(py, self.stepper.claim()?.contact(), tools, n)
    }

    fn contact_pairs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let n = self.body.get().body.points().len();
        contact::pair_reports(py, self.stepper.claim()?.contact(), n)
    }

    fn set_velocity(&self, velocity: PyReadonlyArray2<f64>) -> PyResult<()> {
        let n = self.body.get().body.points().len();
        let velocity = convert::dofs("velocity", &velocity, n)?;
        self.stepper.claim()?.set_velocity(&velocity).map_err(convert::error)
    }

    fn displacement<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        field(py, self.stepper.claim()?.displacement())
    }

    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.stepper.claim()?.velocity().map(|velocity| field(py, velocity)).transpose()
    }

    fn reactions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        convert::field(py, self.stepper.claim()?.reactions().collect())
    }

    #[pyo3(signature = (*, values, means, turns, force, torques, gravity))]
    #[allow(clippy::too_many_arguments)]
    fn frame<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray1<f64>,
        means: PyReadonlyArray2<f64>,
        turns: Vec<Turned<'py>>,
        force: Option<PyReadonlyArray2<f64>>,
        torques: Vec<(PyRef<'py, Patch>, [f64; 3])>,
        gravity: [f64; 3],
    ) -> PyResult<Bound<'py, PyDict>> {
        let body = &self.body.get().body;
        let values = values.as_array().to_vec();
        let means = convert::points("means", &means)?;
        let turn = |(patch, arms): &Turned| {
            convert::points("arms", arms).map(|arms| Turn { patch: *patch, arms })
        };
        let turns = turns.iter().map(turn).collect::<PyResult<Vec<_>>>()?;
        let torque = |(place, torque): &(PyRef<Patch>, _)| Torque {
            place: place.patch.clone(),
            torque: *torque,
        };
        let torques: Vec<_> = torques.iter().map(torque).collect();
        let force = match force {
            Some(force) => convert::dofs("force", &force, body.points().len())?,
            None => Vec::new(),
        };
        let mut claimed = self.stepper.claim()?;
        let stepper = &mut *claimed;
        let input = Input {
            values: &values,
            means: &means,
            turns: &turns,
            force: &force,
            torques: &torques,
            gravity,
        };
        let frame = if stepper.longest_frame() < SHORT {
            detached(py, || stepper.frame(body, &input))?.map_err(convert::error)?
        } else {
            interruptible(py, |is_wanted| stepper.frame_while(body, &input, is_wanted))?
        };
        let dict = PyDict::new(py);
        dict.set_item("displacement", field(py, stepper.displacement())?)?;
        dict.set_item("reactions", convert::field(py, stepper.reactions().collect())?)?;
        dict.set_item("supports", convert::field(py, stepper.supports())?)?;
        dict.set_item("damping", damping(py, body, stepper)?)?;
        dict.set_item("patch_forces", convert::table(py, &frame.patch_forces)?)?;
        dict.set_item("patch_torques", convert::table(py, &frame.patch_torques)?)?;
        dict.set_item("residual", frame.residual)?;
        dict.set_item("is_settled", frame.is_settled)?;
        dict.set_item("steps", frame.steps)?;
        dict.set_item("cells_at_bound", frame.cells_at_bound)?;
        dict.set_item("taken", frame.taken)?;
        dict.set_item("is_unstable", frame.is_unstable)?;
        dict.set_item("iterations", frame.iterations)?;
        dict.set_item("is_solved", frame.is_solved)?;
        dict.set_item("floor", frame.floor)?;
        dict.set_item("within_budget", frame.within_budget)?;
        dict.set_item("seconds", frame.seconds)?;
        dict.set_item("energy", frame.energy)?;
        dict.set_item("kinetic_energy", frame.kinetic_energy)?;
        dict.set_item("device_fault", stepper.device_fault())?;
        dict.set_item("tangent_on_device", stepper.origin().map(Origin::name))?;
        Ok(dict)
    }
}

/// Rayleigh's beta, the velocity that it damps, where its tangent was taken, and whether that was made convex; none
/// without beta, or without what ties the body, whose force alone needs them.
type Damping<'py> = (f64, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, bool);

fn damping<'py>(
    py: Python<'py>,
    body: &body::Body,
    stepper: &equilibrium::Stepper,
) -> PyResult<Option<Damping<'py>>> {
    let pulls = |ties: &Ties| !ties.stiffness.is_empty() || !ties.links.is_empty();
    let Some(damping) = stepper.stiffness_damping().filter(|_| body.ties().is_some_and(pulls))
    else {
        return Ok(None);
    };
    let is_convex = damping.curvature == Curvature::Projected;
    let (velocity, at) = (field(py, &damping.velocity)?, field(py, &damping.displacement)?);
    Ok(Some((damping.beta, velocity, at, is_convex)))
}

fn field<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, values).reshape([values.len() / 3, 3])
}
