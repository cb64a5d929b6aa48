//! Frames against full solutions, motion against its conservation laws and beam theory, relaxation against Prony's
//! curve.

mod extrapolation;
mod inertia;
mod memory;
mod overload;
mod regions;
mod turn;

use super::*;
use crate::equilibrium::{ConjugateGradients, Method, Newton, Preconditioner};
use crate::law::Material;
use crate::mesh::samples::{block, noise};

const DEPTH: f64 = -0.06;
const DENSITY: f64 = 1000.0;
const STILL: Input<'_> =
    Input { values: &[], means: &[], turns: &[], force: &[], torques: &[], gravity: [0.0; 3] };

fn body(law: &str, parameters: &[f64], n: [usize; 3], size: [f64; 3]) -> Body {
    let (points, cells) = block(n, size);
    let material = Material::new(law, vec![parameters.to_vec()]).unwrap();
    Body::new(points, cells, material).unwrap()
}

fn bar(law: &str) -> Body {
    body(law, &[1e4, 4e4], [4, 2, 2], [0.4, 0.2, 0.2])
}

fn nodes(body: &Body, choose: impl Fn(&[f64; 3]) -> bool) -> Vec<u32> {
    (0u32..).zip(body.points()).filter(|(_, x)| choose(x)).map(|(n, _)| n).collect()
}

fn dofs(nodes: &[u32]) -> Vec<u32> {
    nodes.iter().flat_map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect()
}

fn root(body: &Body) -> Vec<u32> {
    dofs(&nodes(body, |x| x[0] == 0.0))
}

fn tip(body: &Body) -> Patch {
    let nodes = nodes(body, |x| x[0] == 0.4 && x[2] == 0.2);
    let weights = vec![1.0 / nodes.len() as f64; nodes.len()];
    Patch { nodes, weights }
}

fn pressed(body: &Body) -> crate::equilibrium::Equilibrium {
    pressed_by(body, DEPTH)
}

fn pressed_by(body: &Body, depth: f64) -> crate::equilibrium::Equilibrium {
    let problem = Problem {
        body,
        prescribed: root(body).into_iter().map(|dof| (dof, 0.0)).collect(),
        force: vec![0.0; body.n_dofs()],
        pressure: Pressure::default(),
        patches: vec![PatchLoad { patch: tip(body), displacement: [0.0, 0.0, depth] }],
        start: None,
    };
    Newton::default().solve(&problem, &mut |_| true).unwrap()
}

fn held(body: &Body, settings: StepperSettings) -> Stepper {
    let mut stepper = Stepper::new(body, &root(body), None, settings).unwrap();
    stepper.grasp(body, &[], &[tip(body)]).unwrap();
    stepper
}

fn press<'a>(means: &'a [[f64; 3]; 1]) -> Input<'a> {
    Input { means, ..STILL }
}

const MATRIX_FREE: ConjugateGradients = ConjugateGradients {
    preconditioner: Preconditioner::BlockJacobi,
    tolerance: 1e-4,
    max_iterations: 500,
    is_matrix_free: true,
    device: None,
};

fn methods() -> Vec<Method> {
    let with_matrix = ConjugateGradients { is_matrix_free: false, ..MATRIX_FREE };
    let cg = |(_, preconditioner)| {
        Method::ConjugateGradients(ConjugateGradients { preconditioner, ..with_matrix })
    };
    let others = [Method::Cholesky, Method::ConjugateGradients(MATRIX_FREE)];
    others.into_iter().chain(Preconditioner::NAMES.map(cg)).collect()
}

fn dynamic(integration: Integration, mass: Mass, time_step: f64) -> StepperSettings {
    StepperSettings {
        time_step: Some(time_step),
        density: vec![DENSITY],
        dynamics: Some(Dynamics { integration, mass, damping: [0.0; 2] }),
        ..Default::default()
    }
}

const TRAPEZOID: Integration = Integration::Newmark { beta: 0.25, gamma: 0.5 };

fn viscous(g: &[f64], tau: &[f64], time_step: f64) -> StepperSettings {
    StepperSettings {
        time_step: Some(time_step),
        relaxation: Some(Prony { g: g.to_vec(), tau: tau.to_vec() }),
        ..Default::default()
    }
}

/// A hand that moves in steps and then waits ends where Newton's method does, with every solver.
#[test]
fn a_hand_that_waits_finds_newtons_equilibrium() {
    let body = bar("neo_hookean");
    let exact = pressed(&body);
    for method in methods() {
        let mut stepper = held(&body, StepperSettings { method, ..Default::default() });
        let mut last = None;
        for k in 1..=18 {
            let d = [0.0, 0.0, DEPTH * (f64::from(k) / 10.0).min(1.0)];
            last = Some(stepper.frame(&body, &press(&[d])).unwrap());
        }
        let frame = last.unwrap();
        assert!(frame.residual < 1e-9 && frame.taken == 1.0, "{method:?} {frame:?}");
        for (u, v) in stepper.displacement().iter().zip(&exact.displacement) {
            assert!((u - v).abs() < 1e-9, "{method:?}");
        }
        let (f, g) = (frame.patch_forces[0][2], exact.patch_forces[0][2]);
        assert!((f - g).abs() < 1e-6 * g.abs(), "{method:?} {f} {g}");
        assert!((frame.energy - exact.energy).abs() < 1e-8 * exact.energy);
    }
}

/// What is let go springs back, and can be grasped again elsewhere: node by node this time.
#[test]
fn grasp_release_and_grasp_again() {
    let body = bar("neo_hookean");
    let exact = pressed(&body);
    for method in methods() {
        let mut stepper = held(&body, StepperSettings { method, ..Default::default() });
        (0..6).for_each(|_| drop(stepper.frame(&body, &press(&[[0.0, 0.0, -0.01]])).unwrap()));
        stepper.grasp(&body, &[], &[]).unwrap();
        (0..8).for_each(|_| drop(stepper.frame(&body, &STILL).unwrap()));
        assert!(stepper.displacement().iter().all(|u| u.abs() < 1e-9), "{method:?}: back at rest");
        let held = dofs(&tip(&body).nodes);
        stepper.grasp(&body, &held, &[]).unwrap();
        for k in 1..=20 {
            let share = (f64::from(k) / 10.0).min(1.0);
            let values: Vec<f64> =
                held.iter().map(|&dof| share * exact.displacement[dof as usize]).collect();
            stepper.frame(&body, &Input { values: &values, ..STILL }).unwrap();
        }
        // Not the same equilibrium, since a patch holds only a mean; but the tip is where it was put.
        for &dof in &held {
            let (u, v) = (stepper.displacement()[dof as usize], exact.displacement[dof as usize]);
            assert!((u - v).abs() < 1e-12, "{method:?}");
        }
        let sum: f64 = stepper.reactions().skip(2).step_by(3).sum();
        assert!(sum.abs() < 1e-5, "{method:?}: {sum} N in balance");
    }
}

/// A hand that jumps through the organ is held back until no cell is inside out.
#[test]
fn a_jump_is_cut_back_and_said() {
    let body = bar("neo_hookean");
    for method in methods() {
        let mut stepper = held(&body, StepperSettings { method, ..Default::default() });
        let frame = stepper.frame(&body, &press(&[[-0.5, 0.0, 0.0]])).unwrap();
        assert!(frame.taken < 1.0 && frame.energy.is_finite());
        assert!(body.smallest_jacobian(stepper.displacement()).0 > 0.0);
    }
}

#[test]
fn a_bad_frame_or_grasp_leaves_the_state_alone() {
    let body = bar("neo_hookean");
    let mut stepper = held(&body, StepperSettings::default());
    stepper.frame(&body, &press(&[[0.0, 0.0, -0.01]])).unwrap();
    let before = stepper.displacement().to_vec();
    assert!(stepper.frame(&body, &press(&[[f64::NAN, 0.0, 0.0]])).is_err());
    assert!(stepper.frame(&body, &STILL).is_err());
    let error = stepper.frame(&body, &Input { gravity: [0.0, 0.0, -9.81], ..press(&[[0.0; 3]]) });
    assert!(error.unwrap_err().to_string().contains("density"));
    let error = stepper.grasp(&body, &[root(&body)[4]], &[]).unwrap_err().to_string();
    assert!(error.contains("prescribed twice"), "{error}");
    assert_eq!(before, stepper.displacement());
    stepper.frame(&body, &press(&[[0.0, 0.0, -0.01]])).unwrap();
}

/// One stiff cell, nearly crushed, has a curvature many times more negative than the mean of the diagonal is positive.
#[test]
fn a_crushed_cell_comes_out_again() {
    let (points, cells) = block([4, 2, 2], [0.4, 0.2, 0.2]);
    let middle = points.iter().position(|x| *x == [0.2, 0.1, 0.1]).unwrap();
    let mut start = vec![0.0; 3 * points.len()];
    start[3 * middle] = 0.07;
    let law = |parameters| Material::new("mooney_rivlin J^2-1", parameters).unwrap();
    let soft = vec![1e3, 3e2, 1e5];
    let whole = Body::new(points.clone(), cells.clone(), law(vec![soft.clone()])).unwrap();
    let mut parameters = vec![soft; cells.len()];
    let (_, crushed) = whole.smallest_jacobian(&start);
    parameters[crushed].iter_mut().for_each(|p| *p *= 1e4);
    let body = Body::new(points, cells, law(parameters)).unwrap();
    for method in methods() {
        let settings = StepperSettings { method, ..Default::default() };
        let mut stepper = Stepper::new(&body, &root(&body), Some(start.clone()), settings).unwrap();
        assert!(stepper.frame(&body, &STILL).unwrap().is_unstable, "{method:?}");
        let last = (0..100).map(|_| stepper.frame(&body, &STILL).unwrap()).last().unwrap();
        assert!(last.residual < 1e-9 && last.taken == 1.0, "{method:?} {last:?}");
        assert!(stepper.displacement().iter().all(|u| u.abs() < 1e-9), "{method:?}: at rest");
    }
}

/// On the way of a large motion tangents may be indefinite; a frame that ends in stable equilibrium does not say so.
#[test]
fn a_stable_frame_is_not_called_unstable_for_what_was_on_its_way() {
    let body = body("neo_hookean", &[4e4, 6e4], [10, 2, 2], [1.0, 0.2, 0.2]);
    let settings = StepperSettings { iterations: 30, settled: 1e-6, ..Default::default() };
    let mut stepper = Stepper::new(&body, &root(&body), None, settings).unwrap();
    let mut force = vec![0.0; body.n_dofs()];
    for node in nodes(&body, |x| x[0] == 1.0) {
        force[3 * node as usize + 2] = -4.0;
    }
    let frame = stepper.frame(&body, &Input { force: &force, ..STILL }).unwrap();
    assert!(frame.is_settled && frame.steps > 3, "{frame:?}");
    assert!(!frame.is_unstable, "{frame:?}");
    assert!(stepper.displacement().iter().any(|u| u.abs() > 0.1));
}

/// A hand that jumps about by the size of the body, as it comes: nothing is crushed, and let go the body comes to rest.
#[test]
fn a_jerky_hand_does_no_harm() {
    let body = body("mooney_rivlin J^2-1", &[2e3, 5e2, 1e5], [4, 2, 2], [0.4, 0.2, 0.2]);
    let newmark = Integration::Newmark { beta: 0.25, gamma: 0.5 };
    let mut moving = dynamic(newmark, Mass::Lumped, 1.0 / 60.0);
    moving.dynamics.as_mut().unwrap().damping = [5.0, 0.01];
    for settings in [StepperSettings::default(), moving] {
        for method in methods() {
            let mut stepper = held(&body, StepperSettings { method, ..settings.clone() });
            let (jumps, mut cuts) = (noise(3 * 200, 7), 0);
            for jump in jumps.as_chunks::<3>().0 {
                let frame = stepper.frame(&body, &press(&[jump.map(|x| 0.6 * x)])).unwrap();
                assert!(frame.energy.is_finite() && frame.residual.is_finite());
                cuts += usize::from(frame.taken < 1.0);
                assert!(body.smallest_jacobian(stepper.displacement()).0 > 0.05);
            }
            assert!(cuts > 50, "{method:?}: {cuts} of 200 cut");
            stepper.grasp(&body, &[], &[]).unwrap();
            let last = (0..300).map(|_| stepper.frame(&body, &STILL).unwrap()).last().unwrap();
            let largest = stepper.displacement().iter().fold(0.0f64, |a, u| a.max(u.abs()));
            assert!(last.taken == 1.0 && largest < 1e-3, "{method:?} {largest} {last:?}");
        }
    }
}

/// Inertia, damping, memory and pressure are added to a tangent without a matrix as to one with it.
#[test]
fn frames_without_a_matrix_are_those_with_a_factor() {
    let body = bar("neo_hookean");
    let faces: Vec<Vec<u32>> = body.surface().iter().take(9).map(|f| f.to_vec()).collect();
    let pressure = Pressure { values: vec![-300.0; faces.len()], faces };
    for mass in [Mass::Lumped, Mass::Consistent] {
        let tight = ConjugateGradients { tolerance: 1e-12, ..MATRIX_FREE };
        let ways = [Method::Cholesky, Method::ConjugateGradients(tight)].map(|method| {
            let settings = StepperSettings {
                method,
                dynamics: Some(Dynamics { integration: TRAPEZOID, mass, damping: [2.0, 0.01] }),
                density: vec![DENSITY],
                ..viscous(&[0.3], &[0.05], 0.01)
            };
            let mut stepper = held(&body, settings);
            stepper.set_pressure(&body, pressure.clone()).unwrap();
            for k in 1..=12 {
                let d = [[0.0, 0.002 * f64::from(k), -0.004 * f64::from(k)]];
                assert!(stepper.frame(&body, &press(&d)).unwrap().is_solved);
            }
            stepper.displacement().to_vec()
        });
        let largest = ways[0].iter().fold(0.0f64, |a, u| a.max(u.abs()));
        let gap = ways[0].iter().zip(&ways[1]).fold(0.0f64, |a, (u, v)| a.max((u - v).abs()));
        assert!(largest > 0.04 && gap < 1e-9 * largest, "{mass:?}: {gap} of {largest}");
    }
}

#[test]
fn a_spent_budget_is_said() {
    let body = bar("neo_hookean");
    let cg = ConjugateGradients { tolerance: 1e-6, max_iterations: 3, ..MATRIX_FREE };
    let method = Method::ConjugateGradients(cg);
    let mut stepper = held(&body, StepperSettings { method, ..Default::default() });
    let frame = stepper.frame(&body, &press(&[[0.0, 0.0, -0.02]])).unwrap();
    assert!(frame.iterations == 3 && !frame.is_solved && frame.within_budget, "{frame:?}");
    assert!(frame.residual > 1e-4);
    let budget = Some(1e-9);
    let mut stepper = held(&body, StepperSettings { method, budget, ..Default::default() });
    let frame = stepper.frame(&body, &press(&[[0.0, 0.0, -0.02]])).unwrap();
    assert!(frame.iterations == 1 && !frame.is_solved && !frame.within_budget, "{frame:?}");
}

#[test]
fn bad_settings_are_refused_with_the_value_and_what_to_do() {
    let good = dynamic(TRAPEZOID, Mass::Lumped, 0.01);
    let with = |change: &dyn Fn(&mut StepperSettings)| {
        let mut settings = good.clone();
        change(&mut settings);
        settings.check().err().map_or("accepted".into(), |e| e.to_string())
    };
    let damping = |d| Some(Dynamics { damping: d, ..good.dynamics.unwrap() });
    let newmark = |beta, gamma| {
        let integration = Integration::Newmark { beta, gamma };
        Some(Dynamics { integration, ..good.dynamics.unwrap() })
    };
    let prony = |g: &[f64], tau: &[f64]| Some(Prony { g: g.to_vec(), tau: tau.to_vec() });
    let (points, cells) = block([1; 3], [0.1; 3]);
    let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
    let quadratic = Body::with_element(Element::P2, points, cells, material).unwrap();
    let refused = Stepper::new(&quadratic, &[], None, viscous(&[0.5], &[1.0], 0.01));
    let refused = refused.err().map_or("accepted".into(), |e| e.to_string());
    let cases = [
        (refused, "choose element=\"P1\""),
        (with(&|_| ()), "accepted"),
        (with(&|s| s.time_step = Some(-0.01)), "time_step is -0.01 s"),
        (with(&|s| s.time_step = None), "need a time_step"),
        (with(&|s| s.budget = Some(0.0)), "budget is 0 s"),
        (with(&|s| s.settled = f64::NAN), "settled is NaN"),
        (with(&|s| s.iterations = 0), "at least one Newton iteration"),
        (with(&|s| s.density.clear()), "needs a density"),
        (with(&|s| s.dynamics = damping([-1.0, 0.0])), "[-1.0, 0.0]"),
        (with(&|s| s.dynamics = newmark(0.1, 0.5)), "2 beta >= gamma >= 1/2"),
        (with(&|s| s.relaxation = prony(&[0.5, 0.6], &[1.0, 1.0])), "sum below 1"),
        (with(&|s| s.relaxation = prony(&[0.5], &[0.0])), "tau = 0 s"),
        (with(&|s| s.relaxation = prony(&[0.5], &[])), "one time for each modulus"),
        (with(&|s| s.relaxation = prony(&[], &[0.5])), "0 moduli g and 1 times tau"),
        (with(&|s| s.relaxation = prony(&[], &[])), "neither moduli g nor times tau; give one of"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}
