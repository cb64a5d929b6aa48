//! Frames against full solutions, motion against its conservation laws and beam theory, relaxation against Prony's
//! curve.

use super::*;
use crate::equilibrium::{ConjugateGradients, Method, Newton, Preconditioner};
use crate::law::Material;
use crate::mesh::samples::{block, noise};

const DEPTH: f64 = -0.06;
const DENSITY: f64 = 1000.0;
const STILL: Input<'_> = Input { values: &[], means: &[], force: &[], gravity: [0.0; 3] };

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
    let problem = Problem {
        body,
        prescribed: root(body).into_iter().map(|dof| (dof, 0.0)).collect(),
        force: vec![0.0; body.n_dofs()],
        pressure: Pressure::default(),
        patches: vec![PatchLoad { patch: tip(body), displacement: [0.0, 0.0, DEPTH] }],
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

fn methods() -> Vec<Method> {
    let cg = |(_, preconditioner)| {
        let settings = ConjugateGradients { preconditioner, tolerance: 1e-4, max_iterations: 500 };
        Method::ConjugateGradients(settings)
    };
    std::iter::once(Method::Cholesky).chain(Preconditioner::NAMES.map(cg)).collect()
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

#[test]
fn a_spent_budget_is_said() {
    let body = bar("neo_hookean");
    let cg = ConjugateGradients {
        preconditioner: Preconditioner::BlockJacobi,
        tolerance: 1e-6,
        max_iterations: 3,
    };
    let method = Method::ConjugateGradients(cg);
    let mut stepper = held(&body, StepperSettings { method, ..Default::default() });
    let frame = stepper.frame(&body, &press(&[[0.0, 0.0, -0.02]])).unwrap();
    assert!(frame.iterations == 3 && !frame.is_solved && frame.within_budget, "{frame:?}");
    assert!(frame.residual > 1e-4);
    let budget = Some(1e-9);
    let mut stepper = held(&body, StepperSettings { method, budget, ..Default::default() });
    let frame = stepper.frame(&body, &press(&[[0.0, 0.0, -0.02]])).unwrap();
    assert!(frame.iterations == 0 && !frame.is_solved && !frame.within_budget, "{frame:?}");
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

/// A velocity that is linear in the position has its exact energy with the consistent mass of any element, and the sum
/// of the lumped masses is the mass.
#[test]
fn masses_integrate_density() {
    let size = [0.4, 0.2, 0.3];
    for element in Element::ALL {
        let (points, cells) = block([3, 2, 2], size);
        let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
        let body = Body::with_element(element, points, cells, material).unwrap();
        let matrix = |mass| MassMatrix::new(mass, &body, &body.zero_tangent(), &[DENSITY]).unwrap();
        let weight = DENSITY * size.iter().product::<f64>();
        let along = |v: &dyn Fn(&[f64; 3]) -> f64| -> Vec<f64> {
            body.points().iter().flat_map(|x| [v(x), 0.0, 0.0]).collect()
        };
        for mass in [Mass::Lumped, Mass::Consistent] {
            let energy = matrix(mass).energy(&along(&|_| 1.0));
            assert!((energy - 0.5 * weight).abs() < 1e-12 * weight, "{element:?} {mass:?}");
        }
        let energy = matrix(Mass::Consistent).energy(&along(&|x| x[1] + 2.0 * x[2]));
        let [_, b, c] = size;
        let exact = 0.5 * weight * (b * b / 3.0 + b * c + 4.0 * c * c / 3.0);
        assert!((energy - exact).abs() < 1e-12 * exact, "{element:?}: {energy} {exact}");
    }
}

/// Nothing holds the body: its momentum stays, whatever it does inside.
#[test]
fn free_flight_keeps_its_momentum() {
    for (integration, mass) in [
        (TRAPEZOID, Mass::Lumped),
        (TRAPEZOID, Mass::Consistent),
        (Integration::BackwardEuler, Mass::Consistent),
    ] {
        let body = bar("neo_hookean");
        let mut stepper = Stepper::new(&body, &[], None, dynamic(integration, mass, 1e-3)).unwrap();
        let (spin, shift) = ([0.0, 0.0, 4.0], [0.5, -0.2, 0.1]);
        let velocity: Vec<f64> = body
            .points()
            .iter()
            .flat_map(|x| {
                let turning = crate::tensor::cross(&spin, x);
                std::array::from_fn::<f64, 3, _>(|i| shift[i] + turning[i] + 0.1 * x[i])
            })
            .collect();
        stepper.set_velocity(&velocity).unwrap();
        let momentum = |v: &[f64]| {
            let nodal = nodal_weight(&body, &[DENSITY]).unwrap();
            let mut sum = [0.0; 3];
            for (v, m) in v.chunks_exact(3).zip(nodal) {
                (0..3).for_each(|i| sum[i] += m * v[i]);
            }
            sum
        };
        // The momentum of a consistent mass is that of the lumped one: its columns have the same sums.
        let before = momentum(&velocity);
        for _ in 0..100 {
            let frame = stepper.frame(&body, &STILL).unwrap();
            assert_eq!(frame.taken, 1.0);
        }
        let after = momentum(stepper.velocity().unwrap());
        (0..3).for_each(|i| assert!((after[i] - before[i]).abs() < 1e-10, "{before:?} {after:?}"));
    }
}

/// Strain and kinetic energy after each of some frames of a bent bar that is let go.
fn energies(law: &str, settings: StepperSettings, frames: usize) -> Vec<f64> {
    let body = bar(law);
    let start = Some(pressed(&body).displacement);
    let mut stepper = Stepper::new(&body, &root(&body), start, settings).unwrap();
    (0..frames)
        .map(|_| {
            let frame = stepper.frame(&body, &STILL).unwrap();
            frame.energy + frame.kinetic_energy
        })
        .collect()
}

#[test]
fn newmark_keeps_the_energy_of_a_linear_body_and_euler_does_not() {
    for mass in [Mass::Lumped, Mass::Consistent] {
        let kept = energies("linear", dynamic(TRAPEZOID, mass, 5e-3), 200);
        assert!(kept.iter().all(|e| (e - kept[0]).abs() < 1e-9 * kept[0]), "{mass:?} {kept:?}");
        let spent = energies("linear", dynamic(Integration::BackwardEuler, mass, 5e-3), 200);
        assert!(spent.windows(2).all(|e| e[1] < e[0]) && spent[199] < 0.75 * spent[0], "{mass:?}");
        let mut damped = dynamic(TRAPEZOID, mass, 5e-3);
        damped.dynamics.as_mut().unwrap().damping = [2.0, 1e-3];
        let damped = energies("linear", damped, 200);
        assert!(
            damped.windows(2).all(|e| e[1] <= e[0]) && damped[199] < 0.2 * damped[0],
            "{mass:?}"
        );
    }
}

/// One Newton iteration a frame linearises the force over the frame, which costs no order.
#[test]
fn errors_fall_with_the_order_of_the_rule() {
    let body = bar("neo_hookean");
    let start = pressed(&body).displacement;
    let end = |integration, frames: usize| {
        let settings = dynamic(integration, Mass::Lumped, 0.02 / frames as f64);
        let mut stepper = Stepper::new(&body, &root(&body), Some(start.clone()), settings).unwrap();
        for _ in 0..frames {
            stepper.frame(&body, &STILL).unwrap();
        }
        stepper.displacement().to_vec()
    };
    let exact = end(TRAPEZOID, 1280);
    let error = |integration, frames| {
        let u = end(integration, frames);
        u.iter().zip(&exact).map(|(u, v)| (u - v).powi(2)).sum::<f64>().sqrt()
    };
    for (integration, order, frames) in
        [(TRAPEZOID, 2.0, 40), (Integration::BackwardEuler, 1.0, 160)]
    {
        let rate = (error(integration, frames) / error(integration, 2 * frames)).log2();
        assert!((rate - order).abs() < 0.25, "{integration:?}: order {rate}");
    }
}

/// Half the time between two passages of the tip through rest, against `omega = 1.8751^2 sqrt(E I / (rho A L^4))`.
/// Linear tetrahedra are too stiff in bending; the excess falls with the square of their size.
#[test]
fn a_cantilever_swings_at_its_first_frequency() {
    let (young, length, height) = (1e5, 1.0, 0.1);
    let k1: f64 = 1.875_104_068_711_961;
    let exact = k1 * k1 * (young * height * height / (12.0 * DENSITY)).sqrt() / (length * length);
    let excess = |across: usize| {
        let n = [10 * across, across, across];
        let body = body("linear", &[young / 2.0, 0.0], n, [length, height, height]);
        let sigma = (k1.sinh() - k1.sin()) / (k1.cosh() + k1.cos());
        let mode = |x: f64| {
            let k = k1 * x;
            let shape = k.cosh() - k.cos() - sigma * (k.sinh() - k.sin());
            let slope = k1 * (k.sinh() + k.sin() - sigma * (k.cosh() - k.cos()));
            [1e-3 * shape, 1e-3 * slope]
        };
        let start = body.points().iter().flat_map(|x| {
            let [shape, slope] = mode(x[0]);
            [-(x[2] - 0.5 * height) * slope, 0.0, shape]
        });
        let time_step = std::f64::consts::TAU / exact / 100.0;
        let settings = dynamic(TRAPEZOID, Mass::Consistent, time_step);
        let mut stepper =
            Stepper::new(&body, &root(&body), Some(start.collect()), settings).unwrap();
        let end = 3 * nodes(&body, |x| x[0] == length)[0] as usize + 2;
        let (mut passages, mut before) = (Vec::new(), stepper.displacement()[end]);
        for k in 0..90 {
            stepper.frame(&body, &STILL).unwrap();
            let now = stepper.displacement()[end];
            if now * before <= 0.0 {
                passages.push(time_step * (f64::from(k) + before / (before - now)));
            }
            before = now;
        }
        std::f64::consts::PI / (passages[1] - passages[0]) / exact - 1.0
    };
    let [coarse, fine] = [2, 4].map(excess);
    assert!(coarse > 0.0 && fine > 0.0 && fine < 0.12, "{coarse} {fine}");
    assert!((2.5..5.0).contains(&(coarse / fine)), "{coarse} {fine}");
}

fn viscous(g: &[f64], tau: &[f64], time_step: f64) -> StepperSettings {
    StepperSettings {
        time_step: Some(time_step),
        relaxation: Some(Prony { g: g.to_vec(), tau: tau.to_vec() }),
        ..Default::default()
    }
}

/// Forces on a block all of whose nodes follow `u` frame by frame.
fn followed(body: &Body, settings: StepperSettings, path: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut stepper = Stepper::new(body, &[], None, settings).unwrap();
    let all: Vec<u32> = (0..body.n_dofs() as u32).collect();
    stepper.grasp(body, &all, &[]).unwrap();
    path.iter()
        .map(|values| {
            let frame = stepper.frame(body, &Input { values, ..STILL }).unwrap();
            assert_eq!(frame.taken, 1.0);
            stepper.reactions().collect()
        })
        .collect()
}

fn norm(v: &[f64]) -> f64 {
    square(v).sqrt()
}

fn deformed(body: &Body) -> Vec<f64> {
    noise(body.n_dofs(), 5).iter().map(|u| 0.01 * u).collect()
}

/// After a ramp of one frame the whole force fades as `1 - sum g (1 - (1 - exp(-x)) / x exp(-(n - 1) x))`.
#[test]
fn a_held_block_relaxes_along_pronys_curve() {
    let law = ("mooney_rivlin ln J", [1e3, 500.0, 4e4]);
    let body = body(law.0, &law.1, [3, 2, 2], [0.4, 0.2, 0.2]);
    let u = deformed(&body);
    let mut elastic = vec![0.0; u.len()];
    body.internal_force(&u, &mut elastic);
    let (g, tau, h) = ([0.3, 0.45], [0.02, 0.5], 0.01);
    let forces = followed(&body, viscous(&g, &tau, h), &vec![u.clone(); 200]);
    for (n, force) in forces.iter().enumerate() {
        let faded = g.iter().zip(&tau).map(|(g, tau)| {
            let x: f64 = h / tau;
            g * (1.0 - (1.0 - (-x).exp()) / x * (-(n as f64) * x).exp())
        });
        let share = 1.0 - faded.sum::<f64>();
        let expected: Vec<f64> = elastic.iter().map(|f| share * f).collect();
        let gap: Vec<f64> = force.iter().zip(&expected).map(|(a, b)| a - b).collect();
        assert!(norm(&gap) < 1e-9 * norm(&elastic), "frame {n}");
    }
    for (tau, share) in [(1e9, 1.0), (1e-9, 0.25)] {
        let force = &followed(&body, viscous(&[0.75], &[tau], h), std::slice::from_ref(&u))[0];
        assert!((norm(force) / norm(&elastic) - share).abs() < 1e-6, "tau {tau}");
    }
}

/// The memory turns with the body: a rigid turn of the held block turns its forces and nothing else.
#[test]
fn a_turn_does_not_disturb_the_memory() {
    let body = bar("neo_hookean");
    let u = deformed(&body);
    let turned: Vec<f64> = u
        .chunks_exact(3)
        .zip(body.points())
        .flat_map(|(u, x)| {
            let y: [f64; 3] = std::array::from_fn(|i| x[i] + u[i]);
            [-y[1] - x[0], y[0] - x[1], y[2] - x[2]] // a quarter turn about z
        })
        .collect();
    let settings = || viscous(&[0.6], &[0.05], 0.02);
    let straight = followed(&body, settings(), &vec![u.clone(); 3]);
    let turning = followed(&body, settings(), &[u.clone(), u, turned]);
    for (a, b) in straight[2].chunks_exact(3).zip(turning[2].chunks_exact(3)) {
        let gap = (b[0] + a[1]).abs() + (b[1] - a[0]).abs() + (b[2] - a[2]).abs();
        assert!(gap < 1e-9 * norm(&straight[2]), "{a:?} {b:?}");
    }
}

/// The tangent is that of the force with its history: Newton's iterations in a frame converge as they should.
#[test]
fn a_viscous_frame_converges_and_a_cycle_costs_work() {
    let body = bar("neo_hookean");
    let settings = StepperSettings { iterations: 7, ..viscous(&[0.5, 0.2], &[0.05, 0.5], 0.02) };
    let mut stepper = held(&body, settings);
    let (mut work, mut before) = (0.0, [0.0; 2]);
    for k in 1..=40 {
        let d = 0.5 * DEPTH * (std::f64::consts::TAU * f64::from(k) / 40.0).sin();
        let frame = stepper.frame(&body, &press(&[[0.0, 0.0, d]])).unwrap();
        assert!(frame.residual < 1e-9, "{frame:?}");
        let f = frame.patch_forces[0][2];
        work += 0.5 * (f + before[1]) * (d - before[0]);
        before = [d, f];
    }
    assert!(work > 0.05 * stepper.force_scale * 1e-6 && work.is_finite(), "{work} J");
    let mut elastic = held(&body, StepperSettings { iterations: 7, ..Default::default() });
    let frame = elastic.frame(&body, &press(&[[0.0, 0.0, 0.5 * DEPTH]])).unwrap();
    assert!(work > 0.05 * frame.energy, "{work} J of {} J", frame.energy);
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
        (with(&|s| s.iterations = 0), "at least one Newton iteration"),
        (with(&|s| s.density.clear()), "needs a density"),
        (with(&|s| s.dynamics = damping([-1.0, 0.0])), "[-1.0, 0.0]"),
        (with(&|s| s.dynamics = newmark(0.1, 0.5)), "2 beta >= gamma >= 1/2"),
        (with(&|s| s.relaxation = prony(&[0.5, 0.6], &[1.0, 1.0])), "sum below 1"),
        (with(&|s| s.relaxation = prony(&[0.5], &[0.0])), "tau = 0 s"),
        (with(&|s| s.relaxation = prony(&[0.5], &[])), "one time for each modulus"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}
