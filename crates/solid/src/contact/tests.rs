//! Distances and energies against differences of each other, and known equilibria.

mod entry;
mod following;
mod jaws;
mod lead;
mod pair_friction;
mod pairs;
mod passage;
mod samples;
mod self_contact;
mod shapes;
mod tool_steps;
mod turns;

use super::*;
use crate::equilibrium::{Dynamics, Integration, Mass};
use crate::equilibrium::{Input, Newton, Pressure, Problem, Status, Stepper, StepperSettings};
use crate::law::Material;
use crate::mesh::samples::{block, noise};
use crate::mesh::{diagonal, dot, norm, surface};
use crate::tensor::Mat3;
use std::sync::Arc;

const SIDE: f64 = 0.1;
const TRAPEZOID: Integration = Integration::Newmark { beta: 0.25, gamma: 0.5 };

fn cube(n: usize) -> Body {
    let (points, cells) = block([n; 3], [SIDE; 3]);
    let material = Material::new("neo_hookean", vec![vec![4e3, 6e3]]).unwrap();
    Body::new(points, cells, material).unwrap()
}

fn base(body: &Body) -> Vec<(u32, f64)> {
    let nodes = (0u32..).zip(body.points()).filter(|(_, x)| x[2] == 0.0);
    nodes.flat_map(|(n, _)| (0..3).map(move |i| (3 * n + i, 0.0))).collect()
}

fn problem(body: &Body, prescribed: Vec<(u32, f64)>) -> Problem<'_> {
    Problem {
        body,
        prescribed,
        force: vec![0.0; body.n_dofs()],
        pressure: Pressure::default(),
        patches: Vec::new(),
        start: None,
    }
}

fn sphere(radius: f64) -> Shape {
    Shape::Rounded { half: [0.0; 3], radius }
}

fn solid() -> Shape {
    let (points, cells) = block([1; 3], [0.06, 0.05, 0.04]);
    let points: Vec<[f64; 3]> = points
        .into_iter()
        .map(|x| std::array::from_fn(|i| x[i] - [0.03, 0.025, 0.02][i]))
        .collect();
    let triangles = surface(&points, &cells);
    Shape::Solid(Arc::new(Solid::new(points, triangles).unwrap()))
}

fn shapes() -> Vec<Shape> {
    vec![
        sphere(0.02),
        Shape::Rounded { half: [0.0, 0.0, 0.03], radius: 0.01 },
        Shape::Rounded { half: [0.03, 0.025, 0.02], radius: 0.0 },
        Shape::HalfSpace,
        solid(),
    ]
}

fn tilted(position: [f64; 3]) -> Pose {
    Pose::at(position).moved([0.0; 3], [0.3, -0.2, 0.5])
}

/// A sphere pressed into the top of a cube that a field has shaken, with a tool that has gone sideways since the start;
/// shallow enough for the tangent to have all of the curvature.
fn pressed(friction: Friction, body: &Body) -> (Contact, Vec<f64>) {
    let mut contact = Contact::new(body);
    let above = tilted([0.05, 0.045, SIDE + 0.2 + 1e-4]);
    let tool = Tool::new(sphere(0.2), friction, above);
    let number = contact.add(body, tool, &vec![0.0; body.n_dofs()]).unwrap();
    let u: Vec<f64> = noise(body.n_dofs(), 7).iter().map(|u| 1e-4 * u).collect();
    contact.place(number, above.moved([1e-3, 2e-3, -2e-3], [0.0; 3])).unwrap();
    contact.linearize(&u);
    (contact, u)
}

#[test]
fn forces_are_slopes_of_the_energy_and_the_tangent_theirs() {
    let body = cube(8);
    for friction in [Friction::Coulomb(0.0), Friction::Coulomb(0.4), Friction::Bonded] {
        let (mut contact, u) = pressed(friction, &body);
        let mut force = vec![0.0; u.len()];
        contact.add_force(&mut force);
        assert!(contact.report(0).unwrap().touching > 10);
        let direction = noise(u.len(), 11);
        let at = |length: f64| -> Vec<f64> {
            u.iter().zip(&direction).map(|(u, w)| u + length * w).collect()
        };
        let step = 1e-8;
        let slope = (contact.energy(&at(step)) - contact.energy(&at(-step))) / (2.0 * step);
        let power: f64 = force.iter().zip(&direction).map(|(f, w)| -f * w).sum();
        assert!((slope - power).abs() < 1e-5 * power.abs(), "{friction:?}: {slope} {power}");

        // The derivative of the force, friction with the bound it has: the tangent, which says so of itself.
        let mut blocks = body.zero_tangent();
        contact.add_stiffness(Curvature::Exact, &mut blocks);
        let mut product = vec![0.0; u.len()];
        blocks.multiply(&direction, &mut product);
        let mut own = vec![0.0; u.len()];
        contact.add_product(1.0, &direction, &mut own);
        let largest = product.iter().fold(0.0f64, |m, p| m.max(p.abs()));
        assert!(product.iter().zip(&own).all(|(p, o)| (p - o).abs() < 1e-12 * largest));
        if friction == Friction::Coulomb(0.0) {
            let mut side = |length: f64| {
                let mut force = vec![0.0; u.len()];
                contact.linearize(&at(length));
                contact.add_force(&mut force);
                force
            };
            let (ahead, behind) = (side(1e-7), side(-1e-7));
            for (dof, p) in product.iter().enumerate() {
                let difference = (behind[dof] - ahead[dof]) / 2e-7;
                assert!((difference - p).abs() < 2e-3 * largest, "{dof}: {difference} {p}");
            }
        }
    }
}

#[test]
fn the_tangent_of_tools_is_semidefinite() {
    let body = cube(3);
    for friction in [Friction::Coulomb(0.0), Friction::Coulomb(0.4), Friction::Bonded] {
        let (mut contact, u) = pressed(friction, &body);
        let mut blocks = body.zero_tangent();
        contact.add_stiffness(Curvature::Projected, &mut blocks);
        for seed in 0..20 {
            let x = noise(u.len(), seed);
            let mut y = vec![0.0; u.len()];
            blocks.multiply(&x, &mut y);
            assert!(x.iter().zip(&y).map(|(x, y)| x * y).sum::<f64>() >= 0.0);
        }
    }
}

#[test]
fn a_half_space_presses_evenly() {
    // Under rollers, so that the cube is in uniaxial compression.
    let body = cube(3);
    let rollers = (0u32..).zip(body.points()).flat_map(|(n, x)| {
        let on = (0..3).filter(|&i| x[i as usize] == 0.0);
        on.map(move |i| (3 * n + i, 0.0)).collect::<Vec<_>>()
    });
    let problem = problem(&body, rollers.collect());
    let down = Pose {
        rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
        position: [0.0, 0.0, SIDE],
    };
    let mut tool = Tool::new(Shape::HalfSpace, Friction::Coulomb(0.0), down);
    tool.displacement = [0.0, 0.0, -0.01];
    let mut contact = Contact::new(&body);
    contact.add(&body, tool, &vec![0.0; body.n_dofs()]).unwrap();
    let found = Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
    assert!(found.status.is_converged(), "{}", found.message);
    let report = contact.report(0).unwrap();
    assert!((report.area - SIDE * SIDE).abs() < 1e-12);
    let pressure = -report.force[2] / report.area;
    assert!(report.force[0].abs() + report.force[1].abs() < 1e-9 * report.force[2].abs());
    for (p, x) in contact.pressures(0, body.points().len()).iter().zip(body.points()) {
        let expected = if x[2] > 0.999 * SIDE { pressure } else { 0.0 };
        assert!((p - expected).abs() < 1e-6 * pressure, "{x:?}: {p} {expected}");
    }
    assert!(report.gap < 0.0 && report.gap > -1e-3 * diagonal(body.points()));
}

#[test]
fn what_pushes_is_pushed() {
    let body = cube(4);
    let problem = problem(&body, base(&body));
    for friction in [Friction::Coulomb(0.0), Friction::Coulomb(0.5), Friction::Bonded] {
        let mut tool = Tool::new(sphere(0.03), friction, Pose::at([0.05, 0.05, SIDE + 0.03]));
        tool.displacement = [0.004, 0.0, -0.01];
        let mut contact = Contact::new(&body);
        contact.add(&body, tool, &vec![0.0; body.n_dofs()]).unwrap();
        let found =
            Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
        assert!(found.status.is_converged(), "{friction:?}: {}", found.message);
        let report = contact.report(0).unwrap();
        for i in 0..3 {
            let nodes = found.internal_force.chunks_exact(3).zip(body.points());
            let held: f64 = nodes.filter(|(_, x)| x[2] == 0.0).map(|(f, _)| f[i]).sum();
            assert!((held + report.force[i]).abs() < 1e-7 * report.force[2].abs());
        }
        assert!(report.force[2] < 0.0 && report.gap > -1e-3 * diagonal(body.points()));
        let along = report.force[0];
        if friction == Friction::Coulomb(0.5) {
            assert!(along > 0.0 && along <= 0.5 * -report.force[2] * 1.1, "{report:?}");
        }
    }
}

/// On either side of each of its factors, and after each load step.
#[test]
fn a_solution_in_contact_can_be_stopped_in_every_iteration() {
    let body = cube(3);
    let problem = problem(&body, base(&body));
    let mut tool =
        Tool::new(sphere(0.03), Friction::Coulomb(0.5), Pose::at([0.05, 0.05, SIDE + 0.03]));
    tool.displacement = [0.0, 0.0, -0.01];
    let stopped_after = |allowed: usize| {
        let mut contact = Contact::new(&body);
        contact.add(&body, tool.clone(), &vec![0.0; body.n_dofs()]).unwrap();
        let mut asked = 0;
        let mut go_on = |_| {
            asked += 1;
            asked <= allowed
        };
        let found = Newton::default().solve_in_contact(&problem, &mut contact, &mut go_on);
        (found.map(|found| 2 * found.iterations + found.residuals.len()), asked)
    };
    let (whole, asked) = stopped_after(usize::MAX);
    assert!(whole == Ok(asked) && asked > 6, "{whole:?} {asked}");
    (0..asked).for_each(|n| assert_eq!(stopped_after(n), (Err(Error::Cancelled), n + 1)));
}

#[test]
fn tools_that_cannot_be_are_refused() {
    let body = cube(2);
    let refusal = |tool: Tool| {
        let mut contact = Contact::new(&body);
        let added = contact.add(&body, tool, &vec![0.0; body.n_dofs()]);
        added.err().map(|error| error.to_string()).unwrap_or_default()
    };
    let free = Tool::new(sphere(0.02), Friction::Coulomb(0.0), Pose::at([0.05, 0.05, 0.2]));
    assert_eq!(refusal(free.clone()), "");
    let inside = Tool { pose: Pose::at([0.05, 0.05, SIDE + 0.01]), ..free.clone() };
    assert!(refusal(inside).contains("starts 1.000e-2 m inside the organ"));
    let swallowed = Tool { pose: Pose::at([0.04, 0.05, 0.06]), ..free.clone() };
    let said = refusal(swallowed);
    assert!(said.contains("tool 0, a sphere at (") && said.contains(" m, starts inside the organ"));
    assert!(refusal(Tool { shape: sphere(-1.0), ..free.clone() }).contains("half sides"));
    assert!(
        refusal(Tool { friction: Friction::Coulomb(-0.1), ..free.clone() }).contains("friction")
    );
    assert!(refusal(Tool { pose: Pose::at([f64::NAN; 3]), ..free.clone() }).contains("finite"));
    assert!(
        refusal(Tool { displacement: [f64::INFINITY; 3], ..free.clone() }).contains("displacement")
    );
    assert!(refusal(Tool { stiffness: 0.0, ..free.clone() }).contains("stiffness"));
    let skewed: Mat3<f64> = [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let skewed = Pose { rotation: skewed, position: [0.0, 0.0, 1.0] };
    assert!(refusal(Tool { pose: skewed, ..free }).contains("no rotation"));
}

#[test]
fn a_frame_that_settles_is_the_equilibrium() {
    let body = cube(4);
    let problem = problem(&body, base(&body));
    let mut tool =
        Tool::new(sphere(0.03), Friction::Coulomb(0.0), Pose::at([0.05, 0.05, SIDE + 0.03]));
    tool.displacement = [0.0, 0.0, -0.01];
    let mut contact = Contact::new(&body);
    contact.add(&body, tool.clone(), &vec![0.0; body.n_dofs()]).unwrap();
    let exact = Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
    let fixed: Vec<u32> = base(&body).iter().map(|(dof, _)| *dof).collect();
    let settings = StepperSettings { iterations: 20, settled: 1e-8, ..StepperSettings::default() };
    let mut stepper = Stepper::new(&body, &fixed, None, settings).unwrap();
    let number = stepper.add_tool(&body, tool.clone()).unwrap();
    let still = Input::default();
    for k in 1..=10 {
        stepper.place_tool(number, tool.pose_at(0.1 * f64::from(k))).unwrap();
        let frame = stepper.frame(&body, &still).unwrap();
        assert!(frame.is_settled, "{frame:?}");
    }
    let difference = exact.displacement.iter().zip(stepper.displacement());
    assert!(difference.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-8);
    let [a, b] = [contact.report(0), stepper.contact().report(number)].map(|r| r.unwrap().force[2]);
    assert!((a - b).abs() < 1e-6 * a.abs());
    stepper.remove_tool(number);
    for _ in 0..3 {
        stepper.frame(&body, &still).unwrap();
    }
    assert!(stepper.displacement().iter().all(|u| u.abs() < 1e-9));
}

const GRAVITY: f64 = 9.81;
const COEFFICIENT: f64 = 0.4;

/// Mean motion along an incline, and its velocity, after every frame of 10 ms of a free block that was put on it.
fn slide(slope: f64, integration: Integration, frames: usize) -> Vec<[f64; 2]> {
    let (points, cells) = block([3, 3, 1], [SIDE, SIDE, 0.03]);
    let material = Material::new("neo_hookean", vec![vec![4e4, 6e4]]).unwrap();
    let body = Body::new(points, cells, material).unwrap();
    let settings = StepperSettings {
        iterations: 30,
        settled: 1e-7,
        time_step: Some(0.01),
        density: vec![1000.0],
        dynamics: Some(Dynamics { integration, mass: Mass::Lumped, damping: [0.0, 0.0] }),
        ..StepperSettings::default()
    };
    let mut stepper = Stepper::new(&body, &[], None, settings).unwrap();
    let table = Tool::new(Shape::HalfSpace, Friction::Coulomb(COEFFICIENT), Pose::default());
    stepper.add_tool(&body, table).unwrap();
    let (sine, cosine) = slope.atan().sin_cos();
    let gravity = [GRAVITY * sine, 0.0, -GRAVITY * cosine];
    let input = crate::equilibrium::Input { gravity, ..Default::default() };
    let mean = |v: &[f64]| v.iter().step_by(3).sum::<f64>() / (v.len() / 3) as f64;
    let one = |_| {
        let frame = stepper.frame(&body, &input).unwrap();
        assert!(frame.residual < 1e-3, "{frame:?}");
        [mean(stepper.displacement()), mean(stepper.velocity().unwrap())]
    };
    (0..frames).map(one).collect()
}

#[test]
fn a_block_on_an_incline_sticks_below_the_angle_of_friction() {
    for integration in [Integration::BackwardEuler, TRAPEZOID] {
        let path = slide(0.9 * COEFFICIENT, integration, 150);
        let creep = path[149][0] - path[49][0];
        assert!(creep.abs() < 1e-3 * SIDE, "{creep}");
    }
}

#[test]
fn and_slides_above_it_as_coulomb_says() {
    let slope = 1.25 * COEFFICIENT;
    for integration in [Integration::BackwardEuler, TRAPEZOID] {
        let path = slide(slope, integration, 60);
        let acceleration = (path[59][1] - path[29][1]) / 0.3;
        let (sine, cosine) = f64::sin_cos(slope.atan());
        let expected = GRAVITY * (sine - COEFFICIENT * cosine);
        assert!((acceleration / expected - 1.0).abs() < 0.01, "{acceleration} {expected}");
    }
}

/// A free block falls on a table. Newmark's rule, which loses nothing in the air, would bounce it higher than it was.
#[test]
fn no_energy_comes_from_an_impact() {
    let body = cube(2);
    let density = 1000.0;
    for (integration, time_step) in
        [(TRAPEZOID, 4e-3), (TRAPEZOID, 1e-3), (Integration::BackwardEuler, 4e-3)]
    {
        let settings = StepperSettings {
            iterations: 40,
            settled: 1e-8,
            time_step: Some(time_step),
            density: vec![density],
            dynamics: Some(Dynamics { integration, mass: Mass::Lumped, damping: [0.0, 0.0] }),
            ..StepperSettings::default()
        };
        let mut stepper = Stepper::new(&body, &[], None, settings).unwrap();
        let below = Pose::at([0.0, 0.0, -0.02]);
        let table = Tool::new(Shape::HalfSpace, Friction::Coulomb(0.0), below);
        let number = stepper.add_tool(&body, table).unwrap();
        let gravity = [0.0, 0.0, -GRAVITY];
        let weight = body.gravity(gravity, &[density]).unwrap();
        let (mut has_landed, mut height) = (false, 0.0);
        for _ in 0..(0.5 / time_step) as usize {
            let frame = stepper.frame(&body, &Input { gravity, ..Input::default() }).unwrap();
            let report = stepper.contact().report(number).unwrap();
            let work: f64 = weight.iter().zip(stepper.displacement()).map(|(f, u)| f * u).sum();
            let energy = frame.energy + frame.kinetic_energy + report.energy - work;
            assert!(energy < 1e-6, "{integration:?} {time_step}: {energy} J out of nothing");
            has_landed |= report.touching > 0;
            height = -work;
        }
        let whole = 0.02 * GRAVITY * density * SIDE.powi(3);
        assert!(has_landed && height < -0.5 * whole, "{height} {whole}");
    }
}

/// A table that an organ is fixed to bears nothing that the organ does not press on it.
#[test]
fn a_table_beneath_fixed_nodes_feels_no_layer() {
    let body = cube(3);
    let table = Tool::new(Shape::HalfSpace, Friction::Coulomb(0.0), Pose::default());
    let problem = problem(&body, base(&body));
    let fixed = problem.prescribed.iter().map(|(dof, _)| *dof);
    let mut contact = Contact::new(&body).on_fixed(fixed);
    contact.add(&body, table, &vec![0.0; body.n_dofs()]).unwrap();
    let found = Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
    assert_eq!(found.status, Status::Converged);
    let [_, _, force] = contact.report(0).unwrap().force;
    assert!(force.abs() < 1e-3, "{force}");
}
