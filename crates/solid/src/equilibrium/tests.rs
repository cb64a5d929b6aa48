//! Known solutions, balance of forces, load stepping.

mod endings;
mod refusals;
mod stability;

use super::*;
use crate::body::Body;
use crate::element::Element;
use crate::error::Error;
use crate::law::Material;
use crate::mesh::samples::{block, noise};
use crate::mesh::{Patch, Surface, surface};

const SIZE: [f64; 3] = [0.04, 0.02, 0.03];
const MU: f64 = 3.0e3;
const LAM: f64 = 11.0e3;

fn bar(law: &str, n: [usize; 3]) -> Body {
    let (points, cells) = block(n, SIZE);
    Body::new(points, cells, Material::new(law, vec![vec![MU, LAM]]).unwrap()).unwrap()
}

/// Nodes on the lower (0) or upper (1) face across an axis.
fn face(body: &Body, axis: usize, side: usize) -> Vec<u32> {
    let place = side as f64 * SIZE[axis];
    (0..body.points().len() as u32)
        .filter(|&n| (body.points()[n as usize][axis] - place).abs() < 1e-12)
        .collect()
}

/// Holds all components of the lower face across x.
fn clamped(body: &Body) -> Vec<(u32, f64)> {
    face(body, 0, 0).iter().flat_map(|&n| (0..3).map(move |i| (3 * n + i, 0.0))).collect()
}

fn problem(body: &Body, prescribed: Vec<(u32, f64)>) -> Problem<'_> {
    let force = vec![0.0; body.n_dofs()];
    Problem {
        body,
        prescribed,
        force,
        pressure: Pressure::default(),
        patches: Vec::new(),
        start: None,
    }
}

/// Clamped at x = 0, the other end moved by `d`.
fn pulled(body: &Body, d: [f64; 3]) -> Problem<'_> {
    let end = face(body, 0, 1);
    let moved = end.iter().flat_map(|&n| (0..3u32).map(move |i| (3 * n + i, d[i as usize])));
    problem(body, clamped(body).into_iter().chain(moved).collect())
}

fn solve(problem: &Problem) -> Equilibrium {
    Newton::default().solve(problem, &mut |_| true).unwrap()
}

fn sum(forces: &[f64], nodes: &[u32]) -> [f64; 3] {
    std::array::from_fn(|i| nodes.iter().map(|&n| forces[3 * n as usize + i]).sum())
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |max, (a, b)| (a - b).abs().max(max))
}

/// `P = mu (stretch - 1 / stretch) + lam ln J / stretch`, the principal stress of the neo-Hookean law.
fn principal_stress(stretch: f64, jacobian: f64) -> f64 {
    MU * (stretch - 1.0 / stretch) + LAM * jacobian.ln() / stretch
}

/// The lateral stretch at which the sides are free of stress, by bisection.
fn lateral_stretch(axial: f64) -> f64 {
    let (mut low, mut high) = (0.1, 10.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        let is_pulled = principal_stress(middle, axial * middle * middle) > 0.0;
        if is_pulled { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

#[test]
fn uniaxial_stretch_is_the_analytic_solution() {
    let body = bar("neo_hookean", [3, 2, 2]);
    for axial in [0.6, 1.4] {
        let hold = |axis: usize, side: usize, value: f64| {
            face(&body, axis, side).into_iter().map(move |n| (3 * n + axis as u32, value))
        };
        let symmetry = hold(0, 0, 0.0).chain(hold(1, 0, 0.0)).chain(hold(2, 0, 0.0));
        let load = problem(&body, symmetry.chain(hold(0, 1, (axial - 1.0) * SIZE[0])).collect());
        let state = solve(&load);
        assert_eq!(state.status, Status::Converged, "{}", state.message);
        let lateral = lateral_stretch(axial);
        let moved = |x: &[f64; 3]| [axial * x[0], lateral * x[1], lateral * x[2]];
        let exact: Vec<f64> = (body.points().iter())
            .flat_map(|x| std::array::from_fn::<f64, 3, _>(|i| moved(x)[i] - x[i]))
            .collect();
        assert!(
            largest_difference(&state.displacement, &exact) < 1e-9 * SIZE[0],
            "stretch {axial}"
        );
        let force = principal_stress(axial, axial * lateral * lateral) * SIZE[1] * SIZE[2];
        let reaction = sum(&state.internal_force, &face(&body, 0, 1));
        assert!((reaction[0] - force).abs() < 1e-7 * force.abs(), "{reaction:?}, exact {force}");
    }
}

#[test]
fn reactions_balance_the_weight() {
    let body = bar("neo_hookean", [4, 2, 3]);
    let mut load = problem(&body, clamped(&body));
    load.force = body.gravity([1.0, -2.0, -9.81], &[1060.0]).unwrap();
    let state = solve(&load);
    assert!(state.status.is_converged() && state.load == 1.0);
    let everywhere: Vec<u32> = (0..body.points().len() as u32).collect();
    let weight = sum(&load.force, &everywhere);
    let out_of_balance: Vec<f64> =
        state.internal_force.iter().zip(&load.force).map(|(i, e)| i - e).collect();
    let reaction = sum(&out_of_balance, &face(&body, 0, 0));
    // 1e-9 is the solver's own tolerance.
    assert!(largest_difference(&reaction, &weight.map(|w| -w)) < 1e-8 * weight[2].abs());
    assert!(state.energy > 0.0 && (state.energy - body.energy(&state.displacement)).abs() < 1e-15);
}

fn end_patch(body: &Body) -> Patch {
    let surface = Surface::new(body.points(), &surface(body.points(), body.cells()));
    surface.patch_at_point([SIZE[0], 0.4 * SIZE[1], 0.6 * SIZE[2]], 0.012, &|_| false).unwrap()
}

#[test]
fn a_patch_moves_by_its_mean_and_feels_the_reaction() {
    let body = bar("neo_hookean", [4, 3, 3]);
    let (patch, d) = (end_patch(&body), [-0.002, 0.003, 0.004]);
    assert!(patch.nodes.len() > 3, "a patch worth the name");
    let mut load = problem(&body, clamped(&body));
    load.patches.push(PatchLoad { patch: patch.clone(), displacement: d });
    let state = solve(&load);
    assert_eq!(state.status, Status::Converged);
    assert!(largest_difference(&patch_mean(&patch, &state.displacement), &d) < 1e-14);
    let [force] = state.patch_forces[..] else { panic!("one patch, one force") };
    let reaction = sum(&state.internal_force, &face(&body, 0, 0));
    let size = force.iter().fold(0.0f64, |max, f| max.max(f.abs()));
    assert!(
        largest_difference(&force, &reaction.map(|r| -r)) < 1e-8 * size,
        "{force:?} {reaction:?}"
    );
    // The tool's force goes to the nodes by their weights.
    for (&node, w) in patch.nodes.iter().zip(&patch.weights) {
        let felt = sum(&state.internal_force, &[node]);
        assert!(largest_difference(&felt, &force.map(|f| w * f)) < 1e-8 * size);
    }
}

#[test]
fn a_solution_continues_from_its_start() {
    let body = bar("neo_hookean", [4, 2, 2]);
    let mut load = pulled(&body, [0.008, 0.004, 0.0]);
    load.force = body.gravity([0.0, 0.0, -9.81], &[1060.0]).unwrap();
    let whole = solve(&load);
    let mut half = pulled(&body, [0.004, 0.002, 0.0]);
    half.force.clone_from(&load.force);
    load.start = Some(solve(&half).displacement);
    let continued = solve(&load);
    assert!(largest_difference(&continued.displacement, &whole.displacement) < 1e-9 * SIZE[0]);
    load.start = Some(whole.displacement.clone());
    let again = solve(&load);
    assert_eq!((again.iterations, again.status), (1, Status::Converged));
    assert!(largest_difference(&again.displacement, &whole.displacement) < 1e-9 * SIZE[0]);
    // A start that is no equilibrium leads to the same end: its imbalance fades with the load.
    let shaken = whole.displacement.iter().zip(noise(body.n_dofs(), 5)).map(|(u, n)| u + 1e-4 * n);
    load.start = Some(shaken.collect());
    assert!(largest_difference(&solve(&load).displacement, &whole.displacement) < 1e-9 * SIZE[0]);
}

#[test]
fn a_large_load_is_cut_into_steps() {
    let body = bar("neo_hookean", [4, 2, 2]);
    let load = pulled(&body, [-SIZE[0], 1.5 * SIZE[0], 0.0]);
    let mut fractions = Vec::new();
    let mut watch = |fraction: f64| {
        fractions.push(fraction);
        true
    };
    let state = Newton::default().solve(&load, &mut watch).unwrap();
    assert!(state.status.is_converged() && state.load == 1.0, "{}", state.message);
    assert!(state.residuals.len() > 1, "one step sufficed; the test asks for too little");
    assert!(fractions.is_sorted() && fractions.last() == Some(&1.0), "{fractions:?}");
    assert!(state.residuals.iter().all(|step| step.last().is_some_and(|&r| r <= 1e-9)));
    assert!(body.smallest_jacobian(&state.displacement).0 > 0.0);
}

#[test]
fn saint_venant_kirchhoff_collapse_is_named() {
    let body = bar("saint_venant_kirchhoff", [4, 2, 2]);
    let mut load = problem(&body, clamped(&body));
    for node in face(&body, 0, 1) {
        load.force[3 * node as usize] = -4.0 * MU * SIZE[1] * SIZE[2] / 9.0;
    }
    let state = solve(&load);
    assert!(!state.status.is_converged(), "{}", state.message);
    assert!(
        state.load < 1.0 && state.message.contains("known flaw of the law"),
        "{}",
        state.message
    );
    assert!(state.displacement.iter().all(|u| u.is_finite()), "the last equilibrium is kept");
}

/// Uniaxial stress `P = E (l^3 - l) / 2` has its minimum `-E / (3 sqrt 3)` at `l = 1 / sqrt 3`.
#[test]
fn a_load_beyond_the_limit_point_says_where_the_tangent_becomes_singular() {
    let body = bar("saint_venant_kirchhoff", [1, 1, 1]);
    let planes = (0..3)
        .flat_map(|axis| face(&body, axis, 0).into_iter().map(move |n| (3 * n + axis as u32, 0.0)));
    let mut load = problem(&body, planes.collect());
    let young = MU * (3.0 * LAM + 2.0 * MU) / (LAM + MU);
    let squeezed: Vec<[u32; 3]> = surface(body.points(), body.cells())
        .into_iter()
        .filter(|t| t.iter().all(|&n| body.points()[n as usize][0] == SIZE[0]))
        .collect();
    for t in &squeezed {
        for &n in t {
            load.force[3 * n as usize] -= 0.4 * young * SIZE[1] * SIZE[2] / 6.0;
        }
    }
    let state = solve(&load);
    assert_eq!(state.status, Status::LimitPoint, "{}", state.message);
    let turn = 1.0 / (3.0 * 3.0f64.sqrt() * 0.4);
    assert!(state.load < turn && state.load > turn - 0.01, "{} {turn}", state.load);
    let said = format!("becomes nearly singular at load {turn:.3}");
    assert!(state.message.contains(&said[..said.len() - 1]), "{}: {said}", state.message);
    assert!(
        state.message.contains("prescribe a displacement"),
        "sliding supports: {}",
        state.message
    );
}

/// All surface triangles on which nothing is prescribed by symmetry planes.
fn pressed(body: &Body, p: f64) -> Pressure {
    let is_free =
        |t: &[u32; 3]| (0..3).all(|axis| t.iter().any(|&n| body.points()[n as usize][axis] > 0.0));
    let triangles = surface(body.points(), body.cells());
    let faces: Vec<_> = triangles.into_iter().filter(is_free).map(|t| t.to_vec()).collect();
    Pressure { values: vec![p; faces.len()], faces }
}

/// Cauchy's stress is `-p` everywhere: with the stretch `l`, `P = -p l^2`.
#[test]
fn a_body_under_pressure_shrinks_as_its_law_says() {
    for p in [-0.6 * MU, 2.0 * MU] {
        let body = bar("neo_hookean", [3, 2, 2]);
        let planes = (0..3).flat_map(|axis| {
            face(&body, axis, 0).into_iter().map(move |n| (3 * n + axis as u32, 0.0))
        });
        let mut load = problem(&body, planes.collect());
        load.pressure = pressed(&body, p);
        let state = solve(&load);
        assert_eq!(state.status, Status::Converged, "{}", state.message);
        let (mut low, mut high) = (0.1, 3.0);
        for _ in 0..100 {
            let l: f64 = 0.5 * (low + high);
            if principal_stress(l, l.powi(3)) > -p * l * l { high = l } else { low = l }
        }
        let exact: Vec<f64> =
            body.points().iter().flatten().map(|x| (0.5 * (low + high) - 1.0) * x).collect();
        assert!(largest_difference(&state.displacement, &exact) < 1e-9 * SIZE[0], "p = {p}");
        // The planes hold what the pressure leaves open.
        let reaction: Vec<f64> =
            state.internal_force.iter().zip(&state.external_force).map(|(i, e)| i - e).collect();
        let all: Vec<u32> = (0..body.points().len() as u32).collect();
        let area = SIZE[1] * SIZE[2] * low * low;
        assert!((sum(&reaction, &all)[0] - p * area).abs() < 1e-6 * p.abs() * area);
        let history = state.residuals.last().unwrap();
        let [.., before, last] = history[..] else { panic!("{history:?}") };
        assert!(last < 1e3 * before * before + 1e-12, "quadratic: {history:?}");
    }
}

#[test]
fn the_caller_can_stop_a_solution() {
    let body = bar("neo_hookean", [4, 2, 2]);
    let load = pulled(&body, [0.01, 0.0, 0.0]);
    let mut calls = 0;
    let mut stop = |_| {
        calls += 1;
        calls < 2
    };
    let result = Newton { steps: 4, ..Newton::default() }.solve(&load, &mut stop);
    assert!(matches!(result, Err(Error::Cancelled)));
    assert_eq!(calls, 2);
}
