//! Two blocks on each other, with meshes that do not match: forces against differences of the energy, balance, uniform
//! pressure.

use super::*;
use crate::body::{ContactPair, Ties};
use crate::element::Element;
use crate::equilibrium::{Input, Newton, Pressure, Problem, Stepper, StepperSettings};
use crate::law::Material;
use crate::mesh::samples::{block, noise};
use crate::mesh::{cross, surface};

const SIDE: f64 = 0.1;

/// A block of `n[0]`^3 cubes and one of `n[1]`^3 above it, this far apart, shifted sideways. A spring too weak to be felt
/// holds the upper one.
pub(super) fn blocks(n: [usize; 2], apart: f64, shift: [f64; 2]) -> Body {
    rough_blocks(n, apart, shift, 0.0)
}

/// The same with a coefficient of friction between them.
pub(super) fn rough_blocks(n: [usize; 2], apart: f64, shift: [f64; 2], friction: f64) -> Body {
    blocks_of(Element::P1, n, apart, shift, friction)
}

/// The same of an element.
pub(super) fn blocks_of(
    element: Element,
    n: [usize; 2],
    apart: f64,
    shift: [f64; 2],
    friction: f64,
) -> Body {
    let (mut points, mut cells) = block([n[0]; 3], [SIDE; 3]);
    let first = surface(&points, &cells);
    let (above, others) = block([n[1]; 3], [SIDE; 3]);
    let start = points.len() as u32;
    let second = surface(&above, &others).into_iter().map(|t| t.map(|node| start + node)).collect();
    points.extend(above.iter().map(|x| [x[0] + shift[0], x[1] + shift[1], x[2] + SIDE + apart]));
    cells.extend(others.iter().map(|cell| cell.map(|node| start + node)));
    let pair = ContactPair::new(&points, [first, second], 0.02, STIFFNESS, friction).unwrap();
    let material = Material::new("neo_hookean", vec![vec![4e3, 6e3]]).unwrap();
    let weak = |entry: usize| if entry.is_multiple_of(4) { 1e-9 } else { 0.0 };
    let ties = Ties {
        start: vec![0, 1],
        nodes: vec![start],
        weights: vec![1.0],
        stiffness: vec![std::array::from_fn(weak)],
        links: Vec::new(),
        contact_pairs: vec![pair],
    };
    Body::tied(element, points, cells, material, ties).unwrap()
}

/// Held by `held` where it says so: node by node, place at rest and component.
pub(super) fn problem(body: &Body, held: impl Fn([f64; 3], usize) -> Option<f64>) -> Problem<'_> {
    let nodes = (0u32..).zip(body.points());
    let held = &held;
    let of = move |(n, x): (u32, &[f64; 3])| {
        let x = *x;
        (0..3).filter_map(move |i| held(x, i).map(|value| (3 * n + i as u32, value)))
    };
    Problem {
        body,
        prescribed: nodes.flat_map(of).collect(),
        force: vec![0.0; body.n_dofs()],
        pressure: Pressure::default(),
        patches: Vec::new(),
        start: None,
    }
}

/// The upper block moved down into the lower one, both shaken.
fn pressed(body: &Body) -> (Contact, Vec<f64>) {
    let mut u: Vec<f64> = noise(body.n_dofs(), 7).iter().map(|u| 1e-4 * u).collect();
    let above = body.points().iter().map(|x| x[2] > 1.001 * SIDE);
    u.chunks_mut(3).zip(above).filter(|(_, above)| *above).for_each(|(u, _)| u[2] -= 1.2e-3);
    (with_pieces_at(body, &u), u)
}

/// The contact at a displacement, after iterations that renew the common pieces until they stay.
pub(super) fn with_pieces_at(body: &Body, u: &[f64]) -> Contact {
    let mut contact = Contact::new(body);
    contact.begin(u);
    for k in 0..10 {
        let beside: Vec<f64> = u.iter().map(|u| u + 1e-13 * f64::from(k)).collect();
        contact.linearize(&beside);
    }
    contact.linearize(u);
    contact
}

/// Forces are differences of the energy, and the exact tangent is those of the forces.
pub(super) fn has_derivatives(body: &Body, contact: &mut Contact, u: &[f64]) {
    let mut force = vec![0.0; u.len()];
    contact.add_force(&mut force);
    let direction = noise(u.len(), 11);
    let at = |length: f64| -> Vec<f64> {
        u.iter().zip(&direction).map(|(u, w)| u + length * w).collect()
    };
    let step = 1e-8;
    let slope = (contact.energy(&at(step)) - contact.energy(&at(-step))) / (2.0 * step);
    let power: f64 = force.iter().zip(&direction).map(|(f, w)| -f * w).sum();
    assert!((slope - power).abs() < 1e-5 * power.abs(), "{slope} {power}");

    let mut blocks = body.zero_tangent();
    contact.add_stiffness(Curvature::Exact, &mut blocks);
    assert!(!contact.is_beyond(body.pattern(), u));
    let (mut product, mut own) = (vec![0.0; u.len()], vec![0.0; u.len()]);
    blocks.multiply(&direction, &mut product);
    contact.add_product(1.0, &direction, &mut own);
    let largest = product.iter().fold(0.0f64, |m, p| m.max(p.abs()));
    assert!(product.iter().zip(&own).all(|(p, o)| (p - o).abs() < 1e-12 * largest));
    let mut side = |length: f64| {
        let mut force = vec![0.0; u.len()];
        contact.linearize(&at(length));
        contact.add_force(&mut force);
        force
    };
    let (ahead, behind) = (side(1e-8), side(-1e-8));
    for (dof, p) in product.iter().enumerate() {
        let difference = (behind[dof] - ahead[dof]) / 2e-8;
        assert!((difference - p).abs() < 1e-4 * largest, "{dof}: {difference} {p} {largest}");
    }
}

/// Sums of forces and torques are zero to this part of all forces.
pub(super) fn cancels(body: &Body, contact: &Contact, u: &[f64], rounding: f64) {
    let mut force = vec![0.0; u.len()];
    contact.add_force(&mut force);
    let (mut sums, mut sizes) = ([0.0; 6], [0.0f64; 3]);
    for ((x, u), f) in body.points().iter().zip(u.chunks(3)).zip(force.chunks(3)) {
        let torque = cross(std::array::from_fn(|i| x[i] + u[i]), [f[0], f[1], f[2]]);
        (0..3).for_each(|i| sums[i] += f[i]);
        (0..3).for_each(|i| sums[3 + i] += torque[i]);
        (0..3).for_each(|i| sizes[i] += f[i].abs());
    }
    let size = sizes.into_iter().fold(0.0, f64::max);
    assert!(size > 1.0 && sums.iter().all(|sum| sum.abs() < rounding * size), "{sums:?} {size}");
}

#[test]
fn forces_are_slopes_of_the_energy_and_the_tangent_theirs() {
    for (element, n) in [(Element::P1, [3, 4]), (Element::P2, [2, 3])] {
        let body = blocks_of(element, n, 1e-3, [0.007, -0.004], 0.0);
        let (mut contact, u) = pressed(&body);
        assert!(contact.pair_report(0).unwrap().touching > 100);
        has_derivatives(&body, &mut contact, &u);
    }
}

#[test]
fn the_projected_tangent_is_semidefinite() {
    let body = blocks([3, 4], 1e-3, [0.007, -0.004]);
    let (mut contact, u) = pressed(&body);
    let mut blocks = body.zero_tangent();
    contact.add_stiffness(Curvature::Projected, &mut blocks);
    for seed in 0..20 {
        let x = noise(u.len(), seed);
        let mut y = vec![0.0; u.len()];
        blocks.multiply(&x, &mut y);
        assert!(x.iter().zip(&y).map(|(x, y)| x * y).sum::<f64>() >= 0.0);
    }
}

#[test]
fn forces_and_torques_of_a_pair_cancel() {
    for element in [Element::P1, Element::P2] {
        let body = blocks_of(element, [3, 4], 1e-3, [0.013, 0.004], 0.0);
        let (contact, u) = pressed(&body);
        cancels(&body, &contact, &u, 1e-13);
    }
}

#[test]
fn a_uniform_pressure_passes_meshes_that_do_not_match() {
    for element in [Element::P1, Element::P2] {
        // Between walls without friction, and moved down by a tenth of a block.
        let body = blocks_of(element, [3, 4], 0.0, [0.0; 2], 0.0);
        let held = |x: [f64; 3], i: usize| match i {
            2 if x[2] == 0.0 => Some(0.0),
            2 if x[2] > 1.999 * SIDE => Some(-0.01),
            0 | 1 if x[i] == 0.0 || x[i] > 0.999 * SIDE => Some(0.0),
            _ => None,
        };
        let problem = problem(&body, held);
        let mut contact = Contact::new(&body);
        contact.check().unwrap();
        let found =
            Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
        assert!(found.status.is_converged(), "{}", found.message);
        let report = contact.pair_report(0).unwrap();
        let pressure = -report.force[2] / report.area;
        assert!((report.area - SIDE * SIDE).abs() < 1e-12, "{}", report.area);
        for (p, x) in contact.pair_pressures(0, body.points().len()).iter().zip(body.points()) {
            let expected = if (x[2] - SIDE).abs() < 1e-9 { pressure } else { 0.0 };
            assert!((p - expected).abs() < 1e-6 * pressure, "{x:?}: {p} {expected}");
        }
    }
}

#[test]
fn a_block_lies_on_another_with_its_weight() {
    let body = blocks([3, 2], 0.0, [0.02, 0.01]);
    let mut problem =
        problem(&body, |x, i| (x[2] == 0.0 || i < 2 && (x[2] > 1.999 * SIDE)).then_some(0.0));
    problem.force = body.gravity([0.0, 0.0, -9.81], &[1000.0]).unwrap();
    let weight = 9.81 * 1000.0 * SIDE.powi(3);
    let mut contact = Contact::new(&body);
    let found = Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
    assert!(found.status.is_converged(), "{}", found.message);
    let report = contact.pair_report(0).unwrap();
    assert!((report.force[2] + weight).abs() < 1e-6 * weight, "{report:?}");
    assert!(report.gap < 0.0 && report.gap > -1e-3 * SIDE);

    // The same in frames.
    let fixed: Vec<u32> = problem.prescribed.iter().map(|&(dof, _)| dof).collect();
    let settings = StepperSettings { iterations: 40, settled: 1e-8, ..StepperSettings::default() };
    let mut stepper = Stepper::new(&body, &fixed, None, settings).unwrap();
    let input = Input { force: &problem.force, ..Input::default() };
    let mut frames = (0..6).map(|_| stepper.frame(&body, &input).unwrap().is_settled);
    assert!(frames.any(|is_settled| is_settled));
    let difference = found.displacement.iter().zip(stepper.displacement());
    assert!(difference.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-6 * SIDE);
}

#[test]
fn what_was_apart_at_rest_touches_in_solves_and_frames() {
    // Farther away than the pattern of the tangent reaches: it is widened.
    let body = blocks([3, 2], 0.03, [0.02, 0.01]);
    let held = |x: [f64; 3], i: usize| match i {
        2 if x[2] > 2.2 * SIDE => Some(-0.035),
        0 | 1 if x[2] > 2.2 * SIDE => Some(0.0),
        _ => (x[2] == 0.0).then_some(0.0),
    };
    let problem = problem(&body, held);
    let mut contact = Contact::new(&body);
    let found = Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
    assert!(found.status.is_converged(), "{}", found.message);
    let force = contact.pair_report(0).unwrap().force[2];
    assert!(force < -0.1 && contact.is_beyond(body.pattern(), &found.displacement));

    let settings = StepperSettings { iterations: 30, settled: 1e-8, ..StepperSettings::default() };
    let mut stepper = Stepper::new(&body, &[], None, settings).unwrap();
    let dofs: Vec<u32> = problem.prescribed.iter().map(|&(dof, _)| dof).collect();
    stepper.grasp(&body, &dofs, &[]).unwrap();
    for part in [0.5, 0.9, 0.95, 1.0] {
        let values: Vec<f64> = problem.prescribed.iter().map(|(_, value)| part * value).collect();
        let frame = stepper.frame(&body, &Input { values: &values, ..Input::default() }).unwrap();
        assert!(frame.is_settled, "{frame:?}");
    }
    let again = stepper.contact().pair_report(0).unwrap().force[2];
    assert!((again / force - 1.0).abs() < 1e-5, "{again} {force}");
}

#[test]
fn what_is_apart_costs_and_changes_nothing() {
    let body = blocks([2, 2], 0.05, [0.0; 2]);
    let mut contact = Contact::new(&body);
    let u = vec![0.0; body.n_dofs()];
    contact.begin(&u);
    contact.linearize(&u);
    let report = contact.pair_report(0).unwrap();
    assert_eq!((report.touching, report.force, report.gap), (0, [0.0; 3], f64::INFINITY));
    assert_eq!(contact.energy(&u), 0.0);
}

/// Blocks on the slant, so that the boxes around them overlap: a step is as long as the way that is free, not as the reach.
#[test]
fn steps_are_as_long_as_the_gap() {
    let (apart, half) = (0.06, 0.5f64.sqrt());
    let body = blocks([2, 3], apart, [0.0; 2]);
    let slant = |x: [f64; 3]| [x[0], half * (x[1] - x[2]), half * (x[1] + x[2])];
    let turn = |x: &[f64; 3]| crate::mesh::sub(slant(*x), *x);
    let u: Vec<f64> = body.points().iter().flat_map(turn).collect();
    let mut contact = Contact::new(&body);
    contact.begin(&u);
    contact.linearize(&u);
    let towards =
        |x: &[f64; 3]| slant([0.0, 0.0, if x[2] > 1.001 * SIDE { -2.0 * apart } else { 0.0 }]);
    let step: Vec<f64> = body.points().iter().flat_map(towards).collect();
    let longest = contact.longest(&u, &step);
    assert!((0.5..0.52).contains(&longest), "{longest}");
}

#[test]
fn surfaces_that_overlap_at_rest_are_refused() {
    let refusal = |apart: f64| {
        let checked = Contact::new(&blocks([2, 3], apart, [0.01; 2])).check();
        checked.map_or_else(|error| error.to_string(), |()| String::new())
    };
    assert_eq!(refusal(0.0), "");
    assert_eq!(refusal(1e-3), "");
    let said = refusal(-2e-3);
    assert!(
        said.contains("2.000e-3 m inside the other") && said.contains("m of the one"),
        "{said}"
    );
}

#[test]
fn pairs_that_cannot_be_are_refused() {
    let (points, cells) = block([1; 3], [SIDE; 3]);
    let whole = surface(&points, &cells);
    let refusal = |surfaces, reach, stiffness, friction| {
        let made = ContactPair::new(&points, surfaces, reach, stiffness, friction);
        made.map_or_else(|error| error.to_string(), |_| String::new())
    };
    let [one, other] = [whole[..1].to_vec(), Vec::new()];
    assert!(refusal([whole.clone(), whole.clone()], 0.1, 30.0, 0.0).contains("both sides"));
    assert!(refusal([one.clone(), other], 0.1, 30.0, 0.0).contains("no triangle"));
    assert!(refusal([one.clone(), vec![[7, 8, 9]]], 0.1, 30.0, 0.0).contains("there are 8 points"));
    let apart = |t: &&[u32; 3]| t.iter().all(|node| !one[0].contains(node));
    let two = whole.iter().find(apart).map_or(Vec::new(), |t| vec![*t]);
    assert!(refusal([one.clone(), two.clone()], f64::NAN, 30.0, 0.0).contains("reach"));
    assert!(refusal([one.clone(), two.clone()], 0.1, 0.0, 0.0).contains("stiffness"));
    assert!(refusal([one.clone(), two], 0.1, 30.0, -0.1).contains("friction coefficient"));
}

#[test]
fn triangles_that_are_no_faces_of_the_surface_are_refused() {
    let (points, cells) = block([2; 3], [SIDE; 3]);
    let inside = vec![[0, 1, 13]];
    let faces =
        vec![surface(&points, &cells).into_iter().find(|t| t.iter().all(|n| *n > 13)).unwrap()];
    for element in [Element::P1, Element::P2] {
        let pair = ContactPair::new(&points, [faces.clone(), inside.clone()], 0.01, STIFFNESS, 0.0)
            .unwrap();
        let ties = Ties { contact_pairs: vec![pair], ..Ties::default() };
        let material = Material::new("neo_hookean", vec![vec![4e3, 6e3]]).unwrap();
        let refused = Body::tied(element, points.clone(), cells.clone(), material, ties).err();
        let words = refused.unwrap().to_string();
        assert!(words.contains("contact pair 0: the points [0, 1, 13] are no face"), "{words}");
    }
}

/// Just below the top and closer to a side of a block, which does not push back what came in from above.
#[test]
fn what_is_behind_a_face_has_its_gap_though_a_side_is_closer() {
    use crate::contact::facets::Facets;
    let (points, cells) = block([1; 3], [SIDE; 3]);
    let triangles = surface(&points, &cells);
    let facets = Facets::new(triangles.clone());
    let placed = facets.at(&points);
    let is_top = |t: &[u32; 3]| t.iter().all(|&n| points[n as usize][2] == SIDE);
    let x = [1e-6, 0.03, SIDE - 1e-4];
    let closest = placed.gap(x, 0.01, facets::Candidates::All).unwrap();
    assert!(
        (closest.gap + 1e-6).abs() < 1e-12 && closest.normal == [-1.0, 0.0, 0.0],
        "{closest:?}"
    );
    let tops = (0..triangles.len()).filter(|&k| is_top(&triangles[k]));
    let found: Vec<_> = tops.filter_map(|k| placed.behind(k, x, 0.01)).collect();
    assert_eq!(found.len(), 1, "of two triangles it is behind one");
    assert!((found[0].gap + 1e-4).abs() < 1e-12 && found[0].normal[2] > 0.999, "{found:?}");
    let at: f64 = (0..3)
        .map(|i| {
            let corner = points[triangles[found[0].triangle][i] as usize];
            found[0].weights[i] * corner[1]
        })
        .sum();
    assert!((at - 0.03).abs() < 1e-12, "{at}");
    let [above, deep] =
        [SIDE + 1e-4, SIDE - 0.02].map(|z| placed.behind(found[0].triangle, [1e-6, 0.03, z], 0.01));
    assert!(above.is_none() && deep.is_none());
}
