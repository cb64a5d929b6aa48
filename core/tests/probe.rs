//! A rigid probe on the model of a block: it presses, sticks, slides, lets go, and answers whatever it is told.

mod block;
mod counting;

use block::{SIZE, block};
use counting::allocations;
use viscera_core::mesh::samples;
use viscera_core::reduced::{Beside, Coupling, Felt, Grip, Probe, ReducedModel, TOLERANCE, Trust};

const RADIUS: f64 = 0.012;
const MIDDLE: [f64; 3] = [0.5 * SIZE[0], 0.5 * SIZE[1], SIZE[2] + RADIUS];

fn probe(model: &ReducedModel, friction: f64) -> Probe {
    Probe::new(model, RADIUS, friction, TOLERANCE, None).unwrap()
}

fn above(x: f64, y: f64, entered: f64) -> [f64; 3] {
    [MIDDLE[0] + x, MIDDLE[1] + y, MIDDLE[2] - entered]
}

fn size(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The force along the top of the block, and onto it.
fn parts(felt: &Felt) -> (f64, f64) {
    ((felt.force[0].powi(2) + felt.force[1].powi(2)).sqrt(), -felt.force[2])
}

#[test]
fn it_presses_from_its_first_touch_on_without_a_jump() {
    let model = block();
    let mut probe = probe(&model, 0.0);
    let mut last = 0.0;
    for n in 0..=300 {
        let entered = 1e-5 * (f64::from(n) - 50.0);
        let felt = probe.place(&model, above(0.0, 0.0, entered));
        assert!((felt.gap + entered).abs() < 1e-12);
        let (along, onto) = parts(&felt);
        assert_eq!(along, 0.0, "without friction there is no force along the surface");
        assert_eq!(felt.grip == Grip::Free, onto == 0.0);
        assert!(onto >= last && onto - last < 0.02, "{onto} N after {last} N");
        assert!(felt.trust == Trust::Trusted, "{felt:?}");
        last = onto;
    }
    assert!(last > 0.1, "{last} N");
}

#[test]
fn the_force_is_in_the_cone_and_the_probe_sticks_before_it_slides() {
    let model = block();
    let friction = 0.3;
    let mut probe = probe(&model, friction);
    probe.place(&model, above(-0.005, 0.0, 0.002));
    let (mut sticks, mut slides) = (0, 0);
    for n in 0..=100 {
        let felt = probe.place(&model, above(-0.005 + 1e-4 * f64::from(n), 0.0, 0.002));
        let (along, onto) = parts(&felt);
        assert!(along <= friction * onto * (1.0 + 1e-9), "{along} N along, {onto} N onto");
        assert!(felt.force[0] >= 0.0, "the organ is dragged where the probe goes");
        match felt.grip {
            Grip::Sticks => {
                assert_eq!(slides, 0, "the drag only grows");
                sticks += 1;
            }
            Grip::Slides => {
                assert!(along > 0.9 * friction * onto, "it slides on the cone: {along} of {onto}");
                slides += 1;
            }
            other => panic!("{other:?}"),
        }
        let torque = RADIUS * along;
        assert!(
            (size(felt.torque) - torque).abs() < 1e-12,
            "torque of the force along the surface"
        );
    }
    assert!(sticks > 3 && slides > 30, "{sticks} ticks stuck, {slides} slid");
    let back = probe.place(&model, above(0.005 - 1e-4, 0.0, 0.002));
    assert_eq!(back.grip, Grip::Sticks, "backwards it sticks first");
    let off = probe.place(&model, above(0.005, 0.0, -0.001));
    assert_eq!((off.grip, off.force), (Grip::Free, [0.0; 3]));
}

#[test]
fn more_friction_holds_longer_and_none_does_not_hold() {
    let model = block();
    let dragged = |friction: f64| {
        let mut probe = probe(&model, friction);
        probe.place(&model, above(0.0, 0.0, 0.002));
        let ways = (1..=20).map(|n| above(1e-4 * f64::from(n), 0.0, 0.002));
        ways.map(|center| parts(&probe.place(&model, center)).0).last().unwrap()
    };
    let forces = [0.0, 0.1, 0.2, 0.4, 100.0].map(dragged);
    assert_eq!(forces[0], 0.0);
    assert!(forces.windows(2).all(|pair| pair[1] >= pair[0]), "{forces:?}");
    assert!(forces[4] > forces[1], "{forces:?}");
}

/// The patch does not know how stiff a support is: its force is not trusted where the sphere contains a fixed node.
#[test]
fn it_is_not_trusted_where_the_organ_is_fixed() {
    let (metadata, mut arrays) = block().into_parts();
    let is_corner = |n: &usize| arrays.points[3 * n..3 * n + 3] == [SIZE[0], SIZE[1], SIZE[2]];
    arrays.fixed.push((0..arrays.points.len() / 3).find(is_corner).unwrap() as u32);
    let model = ReducedModel::new(metadata, arrays).unwrap();
    let mut probe = probe(&model, 0.0);
    let (mut trusted, mut at_support) = (0, 0);
    for n in 0..=100 {
        let way = f64::from(n) / 100.0;
        let center = above(0.018 * way, 0.013 * way, 0.002);
        let felt = probe.place(&model, center);
        let away: [f64; 3] = std::array::from_fn(|i| center[i] - SIZE[i]);
        assert_eq!(felt.beside == Beside::Support, size(away) < RADIUS);
        if felt.beside == Beside::Support {
            at_support += 1;
            assert_eq!((felt.trust, felt.error_estimate), (Trust::ErrorTooLarge, 1.0));
            assert_eq!((felt.shape_trust, felt.shape_error_estimate), (Trust::ErrorTooLarge, 1.0));
        } else {
            trusted += usize::from(felt.trust == Trust::Trusted);
        }
        assert!(parts(&felt).1 > 0.0, "there is a force, trusted or not");
    }
    assert!(trusted > 30 && at_support > 10, "{trusted} trusted, {at_support} at the support");
}

#[test]
fn it_leaves_the_touchable_surface_at_its_end() {
    let model = block();
    let mut probe = probe(&model, 0.2);
    let mut free = None;
    for n in 0..400 {
        let x = 1e-4 * f64::from(n);
        let felt = probe.place(&model, above(x, 0.0, 0.001));
        assert!(size(felt.force).is_finite());
        if felt.grip == Grip::Free {
            free.get_or_insert(x);
        } else {
            assert!(free.is_none(), "it does not come back");
        }
    }
    let x = free.expect("it left");
    assert!(x > 0.5 * SIZE[0] && x < 0.5 * SIZE[0] + model.edge_length() + 2e-4, "free at {x} m");
}

#[test]
fn what_comes_in_one_step_has_no_force_until_it_is_lifted_off() {
    let model = block();
    let mut probe = probe(&model, 0.2);
    for _ in 0..3 {
        let felt = probe.place(&model, above(0.0, 0.0, 0.9 * RADIUS));
        assert_eq!((felt.grip, felt.force), (Grip::Inside, [0.0; 3]));
        assert!(felt.trust != Trust::Trusted);
    }
    assert_eq!(probe.place(&model, above(0.0, 0.0, 0.001)).grip, Grip::Inside);
    assert_eq!(probe.place(&model, above(0.0, 0.0, -0.001)).grip, Grip::Free);
    assert_eq!(probe.place(&model, above(0.0, 0.0, 0.001)).grip, Grip::Sticks);
    // Deeper than the model, step by step: there is a force, and it is not trusted.
    let deep = probe.place(&model, above(0.0, 0.0, 1.5 * model.metadata().depth));
    assert!(deep.trust == Trust::BeyondDepth && parts(&deep).1 > 0.0);
    let deepest = probe.place(&model, above(0.0, 0.0, model.metadata().depth));
    assert!(parts(&deep).1 <= parts(&deepest).1 * (1.0 + 1e-9), "no deeper force than the deepest");
}

#[test]
fn poses_that_are_no_numbers_leave_it_where_it_was() {
    let model = block();
    let mut probe = probe(&model, 0.2);
    let held = probe.place(&model, above(0.0, 0.0, 0.001));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200] {
        for i in 0..3 {
            let mut center = held.center;
            center[i] = bad;
            let drawn = |probe: &mut Probe| probe.follow(&model, center, 1e-3).unwrap();
            for felt in [probe.place(&model, center), drawn(&mut probe)] {
                assert!(felt.force == [0.0; 3] && felt.torque == [0.0; 3]);
                assert!(
                    felt.error_estimate.is_finite() && felt.center.iter().all(|x| x.is_finite())
                );
                assert!(bad == 1e200 || (felt.grip == Grip::Lost && felt.center == held.center));
            }
            probe.lift();
            probe.place(&model, held.center);
        }
    }
}

#[test]
fn a_step_that_is_no_duration_is_refused_and_changes_nothing() {
    let model = block();
    for mut probe in [probe(&model, 0.2), coupled(&model, 0.2)] {
        probe.follow(&model, above(0.0, 0.0, 0.0), 1e-3);
        probe.follow(&model, above(0.001, 0.0, 0.002), 1e-3);
        let before = probe.clone();
        for dt in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e-3] {
            assert_eq!(probe.follow(&model, above(0.002, 0.0, 0.003), dt), None);
            assert_eq!(probe, before);
        }
    }
}

/// The friction that a drag has built up, and a device that goes deep within the step: what follows is what it would be
/// without that step.
#[test]
fn a_step_of_no_duration_loses_nothing() {
    let model = block();
    let forces = |damping: f64, steps: &[f64]| {
        let coupling = Some(Coupling { stiffness: 3000.0, damping });
        let mut probe = Probe::new(&model, RADIUS, 0.5, TOLERANCE, coupling).unwrap();
        for n in 0..300 {
            let part = f64::from(n) / 300.0;
            probe.follow(&model, above(0.0005 * part, 0.0, 0.004 * part), 1e-3);
        }
        let felt = steps.iter().map(|&dt| {
            let felt = probe.follow(&model, above(0.0005, 0.0, 0.012), dt).unwrap();
            assert!(felt.grip == Grip::Sticks && parts(&felt).0 > 0.0, "{dt} s: {felt:?}");
            felt.force
        });
        felt.last().unwrap()
    };
    for damping in [0.0, 2.0] {
        let without = forces(damping, &[1e-3; 40]);
        for dt in [0.0, -0.0, 1e-12, 1e-300] {
            let steps: Vec<f64> = std::iter::once(dt).chain([1e-3; 40]).collect();
            let change = std::array::from_fn(|i| forces(damping, &steps)[i] - without[i]);
            assert!(size(change) < 2e-2 * size(without), "{damping} N s/m, {dt} s: {change:?}");
        }
    }
}

#[test]
fn settings_out_of_range_are_refused_in_a_sentence() {
    let model = block();
    let refused = |radius: f64, friction: f64, tolerance: f64, coupling: Option<Coupling>| {
        Probe::new(&model, radius, friction, tolerance, coupling).unwrap_err().to_string()
    };
    assert!(refused(0.009, 0.0, 0.3, None).contains("from 0.009600 to 0.015000 m"));
    assert!(refused(0.016, 0.0, 0.3, None).contains("radius of a probe is 0.016000 m"));
    assert!(refused(f64::NAN, 0.0, 0.3, None).contains("NaN"));
    assert!(refused(0.012, -0.1, 0.3, None).contains("friction of a probe is -0.1"));
    assert!(refused(0.012, 0.0, 0.0, None).contains("tolerance of a probe is 0"));
    for (stiffness, damping) in [(0.0, 0.0), (f64::NAN, 0.0), (100.0, -1.0), (f64::INFINITY, 0.0)] {
        let coupling = Some(Coupling { stiffness, damping });
        assert!(refused(0.012, 0.0, 0.3, coupling).contains("coupling of a probe"));
    }
    assert!(Probe::new(&model, 0.0096, 0.0, 0.3, None).is_ok());
    assert!(Probe::new(&model, 0.015, 0.0, 0.3, None).is_ok());
}

/// A probe on a spring, above the middle.
fn coupled(model: &ReducedModel, friction: f64) -> Probe {
    let coupling = Some(Coupling { stiffness: 300.0, damping: 1.0 });
    Probe::new(model, RADIUS, friction, TOLERANCE, coupling).unwrap()
}

#[test]
fn coupling_and_tissue_come_into_balance() {
    let model = block();
    let mut probe = coupled(&model, 0.3);
    for n in 0..200 {
        probe.follow(&model, above(0.0, 0.0, 1e-5 * f64::from(n)), 1e-3);
    }
    let device = above(1e-4, 0.0, 0.002);
    let felt = (0..200).filter_map(|_| probe.follow(&model, device, 1e-3)).last().unwrap();
    for i in 0..3 {
        let spring = 300.0 * (device[i] - felt.center[i]);
        assert!((spring - felt.force[i]).abs() < 1e-3 * size(felt.force), "{spring} N, {felt:?}");
    }
    assert!(felt.center[2] > device[2], "the tissue holds it up");
}

/// In its first step and after it was lifted, from a light touch to half a radius; deeper it comes from within.
#[test]
fn a_first_step_in_the_organ_is_in_balance_at_once() {
    let model = block();
    for (stiffness, friction) in [(30.0, 0.0), (300.0, 0.3), (300.0, 1.0), (3000.0, 0.3)] {
        let coupling = Some(Coupling { stiffness, damping: 1.0 });
        let mut probe = Probe::new(&model, RADIUS, friction, TOLERANCE, coupling).unwrap();
        // A stiff spring must not ask for more than the depth of the model.
        let deepest = if stiffness > 1e3 { 0.004 } else { 0.0059 };
        for entered in [1e-4, 5e-4, 0.002, deepest] {
            let device = above(1e-3, 5e-4, entered);
            let (count, felt) = allocations(|| probe.follow(&model, device, 1e-3).unwrap());
            assert_eq!(count, 0);
            let spring = (0..3).map(|i| stiffness * (device[i] - felt.center[i]) - felt.force[i]);
            let lacks = spring.map(|x| x * x).sum::<f64>().sqrt();
            assert!(lacks < 1e-3 * size(felt.force), "{stiffness} N/m, {entered} m: {felt:?}");
            assert!(parts(&felt).1 > 0.0 && felt.trust == Trust::Trusted, "{felt:?}");
            let next = probe.follow(&model, device, 1e-3).unwrap();
            let change = std::array::from_fn(|i| next.force[i] - felt.force[i]);
            assert!(size(change) < 2e-3 * size(felt.force), "{felt:?} {next:?}");
            probe.lift();
        }
        let deep = above(0.0, 0.0, 0.51 * RADIUS);
        assert_eq!(probe.follow(&model, deep, 1e-3).unwrap().grip, Grip::Inside);
    }
}

#[test]
fn a_device_that_jumps_through_the_organ_does_not_take_the_probe_along() {
    let model = block();
    let mut probe = coupled(&model, 0.3);
    probe.follow(&model, above(0.0, 0.0, -0.002), 1e-3);
    let below = above(0.0, 0.0, 3.0 * SIZE[2]);
    let mut last = [0.0; 3];
    for _ in 0..300 {
        let felt = probe.follow(&model, below, 1e-3).unwrap();
        assert!(felt.center[2] > SIZE[2], "its centre stays outside: {felt:?}");
        assert!(size(felt.force).is_finite() && felt.grip != Grip::Inside);
        last = felt.force;
        if felt.trust == Trust::Trusted {
            assert!(-felt.gap <= model.metadata().depth);
        }
    }
    let felt = probe.follow(&model, below, 1e-3).unwrap();
    assert_eq!(felt.trust, Trust::BeyondDepth, "the device asks for more than the model has");
    assert!(-last[2] > 0.0);
    // Back above, it comes free.
    let up = above(0.0, 0.0, -0.01);
    let felt = (0..300).filter_map(|_| probe.follow(&model, up, 1e-3)).last().unwrap();
    assert_eq!((felt.grip, felt.force), (Grip::Free, [0.0; 3]));
}

#[test]
fn random_devices_get_finite_forces_in_the_cone_and_no_energy() {
    let model = block();
    let friction = 0.4;
    let mut probe = coupled(&model, friction);
    let (mut work, mut seen) = (0.0, [0; 5]);
    let mut device = above(0.0, 0.0, -0.001);
    let mut last = probe.follow(&model, device, 1e-3).unwrap();
    for random in samples::noise(30_000, 7).chunks_exact(3) {
        let home = above(0.0, 0.0, 0.0015);
        let step: [f64; 3] =
            std::array::from_fn(|i| 4e-4 * random[i] + 0.02 * (home[i] - device[i]));
        device = std::array::from_fn(|i| device[i] + step[i]);
        let (count, felt) = allocations(|| probe.follow(&model, device, 1e-3).unwrap());
        assert_eq!(count, 0);
        let onto: f64 = -felt.force[2];
        assert!(parts(&felt).0 <= friction * onto * (1.0 + 1e-9) + 1e-15, "{felt:?}");
        // Trapezoids: the work of the probe on the organ.
        work += (0..3)
            .map(|i| 0.5 * (felt.force[i] + last.force[i]) * (felt.center[i] - last.center[i]))
            .sum::<f64>();
        seen[felt.grip as usize] += 1;
        last = felt;
    }
    assert!(seen[..3].iter().all(|&n| n > 100) && seen[3..] == [0, 0], "{seen:?}");
    assert!(work > 0.0, "friction takes energy: {work} J");
}

/// Below a block of which the top alone may be touched, and beside it.
#[test]
fn behind_the_organ_it_is_free_and_within_it_is_not() {
    let model = block();
    let [x, y, z] = SIZE;
    for (place, grip) in [
        ([0.5 * x, 0.5 * y, -1.0], Grip::Free),
        ([0.5 * x, 0.5 * y, -1e-4], Grip::Free),
        ([-1e-4, -1e-4, -1e-4], Grip::Free),
        ([-1e-3, 0.5 * y, 0.3 * z], Grip::Free),
        ([0.5 * x, 0.5 * y, 0.3 * z], Grip::Inside),
        ([1e-4, 1e-4, 1e-4], Grip::Inside),
    ] {
        assert_eq!(probe(&model, 0.3).place(&model, place).grip, grip, "{place:?}");
    }
}
