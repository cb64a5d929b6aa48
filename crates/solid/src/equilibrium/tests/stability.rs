//! What a solution says of its stability.

use super::*;
use std::f64::consts::PI;

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
