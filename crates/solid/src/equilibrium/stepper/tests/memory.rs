//! Tissue that relaxes.

use super::super::regions::square;
use super::*;
use crate::body::{Link, Ties};
use crate::element::Element;
use crate::mesh::samples::noise;

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
    let settings = StepperSettings {
        iterations: 7,
        settled: 1e-12,
        ..viscous(&[0.5, 0.2], &[0.05, 0.5], 0.02)
    };
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
    assert!(work > 0.05 * body.force_scale() * 1e-6 && work.is_finite(), "{work} J");
    let mut elastic =
        held(&body, StepperSettings { iterations: 7, settled: 1e-12, ..Default::default() });
    let frame = elastic.frame(&body, &press(&[[0.0, 0.0, 0.5 * DEPTH]])).unwrap();
    assert!(work > 0.05 * frame.energy, "{work} J of {} J", frame.energy);
}

/// The bar on elastic ground at a node of its tip, with a spring between two others.
fn tied_bar() -> Body {
    let (points, cells) = block([4, 2, 2], [0.4, 0.2, 0.2]);
    let last = points.len() as u32 - 1;
    let ties = Ties {
        start: vec![0, 1],
        nodes: vec![last],
        weights: vec![1.0],
        stiffness: vec![[90.0, 10.0, 0.0, 10.0, 70.0, 5.0, 0.0, 5.0, 80.0]],
        links: vec![Link {
            ends: vec![(last, 1.0), (last / 2, -1.0)],
            rest: [0.2, 0.1, 0.1],
            stiffness: 60.0,
            length: 0.2,
            is_cable: false,
        }],
        contact_pairs: Vec::new(),
    };
    let law = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
    Body::tied(Element::P1, points, cells, law, ties).unwrap()
}

/// However long a frame is, the force of cells fades and that of ties stays.
#[test]
fn ties_do_not_relax() {
    let body = tied_bar();
    let u = deformed(&body);
    let (mut whole, mut of_ties) = (vec![0.0; u.len()], vec![0.0; u.len()]);
    body.internal_force(&u, &mut whole);
    body.ties().unwrap().add_internal_force(&u, &mut of_ties);
    for h in [1e-3, 0.05, 1.0] {
        let path = vec![u.clone(); 2 + (20.0 * 0.05 / h) as usize];
        let forces = followed(&body, viscous(&[0.6], &[0.05], h), &path);
        let expected: Vec<f64> =
            whole.iter().zip(&of_ties).map(|(f, t)| 0.4 * (f - t) + t).collect();
        let gap: Vec<f64> =
            forces[path.len() - 1].iter().zip(&expected).map(|(a, b)| a - b).collect();
        assert!(norm(&gap) < 1e-6 * norm(&of_ties), "{h} s: {}", norm(&gap) / norm(&of_ties));
    }
}

/// Frames of tied tissue under a load converge, assembled or not, and end where statics with what is left of the stress do.
#[test]
fn tied_tissue_creeps_to_the_equilibrium_of_what_is_left_of_its_stress() {
    let body = tied_bar();
    let mut force = vec![0.0; body.n_dofs()];
    force[3 * 20 + 2] = -2.0;
    let long = {
        let law = Material::new("neo_hookean", vec![vec![4e3, 1.6e4]]).unwrap();
        let ties = body.ties().unwrap().clone();
        Body::tied(Element::P1, body.points().to_vec(), body.cells().to_vec(), law, ties).unwrap()
    };
    let problem = Problem {
        body: &long,
        prescribed: root(&long).into_iter().map(|dof| (dof, 0.0)).collect(),
        force: force.clone(),
        pressure: Pressure::default(),
        patches: Vec::new(),
        start: None,
    };
    let end = Newton::default().solve(&problem, &mut |_| true).unwrap().displacement;
    for method in [Method::Cholesky, Method::ConjugateGradients(MATRIX_FREE)] {
        for h in [0.02, 1.0] {
            let settings = StepperSettings {
                method,
                iterations: 12,
                settled: 1e-10,
                ..viscous(&[0.6], &[0.05], h)
            };
            let mut stepper = Stepper::new(&body, &root(&body), None, settings).unwrap();
            for _ in 0..200 {
                let frame = stepper.frame(&body, &Input { force: &force, ..STILL }).unwrap();
                assert!(frame.residual < 1e-9, "{method:?} {frame:?}");
            }
            let gap: Vec<f64> =
                stepper.displacement().iter().zip(&end).map(|(a, b)| a - b).collect();
            assert!(norm(&gap) < 1e-6 * norm(&end), "{h} s: {}", norm(&gap) / norm(&end));
        }
    }
}

/// The law of small strains remembers its own stress: a bar that bends far creeps as far as its law says, in every frame.
#[test]
fn a_law_of_small_strains_creeps_in_proportion() {
    let body = body("linear", &[1e4, 4e4], [8, 1, 1], [0.4, 0.05, 0.05]);
    let mut force = vec![0.0; body.n_dofs()];
    nodes(&body, |x| x[0] == 0.4).iter().for_each(|&n| force[3 * n as usize + 2] = -0.05);
    let settings =
        StepperSettings { settled: 1e-10, iterations: 3, ..viscous(&[0.6], &[0.05], 0.1) };
    let mut stepper = Stepper::new(&body, &root(&body), None, settings).unwrap();
    let input = Input { force: &force, ..STILL };
    let sag = |stepper: &Stepper| stepper.displacement().iter().fold(0.0f64, |low, &u| low.min(u));
    let mut sags = Vec::new();
    for _ in 0..60 {
        let frame = stepper.frame(&body, &input).unwrap();
        assert!(frame.residual < 1e-9, "{frame:?}");
        sags.push(sag(&stepper));
    }
    let mut elastic = Stepper::new(&body, &root(&body), None, StepperSettings::default()).unwrap();
    elastic.frame(&body, &input).unwrap();
    let (first, last) = (sag(&elastic), sags[59]);
    assert!(first < -0.04, "it bends far: {first} m");
    assert!(sags.is_sorted_by(|a, b| *a > b - 1e-12), "{sags:?}");
    assert!((0.4 * last / first - 1.0).abs() < 1e-6, "{last} {first}");
}
