//! Two places of one body that touch: the jaws of a U, whose meshes do not match.

use super::pairs::{cancels, has_derivatives, problem, with_pieces_at};
use super::*;
use crate::body::{ContactPair, Ties};
use crate::contact::samples::modulus;
use crate::element::Element;
use crate::equilibrium::{Dynamics, Integration, Mass};

/// Width of the whole, of its jaws and of the gap between them [m].
const WIDTH: f64 = 0.1;
const JAW: f64 = 0.04;
const APART: f64 = 0.02;
/// Heights of its floor, of the lower ends of the jaws, and of the whole [m].
const FLOOR: f64 = 0.025;
const LOW: f64 = 0.0375;
const HEIGHT: f64 = 0.1;
const DEEP: f64 = 0.03;

const REACH: f64 = 0.008;

const LAW: [f64; 2] = [4e3, 6e3];

/// Two jaws that walls of one cell hold on a floor below both, so that nothing is between them. The nodes of the right jaw
/// are not as high as those of the left one.
fn u_shaped() -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let (mut all, mut cells) = block([10, 3, 8], [WIDTH, DEEP, HEIGHT]);
    cells.retain(|cell| {
        let mean = |i: usize| cell.iter().map(|&n| all[n as usize][i]).sum::<f64>() / 4.0;
        let aside = (mean(0) - 0.5 * WIDTH).abs();
        mean(2) < FLOOR || aside > if mean(2) < LOW { 0.4 * WIDTH } else { 0.5 * APART }
    });
    for x in all.iter_mut().filter(|x| x[0] > JAW + 0.99 * APART && x[2] > LOW) {
        x[2] += 0.003 * (std::f64::consts::PI * (x[2] - LOW) / (HEIGHT - LOW)).sin();
    }
    let mut used: Vec<u32> = cells.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    cells.iter_mut().flatten().for_each(|node| *node = used.partition_point(|n| n < node) as u32);
    (used.into_iter().map(|node| all[node as usize]).collect(), cells)
}

/// The jaws may touch; the law of what holds them is `base` times theirs.
fn jaws(base: f64, friction: f64) -> Body {
    body(base, |points, surface| {
        let sides = [false, true].map(|is_right| {
            let is_on = |&node: &u32| {
                let x = points[node as usize];
                x[2] > 0.999 * LOW && is_right == (x[0] > 0.5 * WIDTH)
            };
            surface.iter().filter(|triangle| triangle.iter().all(is_on)).copied().collect()
        });
        ContactPair::new(points, sides, REACH, STIFFNESS, friction).unwrap()
    })
}

/// The same, where all of the surface may touch itself.
pub(super) fn own_jaws(friction: f64) -> Body {
    body(1.0, |points, surface| {
        ContactPair::of_one(points, surface, REACH, STIFFNESS, friction).unwrap()
    })
}

fn body(base: f64, pair: impl FnOnce(&[[f64; 3]], Vec<[u32; 3]>) -> ContactPair) -> Body {
    let (points, cells) = u_shaped();
    let pair = pair(&points, surface(&points, &cells));
    let law = |cell: &[u32; 4]| {
        let height = cell.iter().map(|&node| points[node as usize][2]).sum::<f64>() / 4.0;
        LAW.map(|modulus| if height < LOW { base * modulus } else { modulus }).to_vec()
    };
    let material = Material::new("neo_hookean", cells.iter().map(law).collect()).unwrap();
    let ties = Ties { contact_pairs: vec![pair], ..Ties::default() };
    Body::tied(Element::P1, points, cells, material, ties).unwrap()
}

pub(super) fn closed(friction: f64) -> (Body, Vec<f64>) {
    pressed(jaws(1.0, friction))
}

/// The jaws moved together until they press, all of it shaken; the body, with a tangent that couples them.
pub(super) fn pressed(body: Body) -> (Body, Vec<f64>) {
    let mut u: Vec<f64> = noise(body.n_dofs(), 3).iter().map(|u| 5e-5 * u).collect();
    for (x, u) in body.points().iter().zip(u.chunks_mut(3)) {
        let part = if x[2] > 0.999 * LOW { 0.5 * APART + 1e-4 } else { 0.0 };
        u[0] += if x[0] < 0.5 * WIDTH { part } else { -part };
    }
    (body.widened(&u), u)
}

#[test]
fn jaws_that_meet_are_coupled_and_their_forces_and_tangent_are_derivatives() {
    let (body, u) = closed(0.0);
    let mut contact = with_pieces_at(&body, &u);
    assert!(contact.pair_report(0).unwrap().touching > 100);
    // At rest they are farther apart than the pattern of the tangent reaches.
    assert!(contact.is_beyond(jaws(1.0, 0.0).pattern(), &u));
    has_derivatives(&body, &mut contact, &u);
}

#[test]
fn forces_and_torques_of_jaws_cancel() {
    for friction in [0.0, 0.3] {
        let (body, mut u) = closed(friction);
        let contact = dragged(&body, &mut u);
        let report = contact.pair_report(0).unwrap();
        assert_eq!(report.sliding > report.touching / 2, friction > 0.0, "{report:?}");
        cancels(&body, &contact, &u, 1e-12);
    }
}

/// In contact at a displacement, the right jaw then moved along the left one.
pub(super) fn dragged(body: &Body, u: &mut [f64]) -> Contact {
    let mut contact = with_pieces_at(body, u);
    contact.end(u);
    contact.begin(u);
    for (x, u) in body.points().iter().zip(u.chunks_mut(3)) {
        u[1] += if x[0] > 0.5 * WIDTH { 1e-3 } else { 0.0 };
    }
    contact.linearize(u);
    contact
}

/// Held by what is too soft to be felt, between walls without friction: uniaxial strain.
#[test]
fn jaws_pressed_together_bear_a_uniform_pressure() {
    let (body, closing) = (jaws(1e-4, 0.0), 2e-3);
    let moved = 0.5 * (APART + closing);
    let held = |x: [f64; 3], i: usize| match i {
        0 if x[0] == 0.0 => Some(moved),
        0 if x[0] > 0.999 * WIDTH => Some(-moved),
        1 if x[1] == 0.0 || x[1] > 0.999 * DEEP => Some(0.0),
        2 if (x[2] - LOW).abs() < 1e-9 || x[2] > 0.999 * HEIGHT => Some(0.0),
        _ => None,
    };
    let problem = problem(&body, held);
    let mut contact = Contact::new(&body);
    contact.check().unwrap();
    let newton = Newton { steps: 2, ..Newton::default() };
    let found = newton.solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
    assert!(found.status.is_converged(), "{}", found.message);
    let report = contact.pair_report(0).unwrap();
    let area = DEEP * (HEIGHT - LOW);
    assert!((report.area / area - 1.0).abs() < 1e-6, "{}", report.area);
    let pressure = -report.force[0] / area;
    let stretch = 1.0 - (closing + report.gap) / (2.0 * JAW);
    let expected = LAW[0] * (1.0 / stretch - stretch) - LAW[1] * stretch.ln() / stretch;
    assert!((pressure / expected - 1.0).abs() < 2e-3, "{pressure} {expected}");
    // Cells are higher than what counts of them.
    let height = 0.015 * diagonal(body.points());
    let depth = pressure * height / (STIFFNESS * modulus(&body, body.cells().len() - 1));
    assert!((-report.gap / depth - 1.0).abs() < 0.01, "{} {depth}", report.gap);
    for (p, x) in contact.pair_pressures(0, body.points().len()).iter().zip(body.points()) {
        let is_wall = (x[0] - 0.5 * WIDTH).abs() < 0.51 * APART && x[2] > 0.999 * LOW;
        let expected = if is_wall { pressure } else { 0.0 };
        assert!((p - expected).abs() < 5e-3 * pressure, "{x:?}: {p} {expected}");
    }
}

/// Laid on its left jaw, the right one falls on it. Gravity has done more work in every frame than there is energy of
/// motion, strain and contact, and was dissipated by friction; also in the few frames of the impact that do not settle.
/// In the end little moves.
#[test]
fn one_jaw_falls_on_the_other_and_comes_to_rest() {
    let body = jaws(1.0, 0.3);
    let table = (0u32..).zip(body.points()).filter(|(_, x)| x[0] == 0.0);
    let fixed: Vec<u32> = table.flat_map(|(n, _)| (0..3).map(move |i| 3 * n + i)).collect();
    let (density, gravity) = (1000.0, [-4.0, 0.0, 0.0]);
    let dynamics = Dynamics {
        integration: Integration::BackwardEuler,
        mass: Mass::Lumped,
        damping: [0.0, 0.0],
    };
    let settings = StepperSettings {
        iterations: 40,
        settled: 1e-7,
        time_step: Some(0.01),
        density: vec![density],
        dynamics: Some(dynamics),
        ..StepperSettings::default()
    };
    let mut stepper = Stepper::new(&body, &fixed, None, settings).unwrap();
    let weight = body.gravity(gravity, &[density]).unwrap();
    let (mut dissipated, mut left_over, mut last) = (0.0, 0, (1.0, 0.0));
    for number in 0..100 {
        let frame = stepper.frame(&body, &Input { gravity, ..Input::default() }).unwrap();
        left_over += usize::from(!frame.is_settled);
        let report = stepper.contact().pair_report(0).unwrap();
        assert!(report.dissipation >= 0.0, "{number}: {report:?}");
        dissipated += report.dissipation;
        let work: f64 = weight.iter().zip(stepper.displacement()).map(|(f, u)| f * u).sum();
        let energy = frame.kinetic_energy + frame.energy + report.energy;
        let balance = work - energy - dissipated;
        assert!(balance > -1e-6 * work, "{number}: {balance} {work}");
        // Where an edge comes down on a face, its depth is that under the face.
        assert!(report.gap > -2.2e-3 * WIDTH, "{number}: {report:?}");
        last = (frame.kinetic_energy / work, report.force[0]);
    }
    let weight_of_jaw = 4.0 * density * JAW * DEEP * (HEIGHT - LOW);
    assert!(left_over <= 5, "{left_over} frames did not settle");
    assert!(last.0 < 1e-3 && last.1 < -0.5 * weight_of_jaw, "{last:?} {weight_of_jaw}");
}

#[test]
fn a_step_of_the_whole_is_not_shortened() {
    let (body, u) = closed(0.0);
    let contact = with_pieces_at(&body, &u);
    let shift: Vec<f64> = (0..u.len()).map(|dof| [0.3, -0.2, 0.1][dof % 3]).collect();
    assert!(contact.longest(&u, &shift) >= 1.0);
    let towards = |x: &[f64; 3]| [if x[0] < 0.5 * WIDTH { 0.01 } else { -0.01 }, 0.0, 0.0];
    let step: Vec<f64> = body.points().iter().flat_map(towards).collect();
    assert!(contact.longest(&u, &step) < 0.1);
}

#[test]
fn the_two_sides_of_a_wall_are_no_pair() {
    let (points, cells) = block([4, 4, 2], [SIDE, SIDE, 0.2 * SIDE]);
    let all = surface(&points, &cells);
    let side = |z: f64| -> Vec<[u32; 3]> {
        let is_on = |t: &&[u32; 3]| t.iter().all(|&n| (points[n as usize][2] - z).abs() < 1e-9);
        all.iter().filter(is_on).copied().collect()
    };
    let sides = [side(0.0), side(0.2 * SIDE)];
    let pair = ContactPair::new(&points, sides, 0.1 * SIDE, STIFFNESS, 0.0).unwrap();
    let ties = Ties { contact_pairs: vec![pair], ..Ties::default() };
    let material = Material::new("neo_hookean", vec![LAW.to_vec()]).unwrap();
    let body = Body::tied(Element::P1, points, cells, material, ties).unwrap();
    let said =
        Contact::new(&body).check().map_or_else(|error| error.to_string(), |()| String::new());
    assert!(
        said.contains("2.000e-2 m inside") && said.contains("faces each other from outside"),
        "{said}"
    );
}
