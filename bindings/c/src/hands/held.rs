//! An answer of a grasp: what a loop reads of it at once, and what the whole organ says of it.

use super::free;
use crate::frame::Frame;
use crate::model::finite_or_zero;
use crate::places::Places;
use crate::put;
use crate::status::{self, viscera_status};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use viscera_galerkin::{ReducedStatus, Solution, Trust};

/// `viscera_held`, opaque to C.
pub struct Held {
    pub(super) solution: Solution,
    /// Of the last search, also of one that was refused; not converged before the first.
    pub(super) status: viscera_status,
    frame: Frame,
    /// Checksum of its mesh, by which it knows places in another one.
    mesh: u32,
    /// Shared with the grasp.
    verdict: Arc<AtomicI32>,
}

/// `struct viscera_search`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SearchFacts {
    pub energy: f64,
    pub depth: f64,
    pub smallest_jacobian: f64,
    pub residual: f64,
    pub seconds: f64,
    pub iterations: u64,
    pub tangents: u64,
}

const _: () = assert!(size_of::<SearchFacts>() == 56);

impl Held {
    pub(super) fn new(solution: Solution, frame: Frame, verdict: Arc<AtomicI32>) -> Self {
        let mesh = solution.contacts.model().mesh_checksum();
        Held { solution, status: status::NOT_CONVERGED, frame, mesh, verdict }
    }

    /// Nothing is held until a search has been made.
    pub(super) fn forget(&mut self) {
        self.solution.forces.clear();
        self.solution.stiffness.clear();
    }

    /// Whether it was made for the grasp with this verdict, whose size and frame it has.
    pub(super) fn is_of(&self, verdict: &Arc<AtomicI32>) -> bool {
        Arc::ptr_eq(&self.verdict, verdict)
    }

    pub(super) fn status_of_search(&self) -> viscera_status {
        status_of(self.solution.trust_of_search())
    }

    fn has_answer(&self) -> bool {
        !self.solution.forces.is_empty()
    }

    fn n_points(&self) -> usize {
        self.solution.contacts.model().n_points()
    }

    /// Displacement of a node, in the caller's frame.
    fn moved(&self, node: usize) -> [f64; 3] {
        self.frame.length_out(self.solution.displacement_of(node))
    }

    /// The estimated error, and what the answer is worth.
    fn assess(&self) -> (f64, viscera_status) {
        if !self.has_answer() {
            return (1.0, self.status);
        }
        match self.solution.assess() {
            Ok(assessment) => (assessment.error(), status_of(assessment.trust)),
            Err(_) => (1.0, status::BAD_SETTING),
        }
    }
}

fn status_of(trust: Trust) -> viscera_status {
    match trust {
        Trust::Trusted => status::OK,
        Trust::NotConverged => status::NOT_CONVERGED,
        Trust::OutOfTime => status::OUT_OF_TIME,
        Trust::Inverted => status::INVERTED,
        Trust::BeyondDepth => status::BEYOND_DEPTH,
        Trust::Unstable => status::UNSTABLE,
        Trust::ErrorTooLarge => status::ERROR_TOO_LARGE,
    }
}

/// Numbers to write behind a pointer, if there is room for them.
///
/// # Safety
/// `out` is null or writable for `len` numbers.
unsafe fn room<'a, T>(
    out: *mut T,
    len: usize,
    needed: usize,
) -> Result<&'a mut [T], viscera_status> {
    if out.is_null() {
        return Err(status::NULL_POINTER);
    }
    if len < needed {
        return Err(status::SHORT_BUFFER);
    }
    // SAFETY: not null, and at least as long as what is taken.
    Ok(unsafe { std::slice::from_raw_parts_mut(out, needed) })
}

/// Frees the room of an answer; null is nothing to do.
///
/// # Safety
/// `held` is null or made, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_free(held: *mut Held) {
    // SAFETY: the caller's contract.
    unsafe { free(held) }
}

/// How the search went.
///
/// # Safety
/// `held` is null or made, `search` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_search(
    held: *const Held,
    search: *mut SearchFacts,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(held) = (unsafe { held.as_ref() }).filter(|_| !search.is_null()) else {
        unsafe { put(search, SearchFacts::default()) };
        return status::NULL_POINTER;
    };
    let solution = &held.solution;
    let mut told = SearchFacts::default();
    if held.has_answer() {
        told = SearchFacts {
            energy: held.frame.energy_out(solution.energy),
            depth: solution.depth / held.frame.metres_per_unit,
            smallest_jacobian: solution.smallest_jacobian,
            residual: solution.residual,
            seconds: solution.seconds,
            iterations: solution.iterations as u64,
            tangents: solution.tangents as u64,
        };
    }
    unsafe { put(search, told) };
    held.status
}

/// Force of each tool on the organ.
///
/// # Safety
/// `held` is null or made, `forces` null or writable for its length.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_forces(
    held: *const Held,
    forces: *mut f64,
    forces_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(held) = (unsafe { held.as_ref() }) else { return status::NULL_POINTER };
    let count = held.solution.contacts.places().len();
    match unsafe { room(forces, forces_len, 3 * count) } {
        Err(status) => status,
        Ok(out) => {
            out.fill(0.0);
            for (out, &f) in out.as_chunks_mut::<3>().0.iter_mut().zip(&held.solution.forces) {
                *out = held.frame.force_out(f);
            }
            finite_or_zero(held.status, out)
        }
    }
}

/// Derivative of the forces.
///
/// # Safety
/// `held` is null or made, `stiffness` null or writable for its length.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_stiffness(
    held: *const Held,
    stiffness: *mut f64,
    stiffness_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(held) = (unsafe { held.as_ref() }) else { return status::NULL_POINTER };
    let n = 3 * held.solution.contacts.places().len();
    let out = match unsafe { room(stiffness, stiffness_len, n * n) } {
        Err(status) => return status,
        Ok(out) => out,
    };
    out.fill(0.0);
    let given = &held.solution.stiffness;
    if given.is_empty() {
        // Where there is an equilibrium, it was not asked for.
        let is_known = held.solution.status == ReducedStatus::Converged && held.has_answer();
        return if is_known { status::BAD_SETTING } else { held.status };
    }
    for (a, b) in (0..n / 3).flat_map(|a| (0..n / 3).map(move |b| (3 * a, 3 * b))) {
        let block = std::array::from_fn(|i| std::array::from_fn(|j| given[(a + i) * n + b + j]));
        let turned = held.frame.stiffness_out(&block);
        (0..9).for_each(|k| out[(a + k / 3) * n + b + k % 3] = turned[k / 3][k % 3]);
    }
    finite_or_zero(held.status, out)
}

/// Displacement of all nodes.
///
/// # Safety
/// `held` is null or made, `moved` null or writable for its length.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_field(
    held: *const Held,
    moved: *mut f64,
    moved_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(held) = (unsafe { held.as_ref() }) else { return status::NULL_POINTER };
    let n = held.n_points();
    match unsafe { room(moved, moved_len, 3 * n) } {
        Err(status) => status,
        Ok(out) => {
            out.fill(0.0);
            if held.has_answer() {
                let nodes = out.as_chunks_mut::<3>().0.iter_mut().enumerate();
                nodes.for_each(|(node, out)| *out = held.moved(node));
            }
            finite_or_zero(held.status, out)
        }
    }
}

/// Positions of the surface nodes.
///
/// # Safety
/// `held` is null or made, `positions` null or writable for its length.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_surface(
    held: *const Held,
    positions: *mut f32,
    positions_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(held) = (unsafe { held.as_ref() }) else { return status::NULL_POINTER };
    let arrays = held.solution.contacts.model().arrays();
    let nodes = &arrays.surface_nodes;
    match unsafe { room(positions, positions_len, 3 * nodes.len()) } {
        Err(status) => status,
        Ok(out) => {
            for (out, &node) in out.as_chunks_mut::<3>().0.iter_mut().zip(nodes) {
                let node = node as usize;
                let rest = std::array::from_fn(|i| arrays.points[3 * node + i]);
                let u = if held.has_answer() { held.moved(node) } else { [0.0; 3] };
                let x = held.frame.point_out(rest);
                *out = std::array::from_fn(|i| (x[i] + u[i]) as f32);
            }
            finite_or_zero(held.status, out)
        }
    }
}

/// Displacement of places.
///
/// # Safety
/// `held` and `places` are null or made, `moved` null or writable for its length.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_places(
    held: *const Held,
    places: *const Places,
    moved: *mut f64,
    moved_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let (Some(held), Some(places)) = (unsafe { (held.as_ref(), places.as_ref()) }) else {
        return status::NULL_POINTER;
    };
    match unsafe { room(moved, moved_len, 3 * places.inside.len()) } {
        Err(status) => status,
        Ok(out) => {
            out.fill(0.0);
            if places.inside.mesh_checksum() != held.mesh {
                return status::BAD_SETTING;
            }
            if held.has_answer() {
                places.inside.interpolate(|node| held.moved(node), out.as_chunks_mut().0);
            }
            finite_or_zero(held.status, out)
        }
    }
}

/// What the whole organ says of an answer.
///
/// # Safety
/// `held` is null or made, `error_estimate` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_assess(
    held: *const Held,
    error_estimate: *mut f64,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(held) = (unsafe { held.as_ref() }) else {
        unsafe { put(error_estimate, 1.0) };
        return status::NULL_POINTER;
    };
    let broken = |_| (1.0, status::BAD_SETTING);
    let (error, verdict) = catch_unwind(AssertUnwindSafe(|| held.assess())).unwrap_or_else(broken);
    // Where the search itself has failed, nothing is learned of the model.
    if held.has_answer() && held.status_of_search() == status::OK {
        held.verdict.store(verdict, Ordering::Relaxed);
    }
    unsafe { put(error_estimate, error) };
    verdict
}
