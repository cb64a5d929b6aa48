//! Between the evaluator and a motor: a force limit, a rate limit, a watchdog and a passivity
//! controller.
//!
//! Trusted answers are followed. While answers are not trusted, the last trusted force stays,
//! because a series beyond its range may turn round and pull the hand in. Without any answer for
//! longer than the watchdog, the force fades linearly to zero. After a number that is not finite it
//! fades at once.
//!
//! A force that is constant for a step while the hand moves on gives back more energy than it took.
//! The work is counted by a passivity observer (Hannaford and Ryu, IEEE Trans. Robotics and
//! Automation 18, 2002), and a debt is paid by damping; but damping guesses the next move from the
//! last. The bound for any move is the ceiling of the force, which falls to zero as the debt
//! reaches its limit: from a debt `D`, a step `m` leads at most to `D + force_limit (1 - D /
//! energy_limit) |m|`.

use crate::status::{self, viscera_status};
use crate::{all_finite, norm, vector};

/// `struct viscera_guard`: settings first, then the state.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard {
    pub force_limit: f64,
    pub rate_limit: f64,
    pub watchdog: f64,
    pub fade: f64,
    /// Force given at the last step.
    pub force: [f64; 3],
    /// Last trusted force, at most the limit.
    pub target: [f64; 3],
    /// Time since the last answer [s].
    pub age: f64,
    /// Force lost per second while fading, 0 otherwise.
    pub fade_rate: f64,
    /// Largest debt of energy; 0 for a guard that does not count.
    pub energy_limit: f64,
    /// Largest damping that pays a debt.
    pub damping: f64,
    /// Work of the hand on the organ since the touch began; a debt where negative.
    pub energy: f64,
}

const _: () = assert!(size_of::<Guard>() == 120);

pub type Mode = i32;
pub const FOLLOWS: Mode = 0;
pub const LIMITS: Mode = 1;
pub const HOLDS: Mode = 2;
pub const FADES: Mode = 3;
pub const REFUSES: Mode = 4;
pub const DAMPS: Mode = 5;

/// The input of a step.
enum News {
    Trusted([f64; 3]),
    /// The tool is off the organ: the force to reach is zero.
    Free,
    NotTrusted,
    Nothing,
    Fault,
}

impl Guard {
    fn is_usable(&self) -> bool {
        let settings = [self.force_limit, self.rate_limit, self.watchdog, self.fade];
        settings.iter().all(|&s| s.is_finite() && s > 0.0)
            && all_finite(&self.force)
            && all_finite(&self.target)
            && self.age >= 0.0
            && self.fade_rate >= 0.0
            && [self.energy_limit, self.damping].iter().all(|&s| s.is_finite() && s >= 0.0)
            && self.energy.is_finite()
    }

    /// One step of a tool that moved since the last one.
    fn step_moved(&mut self, news: News, moved: Option<[f64; 3]>, dt: f64) -> Mode {
        if self.energy_limit == 0.0 || !self.is_usable() {
            return self.step(news, [0.0; 3], dt);
        }
        // Work that is not known cannot be counted.
        let Some(moved) = moved.filter(|m| all_finite(m) && norm(*m).is_finite()) else {
            return self.step(News::Fault, [0.0; 3], dt);
        };
        self.count(moved, dt);
        let is_free = matches!(news, News::Free);
        let payment = if is_free { [0.0; 3] } else { self.payment(moved, dt) };
        let mode = self.step(news, payment, dt);
        let given = self.force;
        self.force = held_below(given, self.ceiling());
        let is_owing = self.force != given || payment != [0.0; 3];
        if is_owing && [FOLLOWS, LIMITS, HOLDS].contains(&mode) { DAMPS } else { mode }
    }

    fn ceiling(&self) -> f64 {
        self.force_limit * (1.0 - self.debt() / self.energy_limit).max(0.0)
    }

    fn debt(&self) -> f64 {
        (-self.energy).max(0.0)
    }

    /// Adds the work of the force that was held during the step. Without force a touch is over: its
    /// energy is not available to the next touch, and a debt is forgiven in the time of a fade,
    /// about as much as the friction of a device takes.
    fn count(&mut self, moved: [f64; 3], dt: f64) {
        self.energy += (0..3).map(|i| self.force[i] * moved[i]).sum::<f64>();
        if self.force == [0.0; 3] && dt >= 0.0 {
            let forgiven = self.energy_limit * (dt / self.fade);
            self.energy = -(self.debt() - forgiven).max(0.0);
        }
        if !self.energy.is_finite() {
            self.energy = -self.energy_limit;
        }
    }

    /// The damping force that would pay the debt if the hand went on as it did.
    fn payment(&self, moved: [f64; 3], dt: f64) -> [f64; 3] {
        let square = moved.iter().map(|m| m * m).sum::<f64>();
        if !(square > 0.0) {
            return [0.0; 3];
        }
        let share = (self.damping / dt).min(self.debt() / square);
        moved.map(|m| if share.is_finite() { share * m } else { 0.0 })
    }

    /// One step; `damping` is a force that is added to the answer's.
    fn step(&mut self, news: News, damping: [f64; 3], dt: f64) -> Mode {
        // A clock that runs backwards leaves no time to fade in.
        if !(self.is_usable() && dt.is_finite() && dt >= 0.0) {
            self.force = [0.0; 3];
            self.target = [0.0; 3];
            self.fade_rate = 0.0;
            return REFUSES;
        }
        self.age = match news {
            News::Trusted(_) | News::Free | News::NotTrusted => dt,
            News::Nothing => self.age + dt,
            News::Fault => f64::INFINITY,
        };
        let wanted = match news {
            News::Fault => return self.fade_out(dt),
            _ if self.age > self.watchdog => return self.fade_out(dt),
            News::Trusted(force) => force,
            News::Free => [0.0; 3],
            News::NotTrusted | News::Nothing => self.target,
        };
        self.fade_rate = 0.0;
        self.target = held_below(wanted, self.force_limit);
        let damped = std::array::from_fn(|i| self.target[i] + damping[i]);
        let goal = held_below(damped, self.force_limit);
        let change = std::array::from_fn(|i| goal[i] - self.force[i]);
        let step = shortened(change, self.rate_limit * dt);
        self.force = std::array::from_fn(|i| self.force[i] + step[i]);
        // Rounding must not carry the force over the limit.
        self.force = held_below(self.force, self.force_limit);
        match news {
            News::NotTrusted | News::Nothing => HOLDS,
            _ if self.target != wanted || goal != damped || step != change => LIMITS,
            _ => FOLLOWS,
        }
    }

    /// One step of the linear fade to zero.
    fn fade_out(&mut self, dt: f64) -> Mode {
        let size = norm(self.force);
        if self.fade_rate == 0.0 {
            self.fade_rate = size / self.fade;
        }
        self.target = [0.0; 3];
        self.force = shortened(self.force, (size - self.fade_rate * dt).max(0.0));
        FADES
    }
}

/// The vector, shortened to at most `length`; zero if its own length overflows.
fn shortened(v: [f64; 3], length: f64) -> [f64; 3] {
    let size = norm(v);
    if size <= length {
        v
    } else if size.is_finite() {
        v.map(|x| x * (length / size))
    } else {
        [0.0; 3]
    }
}

/// The vector with a length of at most `limit`, however that is computed. What is rounded past the limit is longer than
/// `WITHIN`, and what is shortened to `SHORTENED` is not, so that it is not shortened again.
pub fn held_below(v: [f64; 3], limit: f64) -> [f64; 3] {
    const WITHIN: f64 = 1.0 - 4.0 * f64::EPSILON;
    const SHORTENED: f64 = 1.0 - 12.0 * f64::EPSILON;
    // A length along an axis has no rounding.
    let is_exact = v.iter().filter(|&&x| x != 0.0).count() < 2;
    let most = if is_exact { limit } else { limit * WITHIN };
    if norm(v) <= most { v } else { shortened(v, limit * SHORTENED) }
}

/// Sets up a guard at rest; one with settings that are not positive gives no force.
///
/// # Safety
/// `guard` is null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_guard_init(
    guard: *mut Guard,
    force_limit: f64,
    rate_limit: f64,
    watchdog: f64,
    fade: f64,
) -> viscera_status {
    let fresh = Guard {
        force_limit,
        rate_limit,
        watchdog,
        fade,
        force: [0.0; 3],
        target: [0.0; 3],
        age: 0.0,
        fade_rate: 0.0,
        energy_limit: 0.0,
        damping: 0.0,
        energy: 0.0,
    };
    // SAFETY: the caller's contract.
    unsafe { crate::put(guard, fresh) };
    match guard.is_null() {
        true => status::NULL_POINTER,
        false if fresh.is_usable() => status::OK,
        false => status::BAD_SETTING,
    }
}

/// Lets a guard count energy; settings that are out of range leave it without force.
///
/// # Safety
/// `guard` is null or set up.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_guard_keep_passive(
    guard: *mut Guard,
    energy_limit: f64,
    damping: f64,
) -> viscera_status {
    // SAFETY: the caller's contract.
    let Some(guard) = (unsafe { guard.as_mut() }) else { return status::NULL_POINTER };
    // Asked for none, a guard must not go on without counting.
    guard.energy_limit = if energy_limit > 0.0 { energy_limit } else { f64::NAN };
    (guard.damping, guard.energy) = (damping, 0.0);
    if guard.is_usable() { status::OK } else { status::BAD_SETTING }
}

/// The force to send to the device after `dt` seconds.
///
/// # Safety
/// `guard` is null or writable, `force_in` null or readable, `force_out` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_guard_step(
    guard: *mut Guard,
    force_in: *const f64,
    status: viscera_status,
    dt: f64,
    force_out: *mut f64,
) -> Mode {
    // SAFETY: the caller's contract.
    unsafe { viscera_guard_step_moved(guard, force_in, status, std::ptr::null(), dt, force_out) }
}

/// The same for a tool that moved by `moved` since the last step.
///
/// # Safety
/// As above; `moved` is null or readable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viscera_guard_step_moved(
    guard: *mut Guard,
    force_in: *const f64,
    status: viscera_status,
    moved: *const f64,
    dt: f64,
    force_out: *mut f64,
) -> Mode {
    // SAFETY: the caller's contract, here and below.
    let (force, moved) = unsafe { (vector(force_in), vector(moved)) };
    let news = match (status, force) {
        (status::OK, Some(force)) if all_finite(&force) => News::Trusted(force),
        (
            status::BEYOND_DEPTH
            | status::ERROR_TOO_LARGE
            | status::NOT_CONVERGED
            | status::OUT_OF_TIME
            | status::INVERTED
            | status::UNSTABLE,
            Some(force),
        ) if all_finite(&force) => News::NotTrusted,
        (status::OFF_SURFACE, _) => News::Free,
        (status::STALE, _) => News::Nothing,
        _ => News::Fault,
    };
    let (mode, force) = match unsafe { guard.as_mut() } {
        Some(guard) => (guard.step_moved(news, moved, dt), guard.force),
        None => (REFUSES, [0.0; 3]),
    };
    unsafe { crate::put(force_out.cast::<[f64; 3]>(), force) };
    mode
}
