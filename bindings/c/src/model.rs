//! A loaded model: its numbers, its surface, and the calls of a haptic loop.

use crate::frame::Frame;
use crate::status::{self, viscera_status};
use crate::{all_finite, put, vector};
use std::ffi::CString;
use viscera_touch::{Contact, ReducedModel, Trust};

/// `viscera_model`, opaque to C.
#[derive(Clone)]
pub struct Model {
    pub(crate) reduced: ReducedModel,
    /// Surface triangles in the numbering of surface nodes.
    triangles: Vec<[u32; 3]>,
    pub(crate) frame: Frame,
    /// Name of the parameter; empty if there is none.
    pub(crate) parameter: CString,
}

/// `struct viscera_info`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Info {
    pub points: u64,
    pub surface_nodes: u64,
    pub surface_triangles: u64,
    pub positions: u64,
    pub radius: f64,
    pub depth: f64,
    pub edge_length: f64,
}

/// `struct viscera_answer`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    pub force: [f64; 3],
    pub stiffness: [[f64; 3]; 3],
    pub error_estimate: f64,
    pub shape_error_estimate: f64,
    pub contact_point: [f64; 3],
}

const _: () = assert!(size_of::<Info>() == 56 && size_of::<Answer>() == 136);

impl Answer {
    /// No force, and error estimates of 1.
    const NONE: Self = Answer {
        force: [0.0; 3],
        stiffness: [[0.0; 3]; 3],
        error_estimate: 1.0,
        shape_error_estimate: 1.0,
        contact_point: [0.0; 3],
    };

    /// Whether nothing has overflowed in the caller's units.
    fn is_finite(&self) -> bool {
        let Answer { force, stiffness, contact_point, .. } = self;
        [&force[..], stiffness.as_flattened(), contact_point].iter().all(|part| all_finite(part))
    }
}

impl Model {
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let reduced = ReducedModel::from_bytes(bytes).map_err(|error| error.to_string())?;
        let nodes = &reduced.arrays().surface_nodes;
        let row = |node: &u32| {
            let row = nodes.binary_search(node).map_err(|_| {
                format!("not a usable model file: surface node {node} is not among surface_nodes")
            })?;
            Ok(row as u32)
        };
        let rows = reduced.arrays().surface.iter().map(row).collect::<Result<Vec<_>, String>>()?;
        let triangles = rows.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let name = reduced.metadata().parameter.as_ref().map_or("", |parameter| &parameter.name);
        let parameter = CString::new(name)
            .map_err(|_| format!("not a usable model file: a parameter called {name:?}"))?;
        Ok(Model { reduced, triangles, frame: Frame::IDENTITY, parameter })
    }

    /// A warning about the file that was read; usually empty.
    pub fn warning(&self) -> &'static str {
        if self.reduced.metadata().is_sealed() {
            ""
        } else {
            "the file is of format version 1, which has no checksums: damage may go unnoticed"
        }
    }

    fn n_surface(&self) -> usize {
        self.reduced.arrays().surface_nodes.len()
    }

    fn info(&self) -> Info {
        let (metadata, unit) = (self.reduced.metadata(), self.frame.metres_per_unit);
        Info {
            points: self.reduced.n_points() as u64,
            surface_nodes: self.n_surface() as u64,
            surface_triangles: self.triangles.len() as u64,
            positions: self.reduced.n_positions() as u64,
            radius: metadata.radius / unit,
            depth: metadata.depth / unit,
            edge_length: self.reduced.edge_length() / unit,
        }
    }

    /// The contact and the answer in SI, or why there is none.
    pub(crate) fn touch(
        &self,
        point: [f64; 3],
        d: [f64; 3],
    ) -> Result<(Contact, viscera_touch::Answer), viscera_status> {
        if !all_finite(&point) || !all_finite(&d) {
            return Err(status::NOT_FINITE);
        }
        let contact = self.reduced.locate(point).filter(|c| self.reduced.is_on_surface(c));
        let contact = contact.ok_or(status::OFF_SURFACE)?;
        let response = self.reduced.respond(&contact, d);
        // A displacement far beyond the depth may overflow the polynomial.
        let is_finite =
            all_finite(&response.force) && response.stiffness.iter().all(|r| all_finite(r));
        if is_finite { Ok((contact, response)) } else { Err(status::NOT_FINITE) }
    }

    fn answer(
        &self,
        point: [f64; 3],
        displacement: [f64; 3],
    ) -> Result<(Answer, viscera_status), viscera_status> {
        let frame = &self.frame;
        let (contact, response) =
            self.touch(frame.point_in(point), frame.length_in(displacement))?;
        let answer = Answer {
            force: frame.force_out(response.force),
            stiffness: frame.stiffness_out(&response.stiffness),
            error_estimate: response.error_estimate,
            shape_error_estimate: response.shape_error_estimate,
            contact_point: frame.point_out(contact.point),
        };
        if answer.is_finite() {
            Ok((answer, status_of(response.trust)))
        } else {
            Err(status::NOT_FINITE)
        }
    }

    fn energy(
        &self,
        point: [f64; 3],
        displacement: [f64; 3],
    ) -> Result<(f64, viscera_status), viscera_status> {
        let frame = &self.frame;
        let d = frame.length_in(displacement);
        let (contact, response) = self.touch(frame.point_in(point), d)?;
        let energy = frame.energy_out(self.reduced.energy(&contact, d));
        if energy.is_finite() {
            Ok((energy, status_of(response.trust)))
        } else {
            Err(status::NOT_FINITE)
        }
    }

    /// What `evaluate` writes of the shape of the organ, in metres; zero if there is no answer.
    pub(crate) fn shape(
        &self,
        point: [f64; 3],
        displacement: [f64; 3],
        out: &mut [f32],
        evaluate: impl FnOnce(&Contact, [f64; 3], &mut [f32]),
    ) -> viscera_status {
        let d = self.frame.length_in(displacement);
        match self.touch(self.frame.point_in(point), d) {
            Ok((contact, response)) => {
                evaluate(&contact, d, out);
                status_of(response.shape_trust)
            }
            Err(status) => {
                out.fill(0.0);
                status
            }
        }
    }

    /// Deformed positions of the surface nodes; those at rest if there is no answer.
    fn surface(
        &self,
        point: [f64; 3],
        displacement: [f64; 3],
        workspace: &mut [f32],
        out: &mut [f32],
    ) -> viscera_status {
        let status = self.shape(point, displacement, out, |contact, d, out| {
            self.reduced.surface_displacement(contact, d, workspace, out);
        });
        let status = finite_or_zero(status, out);
        let arrays = self.reduced.arrays();
        for (&node, x) in arrays.surface_nodes.iter().zip(out.chunks_exact_mut(3)) {
            let rest = &arrays.points[3 * node as usize..3 * node as usize + 3];
            let moved = std::array::from_fn(|i| rest[i] + f64::from(x[i]));
            let placed = self.frame.point_out(moved);
            (0..3).for_each(|i| x[i] = placed[i] as f32);
        }
        finite_or_zero(status, out)
    }
}

/// Zero in place of numbers that are not finite, and its status.
pub(crate) fn finite_or_zero<T: Copy + Default + Into<f64>>(
    status: viscera_status,
    out: &mut [T],
) -> viscera_status {
    if out.iter().all(|&x| x.into().is_finite()) {
        return status;
    }
    out.fill(T::default());
    status::NOT_FINITE
}

pub(crate) fn status_of(trust: Trust) -> viscera_status {
    match trust {
        Trust::Trusted => status::OK,
        Trust::BeyondDepth => status::BEYOND_DEPTH,
        Trust::ErrorTooLarge => status::ERROR_TOO_LARGE,
    }
}

/// Sizes of the model, in the caller's units.
///
/// # Safety
/// `model` is null or loaded, `info` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_info(model: *const Model, info: *mut Info) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(model) = (unsafe { model.as_ref() }) else {
        unsafe { put(info, Info::default()) };
        return status::NULL_POINTER;
    };
    unsafe { put(info, model.info()) };
    if info.is_null() { status::NULL_POINTER } else { status::OK }
}

/// Sets the caller's frame; the model keeps the old one if the new one is refused.
///
/// # Safety
/// `model` is null or loaded and used by nobody else during the call, `frame` null or readable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_set_frame(
    model: *mut Model,
    frame: *const Frame,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let (Some(model), Some(frame)) = (unsafe { (model.as_mut(), frame.as_ref()) }) else {
        return status::NULL_POINTER;
    };
    if !frame.is_usable() {
        return status::BAD_SETTING;
    }
    model.frame = *frame;
    status::OK
}

/// Numbers of workspace for [`viscera_surface`]; 0 for no model.
///
/// # Safety
/// `model` is null or loaded.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_workspace_size(model: *const Model) -> usize {
    // SAFETY: the caller's contract.
    unsafe { model.as_ref() }.map_or(0, |model| model.reduced.workspace_len())
}

/// The closest touchable point and its distance.
///
/// # Safety
/// `model` is null or loaded, `point` null or readable, the others null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_locate(
    model: *const Model,
    point: *const f64,
    contact_point: *mut f64,
    distance: *mut f64,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let (Some(model), Some(point)) = (unsafe { (model.as_ref(), vector(point)) }) else {
        return status::NULL_POINTER;
    };
    let Some(contact) = model.reduced.locate(model.frame.point_in(point)) else {
        return status::NOT_FINITE;
    };
    let found = model.frame.point_out(contact.point);
    let away = contact.distance / model.frame.metres_per_unit;
    if !(all_finite(&found) && away.is_finite()) {
        return status::NOT_FINITE;
    }
    unsafe {
        put(contact_point.cast::<[f64; 3]>(), found);
        put(distance, away);
    }
    status::OK
}

/// Force, stiffness and error estimates of a touch.
///
/// # Safety
/// `model` is null or loaded, `point` and `displacement` null or readable, `answer` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_evaluate(
    model: *const Model,
    point: *const f64,
    displacement: *const f64,
    answer: *mut Answer,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let given = unsafe { (model.as_ref(), vector(point), vector(displacement)) };
    let (result, status) = match given {
        (Some(model), Some(point), Some(d)) => {
            model.answer(point, d).unwrap_or_else(|status| (Answer::NONE, status))
        }
        _ => (Answer::NONE, status::NULL_POINTER),
    };
    unsafe { put(answer, result) };
    if answer.is_null() { status::NULL_POINTER } else { status }
}

/// The energy that a touch has put into the organ.
///
/// # Safety
/// `model` is null or loaded, `point` and `displacement` null or readable, `energy` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_energy(
    model: *const Model,
    point: *const f64,
    displacement: *const f64,
    energy: *mut f64,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let given = unsafe { (model.as_ref(), vector(point), vector(displacement)) };
    let (result, status) = match given {
        (Some(model), Some(point), Some(d)) => {
            model.energy(point, d).unwrap_or_else(|status| (0.0, status))
        }
        _ => (0.0, status::NULL_POINTER),
    };
    unsafe { put(energy, result) };
    if energy.is_null() { status::NULL_POINTER } else { status }
}

/// Deformed positions of the surface nodes.
///
/// # Safety
/// `model` is null or loaded, `point` and `displacement` null or readable; `workspace` and
/// `positions` null or writable for their lengths, and apart from each other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_surface(
    model: *const Model,
    point: *const f64,
    displacement: *const f64,
    workspace: *mut f32,
    workspace_len: usize,
    positions: *mut f32,
    positions_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let given = unsafe { (model.as_ref(), vector(point), vector(displacement)) };
    let (Some(model), Some(point), Some(d)) = given else {
        return status::NULL_POINTER;
    };
    if workspace.is_null() || positions.is_null() {
        return status::NULL_POINTER;
    }
    let needed = (model.reduced.workspace_len(), 3 * model.n_surface());
    if workspace_len < needed.0 || positions_len < needed.1 {
        return status::SHORT_BUFFER;
    }
    // SAFETY: not null, and at least as long as what is taken.
    let (workspace, positions) = unsafe {
        (
            std::slice::from_raw_parts_mut(workspace, needed.0),
            std::slice::from_raw_parts_mut(positions, needed.1),
        )
    };
    model.surface(point, d, workspace, positions)
}

/// Triangles of the surface in the numbering of its nodes, and the mesh nodes these are.
///
/// # Safety
/// `model` is null or loaded; `triangles` and `nodes` null or writable for their lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_surface_topology(
    model: *const Model,
    triangles: *mut u32,
    triangles_len: usize,
    nodes: *mut u32,
    nodes_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let Some(model) = (unsafe { model.as_ref() }) else { return status::NULL_POINTER };
    let surface_nodes = &model.reduced.arrays().surface_nodes;
    let needed = (3 * model.triangles.len(), surface_nodes.len());
    if (!triangles.is_null() && triangles_len < needed.0)
        || (!nodes.is_null() && nodes_len < needed.1)
    {
        return status::SHORT_BUFFER;
    }
    if !triangles.is_null() {
        // SAFETY: not null, and at least as long as what is taken.
        let out = unsafe { std::slice::from_raw_parts_mut(triangles, needed.0) };
        for (out, t) in out.chunks_exact_mut(3).zip(&model.triangles) {
            let turned = if model.frame.is_reflected() { [t[0], t[2], t[1]] } else { *t };
            out.copy_from_slice(&turned);
        }
    }
    if !nodes.is_null() {
        // SAFETY: not null, and at least as long as what is taken.
        unsafe { std::slice::from_raw_parts_mut(nodes, needed.1) }.copy_from_slice(surface_nodes);
    }
    status::OK
}
