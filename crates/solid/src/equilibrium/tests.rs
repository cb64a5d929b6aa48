//! Known solutions, balance of forces, load stepping, and every way a load case can be refused.

use super::*;
use crate::body::Body;
use crate::element::Element;
use crate::error::Error;
use crate::law::Material;
use crate::mesh::samples::{block, noise};
use crate::mesh::{Patch, Surface, surface};
use std::f64::consts::PI;

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

fn refusal(problem: &Problem) -> String {
    match Newton::default().solve(problem, &mut |_| true) {
        Ok(_) => "accepted".to_string(),
        Err(error) => error.to_string(),
    }
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
fn a_load_beyond_the_limit_point_says_where_the_path_turns() {
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
    let said = format!("turns back at load {turn:.3}");
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
fn a_start_turned_inside_out_is_refused() {
    let body = bar("neo_hookean", [2, 1, 1]);
    let mut load = problem(&body, clamped(&body));
    let mut start = vec![0.0; body.n_dofs()];
    start[3 * face(&body, 0, 1)[0] as usize] = -2.0 * SIZE[0];
    load.start = Some(start);
    let sentence = refusal(&load);
    assert!(sentence.contains("inside out") && sentence.contains("cell"), "{sentence}");
}

#[test]
fn bodies_that_nothing_holds_are_refused() {
    let body = bar("neo_hookean", [2, 1, 1]);
    assert!(refusal(&problem(&body, Vec::new())).contains("nothing holds the part of 12 points"));
    let in_plane = clamped(&body).into_iter().filter(|(dof, _)| dof % 3 != 1).collect();
    assert!(refusal(&problem(&body, in_plane)).contains("in y"));

    let (points, cells) = block([2, 1, 1], SIZE);
    let n = points.len() as u32;
    let apart = points.iter().map(|x| [x[0], x[1], x[2] + 0.1]);
    let twice: Vec<[u32; 4]> = cells.iter().map(|cell| cell.map(|node| node + n)).collect();
    let both = Body::new(
        points.iter().copied().chain(apart).collect(),
        [cells, twice].concat(),
        body.material().clone(),
    )
    .unwrap();
    let sentence = refusal(&problem(&both, clamped(&body)));
    assert!(sentence.contains("the part of 12 points around point 12 in x"), "{sentence}");
}

#[test]
fn bad_loads_are_refused_with_the_place_and_the_value() {
    let body = bar("neo_hookean", [2, 1, 1]);
    let refused = |change: &dyn Fn(&mut Problem)| {
        let mut load = problem(&body, clamped(&body));
        change(&mut load);
        refusal(&load)
    };
    let cases = [
        (refused(&|_| ()), "accepted"),
        (refused(&|l| l.force[7] = f64::NAN), "force is NaN at point 2"),
        (refused(&|l| l.force.truncate(5)), "force has 5 values; it needs 36"),
        (refused(&|l| l.start = Some(vec![f64::INFINITY; 36])), "start displacement is inf"),
        (refused(&|l| l.pressure.values.push(1.0)), "1 pressures for 0 faces"),
        (
            refused(&|l| {
                l.pressure = Pressure { faces: vec![vec![0, 1, 3]], values: vec![f64::NAN] }
            }),
            "pressure on face 0 is NaN",
        ),
        (
            refused(&|l| l.pressure = Pressure { faces: vec![vec![0, 1, 99]], values: vec![1.0] }),
            "face 0, [0, 1, 99], is none of the mesh",
        ),
        (
            refused(&|l| l.prescribed.push((1, 0.1))),
            "y displacement of point 0 is prescribed twice",
        ),
        (refused(&|l| l.prescribed.push((5, f64::NAN))), "z displacement of point 1 is NaN"),
        (refused(&|l| l.prescribed.push((36, 0.0))), "at point 12; there are 12 points"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

#[test]
fn bad_patches_are_refused_with_their_number() {
    let body = bar("neo_hookean", [2, 1, 1]);
    let refused = |patches: &[(f64, u32, f64)]| {
        let mut load = problem(&body, clamped(&body));
        load.patches.extend(patches.iter().map(|&(weight, node, d)| PatchLoad {
            patch: Patch { nodes: vec![node], weights: vec![weight] },
            displacement: [0.0, d, 0.0],
        }));
        refusal(&load)
    };
    let cases = [
        (refused(&[(1.0, 2, 0.0), (1.0, 5, 0.001)]), "accepted"),
        (refused(&[(0.9, 2, 0.0)]), "patch 0 has 1 nodes and 1 weights with sum 0.9"),
        (refused(&[(1.0, 2, 0.0), (1.0, 12, 0.0)]), "patch 1 uses point 12"),
        (refused(&[(1.0, 2, f64::NAN)]), "patch 0 is displaced by [0.0, NaN, 0.0]"),
        (refused(&[(1.0, 0, 0.0)]), "the x displacement of every point of patch 0 is prescribed"),
        (refused(&[(1.0, 2, 0.0), (1.0, 2, 0.1)]), "patches 0 and 1 are the same"),
    ];
    let mut load = problem(&body, clamped(&body));
    for (nodes, weights) in
        [(vec![2], vec![1.0]), (vec![5], vec![1.0]), (vec![2, 5], vec![0.3, 0.7])]
    {
        load.patches.push(PatchLoad { patch: Patch { nodes, weights }, displacement: [0.0; 3] });
    }
    let sentence = refusal(&load);
    assert!(sentence.contains("patch 2 follows from those of the patches before"), "{sentence}");
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

#[test]
fn bad_settings_are_refused() {
    let body = bar("neo_hookean", [2, 1, 1]);
    let load = problem(&body, clamped(&body));
    let usual = Newton::default();
    for (settings, words) in [
        (Newton { tolerance: 0.0, ..usual }, "tolerance of Newton's method is 0;"),
        (Newton { tolerance: f64::NAN, ..usual }, "tolerance of Newton's method is NaN;"),
        (Newton { smallest_step: -1.0, ..usual }, "smallest_step of Newton's method is -1;"),
        (Newton { max_iterations: 0, ..usual }, "max_iterations of Newton's method is 0;"),
    ] {
        let sentence = settings.solve(&load, &mut |_| true).err().unwrap().to_string();
        assert!(sentence.contains(words), "{sentence}");
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

/// A column of twenty times its thickness, without Poisson's effect, so that pressed straight it stays in uniform strain.
fn column() -> (Body, [f64; 3]) {
    let size = [0.2, 0.01, 0.01];
    let (points, cells) = block([12, 1, 1], size);
    let law = Material::new("saint_venant_kirchhoff", vec![vec![MU, 0.0]]).unwrap();
    (Body::with_element(Element::P2, points, cells, law).unwrap(), size)
}

fn methods() -> [Method; 3] {
    let cg = |preconditioner| {
        Method::ConjugateGradients(ConjugateGradients {
            preconditioner,
            tolerance: 1e-9,
            max_iterations: 4000,
            ..ConjugateGradients::default()
        })
    };
    [Method::Cholesky, cg(Preconditioner::LaggedCholesky), cg(Preconditioner::BlockJacobi)]
}

/// Both ends clamped and the one moved: the first step is exact, and the only tangent before it is that of rest. Rounding,
/// or what conjugate gradients leave, may bend the column on: it has passed an instability all the same. Euler's strain is
/// `4 pi^2 I / (A L^2)`.
#[test]
fn a_straight_column_is_unstable_beyond_its_euler_load() {
    let (body, [length, height, _]) = column();
    let euler = 4.0 * PI.powi(2) * height.powi(2) / (12.0 * length.powi(2));
    let at = |x: f64| (0u32..).zip(body.points()).filter(move |(_, p)| (p[0] - x).abs() < 1e-12);
    for (part, method) in [0.9, 1.1].into_iter().flat_map(|p| methods().map(|m| (p, m))) {
        let hold =
            |(n, _), by: f64| (0..3).map(move |i| (3 * n + i, if i == 0 { by } else { 0.0 }));
        let moved = at(length).flat_map(|node| hold(node, -part * euler * length));
        let load = problem(&body, at(0.0).flat_map(|node| hold(node, 0.0)).chain(moved).collect());
        let state = Newton { method, ..Newton::default() }.solve(&load, &mut |_| true).unwrap();
        let expected =
            if part < 1.0 { Status::Converged } else { Status::ConvergedPastInstability };
        assert_eq!(state.status, expected, "{part} of Euler's load, {method:?}: {}", state.message);
    }
}

/// One end clamped and the other pressed by a dead force: `pi^2 E I / (4 L^2)`.
#[test]
fn a_straight_column_under_a_dead_force_is_unstable_beyond_its_euler_load() {
    let (body, [length, height, _]) = column();
    let euler = PI.powi(2) * 2.0 * MU * height.powi(4) / (48.0 * length.powi(2));
    let pressed: Vec<[u32; 3]> = surface(&body.points()[..body.n_corners()], body.cells())
        .into_iter()
        .filter(|t| t.iter().all(|&n| (body.points()[n as usize][0] - length).abs() < 1e-12))
        .collect();
    let faces: Vec<Vec<u32>> = pressed.iter().map(|t| t.to_vec()).collect();
    let unit = Pressure { values: vec![1.0 / height.powi(2); faces.len()], faces };
    for (part, method) in [0.9, 1.1].into_iter().flat_map(|p| methods().map(|m| (p, m))) {
        let held = (0u32..).zip(body.points()).filter(|(_, p)| p[0] == 0.0);
        let held = held.flat_map(|(n, _)| (0..3).map(move |i| (3 * n + i, 0.0))).collect();
        let mut load = problem(&body, held);
        unit.add_force(&body, &vec![0.0; body.n_dofs()], part * euler, &mut load.force);
        let state = Newton { method, ..Newton::default() }.solve(&load, &mut |_| true).unwrap();
        let expected =
            if part < 1.0 { Status::Converged } else { Status::ConvergedPastInstability };
        assert_eq!(state.status, expected, "{part} of Euler's load, {method:?}: {}", state.message);
    }
}

#[test]
fn an_ordinary_solution_needs_no_tangent_to_say_that_it_is_stable() {
    for (law, iterations) in [("neo_hookean", 3), ("linear", 1)] {
        let body = bar(law, [4, 2, 2]);
        let state = solve(&pulled(&body, [0.002, 0.001, 0.0]));
        assert_eq!(state.status, Status::Converged);
        assert!(state.iterations >= iterations && state.factorizations == state.iterations);
    }
}
