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

/// A cube clamped below, its top pulled up to three times its height.
fn drawn(law: &str, row: Vec<f64>) -> Equilibrium {
    let (points, cells) = block([3, 3, 3], [0.1; 3]);
    let body = Body::new(points, cells, Material::new(law, vec![row]).unwrap()).unwrap();
    let nodes = (0u32..).zip(body.points());
    let ends = nodes.filter(|(_, x)| x[2] == 0.0 || (x[2] - 0.1).abs() < 1e-12);
    let held = ends.flat_map(|(n, x)| [(3 * n, 0.0), (3 * n + 1, 0.0), (3 * n + 2, 2.0 * x[2])]);
    solve(&problem(&body, held.collect()))
}

/// Next to the pole of its energy a body moves ever faster where it does not lock yet, as next to a limit point, but it
/// resists more and more.
#[test]
fn a_body_that_locks_is_not_told_as_next_to_a_limit_point() {
    for (energy, row) in [
        ("-mu*Jm/2*log(1 - (I1bar - 3)/Jm) + k*log(J)**2", vec![1e3, 0.3, 5e3]),
        ("-mu*Jm/2*log(1 - (I1 - 3)/Jm) - mu*log(J) + k*log(J)**2", vec![1e3, 0.5, 2e3]),
        (
            "mu/2*(I1bar - 3) + k*log(J)**2 - q*log(1 - ((I4 - 1)/a)**2)",
            vec![1e3, 5e3, 1e2, 0.3, 0.0, 0.0, 1.0],
        ),
    ] {
        let state = drawn(&format!("formula {energy}"), row);
        assert_eq!(state.status, Status::StepTooSmall, "{energy}: {}", state.message);
        let said = state.message.contains("to where its law has no energy");
        assert!(said && !state.message.contains("singular"), "{energy}: {}", state.message);
    }
}

/// The exponential of a law leaves the numbers before its body is where it is pulled to.
#[test]
fn forces_that_overflow_are_told_in_words() {
    let state = drawn("formula mu*exp(b*(I1bar - 3)) + k*log(J)**2", vec![500.0, 1e3, 5e3]);
    assert_eq!(state.status, Status::StepTooSmall, "{}", state.message);
    let said = state.message.contains("the forces of a smaller load step still overflow");
    assert!(said, "{}", state.message);
}

/// A bar that softens, of which a part is weaker: when that yields, the rest springs back.
#[test]
fn a_bar_that_snaps_back_is_told_as_next_to_a_limit_point() {
    let (points, cells) = block([3, 1, 1], SIZE);
    let is_weak = |cell: &[u32; 4]| cell.iter().all(|&n| points[n as usize][0] < 0.34 * SIZE[0]);
    let part = |cell| if is_weak(cell) { 0.95 } else { 1.0 };
    let rows = cells.iter().map(|cell| vec![part(cell) * MU, part(cell) * LAM]).collect();
    let law = Material::new("saint_venant_kirchhoff", rows).unwrap();
    let body = Body::new(points.clone(), cells.clone(), law).unwrap();
    let planes = (0..3)
        .flat_map(|axis| face(&body, axis, 0).into_iter().map(move |n| (3 * n + axis as u32, 0.0)));
    let end = face(&body, 0, 1).into_iter().map(|n| (3 * n, -0.6 * SIZE[0]));
    let state = solve(&problem(&body, planes.chain(end).collect()));
    assert_eq!(state.status, Status::LimitPoint, "{}", state.message);
}

/// Its first steps would stretch it out of proportion; the series that takes their place does not exist.
#[test]
fn a_law_without_a_power_series_is_solved_by_linear_steps() {
    let (points, cells) = block([12, 1, 1], [0.3, 0.02, 0.02]);
    let energy = "formula mu/2*(I1bar - 3) + k*log(J)**2 + mu*max(I1bar - 3, 0)**n";
    let law = Material::new(energy, vec![vec![1e4, 1e5, 2.5]]).unwrap();
    let body = Body::new(points, cells, law).unwrap();
    let ends = (0u32..).zip(body.points());
    let held =
        ends.filter(|(_, x)| x[0] == 0.0).flat_map(|(n, _)| (0..3).map(move |i| (3 * n + i, 0.0)));
    let mut load = problem(&body, held.collect());
    for (n, _) in (0..).zip(body.points()).filter(|(_, x)| (x[0] - 0.3).abs() < 1e-12) {
        load.force[3 * n + 2] = -0.02;
    }
    let state = solve(&load);
    assert_eq!(state.status, Status::Converged, "{}", state.message);
}
