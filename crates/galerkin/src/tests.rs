//! The Galerkin model against differences, against full Newton, and against its own promises.

use super::basis::Basis;
use super::forces::{Forces, TrainingState, systematic, with_forces};
use super::guesses::guesses;
use super::model::{Galerkin, Sampling};
use super::newton::{ReducedNewton, ReducedStatus, Search};
use super::nnls::{self, Columns};
use super::origin::Origin;
use super::reduced_energy::Reduced;
use super::sampled::Sampled;
use super::snapshots::Correction;
use super::solution::Solution;
use super::subspace::Subspace;
use super::{Asked, Assessment, HyperReducedModel, Trust};
use crate::body::Body;
use crate::element::Element;
use crate::equilibrium::{Newton, PatchLoad, Pressure, Problem, patch_mean};
use crate::law::Material;
use crate::mesh::samples::{block, noise};
use crate::mesh::{Patch, Surface};
use crate::number::{dot, norm};
use crate::reduced::{Metadata, Notes, ReducedModel, Reduction, allowance};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

mod elements;
mod snapshots;

const SIZE: [f64; 3] = [0.06, 0.04, 0.03];
const DEPTH: f64 = 0.006;

/// A block held at the bottom, touched at the top.
static MODEL: LazyLock<Arc<Galerkin>> =
    LazyLock::new(|| galerkin(Element::P1, [6, 4, 3], vec![3.0e3, 27.0e3], [0.0; 3]));

/// The block cut into so many hexahedra, with the moduli of a neo-Hookean law, touched as a body force [N/m^3] leaves it.
fn galerkin(
    element: Element,
    counts: [usize; 3],
    moduli: Vec<f64>,
    weight: [f64; 3],
) -> Arc<Galerkin> {
    let (points, cells) = block(counts, SIZE);
    let law = Material::new("neo_hookean", vec![moduli]).unwrap();
    let body = Body::with_element(element, points, cells, law).unwrap();
    let at = |z: f64| -> Vec<u32> {
        let is_there = |&n: &u32| (body.points()[n as usize][2] - z).abs() < 1e-12;
        (0..body.points().len() as u32).filter(is_there).collect()
    };
    let skin = Surface::new(body.points(), &body.surface());
    let fixed = at(0.0);
    let preload = loaded(&body, &fixed, weight);
    let user = Notes::default();
    let reduction = Reduction {
        touchable: at(SIZE[2]),
        radius: 0.015,
        depth: DEPTH,
        order: 3,
        tolerance: 1e-4,
        pade: true,
        memory: 1e9,
        device: None,
        preload,
        user,
    };
    let model = reduction.run(&body, &skin, &fixed, &mut |_| true).unwrap();
    let sampling = Sampling { order: 3, tolerance: 0.01, depth: DEPTH, snapshots: 0 };
    Arc::new(Galerkin::new(model, sampling).unwrap())
}

/// Displacement under a body force; none for none.
fn loaded(body: &Body, fixed: &[u32], weight: [f64; 3]) -> Vec<f64> {
    if weight == [0.0; 3] {
        return Vec::new();
    }
    let problem = Problem {
        body,
        prescribed: fixed.iter().flat_map(|&n| (0..3).map(move |i| (3 * n + i, 0.0))).collect(),
        force: body.gravity(weight, &[1.0]).unwrap(),
        pressure: Pressure { faces: Vec::new(), values: Vec::new() },
        patches: Vec::new(),
        start: None,
    };
    let state = Newton::default().solve(&problem, &mut |_| true).unwrap();
    assert!(state.status.is_converged());
    state.displacement
}

const LEFT: [f64; 3] = [0.018, 0.021, 0.03];
const RIGHT: [f64; 3] = [0.042, 0.017, 0.03];

fn two() -> HyperReducedModel {
    MODEL.grasp(&[LEFT, RIGHT]).unwrap()
}

/// Displacements of two contacts at a depth, in directions of their own.
fn pushes(depth: f64) -> [[f64; 3]; 2] {
    [[0.5, 0.1, -0.8], [-0.3, 0.4, -0.7]].map(|d| d.map(|x| depth * x / norm(&d)))
}

/// States that the superposed series predicts.
fn states(
    origin: &Origin,
    subspace: &Subspace,
    depth: f64,
    numbers: std::ops::Range<usize>,
) -> Vec<TrainingState> {
    let guesses = guesses(origin, subspace, depth, numbers);
    with_forces(origin, subspace, guesses.into_iter().map(|guess| guess.q).collect())
}

/// Displacement and contact forces by full Newton.
fn newton(patches: &[Patch], displacements: &[[f64; 3]]) -> (Vec<f64>, Vec<[f64; 3]>) {
    newton_of(&MODEL, patches, displacements)
}

/// The same for any model; displacements are from where its touches start.
fn newton_of(
    Galerkin { origin, .. }: &Galerkin,
    patches: &[Patch],
    displacements: &[[f64; 3]],
) -> (Vec<f64>, Vec<[f64; 3]>) {
    let patches = patches.iter().zip(displacements);
    let there = |patch: &Patch, d: &[f64; 3]| {
        let mean = patch_mean(patch, &origin.displacement);
        std::array::from_fn(|i| mean[i] + d[i])
    };
    let problem = Problem {
        body: &origin.body,
        prescribed: origin.fixed.iter().map(|&dof| (dof, 0.0)).collect(),
        force: origin.force.clone(),
        pressure: Pressure { faces: Vec::new(), values: Vec::new() },
        patches: patches
            .map(|(patch, d)| PatchLoad { patch: patch.clone(), displacement: there(patch, d) })
            .collect(),
        start: Some(origin.displacement.clone()),
    };
    let state = Newton::default().solve(&problem, &mut |_| true).unwrap();
    assert!(state.status.is_converged());
    let moved = state.displacement.iter().zip(&origin.displacement).map(|(u, start)| u - start);
    (moved.collect(), state.patch_forces)
}

fn relative(a: &[f64], exact: &[f64]) -> f64 {
    norm(&a.iter().zip(exact).map(|(a, b)| a - b).collect::<Vec<_>>()) / norm(exact)
}

#[test]
fn non_negative_least_squares_meets_its_conditions() {
    let (rows, count) = (40, 25);
    let values = noise(rows * count, 3);
    let b: Vec<f64> = noise(rows, 4);
    let a = Columns { rows, values: &values };
    let chosen = nnls::greedy(&a, &b, 0.0);
    let column = |k: usize| &values[k * rows..(k + 1) * rows];
    let mut residual = b.clone();
    for &(k, w) in &chosen {
        assert!(w > 0.0, "column {k}: weight {w}");
        residual.iter_mut().zip(column(k)).for_each(|(r, x)| *r -= w * x);
    }
    for k in 0..count {
        let gain = dot(column(k), &residual);
        let is_chosen = chosen.iter().any(|&(c, _)| c == k);
        assert!(gain < 1e-8 && (!is_chosen || gain > -1e-8), "column {k}: gain {gain}");
    }
    assert!(chosen.is_sorted() && chosen.len() > 3 && chosen.len() < count);
}

#[test]
fn few_columns_do_for_a_rough_answer_and_doubles_are_not_taken_twice() {
    let (rows, count) = (60, 40);
    let single = noise(rows * count, 5).iter().map(|x| 1.5 + x).collect::<Vec<_>>();
    let b: Vec<f64> = (0..rows).map(|i| (0..count).map(|k| single[k * rows + i]).sum()).collect();
    let values = [&single[..], &single[..]].concat();
    let a = Columns { rows, values: &values };
    let sizes = [0.1, 1e-3, 1e-6].map(|tolerance| {
        let chosen = nnls::greedy(&a, &b, tolerance);
        let mut residual = b.clone();
        for &(k, w) in &chosen {
            let column = &values[k * rows..(k + 1) * rows];
            residual.iter_mut().zip(column).for_each(|(r, x)| *r -= w * x);
        }
        assert!(norm(&residual) <= tolerance * norm(&b), "{tolerance}: {}", norm(&residual));
        chosen.len()
    });
    assert!(sizes[0] < sizes[1] && sizes[1] <= sizes[2] && sizes[2] <= count, "{sizes:?}");
}

#[test]
fn what_counts_more_is_taken_more_often() {
    let sizes: Vec<f64> = (0..1000).map(|k| if k < 100 { 9.0 } else { 1.0 }).collect();
    let taken = systematic(&sizes, 180);
    assert!(taken.is_sorted_by(|a, b| a < b));
    let large = taken.iter().filter(|&&k| k < 100).count();
    assert_eq!((large, taken.len()), (90, 180));
    assert_eq!(systematic(&[1.0, 100.0, 1.0], 50), [1], "no place is taken twice");
}

#[test]
fn modes_are_orthonormal_in_the_energy_and_span_their_fields() {
    let body = &MODEL.origin.body;
    let free: Vec<usize> = MODEL.origin.system.free().iter().map(|&dof| dof as usize).collect();
    let mut fields: Vec<Vec<f64>> = Vec::new();
    for k in 0..5 {
        let mut field = vec![0.0; body.n_dofs()];
        free.iter().zip(noise(free.len(), k)).for_each(|(&dof, x)| field[dof] = x);
        fields.push(field);
    }
    fields.insert(3, (0..body.n_dofs()).map(|i| fields[0][i] - 2.0 * fields[1][i]).collect());
    let basis = Basis::new(&fields, &MODEL.origin.stiffness);
    assert_eq!(basis.len(), 5, "the field that others span drops out");
    let mut force = vec![0.0; body.n_dofs()];
    for i in 0..basis.len() {
        MODEL.origin.stiffness.multiply(&basis.modes[i], &mut force);
        for (j, product) in basis.project(&force).into_iter().enumerate() {
            assert!((product - f64::from(u8::from(i == j))).abs() < 1e-9);
        }
    }
    for (k, field) in fields.iter().enumerate() {
        let mut q = vec![0.0; basis.len()];
        basis.add(k, 1.0, &mut q);
        assert!(relative(&basis.field(&q), field) < 1e-9);
    }
}

#[test]
fn sampled_energies_are_those_of_the_body_in_training() {
    let body = &MODEL.origin.body;
    let mut grasp = two();
    assert!(grasp.n_cells() < body.cells().len() * 3 / 4, "{} cells", grasp.n_cells());
    for state in states(&MODEL.origin, &grasp.contacts().subspace, DEPTH, 0..20) {
        let full = body.energy(&grasp.contacts().subspace.basis.field(&state.q));
        grasp.solver_mut().start(|_, q| q.copy_from_slice(&state.q));
        let error = (grasp.solver_mut().reduced.energy - full).abs() / full;
        assert!(error < 0.03, "energy off by {error}");
    }
}

#[test]
fn one_shallow_touch_is_that_of_the_series() {
    let mut grasp = MODEL.grasp(&[LEFT]).unwrap();
    let contact = grasp.contacts().places()[0];
    let d = pushes(1e-3 * DEPTH)[0];
    let solution = grasp.solve(&[d], false, true).unwrap();
    let response = MODEL.model.respond(&contact, d);
    // Within the error of a sampling to one per cent.
    assert!(relative(&solution.forces[0], &response.force) < 0.02);
    let stiffness = response.stiffness.as_flattened();
    assert!(relative(&solution.stiffness, stiffness) < 0.02);
    assert_eq!(solution.status, ReducedStatus::Converged);
}

#[test]
fn the_superposed_series_is_right_to_second_order() {
    let grasp = two();
    let patches = grasp.contacts().patches();
    let error = |depth: f64| {
        let d = pushes(depth);
        relative(&grasp.contacts().superposed(&d).unwrap(), &newton(&patches, &d).0)
    };
    let (coarse, fine) = (error(0.5 * DEPTH), error(0.25 * DEPTH));
    // The part left is of third order, a quarter relative to a displacement half as large.
    assert!(fine < 0.35 * coarse, "{coarse:e} at half the depth, {fine:e} at a quarter");
}

#[test]
fn two_fingers_are_near_newton_where_superposition_is_not() {
    let mut grasp = two();
    let patches = grasp.contacts().patches();
    for depth in [0.25 * DEPTH, 0.5 * DEPTH] {
        let d = pushes(depth);
        let (field, forces) = newton(&patches, &d);
        let solution = grasp.solve(&d, false, false).unwrap();
        let error = relative(&solution.displacement(), &field);
        let force_error = relative(solution.forces.as_flattened(), forces.as_flattened());
        assert!(error < 0.015 && force_error < 0.03, "{error}, force {force_error} at {depth} m");
        let responses = grasp.contacts().places().iter().zip(d);
        let alone: Vec<f64> =
            responses.flat_map(|(c, d)| MODEL.model.respond(c, d).force).collect();
        let alone = relative(&alone, forces.as_flattened());
        assert!(alone > 5.0 * force_error, "superposition is off by {alone}");
    }
}

#[test]
fn stiffness_is_the_derivative_of_the_forces() {
    let mut grasp = two();
    let d = pushes(0.6 * DEPTH);
    let stiffness = grasp.solve(&d, false, true).unwrap().stiffness;
    let h = 1e-2 * DEPTH;
    for k in 0..6 {
        let mut force = |step: f64| {
            let mut moved = d;
            moved[k / 3][k % 3] += step;
            grasp.solve(&moved, true, false).unwrap().forces
        };
        let (above, below) = (force(h), force(-h));
        for j in 0..6 {
            let slope = (above[j / 3][j % 3] - below[j / 3][j % 3]) / (2.0 * h);
            assert!((slope - stiffness[6 * j + k]).abs() < 2e-3 * norm(&stiffness), "{j}, {k}");
        }
    }
}

#[test]
fn the_way_there_does_not_matter() {
    let mut grasp = two();
    let d = pushes(0.7 * DEPTH);
    let cold = grasp.solve(&d, false, false).unwrap();
    grasp.solve(&pushes(0.5 * DEPTH), false, true).unwrap();
    let warm = grasp.solve(&d, true, false).unwrap();
    assert!(relative(warm.forces.as_flattened(), cold.forces.as_flattened()) < 1e-4);
    let rest = grasp.solve(&[[0.0; 3]; 2], true, false).unwrap();
    assert_eq!(
        rest.assess().unwrap(),
        Assessment { force_error: 0.0, shape_error: 0.0, trust: Trust::Trusted }
    );
    assert!(norm(rest.forces.as_flattened()) < 1e-6 * norm(cold.forces.as_flattened()));
}

#[test]
fn the_whole_body_knows_the_error_of_an_answer() {
    let mut grasp = two();
    for depth in [0.5 * DEPTH, DEPTH] {
        let d = pushes(depth);
        let solution = grasp.solve(&d, false, false).unwrap();
        let (field, forces) = newton(&grasp.contacts().patches(), &d);
        let assessment = solution.assess().unwrap();
        let shape = relative(&solution.displacement(), &field);
        let force = relative(solution.forces.as_flattened(), forces.as_flattened());
        // Expectations, no bounds: they may fall short by little.
        for (error, expected) in [(shape, assessment.shape_error), (force, assessment.force_error)]
        {
            assert!((expected / error - 1.0).abs() < 0.2, "{error}, {expected} expected");
        }
        let allowed = allowance(depth / MODEL.model.metadata().diagonal);
        assert_eq!(assessment.trust == Trust::Trusted, assessment.error() <= allowed);
    }
}

#[test]
fn an_estimate_counts_the_steps_to_come_and_steps_that_do_not_shrink_lead_nowhere() {
    // Steps 1, 1/2, 1/4, ... from a field of norm 8 add up to 2; forces 1, 2, 2.5, ... to 3, where 2.7 was the answer.
    let after = |steps, forces: [f64; 2]| {
        Correction { steps, forces: forces.map(|force| vec![force]), is_stable: true }
            .errors(8.0, &[2.7])
    };
    let [force, shape] = after([1.0, 0.5], [1.0, 2.0]);
    assert!((force - (0.7 + 1.0) / 2.0).abs() < 1e-15 && shape == 0.25, "{force}, {shape}");
    assert_eq!(after([1.0, 0.0], [2.7, 2.7]), [0.0, 0.125]);
    assert_eq!(after([0.0, 0.0], [2.7, 2.7]), [0.0, 0.0]);
    for lost in [[1.0, 1.0], [1.0, 2.0], [0.0, 1.0], [1.0, f64::INFINITY], [f64::NAN; 2]] {
        assert_eq!(after(lost, [2.7, 2.7]), [1.0, 1.0]);
    }
}

#[test]
fn a_search_that_runs_out_of_time_goes_on_in_the_next() {
    let (mut grasp, d) = (two(), pushes(0.8 * DEPTH));
    let whole = grasp.solve(&d, false, false).unwrap();
    let mut solution = grasp.room();
    let mut step = |from_last, solution: &mut Solution| {
        let asked = Asked { from_last, with_stiffness: true, budget: Some(Duration::ZERO) };
        grasp.solve_into(&d, asked, solution).unwrap();
        assert!(solution.iterations <= 1, "one step and no more");
        assert_eq!(solution.stiffness.is_empty(), solution.status != ReducedStatus::Converged);
    };
    step(false, &mut solution);
    assert_eq!(solution.status, ReducedStatus::OutOfTime);
    for _ in 0..whole.iterations + 2 {
        step(true, &mut solution);
    }
    assert_eq!(solution.status, ReducedStatus::Converged);
    assert!(relative(solution.forces.as_flattened(), whole.forces.as_flattened()) < 1e-4);
    let late = Asked { budget: Some(Duration::ZERO), ..Asked::default() };
    grasp.solve_into(&d, late, &mut solution).unwrap();
    assert_eq!(solution.assess().unwrap().trust, Trust::OutOfTime);
    assert!(!grasp.add_snapshot().unwrap(), "there is no answer to learn from");
}

#[test]
fn failures_say_so() {
    let mut grasp = two();
    let beyond = grasp.solve(&pushes(1.5 * DEPTH), false, false).unwrap();
    assert_ne!(beyond.assess().unwrap().trust, Trust::Trusted);
    // Two fingers pulled through each other: no equilibrium, or none to be trusted.
    let through = [[0.05, 0.0, 0.0], [-0.05, 0.0, 0.0]];
    let hopeless = grasp.solve(&through, false, true).unwrap();
    assert_ne!(hopeless.assess().unwrap().trust, Trust::Trusted);
    assert!(hopeless.forces.iter().flatten().all(|f| f.is_finite()));
    let again = grasp.solve(&pushes(0.5 * DEPTH), true, false).unwrap();
    assert_eq!(
        again.status,
        ReducedStatus::Converged,
        "a failure spoils nothing that comes after it"
    );
}

#[test]
fn bad_input_is_said_in_a_sentence() {
    let sentence = |result: Result<(), crate::error::Error>| result.unwrap_err().to_string();
    let grasp = |points: &[[f64; 3]]| sentence(MODEL.grasp(points).map(|_| ()));
    assert!(grasp(&[]).contains("no contact"));
    assert!(grasp(&[LEFT, [0.0, 0.0, 1.0]]).contains("contact 1 at"));
    assert!(grasp(&[LEFT, [f64::NAN, 0.0, 0.0]]).contains("contact 1"));
    assert!(grasp(&[LEFT, LEFT]).contains("so close"));
    let solve = |d: &[[f64; 3]]| sentence(two().solve(d, false, false).map(|_| ()));
    assert!(solve(&[[0.0; 3]]).contains("1 displacements for 2 contacts"));
    assert!(solve(&[[0.0; 3], [0.0, f64::INFINITY, 0.0]]).contains("contact 1 is displaced"));
    let settings = MODEL.sampling;
    let build = |model: &ReducedModel, sampling| {
        sentence(Galerkin::new(model.clone(), sampling).map(|_| ()))
    };
    let series = &MODEL.model;
    assert!(build(series, Sampling { order: 4, ..settings }).contains("order 4"));
    assert!(build(series, Sampling { tolerance: 0.0, ..settings }).contains("tolerance 0"));
    assert!(build(series, Sampling { depth: -1.0, ..settings }).contains("depth -1"));
    assert!(build(series, Sampling { snapshots: 201, ..settings }).contains("201 snapshots"));
    let quadratic = Metadata { element: "P2".into(), ..series.metadata().clone() };
    let unlike = ReducedModel::new(quadratic, series.arrays().clone()).unwrap();
    assert!(build(&unlike, settings).contains("reduce the organ anew"));
}
