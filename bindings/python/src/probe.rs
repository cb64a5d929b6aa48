//! A rigid probe on a reduced model.

use crate::convert;
use crate::exclusive::Exclusive;
use crate::model::{Model, reason};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::MutexGuard;
use viscera_core::Error;
use viscera_core::reduced::{
    self, Beside, CONTACT_ERROR, Coupling, Decisive, Felt, Grip, ProbeGroup, ReducedModel, Trust,
    refused,
};

/// A sphere, and the model it touches.
#[pyclass(frozen, module = "viscera._core")]
pub struct Probe {
    model: Py<Model>,
    probe: Exclusive<reduced::Probe>,
}

#[pymethods]
impl Probe {
    #[new]
    fn new(
        model: Py<Model>,
        radius: f64,
        friction: f64,
        tolerance: f64,
        coupling: Option<(f64, f64)>,
    ) -> PyResult<Self> {
        let coupling = coupling.map(|(stiffness, damping)| Coupling { stiffness, damping });
        let reduced = &model.get().model;
        let probe = reduced::Probe::new(reduced, radius, friction, tolerance, coupling);
        let probe = probe.map_err(refused).map_err(convert::error)?;
        Ok(Probe { model, probe: Exclusive::new("probe", probe) })
    }

    fn place<'py>(&self, py: Python<'py>, center: [f64; 3]) -> PyResult<Bound<'py, PyDict>> {
        let model = self.model.get();
        let felt = self.probe.claim()?.place(&model.model, center);
        told(py, model, &felt)
    }

    fn follow<'py>(
        &self,
        py: Python<'py>,
        device: [f64; 3],
        dt: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let model = self.model.get();
        let felt = self.probe.claim()?.follow(&model.model, device, dt);
        told(py, model, &felt.ok_or_else(|| no_duration(dt))?)
    }

    fn lift(&self) -> PyResult<()> {
        self.probe.claim()?.lift();
        Ok(())
    }
}

/// Several spheres on one model that feel each other.
#[pyclass(frozen, module = "viscera._core")]
pub struct Probes {
    probes: Vec<Py<Probe>>,
    together: Exclusive<ProbeGroup>,
}

#[pymethods]
impl Probes {
    /// At least one probe, all on one model, none of them twice.
    #[new]
    fn new(probes: Vec<Py<Probe>>) -> Self {
        let together = ProbeGroup::new(&probes[0].get().model.get().model, probes.len());
        Probes { probes, together: Exclusive::new("group of probes", together) }
    }

    fn place<'py>(
        &self,
        py: Python<'py>,
        centers: Vec<[f64; 3]>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.step(py, |together, model, probes| Ok(together.place(model, probes, &centers)))
    }

    fn follow<'py>(
        &self,
        py: Python<'py>,
        devices: Vec<[f64; 3]>,
        dt: f64,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.step(py, |together, model, probes| {
            together.follow(model, probes, &devices, dt).ok_or_else(|| no_duration(dt))
        })
    }
}

impl Probes {
    fn step<'py>(
        &self,
        py: Python<'py>,
        step: impl for<'a> Fn(
            &'a mut ProbeGroup,
            &ReducedModel,
            &mut [MutexGuard<'_, reduced::Probe>],
        ) -> PyResult<&'a [Felt]>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let model = self.probes[0].get().model.get();
        let mut together = self.together.claim()?;
        let claimed = self.probes.iter().map(|probe| probe.get().probe.claim());
        let mut claimed = claimed.collect::<PyResult<Vec<_>>>()?;
        let felt = step(&mut together, &model.model, &mut claimed)?;
        felt.iter().map(|felt| told(py, model, felt)).collect()
    }
}

fn no_duration(dt: f64) -> PyErr {
    convert::error(Error::input(format!(
        "the time step is {dt}; it must be at least 0 and finite [s]"
    )))
}

fn told<'py>(py: Python<'py>, model: &Model, felt: &Felt) -> PyResult<Bound<'py, PyDict>> {
    let (trust, shape) = (felt.trust, felt.shape_trust);
    let (error, shape_error) = (felt.error_estimate, felt.shape_error_estimate);
    let d = felt.displacement;
    let why = |trust: Trust, kind: &str, decisive: Decisive| match (felt.grip, trust) {
        (Grip::Inside, _) => "the probe came into the organ in one step; lift it off".to_string(),
        (Grip::Lost, _) => "the pose is not a usable number".to_string(),
        (_, Trust::BeyondDepth) => {
            format!(
                "the probe has entered by {:.1} mm, deeper than the model serves",
                -1e3 * felt.gap
            )
        }
        _ if felt.beside == Beside::Support => {
            "the probe touches where the organ is fixed".to_string()
        }
        _ if felt.beside == Beside::SecondPlace => {
            "the probe touches the organ at a second place".to_string()
        }
        _ if felt.beside == Beside::Untouchable => {
            "the probe touches the organ beside its touchable surface".to_string()
        }
        (_, Trust::ErrorTooLarge) if decisive.has_contact => format!(
            "the estimated {kind}, with {:.0} % for the contact, is {:.1} %, above the {:.1} % that is allowed",
            100.0 * CONTACT_ERROR,
            100.0 * decisive.estimate,
            100.0 * decisive.allowed
        ),
        _ => reason(
            trust,
            &format!("the model's estimated {kind}"),
            decisive.estimate,
            &model.model,
            d,
        ),
    };
    let told = PyDict::new(py);
    for (name, vector) in [
        ("center", felt.center),
        ("contact_point", felt.contact.point),
        ("push", d),
        ("force", felt.force),
        ("torque", felt.torque),
    ] {
        told.set_item(name, PyArray1::from_slice(py, &vector))?;
    }
    told.set_item("gap", felt.gap)?;
    told.set_item(
        "grip",
        match felt.grip {
            Grip::Free => "free",
            Grip::Sticks => "sticks",
            Grip::Slides => "slides",
            Grip::Inside => "inside",
            Grip::Lost => "lost",
        },
    )?;
    told.set_item("error_estimate", error)?;
    told.set_item("is_trusted", trust == Trust::Trusted)?;
    told.set_item("reason", why(trust, "error", felt.decisive))?;
    told.set_item("shape_error_estimate", shape_error)?;
    told.set_item("is_shape_trusted", shape == Trust::Trusted)?;
    told.set_item("shape_reason", why(shape, "error of the shape", felt.shape_decisive))?;
    Ok(told)
}
