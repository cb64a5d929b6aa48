//! What C programs cannot see: allocations, and the guard step by step.

#[path = "../../../core/tests/block/mod.rs"]
mod block;
#[path = "../../../core/tests/counting/mod.rs"]
mod counting;

use crate::field::*;
use crate::guard::*;
use crate::load::{viscera_free, viscera_load};
use crate::model::*;
use crate::norm;
use crate::places::*;
use crate::probe::*;
use crate::status;
use block::{SIZE, block};
use counting::allocations;
use std::ptr;
use viscera_core::mesh::samples;
use viscera_core::reduced::recompressed;

#[test]
fn a_tick_allocates_nothing() {
    let bytes = block().to_bytes().unwrap();
    let mut model = ptr::null_mut();
    // SAFETY: all pointers of this test are to living values of the stated lengths.
    let loaded =
        unsafe { viscera_load(bytes.as_ptr(), bytes.len(), &mut model, ptr::null_mut(), 0) };
    assert_eq!(loaded, status::OK);
    let mut info = Info::default();
    unsafe { viscera_info(model, &mut info) };
    let mut workspace = vec![0.0f32; unsafe { viscera_workspace_size(model) }];
    let mut positions = vec![0.0f32; 3 * info.surface_nodes as usize];
    let mut field_workspace = vec![0.0f32; unsafe { viscera_field_workspace_size(model) }];
    let mut field = vec![0.0f32; 3 * info.points as usize];
    let (inside, mut places, mut moved) = (SIZE.map(|x| 0.4 * x), ptr::null_mut(), [0.0; 3]);
    let found =
        unsafe { viscera_places_at(model, inside.as_ptr(), 1, &mut places, ptr::null_mut(), 0) };
    assert_eq!(found, status::OK);
    let mut guard = guard();
    let mut seen = [0; 10];
    for random in samples::noise(1800, 1).chunks_exact(6) {
        let point: [f64; 3] = std::array::from_fn(|i| SIZE[i] * (0.5 + 1.2 * random[i]));
        let d: [f64; 3] = std::array::from_fn(|i| 0.006 * random[3 + i]);
        let mut answer = std::mem::MaybeUninit::<Answer>::zeroed();
        let mut force = [0.0; 3];
        let (count, status) = allocations(|| unsafe {
            let status = viscera_evaluate(model, point.as_ptr(), d.as_ptr(), answer.as_mut_ptr());
            let force_in = (*answer.as_ptr()).force.as_ptr();
            viscera_guard_step(&mut guard, force_in, status, 1e-3, force.as_mut_ptr());
            let drawn = viscera_surface(
                model,
                point.as_ptr(),
                d.as_ptr(),
                workspace.as_mut_ptr(),
                workspace.len(),
                positions.as_mut_ptr(),
                positions.len(),
            );
            assert!(
                drawn == status || drawn == status::ERROR_TOO_LARGE,
                "the shape has an error of its own"
            );
            let of_all = viscera_field(
                model,
                point.as_ptr(),
                d.as_ptr(),
                field_workspace.as_mut_ptr(),
                field_workspace.len(),
                field.as_mut_ptr(),
                field.len(),
            );
            let of_places = viscera_places_displacement(
                places,
                point.as_ptr(),
                d.as_ptr(),
                moved.as_mut_ptr(),
                moved.len(),
            );
            assert!(of_all == drawn && of_places == drawn);
            let mut energy = 0.0;
            assert_eq!(viscera_energy(model, point.as_ptr(), d.as_ptr(), &mut energy), status);
            assert!(energy.is_finite() && (energy == 0.0) == (status == status::OFF_SURFACE));
            status
        });
        assert_eq!(count, 0);
        seen[status as usize] += 1;
    }
    let reached = [status::OK, status::BEYOND_DEPTH, status::OFF_SURFACE];
    assert!(reached.iter().all(|&s| seen[s as usize] > 5), "every branch was taken: {seen:?}");
    unsafe {
        viscera_places_free(places);
        viscera_free(model);
    };
}

/// Status and sentence of a load.
fn load(bytes: &[u8]) -> (i32, String) {
    let (mut model, mut message) = (ptr::null_mut(), [0u8; 256]);
    // SAFETY: all pointers are to living values of the stated lengths, and the message ends with a zero.
    let status = unsafe {
        let place = message.as_mut_ptr().cast();
        let status = viscera_load(bytes.as_ptr(), bytes.len(), &mut model, place, message.len());
        assert_eq!(model.is_null(), status != status::OK);
        viscera_free(model);
        status
    };
    let end = message.iter().position(|&byte| byte == 0).unwrap();
    (status, String::from_utf8_lossy(&message[..end]).into_owned())
}

#[test]
fn a_flipped_bit_is_refused_and_a_file_without_checksums_comes_with_a_warning() {
    let bytes = block().to_bytes().unwrap();
    assert_eq!(load(&bytes), (status::OK, String::new()));
    for place in (0..bytes.len()).step_by(bytes.len() / 97) {
        let mut damaged = bytes.clone();
        damaged[place] ^= 1 << (place % 8);
        let (status, sentence) = load(&damaged);
        assert!(status == status::BAD_MODEL && !sentence.is_empty(), "byte {place}: {sentence}");
    }
    let (status, sentence) = load(include_bytes!("../../../tests/data/format-1.viscera"));
    assert!(status == status::OK && sentence.contains("no checksums"), "{sentence}");
}

/// Of a model with few modes: the force is trusted as before, its shape is not.
#[test]
fn force_and_shape_have_a_status_of_their_own() {
    let full = block();
    let models = [full.to_bytes(), recompressed(&full, 0.3).unwrap().to_bytes()];
    let [mut trusted, mut drawn] = [[0; 2]; 2];
    for (which, bytes) in models.into_iter().enumerate() {
        let model = Model::from_bytes(&bytes.unwrap()).unwrap();
        for random in samples::noise(600, 2).chunks_exact(3) {
            let point = [0.5 * SIZE[0], 0.5 * SIZE[1], SIZE[2]];
            let d: [f64; 3] = std::array::from_fn(|i| 0.002 * random[i]);
            let (forces, shapes) = statuses(&model, point, d);
            trusted[which] += usize::from(forces == status::OK);
            drawn[which] += usize::from(shapes == status::OK);
        }
    }
    assert!(trusted[0] > 20 && trusted[0] == trusted[1], "{trusted:?}");
    assert!(drawn[0] > 20 && drawn[1] < drawn[0] / 2, "{drawn:?}");
}

/// What the two calls return for a touch.
fn statuses(model: &Model, point: [f64; 3], d: [f64; 3]) -> (i32, i32) {
    let mut answer = std::mem::MaybeUninit::<Answer>::zeroed();
    let mut info = Info::default();
    // SAFETY: all pointers are to living values of the stated lengths.
    unsafe {
        viscera_info(model, &mut info);
        let mut workspace = vec![0.0f32; viscera_workspace_size(model)];
        let mut positions = vec![0.0f32; 3 * info.surface_nodes as usize];
        let (w, p) = (workspace.as_mut_slice(), positions.as_mut_slice());
        let status = viscera_evaluate(model, point.as_ptr(), d.as_ptr(), answer.as_mut_ptr());
        let (w, p) = ((w.as_mut_ptr(), w.len()), (p.as_mut_ptr(), p.len()));
        (status, viscera_surface(model, point.as_ptr(), d.as_ptr(), w.0, w.1, p.0, p.1))
    }
}

/// At most 10 N, 1000 N/s; 5 ms of patience, 20 ms to fade.
fn guard() -> Guard {
    let mut guard = std::mem::MaybeUninit::uninit();
    // SAFETY: the guard is writable, and written by the call.
    unsafe {
        assert_eq!(viscera_guard_init(guard.as_mut_ptr(), 10.0, 1e3, 5e-3, 20e-3), status::OK);
        guard.assume_init()
    }
}

/// One millisecond; the mode and the force's third component.
fn step(guard: &mut Guard, force: f64, status: i32) -> (Mode, f64) {
    let (force, mut out) = ([0.0, 0.0, force], [f64::NAN; 3]);
    // SAFETY: the arrays live, and have three numbers each.
    let mode = unsafe { viscera_guard_step(guard, force.as_ptr(), status, 1e-3, out.as_mut_ptr()) };
    assert_eq!(out, guard.force);
    (mode, out[2])
}

fn near(found: (Mode, f64), mode: Mode, force: f64) {
    assert!(found.0 == mode && (found.1 - force).abs() < 1e-12, "{found:?}, not {mode} {force}");
}

#[test]
fn a_guard_limits_rate_and_force() {
    let mut guard = guard();
    near(step(&mut guard, -0.5, status::OK), FOLLOWS, -0.5);
    near(step(&mut guard, -3.0, status::OK), LIMITS, -1.5);
    near(step(&mut guard, -2.0, status::OK), FOLLOWS, -2.0);
    for _ in 0..20 {
        step(&mut guard, -50.0, status::OK);
    }
    near(step(&mut guard, -50.0, status::OK), LIMITS, -10.0);
    near(step(&mut guard, -50.0, status::OFF_SURFACE), LIMITS, -9.0);
}

#[test]
fn what_is_not_trusted_leaves_the_last_trusted_force() {
    let mut guard = guard();
    near(step(&mut guard, -0.8, status::OK), FOLLOWS, -0.8);
    for status in [status::BEYOND_DEPTH, status::ERROR_TOO_LARGE] {
        for _ in 0..50 {
            near(step(&mut guard, 9.0, status), HOLDS, -0.8);
        }
    }
    near(step(&mut guard, -0.9, status::OK), FOLLOWS, -0.9);
}

#[test]
fn a_stale_force_stays_for_the_watchdog_then_fades_linearly() {
    let mut guard = guard();
    near(step(&mut guard, -1.0, status::OK), FOLLOWS, -1.0);
    for _ in 0..4 {
        near(step(&mut guard, f64::NAN, status::STALE), HOLDS, -1.0);
    }
    for tick in 1..=20 {
        let expected = -1.0 + f64::from(tick) / 20.0;
        near(step(&mut guard, f64::NAN, status::STALE), FADES, expected);
    }
    near(step(&mut guard, f64::NAN, status::STALE), FADES, 0.0);
    near(step(&mut guard, -3.0, status::OK), LIMITS, -1.0);
}

#[test]
fn faults_fade_at_once() {
    for (force, status) in [
        (f64::NAN, status::OK),
        (f64::INFINITY, status::BEYOND_DEPTH),
        (-1.0, status::NOT_FINITE),
        (-1.0, status::NULL_POINTER),
        (-1.0, 77),
    ] {
        let mut guard = guard();
        step(&mut guard, -1.0, status::OK);
        near(step(&mut guard, force, status), FADES, -0.95);
        near(step(&mut guard, 0.0, status::STALE), FADES, -0.9);
    }
}

#[test]
fn a_broken_clock_gives_no_force() {
    let force = [0.0, 0.0, -1.0];
    for (dt, mode) in
        [(-1e-3, REFUSES), (f64::NAN, REFUSES), (f64::INFINITY, REFUSES), (1.0, FADES)]
    {
        let (mut guard, mut out) = (guard(), [f64::NAN; 3]);
        step(&mut guard, -1.0, status::OK);
        // SAFETY: the arrays live, and have three numbers each.
        let done = unsafe {
            viscera_guard_step(&mut guard, force.as_ptr(), status::OK, dt, out.as_mut_ptr())
        };
        assert_eq!((done, out), (mode, [0.0; 3]), "after {dt} s");
    }
}

/// Whether a force is within a limit to the last digit, however its norm is computed.
fn is_within(force: [f64; 3], limit: f64) -> bool {
    let [x, y, z] = force;
    let fused = z.mul_add(z, y.mul_add(y, x * x)).sqrt();
    let norms = [norm(force), norm_of(force), fused, x.hypot(y).hypot(z)];
    norms.iter().all(|&size| size <= limit)
}

#[test]
fn a_force_beyond_the_limit_is_shortened_once_and_one_at_the_limit_is_not() {
    for random in samples::noise(3000, 4).chunks_exact(3) {
        let limit = 5.0;
        let force: [f64; 3] = std::array::from_fn(|i| 50.0 * random[i]);
        let held = held_below(force, limit);
        assert!(is_within(held, limit), "{held:?}");
        assert!(norm(force) < limit || norm(held) > limit * (1.0 - 1e-14), "{held:?}");
        assert_eq!(held_below(held, limit), held);
    }
    assert_eq!(held_below([0.0, 0.0, -5.0], 5.0), [0.0, 0.0, -5.0]);
}

#[test]
fn no_sequence_gives_more_than_the_limits() {
    let mut guard = guard();
    let mut last = [0.0; 3];
    for (k, random) in samples::noise(4000, 2).chunks_exact(4).enumerate() {
        let force: [f64; 3] = std::array::from_fn(|i| 10f64.powf(4.0 * random[3]) * random[i]);
        let (status, mut out) = ([0, 0, 0, 1, 2, 3, 9][k % 7], [0.0; 3]);
        // SAFETY: the arrays live, and have three numbers each.
        unsafe {
            viscera_guard_step(&mut guard, force.as_ptr(), status, 1e-3, out.as_mut_ptr());
        }
        let change = crate::norm(std::array::from_fn(|i| out[i] - last[i]));
        assert!(is_within(out, 10.0), "{out:?}");
        assert!(change <= 1.0 + 1e-12, "{change} N in a millisecond");
        last = out;
    }
}

fn step_moved(guard: &mut Guard, force: [f64; 3], moved: [f64; 3]) -> (Mode, [f64; 3]) {
    let (moved, mut out) = (moved.as_ptr(), [f64::NAN; 3]);
    // SAFETY: the arrays live, and have three numbers each.
    let mode = unsafe {
        let (force, out) = (force.as_ptr(), out.as_mut_ptr());
        viscera_guard_step_moved(guard, force, status::OK, moved, 1e-3, out)
    };
    (mode, out)
}

fn passive(energy_limit: f64, damping: f64) -> Guard {
    let mut guard = guard();
    // SAFETY: the guard lives.
    let done = unsafe { viscera_guard_keep_passive(&mut guard, energy_limit, damping) };
    assert_eq!(done, status::OK);
    guard
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

#[test]
fn a_debt_is_paid_by_damping() {
    let mut guard = passive(1e-3, 2.0);
    let (force, still) = ([0.0, 0.0, -1.0], [0.0; 3]);
    assert_eq!(step_moved(&mut guard, force, still), (FOLLOWS, force));
    // Pressed in by 0.2 mm, let out by 0.5 mm, all at 1 N: 0.3 mJ owed.
    assert_eq!(step_moved(&mut guard, force, [0.0, 0.0, -2e-4]).0, FOLLOWS);
    let (mode, out) = step_moved(&mut guard, force, [0.0, 0.0, 5e-4]);
    assert!(mode == DAMPS && (guard.energy + 3e-4).abs() < 1e-12);
    // 2 N s/m would be 1 N at 0.5 m/s; 0.3 mJ over the next 0.5 mm are 0.6 N.
    assert!((out[2] + 0.4).abs() < 1e-12, "{out:?}");
    step_moved(&mut guard, still, [0.0, 0.0, 5e-4]);
    assert!((guard.energy + 5e-4).abs() < 1e-12, "held down by the rate limit, it went on owing");
}

/// Whatever the hand does: an adversary that moves with the force it has just been given.
#[test]
fn no_hand_wins_more_than_the_energy_limit() {
    for damping in [0.0, 3.0] {
        let (mut guard, mut won, mut most) = (passive(1e-3, damping), 0.0, 0.0f64);
        let (mut force, mut forgiven) = ([0.0; 3], 0.0);
        for (k, random) in samples::noise(18000, 5).chunks_exact(6).enumerate() {
            let size = 1e-4 * random[3].abs(); // no more than 1 mJ at 10 N
            let against = dot(force, force).sqrt().max(1e-12);
            let moved = match k % 7 {
                0 => std::array::from_fn(|i| size * random[i] / 2.0),
                _ => force.map(|f| -size * f / against),
            };
            won -= dot(force, moved);
            // 1 mJ in 20 ms without force.
            forgiven += if force == [0.0; 3] { 5e-5 } else { 0.0 };
            most = most.max(won - forgiven);
            let field = std::array::from_fn(|i| 20.0 * random[i]);
            force = step_moved(&mut guard, field, moved).1;
            assert!(is_within(force, 10.0), "{force:?}");
        }
        assert!(most <= 1e-3 * (1.0 + 1e-9), "{most} J");
        assert!(most > 0.9e-3, "the adversary is no good: {most} J");
    }
}

fn norm_of(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

#[test]
fn work_that_is_not_known_lets_the_force_fade() {
    let force = [0.0, 0.0, -1.0];
    for moved in [[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0], [f64::MAX; 3]] {
        let mut guard = passive(1e-3, 1.0);
        step_moved(&mut guard, force, [0.0; 3]);
        let (mode, out) = step_moved(&mut guard, force, moved);
        assert!(mode == FADES && out[2] > -1.0, "{moved:?}: {mode} {out:?}");
    }
    let mut guard = passive(1e-3, 1.0);
    assert_eq!(step(&mut guard, -1.0, status::OK).0, FADES, "no movement given at all");
}

#[test]
fn a_free_hand_is_forgiven_and_lent_nothing() {
    let mut guard = passive(1e-3, 0.0);
    let (force, still) = ([0.0, 0.0, -0.5], [0.0; 3]);
    step_moved(&mut guard, force, still);
    step_moved(&mut guard, still, [0.0, 0.0, -1e-3]);
    assert!((guard.energy - 5e-4).abs() < 1e-12);
    step_moved(&mut guard, force, still);
    assert_eq!(guard.energy, 0.0, "what the last touch took is not lent to the next");
    step_moved(&mut guard, still, [0.0, 0.0, 8e-4]);
    assert!((guard.energy + 4e-4).abs() < 1e-12);
    // 1 mJ in 20 ms, the time of a fade.
    for tick in 1..=10 {
        step_moved(&mut guard, still, still);
        assert!((guard.energy - (-4e-4 + 5e-5 * f64::from(tick)).min(0.0)).abs() < 1e-12);
    }
}

#[test]
fn a_tick_of_a_probe_allocates_nothing_and_its_guard_stays_passive() {
    let bytes = block().to_bytes().unwrap();
    let (mut model, mut probe) = (ptr::null_mut(), ptr::null_mut());
    let (force_limit, energy_limit, step) = (2.0, 1e-4, 1e-3);
    let mut guard = guard();
    // SAFETY: all pointers of this test are to living values of the stated lengths.
    unsafe {
        viscera_load(bytes.as_ptr(), bytes.len(), &mut model, ptr::null_mut(), 0);
        let made = viscera_probe_new(model, 0.012, 0.3, &mut probe, ptr::null_mut(), 0);
        assert_eq!(made, status::OK);
        assert_eq!(viscera_probe_couple(probe, 300.0, 1.0), status::OK);
        viscera_guard_init(&mut guard, force_limit, 1e4, 0.02, 0.1);
        assert_eq!(viscera_guard_keep_passive(&mut guard, energy_limit, 2.0), status::OK);
    }
    let home = [0.5 * SIZE[0], 0.5 * SIZE[1], SIZE[2] + 0.011];
    let (mut hand, mut energy, mut lowest, mut longest) = (home, 0.0f64, 0.0f64, 0.0f64);
    let (mut force, mut touching) = ([0.0; 3], 0);
    for random in samples::noise(30_000, 3).chunks_exact(3) {
        let moved: [f64; 3] =
            std::array::from_fn(|i| 6e-4 * random[i] + 0.02 * (home[i] - hand[i]));
        hand = std::array::from_fn(|i| hand[i] + moved[i]);
        // The force of the last step acted while the hand moved.
        energy += (0..3).map(|i| force[i] * moved[i]).sum::<f64>();
        (lowest, longest) = (lowest.min(energy), longest.max(norm(moved)));
        let mut felt = std::mem::MaybeUninit::<Felt>::zeroed();
        let (count, ()) = allocations(|| unsafe {
            let status = viscera_probe_follow(probe, hand.as_ptr(), step, felt.as_mut_ptr());
            let (given, by) = ((*felt.as_ptr()).force.as_ptr(), moved.as_ptr());
            viscera_guard_step_moved(&mut guard, given, status, by, step, force.as_mut_ptr());
        });
        assert_eq!(count, 0);
        touching += usize::from(norm(force) > 0.0);
        assert!(is_within(force, force_limit), "{force:?}");
        if force == [0.0; 3] {
            energy = 0.0; // a touch is over
        }
    }
    assert!((1000..9900).contains(&touching), "{touching} ticks in touch");
    let bound = energy_limit.max(force_limit * longest);
    assert!(lowest >= -bound * (1.0 + 1e-9), "{lowest} J, at most {bound} J may be given out");
    unsafe {
        viscera_probe_free(probe);
        viscera_free(model);
    }
}
