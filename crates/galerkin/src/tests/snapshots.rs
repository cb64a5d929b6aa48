//! Snapshots are equilibria, and bring a grasp nearer to Newton.

use super::super::snapshots::Patience;
use super::*;
use crate::error::Error;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The same model, with snapshots.
static WITH_SNAPSHOTS: LazyLock<Arc<Galerkin>> = LazyLock::new(|| {
    let sampling = Sampling { snapshots: 40, ..MODEL.sampling };
    Arc::new(Galerkin::new(MODEL.model.clone(), sampling).unwrap())
});

#[test]
fn snapshots_are_equilibria_with_the_means_of_the_series() {
    let grasp = two();
    let patches = grasp.contacts().patches();
    let guess = grasp.contacts().superposed(&pushes(0.8 * DEPTH)).unwrap();
    let means: Vec<[f64; 3]> = patches.iter().map(|p| patch_mean(p, &guess)).collect();
    let snapshot =
        MODEL.snapshot(&patches, &guess, &Patience::OF_MANY).unwrap().expect("a stable state");
    let (field, _) = newton(&patches, &means);
    let (before, after) = (relative(&guess, &field), relative(&snapshot, &field));
    assert!(before > 0.01 && after < 1e-3, "{before} off before, {after} after");
}

#[test]
fn a_snapshot_is_found_from_far_away_and_none_from_nowhere() {
    let patches = two().contacts().patches();
    // Pressed evenly, as no equilibrium is.
    let points = MODEL.origin.body.points();
    let pressed = |share: f64| -> Vec<f64> {
        points.iter().flat_map(|p| [0.0, 0.0, -share * p[2]]).collect()
    };
    let guess = pressed(0.15);
    let means: Vec<[f64; 3]> = patches.iter().map(|p| patch_mean(p, &guess)).collect();
    let snapshot = MODEL
        .snapshot(&patches, &guess, &Patience::OF_MANY)
        .unwrap()
        .expect("a minimum of the energy");
    let kept: Vec<[f64; 3]> = patches.iter().map(|p| patch_mean(p, &snapshot)).collect();
    assert!(relative(kept.as_flattened(), means.as_flattened()) < 1e-9);
    let body = &MODEL.origin.body;
    assert!(body.energy(&snapshot) < 0.5 * body.energy(&guess));
    assert!(
        MODEL.snapshot(&patches, &pressed(1.5), &Patience::OF_MANY).unwrap().is_none(),
        "cells inside out"
    );
}

#[test]
fn snapshots_bring_answers_nearer_to_newton() {
    let with_cells_of_many_digits = |snapshots| {
        // Cells that give the forces to many digits: of all that may be wrong, only the modes are left.
        let sampling = Sampling { snapshots, tolerance: 1e-4, ..MODEL.sampling };
        let galerkin = Arc::new(Galerkin::new(MODEL.model.clone(), sampling).unwrap());
        galerkin.grasp(&[LEFT, RIGHT]).unwrap()
    };
    let (mut without, mut with) = (with_cells_of_many_digits(0), with_cells_of_many_digits(40));
    let patches = without.contacts().patches();
    assert!(with.contacts().n_modes() > without.contacts().n_modes());
    let d = pushes(0.9 * DEPTH);
    let (field, _) = newton(&patches, &d);
    let error = |grasp: &mut HyperReducedModel| {
        let solution = grasp.solve(&d, false, false).unwrap();
        relative(&solution.displacement(), &field)
    };
    let (series, snapshots) = (error(&mut without), error(&mut with));
    assert!(2.0 * snapshots < series, "{series} without, {snapshots} with");
}

#[test]
fn snapshots_are_taken_as_long_as_answers_are_wrong() {
    let taken = |depth: f64| {
        // Cells that give the forces to many digits: of all that may be wrong, only the modes are left.
        let sampling = Sampling { snapshots: 60, depth, tolerance: 1e-4, ..MODEL.sampling };
        let galerkin = Arc::new(Galerkin::new(MODEL.model.clone(), sampling).unwrap());
        galerkin.grasp(&[LEFT, RIGHT]).unwrap().n_snapshots()
    };
    let (shallow, deep) = (taken(0.1 * DEPTH), taken(DEPTH));
    // The first two dozen, and none after them.
    assert_eq!(shallow, 24);
    assert!(deep > shallow, "{deep}");
}

#[test]
fn lessons_come_while_a_grasp_is_in_use_and_change_nothing_that_it_holds() {
    let d = pushes(0.9 * DEPTH);
    let mut grasp = WITH_SNAPSHOTS.grasp_in_background(&[LEFT, RIGHT]).unwrap();
    let mut trained = WITH_SNAPSHOTS.grasp(&[LEFT, RIGHT]).unwrap();
    let first = grasp.solve(&d, false, false).unwrap();
    let mut answers = vec![(first.displacement(), grasp.n_snapshots())];
    while grasp.is_training().unwrap() {
        let solution = grasp.solve(&d, true, false).unwrap();
        assert_eq!(solution.status, ReducedStatus::Converged);
        let answer = solution.displacement();
        assert!(relative(&answer, &answers.last().unwrap().0) < 0.05, "a jump");
        answers.push((answer, grasp.n_snapshots()));
    }
    assert!(answers.windows(2).all(|pair| pair[0].1 <= pair[1].1), "lessons forgotten");
    assert!(grasp.n_snapshots() >= trained.n_snapshots());
    let (field, _) = newton(&grasp.contacts().patches(), &d);
    let error = |grasp: &mut HyperReducedModel, from_last: bool| {
        let solution = grasp.solve(&d, from_last, false).unwrap();
        relative(&solution.displacement(), &field)
    };
    let (last, best) = (error(&mut grasp, true), error(&mut trained, false));
    assert!(last < 1.1 * best, "{last} in the background, {best} by waiting");
}

#[test]
fn a_wrong_answer_is_learned_once() {
    let mut grasp = two();
    assert!(!grasp.add_snapshot().unwrap(), "nothing was asked yet");
    let d = pushes(DEPTH);
    let (field, _) = newton(&grasp.contacts().patches(), &d);
    let error = |grasp: &mut HyperReducedModel| {
        let solution = grasp.solve(&d, true, false).unwrap();
        relative(&solution.displacement(), &field)
    };
    let shape = |grasp: &mut HyperReducedModel| {
        let q = grasp.solver_mut().q.clone();
        grasp.contacts().subspace.basis.field(&q)
    };
    let before = error(&mut grasp);
    let was = shape(&mut grasp);
    assert!(grasp.add_snapshot().unwrap(), "{before} is wrong");
    let modes = grasp.contacts().n_modes();
    assert!(!grasp.add_snapshot().unwrap(), "there is no new answer to learn from");
    assert_eq!((grasp.n_snapshots(), grasp.contacts().n_modes()), (1, modes));
    assert!(relative(&shape(&mut grasp), &was) < 1e-12, "the tool feels no jump");
    let after = error(&mut grasp);
    assert!(3.0 * after < before, "{before} before, {after} after");
    assert!(!grasp.add_snapshot().unwrap(), "{after} is right");
}

#[test]
fn a_grasp_that_does_not_wait_learns_where_the_tools_are() {
    let sampling = Sampling { snapshots: 1, ..MODEL.sampling };
    let galerkin = Arc::new(Galerkin::new(MODEL.model.clone(), sampling).unwrap());
    let mut grasp = galerkin.grasp_in_background(&[LEFT, RIGHT]).unwrap();
    while grasp.is_training().unwrap() {}
    assert!(grasp.add_snapshot().is_err(), "it does so by itself");
    let taken = grasp.n_snapshots();
    let d = pushes(DEPTH);
    let first = grasp.solve(&d, false, false).unwrap();
    let first = first.displacement();
    while grasp.is_training().unwrap() {}
    let last = grasp.solve(&d, true, false).unwrap();
    let last = last.displacement();
    let (field, _) = newton(&grasp.contacts().patches(), &d);
    assert_eq!(grasp.n_snapshots(), taken + 1);
    let (before, after) = (relative(&first, &field), relative(&last, &field));
    assert!(3.0 * after < before, "{before} before, {after} after");
}

#[test]
fn taking_hold_ends_when_nobody_wants_it_any_more() {
    let asked = AtomicUsize::new(0);
    let is_wanted = || asked.fetch_add(1, Ordering::Relaxed) < 3;
    let outcome = WITH_SNAPSHOTS.grasp_while(&[LEFT, RIGHT], &is_wanted);
    assert!(matches!(outcome, Err(Error::Cancelled)));
}

#[test]
fn lessons_end_when_the_grasp_is_let_go() {
    let sampling = Sampling { snapshots: 200, depth: 1.5 * DEPTH, ..MODEL.sampling };
    let galerkin = Arc::new(Galerkin::new(MODEL.model.clone(), sampling).unwrap());
    let grasp = galerkin.grasp_in_background(&[LEFT, RIGHT]).unwrap();
    let weak = Arc::downgrade(&galerkin);
    drop((grasp, galerkin));
    while weak.strong_count() > 0 {
        std::thread::sleep(std::time::Duration::from_millis(5)); // hangs, if they do not
    }
}

#[test]
fn an_enriched_basis_is_orthonormal_and_holds_what_it_was_given() {
    let grasp = two();
    let patches = grasp.contacts().patches();
    let fields: Vec<Vec<f64>> = [0.3, 0.6, 0.9]
        .map(|share| newton(&patches, &pushes(share * DEPTH)).0)
        .into_iter()
        .chain([vec![0.0; MODEL.origin.body.n_dofs()]])
        .collect();
    let series = MODEL.model.series_fields(&grasp.contacts().places()[0], 1);
    let mut basis = Basis::new(&series, &MODEL.origin.stiffness);
    basis.enrich(&fields, 1e-3, &MODEL.origin.stiffness);
    assert_eq!(basis.len(), 6);
    for (i, mode) in basis.modes.iter().enumerate() {
        for (j, product) in basis.nearest(mode, &MODEL.origin.stiffness).into_iter().enumerate() {
            assert!((product - f64::from(u8::from(i == j))).abs() < 1e-9);
        }
    }
    for field in &fields[..3] {
        let nearest = basis.field(&basis.nearest(field, &MODEL.origin.stiffness));
        assert!(relative(&nearest, field) < 2e-3);
    }
}

#[test]
fn a_search_starts_from_the_nearest_snapshot_where_that_is_better_than_the_series() {
    let mut grasp = WITH_SNAPSHOTS.grasp(&[LEFT, RIGHT]).unwrap();
    let contacts = Arc::clone(grasp.contacts());
    let u = grasp.training().states(&contacts)[0].q.clone();
    let field = contacts.subspace.basis.field(&u);
    let means: Vec<[f64; 3]> = contacts.patches().iter().map(|p| patch_mean(p, &field)).collect();
    let solver = grasp.solver_mut();
    solver.start_at(means.as_flattened(), |_, q| q.fill(0.0));
    let (started, energy) = (solver.q.clone(), solver.reduced.energy);
    assert!(relative(&started, &u) < 1e-9, "from the snapshot itself");
    solver.start_at(means.as_flattened(), |_, q| q.copy_from_slice(&started));
    // To rounding: the means of the guess are corrected once more.
    assert!((solver.reduced.energy - energy).abs() < 1e-14 * energy);
    // Where nothing is sound, from a share of the guess.
    let absurd = means.iter().map(|d| d.map(|x| 30.0 * x)).collect::<Vec<_>>();
    solver.start_at(absurd.as_flattened(), |share, q| {
        q.iter_mut().zip(&started).for_each(|(q, started)| *q = share * started);
    });
    assert!(relative(&solver.q, &started) < 1e-9);
}
