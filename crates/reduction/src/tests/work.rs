//! Energy: the force on a contact is the slope of an energy, so that a closed loop costs nothing.

use super::*;

/// Nodes and weights of Gauss and Legendre on [0, 1], exact for the work of a model of order 8.
const GAUSS: [(f64, f64); 5] = [
    (0.046910077030668, 0.118463442528095),
    (0.230765344947158, 0.239314335249683),
    (0.5, 0.284444444444444),
    (0.769234655052842, 0.239314335249683),
    (0.953089922969332, 0.118463442528095),
];

/// Work along the straight line between two displacements of a contact.
fn work(model: &ReducedModel, contact: &Contact, from: [f64; 3], to: [f64; 3]) -> f64 {
    let line: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
    let power = |s: f64| {
        let force = model.respond(contact, std::array::from_fn(|i| from[i] + s * line[i])).force;
        (0..3).map(|i| force[i] * line[i]).sum::<f64>()
    };
    GAUSS.iter().map(|&(s, weight)| weight * power(s)).sum()
}

/// The part of the work that random closed loops of a contact do not return, at worst.
pub(super) fn lost(model: &ReducedModel, depth: f64) -> f64 {
    let mut worst: f64 = 0.0;
    for (k, random) in noise(40 * 32, 9).chunks_exact(32).enumerate() {
        let contact = inside(k % MODEL.triangles().len(), barycentric(random[30], random[31]));
        let corner = |c: usize| -> [f64; 3] {
            std::array::from_fn(|i| depth * random[3 * (c % 10) + i] / 3f64.sqrt())
        };
        let sides = (0..10).map(|c| work(model, &contact, corner(c), corner(c + 1)));
        let (gain, size) = sides.fold((0.0, 0.0), |(gain, size), w| (gain + w, size + w.abs()));
        worst = worst.max(f64::abs(gain) / size);
    }
    worst
}

/// At positions and between them, where orders are blended: all of it is a potential.
#[test]
fn a_closed_loop_of_a_contact_returns_what_it_took() {
    assert!(lost(&MODEL, DEPTH) < 1e-9, "{:e}", lost(&MODEL, DEPTH));
    let (metadata, mut arrays) = MODEL.clone().into_parts();
    let terms = 3 * MODEL.n_terms();
    // A second-order coefficient that is no slope of anything: F_x += c y^2, for every position.
    for position in arrays.answers.force.chunks_exact_mut(terms) {
        position[3 * 6] += 0.01 * position[2].abs().max(position[8].abs()) / DEPTH;
    }
    let other = ReducedModel::new(metadata, arrays).unwrap();
    assert!(
        lost(&other, DEPTH) > 1e-5,
        "a force without potential is seen: {:e}",
        lost(&other, DEPTH)
    );
}

/// Along the way its slope is the power of the force, also where orders are summed in the Padé form.
#[test]
fn the_energy_of_a_touch_is_the_work_of_its_force() {
    let h = 1e-4;
    for (model, depth, tolerance) in [(&*MODEL, DEPTH, 1e-7), (&*super::pade::PADE, 0.012, 1e-6)] {
        for (k, random) in noise(8 * 5, 4).chunks_exact(5).enumerate() {
            let contact = inside(3 * k, barycentric(random[3], random[4]));
            let d: [f64; 3] = std::array::from_fn(|i| depth * random[i] / 3f64.sqrt());
            let energy = |s: f64| model.energy(&contact, d.map(|x| s * x));
            let slope = (energy(1.0 + h) - energy(1.0 - h)) / (2.0 * h);
            let force = model.respond(&contact, d).force;
            let power: f64 = (0..3).map(|i| force[i] * d[i]).sum();
            assert!((slope - power).abs() < tolerance * power, "{slope} J, {power} J");
        }
        assert_eq!(model.energy(&model.centroid(0), [0.0; 3]), 0.0);
    }
    let (contact, d) = (inside(5, [0.2, 0.5, 0.3]), [0.001, 0.002, -0.003]);
    let along = work(&MODEL, &contact, [0.0; 3], d);
    assert!((MODEL.energy(&contact, d) - along).abs() < 1e-12 * along);
}

fn barycentric(a: f64, b: f64) -> [f64; 3] {
    let (a, b) = (0.5 + 0.5 * a, 0.5 + 0.5 * b);
    let root = a.sqrt();
    [1.0 - root, root * (1.0 - b), root * b]
}
