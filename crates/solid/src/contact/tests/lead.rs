//! Tools that lead what they touch, in the first step of a frame.

use super::*;

/// A sphere deep in the top of a cube, where a step has ended, and the next one begun.
fn settled(friction: Friction, body: &Body) -> (Contact, Vec<f64>, Pose) {
    let mut contact = Contact::new(body);
    let above = Pose::at([0.05, 0.045, SIDE + 0.2 + 1e-4]);
    contact.add(body, Tool::new(sphere(0.2), friction, above), &vec![0.0; body.n_dofs()]).unwrap();
    let u: Vec<f64> = noise(body.n_dofs(), 7).iter().map(|u| 1e-4 * u).collect();
    let pressed = above.moved([2e-4, 3e-4, -1e-3], [0.0; 3]);
    contact.place(0, pressed).unwrap();
    contact.linearize(&u);
    contact.end(&u);
    contact.begin(&u);
    (contact, u, pressed)
}

fn force(contact: &Contact, n: usize) -> Vec<f64> {
    let mut force = vec![0.0; n];
    contact.add_force(&mut force);
    force
}

fn size(v: impl Iterator<Item = f64>) -> f64 {
    v.map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn a_tool_at_rest_leads_with_the_force_it_has() {
    let body = cube(8);
    for friction in [Friction::Coulomb(0.0), Friction::Coulomb(0.4), Friction::Bonded] {
        let (mut contact, u, _) = settled(friction, &body);
        contact.linearize(&u);
        let found = force(&contact, u.len());
        contact.lead(&u);
        let led = force(&contact, u.len());
        let error = size(found.iter().zip(&led).map(|(a, b)| a - b));
        assert!(error < 1e-12 * size(found.iter().copied()), "{friction:?}: {error}");
        assert!(contact.report(0).unwrap().touching > 10);
    }
}

/// `f - K w` after a motion `w` of the tool, and the same of the body, is the force before, up to the square of `w`.
#[test]
fn what_goes_along_keeps_its_force() {
    let body = cube(8);
    let error = |length: f64| {
        let (mut contact, u, pressed) = settled(Friction::Coulomb(0.0), &body);
        contact.linearize(&u);
        let before = force(&contact, u.len());
        let touching = contact.report(0).unwrap().touching;
        let motion = [3.0, -2.0, -6.0].map(|w| length * w);
        contact.place(0, pressed.moved(motion, [0.0; 3])).unwrap();
        contact.lead(&u);
        assert_eq!(contact.report(0).unwrap().touching, touching);
        let mut after = force(&contact, u.len());
        let mut blocks = body.zero_tangent();
        contact.add_stiffness(Curvature::Exact, &mut blocks);
        let along: Vec<f64> = (0..u.len()).map(|dof| motion[dof % 3]).collect();
        contact.add_product(-1.0, &along, &mut after);
        size(after.iter().zip(&before).map(|(a, b)| a - b)) / size(before.iter().copied())
    };
    let errors = [1e-5, 2e-5].map(error);
    assert!(errors[1] < 0.02 && (errors[1] / errors[0] - 4.0).abs() < 0.2, "{errors:?}");
}

#[test]
fn a_tool_that_has_gone_too_far_leads_nothing() {
    let body = cube(8);
    let (mut contact, u, pressed) = settled(Friction::Coulomb(0.4), &body);
    contact.place(0, pressed.moved([0.0, 0.0, -0.2 * SIDE], [0.0; 3])).unwrap();
    contact.linearize(&u);
    let found = force(&contact, u.len());
    contact.lead(&u);
    assert_eq!(found, force(&contact, u.len()));
}
