//! Contacts that hold the organ: their training, and the search for their equilibrium in a haptic loop.

use super::held::Held;
use super::{Hands, Refusal, free, hand_out, missing, refusal, tell};
use crate::frame::Frame;
use crate::status::{self, viscera_status};
use crate::{all_finite, put};
use std::ffi::{c_char, c_void};
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::Duration;
use viscera_galerkin::{Asked, HyperReducedModel};

/// `viscera_grasp`, opaque to C.
pub struct Grasp {
    model: HyperReducedModel,
    frame: Frame,
    /// Displacements of the contacts [m].
    d: Vec<[f64; 3]>,
    has_failed: bool,
    /// Status of the answer that was assessed last.
    verdict: Arc<AtomicI32>,
}

/// `struct viscera_grasp_state`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GraspState {
    pub contacts: u64,
    pub modes: u64,
    pub cells: u64,
    pub snapshots: u64,
    pub seconds: f64,
    pub training: i64,
}

const _: () = assert!(size_of::<GraspState>() == 48);

pub const TRAINING_OVER: i32 = 0;
pub const TRAINING_GOES_ON: i32 = 1;
pub const TRAINING_FAILED: i32 = 2;

/// Bits of what is asked of a search.
pub const FROM_LAST: i32 = 1;
pub const WITH_STIFFNESS: i32 = 2;

/// The caller's word on whether work goes on: 0 ends it.
type GoOn = Option<unsafe extern "C" fn(*mut c_void) -> i32>;

/// What the caller's function is called with, by any thread.
struct Context(*mut c_void);

// SAFETY: the caller's contract: the function may be called by several threads at once.
unsafe impl Sync for Context {}

impl Context {
    fn get(&self) -> *mut c_void {
        self.0
    }
}

impl Grasp {
    fn new(mut model: HyperReducedModel, frame: Frame) -> Self {
        model.stay_on_one_thread();
        let d = vec![[0.0; 3]; model.contacts().places().len()];
        let verdict = Arc::new(AtomicI32::new(status::OK));
        Grasp { model, frame, d, has_failed: false, verdict }
    }

    /// The equilibrium under `self.d`; the status is what is known of its worth.
    fn solve(&mut self, asked: Asked, held: &mut Held) -> viscera_status {
        let mut found = self.model.solve_into(&self.d, asked, &mut held.solution);
        if found.is_err() {
            // Training has failed: what was trained before stays.
            self.has_failed = true;
            found = self.model.solve_into(&self.d, asked, &mut held.solution);
        }
        let own = if found.is_ok() { held.status_of_search() } else { status::BAD_SETTING };
        match own {
            status::OK => self.verdict.load(Ordering::Relaxed),
            doubtful => doubtful,
        }
    }

    /// Takes the caller's displacements of all contacts.
    fn displace(&mut self, given: &[[f64; 3]]) -> Result<(), viscera_status> {
        for (d, &given) in self.d.iter_mut().zip(given) {
            *d = self.frame.length_in(given);
        }
        if all_finite(self.d.as_flattened()) { Ok(()) } else { Err(status::NOT_FINITE) }
    }

    fn state(&mut self) -> GraspState {
        let goes_on = self.model.is_training().unwrap_or_else(|_| {
            self.has_failed = true;
            false
        });
        let training = match (self.has_failed, goes_on) {
            (true, _) => TRAINING_FAILED,
            (false, true) => TRAINING_GOES_ON,
            (false, false) => TRAINING_OVER,
        };
        GraspState {
            contacts: self.d.len() as u64,
            modes: self.model.contacts().n_modes() as u64,
            cells: self.model.n_cells() as u64,
            snapshots: self.model.n_snapshots() as u64,
            seconds: self.model.seconds(),
            training: i64::from(training),
        }
    }
}

/// What is asked of a search by the caller's bits and seconds, 0 for no limit.
fn asked_of(bits: i32, budget: f64) -> Result<Asked, viscera_status> {
    if !(budget >= 0.0) || bits & !(FROM_LAST | WITH_STIFFNESS) != 0 {
        return Err(status::BAD_SETTING);
    }
    // One that is too long for a clock is none.
    let budget = if budget > 0.0 { Duration::try_from_secs_f64(budget).ok() } else { None };
    let (from_last, with_stiffness) = (bits & FROM_LAST != 0, bits & WITH_STIFFNESS != 0);
    Ok(Asked { from_last, with_stiffness, budget })
}

/// The contacts [m].
pub(super) unsafe fn contacts(
    hands: &Hands,
    points: *const f64,
    count: usize,
) -> Result<Vec<[f64; 3]>, Refusal> {
    if points.is_null() || count > isize::MAX as usize / size_of::<[f64; 3]>() {
        return Err(missing("contact points"));
    }
    // SAFETY: not null, and readable for `count` points by the caller's contract.
    let points = unsafe { std::slice::from_raw_parts(points.cast::<[f64; 3]>(), count) };
    Ok(points.iter().map(|&x| hands.frame.point_in(x)).collect())
}

/// Contacts take hold, and train on the thread that calls.
///
/// # Safety
/// `hands` is null or made; `points` is readable for `count` points or null; `go_on` is null or may be called with
/// `context` by several threads at once; `grasp` is null or writable, `message` writable for `message_len` or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_grasp_new(
    hands: *const Hands,
    points: *const f64,
    count: usize,
    go_on: GoOn,
    context: *mut c_void,
    grasp: *mut *mut Grasp,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    let context = Context(context);
    // SAFETY: the caller's contract, here and below.
    let is_wanted = || go_on.is_none_or(|go_on| unsafe { go_on(context.get()) != 0 });
    let make = || {
        let hands = unsafe { hands.as_ref() }.ok_or_else(|| missing("model to hold"))?;
        let points = unsafe { contacts(hands, points, count) }?;
        let model = hands.galerkin.grasp_while(&points, &is_wanted).map_err(refusal)?;
        Ok(Grasp::new(model, hands.frame))
    };
    unsafe { hand_out(make, grasp, message, message_len) }
}

/// Contacts take hold at once, and train on other threads while they are in use.
///
/// # Safety
/// As above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_grasp_in_background(
    hands: *const Hands,
    points: *const f64,
    count: usize,
    grasp: *mut *mut Grasp,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let make = || {
        let hands = unsafe { hands.as_ref() }.ok_or_else(|| missing("model to hold"))?;
        let points = unsafe { contacts(hands, points, count) }?;
        let model = hands.galerkin.grasp_in_background(&points).map_err(refusal)?;
        Ok(Grasp::new(model, hands.frame))
    };
    unsafe { hand_out(make, grasp, message, message_len) }
}

/// Lets go; null is nothing to do.
///
/// # Safety
/// `grasp` is null or made, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_grasp_free(grasp: *mut Grasp) {
    // SAFETY: the caller's contract.
    unsafe { free(grasp) }
}

/// Sizes and progress of training.
///
/// # Safety
/// `grasp` is null or made, `state` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_grasp_progress(
    grasp: *mut Grasp,
    state: *mut GraspState,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let told = unsafe { grasp.as_mut() }.map(Grasp::state);
    unsafe { put(state, told.unwrap_or_default()) };
    if told.is_none() || state.is_null() { status::NULL_POINTER } else { status::OK }
}

/// Adds the equilibrium nearest to the last answer as a snapshot, if the answer is wrong.
///
/// # Safety
/// `grasp` is null or made and used by nobody else, `added` null or writable, `message` writable for `message_len` or
/// null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_grasp_add_snapshot(
    grasp: *mut Grasp,
    added: *mut i32,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    unsafe { put(added, 0) };
    let work = || {
        let grasp = unsafe { grasp.as_mut() }.ok_or_else(|| missing("grasp"))?;
        let was_wrong = grasp.model.add_snapshot().map_err(refusal)?;
        unsafe { put(added, i32::from(was_wrong)) };
        Ok(())
    };
    unsafe { tell(work, message, message_len) }
}

/// The equilibrium under displacements of all contacts, or the status of a search that is refused.
///
/// # Safety
/// `grasp` is null or made, `displacements` null or readable for its length.
unsafe fn search(
    grasp: *mut Grasp,
    displacements: *const f64,
    displacements_len: usize,
    asked: Result<Asked, viscera_status>,
    held: &mut Held,
) -> Result<viscera_status, viscera_status> {
    // SAFETY: the caller's contract.
    let grasp = unsafe { grasp.as_mut() }.ok_or(status::NULL_POINTER)?;
    if !held.is_of(&grasp.verdict) {
        return Err(status::BAD_SETTING);
    }
    if displacements.is_null() {
        return Err(status::NULL_POINTER);
    }
    if displacements_len < 3 * grasp.d.len() {
        return Err(status::SHORT_BUFFER);
    }
    // SAFETY: at least as long as what is taken.
    let given = unsafe { std::slice::from_raw_parts(displacements.cast(), grasp.d.len()) };
    grasp.displace(given)?;
    Ok(grasp.solve(asked?, held))
}

/// Searches; what is read of `held` afterwards has the same status.
///
/// # Safety
/// `grasp` is null or made, `displacements` null or readable for its length, `held` null or made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_grasp_solve(
    grasp: *mut Grasp,
    displacements: *const f64,
    displacements_len: usize,
    asked: i32,
    budget: f64,
    held: *mut Held,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let Some(held) = (unsafe { held.as_mut() }) else { return status::NULL_POINTER };
    held.forget();
    let asked = asked_of(asked, budget);
    let found = unsafe { search(grasp, displacements, displacements_len, asked, held) };
    held.status = found.unwrap_or_else(|refusal| refusal);
    held.status
}

/// Room for an answer.
///
/// # Safety
/// `grasp` is null or made, `held` null or writable, `message` writable for `message_len` or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_held_new(
    grasp: *const Grasp,
    held: *mut *mut Held,
    message: *mut c_char,
    message_len: usize,
) -> viscera_status {
    // SAFETY: the caller's contract, here and below.
    let make = || {
        let grasp = unsafe { grasp.as_ref() }.ok_or_else(|| missing("grasp"))?;
        Ok(Held::new(grasp.model.room(), grasp.frame, Arc::clone(&grasp.verdict)))
    };
    unsafe { hand_out(make, held, message, message_len) }
}
