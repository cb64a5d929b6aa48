//! Touches of a loaded organ: against Newton's method from the same equilibrium, and what is refused.

use super::*;
use crate::equilibrium::{Equilibrium, Newton, PatchLoad, Pressure, Problem};

/// Newton's equilibrium under dead forces, with or without a touch on top.
pub(super) fn newton(
    force: &[f64],
    start: Option<&[f64]>,
    touch: Option<PatchLoad>,
) -> Equilibrium {
    let held = FULL.fixed.iter().flat_map(|n| (0..3).map(move |i| (3 * n + i, 0.0)));
    let problem = Problem {
        body: &FULL.body,
        prescribed: held.collect(),
        force: force.to_vec(),
        pressure: Pressure::default(),
        patches: touch.into_iter().collect(),
        start: start.map(<[f64]>::to_vec),
    };
    let state = Newton { tolerance: 1e-12, ..Newton::default() }.solve(&problem, &mut |_| true);
    let state = state.unwrap();
    assert!(state.status.is_converged(), "{}", state.message);
    state
}

/// A force that pulls the block aside by a fifth of its height.
fn load() -> Vec<f64> {
    let mut force = vec![0.0; FULL.body.n_dofs()];
    FULL.top.iter().for_each(|&node| force[3 * node as usize] = 0.04);
    force
}

#[test]
fn a_touch_of_a_loaded_organ_is_what_newton_adds_to_the_load() {
    let force = load();
    let loaded = newton(&force, None, None).displacement;
    assert!(loaded.iter().fold(0.0, |a: f64, u| a.max(u.abs())) > 0.004, "a load worth the name");
    let model = reduce(&Reduction { preload: loaded.clone(), ..settings() }).unwrap();
    let worst = |model: &ReducedModel, depth: f64| {
        let mut worst: f64 = 0.0;
        for (triangle, d) in [(2, [0.6, 0.0, -0.8]), (9, [0.0, -0.6, 0.8]), (14, [-0.8, 0.6, 0.0])]
        {
            let d: [f64; 3] = d.map(|x| depth * x);
            let contact = model.centroid(triangle);
            let patch = model.patch(&contact);
            let mean = crate::equilibrium::patch_mean(&patch, &loaded);
            let displacement = std::array::from_fn(|i| mean[i] + d[i]);
            let full = newton(&force, Some(&loaded), Some(PatchLoad { patch, displacement }));
            let added: Vec<f64> =
                full.displacement.iter().zip(&loaded).map(|(u, start)| u - start).collect();
            let answer = model.respond(&contact, d);
            worst = worst.max(relative(&field(model, &contact, d), &added));
            worst = worst.max(relative(&answer.force, &full.patch_forces[0]));
        }
        worst
    };
    let (near, far) = (worst(&model, 0.05 * DEPTH), worst(&model, 0.25 * DEPTH));
    assert!(near < 3e-3 && far < 1e-2, "{near:e} {far:e}");
    // The organ at rest answers otherwise: the load turns it and stiffens it.
    assert!(worst(&MODEL, 0.05 * DEPTH) > 10.0 * near);
}

#[test]
fn the_loaded_shape_is_what_is_touched() {
    let loaded = newton(&load(), None, None).displacement;
    let model = reduce(&Reduction { preload: loaded.clone(), ..settings() }).unwrap();
    for (node, x) in FULL.body.points().iter().enumerate() {
        for i in 0..3 {
            assert_eq!(model.arrays().points[3 * node + i], x[i] + loaded[3 * node + i]);
        }
    }
    let node = model.arrays().positions[7] as usize;
    let point: [f64; 3] = std::array::from_fn(|i| model.arrays().points[3 * node + i]);
    assert!(model.locate(point).unwrap().distance < 1e-15);
    let again = ReducedModel::from_bytes(&model.to_bytes().unwrap()).unwrap();
    assert!(again.arrays() == model.arrays() && again.arrays().preload == loaded);
}

#[test]
fn preloads_that_touches_cannot_start_from_are_refused() {
    let refused = |preload: Vec<f64>| {
        let refused = reduce(&Reduction { preload, ..settings() }).err();
        refused.map_or("accepted".to_string(), |e| e.to_string())
    };
    let with = |dof: usize, value: f64| {
        let mut preload = vec![0.0; FULL.body.n_dofs()];
        preload[dof] = value;
        preload
    };
    // Crushed to a quarter of its height, nothing holds it aside.
    let crushed: Vec<f64> =
        FULL.body.points().iter().flat_map(|x| [0.0, 0.0, -0.75 * x[2]]).collect();
    let (free, fixed) = (3 * FULL.top[4] as usize, 3 * FULL.fixed[2] as usize);
    let cases = [
        (refused(vec![0.0; 7]), "the preload has 7 values; it needs 240"),
        (refused(with(free, f64::NAN)), "the preload is NaN at point"),
        (refused(with(fixed + 1, 1e-3)), "the preload moves the fixed point 2"),
        (refused(with(free + 2, -0.02)), "inside out"),
        (refused(crushed), "the preload is no stable equilibrium"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}
