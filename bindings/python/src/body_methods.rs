//! What Python asks a body for: its integrals and statics, paths, steppers and off-line stages.

use crate::body::Body;
use crate::family::FamilyArguments;
use crate::threads;
use crate::{
    contact,
    convert::{self, VisceraError},
    gpu,
    law::Law,
    mesh::Patch,
    model::Model,
    path,
    settings::{Solver, choose},
};
use numpy::{PyArray1, PyArray2, PyArray4, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use std::collections::BTreeMap;
use std::sync::Arc;
use viscera_core::contact::Contact;
use viscera_core::element::Element;
use viscera_core::equilibrium::{Equilibrium, Newton, Origin, PatchLoad, Problem};
use viscera_core::mesh::NoPatch;
use viscera_core::reduced::{Batches, Notes, Progress, Reduction};
use viscera_core::series::{Continuation, Parameter, SeriesDevice};
use viscera_core::{body, mesh};

/// Deformation gradients and stresses (m, q, 3, 3), energy densities (m, q).
type Responses<'py> =
    (Bound<'py, PyArray4<f64>>, Bound<'py, PyArray4<f64>>, Bound<'py, PyArray2<f64>>);

/// A spring or a cable: nodes and weights of its ends, vector between them at rest, stiffness, length, whether it is a cable.
type Link = (Vec<(u32, f64)>, [f64; 3], f64, f64, bool);

/// Surfaces that may touch: the triangles of both, reach, stiffness, and the coefficient of friction.
type ContactPair<'py> =
    (PyReadonlyArray2<'py, u32>, Option<PyReadonlyArray2<'py, u32>>, f64, f64, f64);

/// Elastic supports and bonds: where the nodes of each sample start, nodes, weights, and stiffness (s, 9); springs;
/// contact pairs.
#[derive(FromPyObject)]
struct Ties<'py>(
    PyReadonlyArray1<'py, u32>,
    PyReadonlyArray1<'py, u32>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray2<'py, f64>,
    Vec<Link>,
    Vec<ContactPair<'py>>,
);

impl Ties<'_> {
    fn arrays(&self, points: &[[f64; 3]]) -> PyResult<body::Ties> {
        let rows = self.3.as_array();
        let pair = |(first, second, reach, stiffness, friction): &ContactPair| {
            let first = convert::triangles(first)?;
            match second {
                Some(second) => {
                    let surfaces = [first, convert::triangles(second)?];
                    body::ContactPair::new(points, surfaces, *reach, *stiffness, *friction)
                }
                None => body::ContactPair::of_one(points, first, *reach, *stiffness, *friction),
            }
            .map_err(convert::error)
        };
        Ok(body::Ties {
            start: self.0.as_array().to_vec(),
            nodes: self.1.as_array().to_vec(),
            weights: self.2.as_array().to_vec(),
            links: self.4.iter().map(link).collect(),
            stiffness: rows.rows().into_iter().map(|k| std::array::from_fn(|i| k[i])).collect(),
            contact_pairs: self.5.iter().map(pair).collect::<PyResult<_>>()?,
        })
    }
}

fn link((ends, rest, stiffness, length, is_cable): &Link) -> body::Link {
    let (ends, rest) = (ends.clone(), *rest);
    body::Link { ends, rest, stiffness: *stiffness, length: *length, is_cable: *is_cable }
}

#[pymethods]
impl Body {
    #[new]
    #[pyo3(signature = (points, cells, law, fixed, element, ties=None))]
    fn new(
        points: PyReadonlyArray2<f64>,
        cells: PyReadonlyArray2<u32>,
        law: &Law,
        fixed: PyReadonlyArray1<u32>,
        element: &str,
        ties: Option<Ties<'_>>,
    ) -> PyResult<Self> {
        let (points, cells) = (convert::points("points", &points)?, convert::cells(&cells)?);
        let element = Element::named(element).map_err(convert::error)?;
        let ties = ties.map(|ties| ties.arrays(&points)).transpose()?.unwrap_or_default();
        let body = body::Body::tied(element, points, cells, law.material.clone(), ties)
            .map_err(convert::error)?;
        if !body.contact_pairs().is_empty() {
            Contact::new(&body).check().map_err(convert::error)?;
        }
        let surface = mesh::Surface::new(body.points(), &body.surface());
        let mut fixed = fixed.as_array().to_vec();
        fixed.sort_unstable();
        fixed.dedup();
        if let Some(node) = fixed.iter().find(|&&node| node as usize >= body.points().len()) {
            return Err(VisceraError::new_err(format!(
                "fixed point {node} does not exist; there are {} points",
                body.points().len()
            )));
        }
        Ok(Body { body, surface, fixed })
    }

    #[pyo3(signature = (*, prescribed, values, force, body_force, pressed, pressure, patches, tools, anchored, start, steps, settings, solver, on_progress))]
    #[allow(clippy::too_many_arguments)]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        prescribed: PyReadonlyArray1<u32>,
        values: PyReadonlyArray1<f64>,
        force: PyReadonlyArray2<f64>,
        body_force: PyReadonlyArray2<f64>,
        pressed: PyReadonlyArray2<u32>,
        pressure: PyReadonlyArray1<f64>,
        patches: Vec<(PyRef<'py, Patch>, PyReadonlyArray1<'py, f64>)>,
        tools: Vec<contact::Tool<'py>>,
        anchored: Vec<Vec<contact::Anchored>>,
        start: Option<PyReadonlyArray2<f64>>,
        steps: usize,
        settings: BTreeMap<String, f64>,
        solver: Solver,
        on_progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let n = self.body.points().len();
        let (dofs, values) = (prescribed.as_array(), values.as_array());
        if dofs.len() != values.len() {
            return Err(VisceraError::new_err(format!(
                "{} prescribed degrees of freedom but {} values",
                dofs.len(),
                values.len()
            )));
        }
        let fixed = self.fixed.iter().flat_map(|&node| (0..3).map(move |i| (3 * node + i, 0.0)));
        let mut total = convert::dofs("force", &force, n)?;
        let body_force = convert::dofs("body_force", &body_force, n)?;
        total.iter_mut().zip(&body_force).for_each(|(f, b)| *f += b);
        let patches = patches
            .iter()
            .map(|(patch, d)| {
                let displacement = convert::vector("patch displacement", d)?;
                Ok(PatchLoad { patch: patch.patch.clone(), displacement })
            })
            .collect::<PyResult<Vec<_>>>()?;
        let problem = Problem {
            body: &self.body,
            prescribed: fixed.chain(dofs.iter().copied().zip(values.iter().copied())).collect(),
            force: total,
            pressure: convert::pressure(&pressed, &pressure),
            patches,
            start: start.map(|u| convert::dofs("start", &u, n)).transpose()?,
        };
        let mut newton = Newton { steps, method: solver.method()?, ..Newton::default() };
        choose(&Newton::SETTINGS, &mut newton, "Newton's method", &settings)?;
        problem.check_grasp().map_err(convert::error)?;
        let fixed = self.fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i));
        let mut contact = Contact::new(&self.body).on_fixed(fixed);
        let rest = problem.start.clone().unwrap_or_else(|| vec![0.0; 3 * n]);
        contact::add(&mut contact, &self.body, &tools, &anchored, &rest)?;
        let n_tools = tools.len();
        let mut watch = Watch::new(on_progress);
        let result = threads::detached(py, || {
            newton.solve_in_contact(&problem, &mut contact, &mut |load| watch.report((load,)))
        })?;
        let state = watch.outcome(result)?;
        let dict = state_dict(py, &self.body, state)?;
        dict.set_item("contact", contact::reports(py, &contact, 0..n_tools, n)?)?;
        dict.set_item("contact_pairs", contact::pair_reports(py, &contact, n)?)?;
        dict.set_item("anchored", contact::anchored(&contact, n_tools))?;
        Ok(dict)
    }

    fn internal_force<'py>(
        &self,
        py: Python<'py>,
        displacement: PyReadonlyArray2<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let u = convert::dofs("displacement", &displacement, self.body.points().len())?;
        let mut force = vec![0.0; u.len()];
        threads::integrated(py, &self.body, || self.body.internal_force(&u, &mut force))?;
        convert::field(py, force)
    }

    fn energy(&self, py: Python<'_>, displacement: PyReadonlyArray2<f64>) -> PyResult<f64> {
        let u = convert::dofs("displacement", &displacement, self.body.points().len())?;
        threads::integrated(py, &self.body, || self.body.energy(&u))
    }

    fn responses<'py>(
        &self,
        py: Python<'py>,
        displacement: PyReadonlyArray2<f64>,
    ) -> PyResult<Responses<'py>> {
        let u = convert::dofs("displacement", &displacement, self.body.points().len())?;
        let found = threads::integrated(py, &self.body, || self.body.quadrature_points(&u))?;
        let m = self.body.cells().len();
        let q = found.len() / m;
        let tensors = |of: fn(&body::QuadraturePoint) -> [[f64; 3]; 3]| {
            let entries: Vec<f64> =
                found.iter().flat_map(|r| of(r).into_iter().flatten()).collect();
            PyArray1::from_vec(py, entries).reshape([m, q, 3, 3])
        };
        let energies = PyArray1::from_vec(py, found.iter().map(|r| r.energy).collect());
        Ok((tensors(|r| r.gradient)?, tensors(|r| r.stress)?, energies.reshape([m, q])?))
    }

    fn gravity<'py>(
        &self,
        py: Python<'py>,
        gravity: PyReadonlyArray1<f64>,
        density: PyReadonlyArray1<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let gravity = convert::vector("gravity", &gravity)?;
        let force =
            self.body.gravity(gravity, &density.as_array().to_vec()).map_err(convert::error)?;
        convert::field(py, force)
    }

    #[pyo3(signature = (*, force, pressed, pressure, order, parameter, until, tolerance, max_expansions))]
    #[allow(clippy::too_many_arguments)]
    fn path<'py>(
        &self,
        py: Python<'py>,
        force: PyReadonlyArray2<f64>,
        pressed: PyReadonlyArray2<u32>,
        pressure: PyReadonlyArray1<f64>,
        order: usize,
        parameter: &str,
        until: f64,
        tolerance: f64,
        max_expansions: usize,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let force = convert::dofs("force", &force, self.body.points().len())?;
        let parameter = match parameter {
            "load" => Parameter::Load,
            "arc length" => Parameter::ArcLength,
            other => {
                return Err(VisceraError::new_err(format!(
                    "the path parameter is 'load' or 'arc length', got {other:?}"
                )));
            }
        };
        let pressure = convert::pressure(&pressed, &pressure);
        let continuation = Continuation { order, parameter, until, tolerance, max_expansions };
        let mut watch = Watch::new(None);
        let result = threads::detached(py, || {
            let (body, fixed) = (&self.body, &self.fixed);
            continuation.follow(body, fixed, &force, &pressure, &mut || watch.report(()))
        })?;
        let expansions = watch.outcome(result)?;
        expansions.into_iter().map(|expansion| path::expansion_dict(py, expansion)).collect()
    }

    fn patch(&self, point: PyReadonlyArray1<f64>, radius: f64) -> PyResult<Patch> {
        let point = convert::vector("point", &point)?;
        let excluded = |node: u32| self.fixed.binary_search(&node).is_ok();
        let patch = self.surface.patch_at_point(point, radius, &excluded);
        patch.map(|patch| Patch { patch }).map_err(|fault| {
            VisceraError::new_err(match fault {
                NoPatch::TooFar => format!(
                    "there is no free surface within {radius} m of the point {point:?}; move the point or widen the radius"
                ),
                NoPatch::Excluded => format!(
                    "the surface is fixed at the point {point:?}, and what is fixed cannot be held; move the point beside it"
                ),
            })
        })
    }

    #[pyo3(signature = (*, touchable, radius, depth, order, tolerance, pade, memory, preload, family, metadata, on_progress, batches=None, on_gpu=false))]
    #[allow(clippy::too_many_arguments)]
    fn reduce(
        &self,
        py: Python<'_>,
        touchable: PyReadonlyArray1<u32>,
        radius: f64,
        depth: f64,
        order: usize,
        tolerance: f64,
        pade: bool,
        memory: f64,
        preload: Option<PyReadonlyArray2<f64>>,
        family: Option<FamilyArguments>,
        metadata: &str,
        on_progress: Option<Py<PyAny>>,
        batches: Option<Py<PyAny>>,
        on_gpu: bool,
    ) -> PyResult<(Model, Option<String>)> {
        let user = Notes::new(metadata)
            .map_err(|e| VisceraError::new_err(format!("metadata is not JSON: {e}")))?;
        let touchable = touchable.as_array().to_vec();
        let n = self.body.points().len();
        let preload = preload.map_or(Ok(Vec::new()), |u| convert::dofs("preload", &u, n))?;
        let device = on_gpu.then(gpu::device).transpose()?;
        let device = device.map(|device| Arc::new(SeriesDevice::new(device)));
        let reduction = Reduction {
            touchable,
            radius,
            depth,
            order,
            tolerance,
            pade,
            memory,
            preload,
            device: device.clone(),
            user,
        };
        let (mut watch, mut kept) = (Watch::new(on_progress), Kept { batches, raised: None });
        let result = threads::detached(py, || {
            let mut report = |p: Progress| watch.report((p.done, p.total, p.stage));
            let (body, surface, fixed) = (&self.body, &self.surface, &self.fixed[..]);
            let family = family.as_ref().map(|family| family.family());
            reduction.run_kept(body, family.as_ref(), surface, fixed, (&mut kept, &mut report))
        })?;
        match kept.raised {
            Some(raised) => Err(raised),
            None => {
                let fault = device.as_ref().and_then(|device| device.fault());
                Ok((Model { model: watch.outcome(result)? }, fault.map(str::to_string)))
            }
        }
    }

    fn lumped_areas<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.surface.lumped_areas())
    }
}

fn state_dict<'py>(
    py: Python<'py>,
    body: &body::Body,
    state: Equilibrium,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("volume", body.volume(&state.displacement))?;
    dict.set_item("displacement", convert::field(py, state.displacement)?)?;
    dict.set_item("internal_force", convert::field(py, state.internal_force)?)?;
    dict.set_item("external_force", convert::field(py, state.external_force)?)?;
    dict.set_item("patch_forces", convert::table(py, &state.patch_forces)?)?;
    dict.set_item("energy", state.energy)?;
    dict.set_item("status", state.status.name())?;
    dict.set_item("is_converged", state.status.is_converged())?;
    dict.set_item("message", state.message)?;
    dict.set_item("device_fault", state.device_fault)?;
    dict.set_item("tangent_on_device", state.origin.map(Origin::name))?;
    dict.set_item("load", state.load)?;
    dict.set_item("iterations", state.iterations)?;
    dict.set_item("factorizations", state.factorizations)?;
    dict.set_item("linear_iterations", state.linear_iterations)?;
    dict.set_item("solver", state.solvers.join(", then "))?;
    dict.set_item("load_steps", state.residuals.len())?;
    dict.set_item("residuals", PyList::new(py, state.residuals)?)?;
    let seconds = PyDict::new(py);
    seconds.set_item("analysis", state.seconds.analysis)?;
    seconds.set_item("assembly", state.seconds.assembly)?;
    seconds.set_item("factorization", state.seconds.factorization)?;
    seconds.set_item("solve", state.seconds.solve)?;
    seconds.set_item("total", state.seconds.total)?;
    dict.set_item("seconds", seconds)?;
    Ok(dict)
}

/// Python's store of finished batches, for the core: an object with `finished()` and `keep(bytes)`, or none.
struct Kept {
    batches: Option<Py<PyAny>>,
    raised: Option<PyErr>,
}

impl Batches for Kept {
    fn finished(&mut self) -> Option<Vec<Vec<u8>>> {
        let Some(batches) = &self.batches else { return Some(Vec::new()) };
        let found =
            Python::attach(|py| batches.call_method0(py, "finished")?.extract::<Vec<Vec<u8>>>(py));
        found.map_err(|error| self.raised = Some(error)).ok()
    }

    fn keep(&mut self, batch: &[u8]) -> bool {
        if let Some(batches) = &self.batches {
            let kept = Python::attach(|py| {
                batches.call_method1(py, "keep", (PyBytes::new(py, batch),)).map(drop)
            });
            self.raised = self.raised.take().or(kept.err());
        }
        self.raised.is_none()
    }
}

/// A Python progress callback seen from the core: it may raise, and Ctrl-C counts as raising.
pub struct Watch {
    callback: Option<Py<PyAny>>,
    raised: Option<PyErr>,
}

impl Watch {
    pub fn new(callback: Option<Py<PyAny>>) -> Self {
        Watch { callback, raised: None }
    }

    /// Calls back with the interpreter attached; false asks the core to stop.
    pub fn report<A>(&mut self, arguments: A) -> bool
    where
        A: for<'py> pyo3::call::PyCallArgs<'py>,
    {
        if self.raised.is_some() {
            return false; // what stopped the work is told, not what came after
        }
        let outcome = Python::attach(|py| {
            py.check_signals()?;
            if let Some(callback) = &self.callback {
                callback.call1(py, arguments)?;
            }
            Ok(())
        });
        self.raised = outcome.err();
        self.raised.is_none()
    }

    /// The result, or what the callback raised.
    pub fn outcome<T>(self, result: Result<T, viscera_core::Error>) -> PyResult<T> {
        match self.raised {
            Some(raised) => Err(raised),
            None => result.map_err(convert::error),
        }
    }
}
