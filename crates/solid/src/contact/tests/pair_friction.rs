//! Friction between two blocks with meshes that do not match: forces against differences of the energy, balance,
//! Coulomb's law, and a block on an incline.

use super::pairs::{problem, rough_blocks};
use super::*;
use crate::body::{ContactPair, Ties};
use crate::element::Element;
use crate::equilibrium::{Dynamics, Input, Integration, Mass};
use crate::mesh::cross;

const MU: f64 = 0.4;

/// The upper block pressed into the lower one, which is shaken, and then moved sideways by this much.
fn dragged(body: &Body, by: [f64; 2]) -> (Contact, Vec<f64>) {
    let mut u: Vec<f64> = noise(body.n_dofs(), 7).iter().map(|u| 1e-4 * u).collect();
    let upper = body.points().iter().position(|x| x[2] > 1.001 * SIDE).unwrap();
    u.iter_mut().skip(3 * upper + 2).step_by(3).for_each(|u| *u -= 1.2e-3);
    let mut contact = Contact::new(body);
    contact.begin(&u);
    contact.linearize(&u);
    contact.end(&u);
    contact.begin(&u);
    for (i, by) in by.into_iter().enumerate() {
        u.iter_mut().skip(3 * upper + i).step_by(3).for_each(|u| *u += by);
    }
    contact.linearize(&u);
    // A slide that goes on.
    contact.add_stiffness(Curvature::Exact, &mut body.zero_tangent());
    let beside: Vec<f64> = u.iter().map(|u| u + 1e-13).collect();
    contact.linearize(&beside);
    contact.linearize(&u);
    (contact, u)
}

/// Sideways by a part of what the springs yield at, and by much more.
const STUCK: [f64; 2] = [1e-7, -5e-8];
const SLID: [f64; 2] = [3e-3, -2e-3];

#[test]
fn forces_are_slopes_of_the_energy() {
    for (by, slides) in [(STUCK, false), (SLID, true)] {
        let body = rough_blocks([3, 4], 1e-3, [0.007, -0.004], MU);
        let (contact, u) = dragged(&body, by);
        let report = contact.pair_report(0).unwrap();
        assert!(report.touching > 100);
        assert_eq!(report.sliding > report.touching / 2, slides, "{report:?}");
        let mut force = vec![0.0; u.len()];
        contact.add_force(&mut force);
        let direction = noise(u.len(), 11);
        let at = |length: f64| -> Vec<f64> {
            u.iter().zip(&direction).map(|(u, w)| u + length * w).collect()
        };
        let step = 1e-8;
        let slope = (contact.energy(&at(step)) - contact.energy(&at(-step))) / (2.0 * step);
        let power: f64 = force.iter().zip(&direction).map(|(f, w)| -f * w).sum();
        assert!((slope - power).abs() < 1e-4 * power.abs(), "{by:?}: {slope} {power}");
    }
}

/// Where samples stick the tangent is that of the forces. Where they slide it holds the bound, which follows the pressure:
/// then it is that of the energy with this bound, along a line. The other normal at the tied point is left out there, a
/// part of slide over edge.
#[test]
fn the_tangent_is_the_slope_of_the_forces() {
    let body = rough_blocks([3, 4], 1e-3, [0.007, -0.004], MU);
    let (mut contact, u) = dragged(&body, STUCK);
    let direction = noise(u.len(), 13);
    let product = |contact: &mut Contact, u: &[f64]| {
        let (mut blocks, mut product) = (body.zero_tangent(), vec![0.0; u.len()]);
        let mut own = product.clone();
        contact.add_stiffness(Curvature::Exact, &mut blocks);
        assert!(!contact.is_beyond(body.pattern(), u));
        blocks.multiply(&direction, &mut product);
        contact.add_product(1.0, &direction, &mut own);
        let largest = product.iter().fold(0.0f64, |m, p| m.max(p.abs()));
        assert!(product.iter().zip(&own).all(|(p, o)| (p - o).abs() < 1e-12 * largest));
        (product, largest)
    };
    let at = |length: f64| -> Vec<f64> {
        u.iter().zip(&direction).map(|(u, w)| u + length * w).collect()
    };
    // All of it sticks but what barely touches.
    let sliding = contact.pair_report(0).unwrap().sliding;
    assert!(sliding < 10, "{sliding}");
    let (found, largest) = product(&mut contact, &u);
    let mut side = |length: f64| {
        let mut force = vec![0.0; u.len()];
        contact.linearize(&at(length));
        contact.add_force(&mut force);
        force
    };
    let (ahead, behind) = (side(1e-9), side(-1e-9));
    for (dof, p) in found.iter().enumerate() {
        let difference = (behind[dof] - ahead[dof]) / 2e-9;
        assert!((difference - p).abs() < 1e-3 * largest, "{dof}: {difference} {p} {largest}");
    }

    let (mut contact, u) = dragged(&body, SLID);
    let at = |length: f64| -> Vec<f64> {
        u.iter().zip(&direction).map(|(u, w)| u + length * w).collect()
    };
    let (found, _) = product(&mut contact, &u);
    let bent: f64 = found.iter().zip(&direction).map(|(p, w)| p * w).sum();
    let step = 1e-7;
    let second = (contact.energy(&at(step)) - 2.0 * contact.energy(&u)
        + contact.energy(&at(-step)))
        / (step * step);
    assert!((second / bent - 1.0).abs() < 5e-3, "{second} {bent}");
}

#[test]
fn the_projected_tangent_is_semidefinite() {
    for by in [STUCK, SLID] {
        let body = rough_blocks([3, 4], 1e-3, [0.007, -0.004], MU);
        let (mut contact, u) = dragged(&body, by);
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
fn forces_and_torques_cancel_and_keep_to_the_cone() {
    let body = rough_blocks([3, 4], 1e-3, [0.013, 0.004], MU);
    for (by, slides) in [(STUCK, false), (SLID, true)] {
        let (contact, u) = dragged(&body, by);
        let mut force = vec![0.0; u.len()];
        contact.add_force(&mut force);
        let (mut sums, mut size) = ([0.0; 6], 0.0);
        for ((x, u), f) in body.points().iter().zip(u.chunks(3)).zip(force.chunks(3)) {
            let torque = cross(std::array::from_fn(|i| x[i] + u[i]), [f[0], f[1], f[2]]);
            (0..3).for_each(|i| sums[i] += f[i]);
            (0..3).for_each(|i| sums[3 + i] += torque[i]);
            size += f[2].abs();
        }
        assert!(size > 1.0 && sums.iter().all(|sum| sum.abs() < 1e-12 * size), "{sums:?} {size}");
        // Of the upper block on the lower one: it pushes down and, sliding, drags along with it.
        let f = contact.pair_report(0).unwrap().force;
        let along = f[0].hypot(f[1]);
        if slides {
            // The surfaces are shaken, so that their normals differ by some hundredths.
            assert!((along / (MU * -f[2]) - 1.0).abs() < 0.02, "{f:?}");
            assert!((f[1] / f[0] - by[1] / by[0]).abs() < 0.02, "{f:?}");
        } else {
            assert!(along > 0.0 && along < MU * -f[2], "{f:?}");
        }
    }
}

/// A block on a longer one, either sampled, held in an incline; friction between them.
fn incline(n: [[usize; 3]; 2]) -> Body {
    let (mut points, mut cells) = block(n[0], [0.3, 0.06, 0.03]);
    let first = surface(&points, &cells);
    let (above, others) = block(n[1], [0.06, 0.04, 0.03]);
    let start = points.len() as u32;
    let second = surface(&above, &others).into_iter().map(|t| t.map(|node| start + node)).collect();
    points.extend(above.iter().map(|x| [x[0] + 0.05, x[1] + 0.011, x[2] + 0.03]));
    cells.extend(others.iter().map(|cell| cell.map(|node| start + node)));
    let pair = ContactPair::new(&points, [first, second], 0.01, STIFFNESS, MU).unwrap();
    let material = Material::new("neo_hookean", vec![vec![4e4, 6e4]]).unwrap();
    let ties = Ties { contact_pairs: vec![pair], ..Ties::default() };
    Body::tied(Element::P1, points, cells, material, ties).unwrap()
}

/// Motion and velocity of the upper block along an incline after every frame of 10 ms. In each, gravity has done more work
/// than there is energy of motion, strain and contact, and was dissipated.
fn slide(n: [[usize; 3]; 2], slope: f64, frames: usize) -> Vec<[f64; 2]> {
    let body = incline(n);
    let fixed: Vec<u32> = base(&body).into_iter().map(|(dof, _)| dof).collect();
    let density = 1000.0;
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
    let (sine, cosine) = slope.atan().sin_cos();
    let gravity = [9.81 * sine, 0.0, -9.81 * cosine];
    let weight = body.gravity(gravity, &[density]).unwrap();
    // The lumped masses, out of the weight of a gravity along an axis.
    let mass = body.gravity([1.0, 0.0, 0.0], &[density]).unwrap();
    let upper = body.points().len() - (n[1][0] + 1) * (n[1][1] + 1) * (n[1][2] + 1);
    let mean = |v: &[f64]| {
        let own = &v[3 * upper..];
        own.iter().step_by(3).sum::<f64>() / (own.len() / 3) as f64
    };
    let mut dissipated = 0.0;
    let one = |_| {
        let frame = stepper.frame(&body, &Input { gravity, ..Default::default() }).unwrap();
        assert!(frame.residual < 1e-3, "{frame:?}");
        let (u, v) = (stepper.displacement(), stepper.velocity().unwrap());
        let report = stepper.contact().pair_report(0).unwrap();
        assert!(report.dissipation >= 0.0, "{report:?}");
        dissipated += report.dissipation;
        let work: f64 = weight.iter().zip(u).map(|(f, u)| f * u).sum();
        let motion: f64 = (0..v.len()).map(|k| 0.5 * mass[k - k % 3] * v[k] * v[k]).sum();
        let balance = work - (motion + body.energy(u) + report.energy) - dissipated;
        // Backward Euler loses energy and makes none.
        assert!(balance > -1e-6 * work.abs(), "{balance} {work}");
        [mean(u), mean(v)]
    };
    (0..frames).map(one).collect()
}

const FINER: [[[usize; 3]; 2]; 2] = [[[20, 4, 2], [5, 4, 2]], [[25, 5, 2], [4, 2, 2]]];

#[test]
fn a_block_on_an_incline_of_another_sticks_below_the_angle_of_friction() {
    for n in FINER {
        let path = slide(n, 0.9 * MU, 130);
        let creep = path[129][0] - path[29][0];
        assert!(creep.abs() < 1e-3 * 0.06, "{n:?}: {creep}");
    }
}

#[test]
fn and_slides_above_it_as_coulomb_says() {
    // Where a sharp edge comes to slide over the sampled surface by a third of its edges a frame, some frames do not settle.
    for (n, frames) in FINER.into_iter().zip([32, 20]) {
        let slope = 1.5 * MU;
        let path = slide(n, slope, frames);
        let (half, last) = (frames / 2 - 1, frames - 1);
        let acceleration = (path[last][1] - path[half][1]) / (0.01 * (last - half) as f64);
        let (sine, cosine) = f64::sin_cos(slope.atan());
        let expected = 9.81 * (sine - MU * cosine);
        assert!((acceleration / expected - 1.0).abs() < 0.02, "{n:?}: {acceleration} {expected}");
        assert!(path[last][0] > 0.03, "{:?}", path[last]);
    }
}

/// Load steps: the springs of friction remember.
#[test]
fn a_block_pressed_and_dragged_in_statics_is_held_by_friction() {
    let body = rough_blocks([3, 4], 0.0, [0.01, 0.006], MU);
    let top = |x: [f64; 3]| x[2] > 1.999 * SIDE;
    let walk = |by: [f64; 3], start: Option<Vec<f64>>, contact: &mut Contact| {
        let held = |x: [f64; 3], i: usize| match i {
            _ if x[2] == 0.0 => Some(0.0),
            _ if top(x) => Some(by[i]),
            _ => None,
        };
        let problem = Problem { start, ..problem(&body, held) };
        let found = Newton { steps: 4, ..Newton::default() }
            .solve_in_contact(&problem, contact, &mut |_| true)
            .unwrap();
        assert!(found.status.is_converged(), "{}", found.message);
        (found.displacement, contact.pair_report(0).unwrap())
    };
    let mut contact = Contact::new(&body);
    let (u, pressed) = walk([0.0, 0.0, -0.004], None, &mut contact);
    let (u, stuck) = walk([0.0005, 0.0, -0.004], Some(u), &mut contact);
    assert!(stuck.sliding < stuck.touching / 2, "{stuck:?}");
    // The upper block is shifted, so it was held sideways before.
    let (more, along) = (stuck.force[0] - pressed.force[0], stuck.force[0].hypot(stuck.force[1]));
    assert!(more > 0.02 && along < MU * -stuck.force[2], "{pressed:?} {stuck:?}");
    let (_, slid) = walk([0.02, 0.0, -0.004], Some(u), &mut contact);
    // All of it slides. The upper block tips, so neither the normals nor the slides are all parallel: the sum of what is at
    // the bound is less than the bound of the sum.
    assert!(slid.sliding == slid.touching && slid.dissipation > 0.0, "{slid:?}");
    let ratio = slid.force[0] / (MU * -slid.force[2]);
    assert!(ratio > 0.8 && ratio < 1.0, "{slid:?} {ratio}");
}
