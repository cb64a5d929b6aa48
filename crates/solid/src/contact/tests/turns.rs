//! Friction under tools that turn.

use super::*;
use std::f64::consts::PI;

/// Rotation vectors of every direction, up to half a turn.
#[test]
fn the_turn_from_a_pose_to_another_leads_there_the_shorter_way() {
    for (k, axis) in noise(60, 9).as_chunks::<3>().0.iter().enumerate() {
        let from = tilted([0.1, 0.2, 0.3]);
        let angle = [1e-9, 0.3, 2.0, 3.1, PI - 1e-9][k % 5];
        let turn = axis.map(|a| angle * a / norm(*axis));
        let found = from.turn_to(&from.moved([0.0; 3], turn));
        assert!(norm(crate::mesh::sub(found, turn)) < 1e-7, "{turn:?}: {found:?}");
        assert!((norm(found) - angle).abs() < 1e-12 + 1e-7 * angle);
        let back = from.turn_to(&from.moved([0.0; 3], turn.map(|t| t * (2.0 * PI - 0.5) / angle)));
        assert!((norm(back) - 0.5).abs() < 1e-9, "the other way round");
    }
}

/// A cylinder in the top of a body that does not move, turned about its axis: it drags all that touches along, over the arc
/// that its surface goes.
#[test]
fn a_cylinder_drags_over_the_arc_however_far_it_turns() {
    let (body, radius, friction) = (cube(8), 0.2, 0.3);
    let u = vec![0.0; body.n_dofs()];
    let outside =
        Pose::at([0.05, 0.05, SIDE + radius + 1e-4]).moved([0.0; 3], [0.5 * PI, 0.0, 0.0]);
    let shape = Shape::Rounded { half: [0.0, 0.0, 0.3], radius };
    for degrees in [10.0f64, 40.0, 90.0, 135.0, 179.0] {
        let mut contact = Contact::new(&body);
        let tool = Tool::new(shape.clone(), Friction::Coulomb(friction), outside);
        contact.add(&body, tool, &u).unwrap();
        let pressed = outside.moved([0.0, 0.0, -3e-4], [0.0; 3]);
        contact.place(0, pressed).unwrap();
        contact.linearize(&u);
        contact.end(&u);
        contact.begin(&u);
        contact.place(0, pressed.moved([0.0; 3], [0.0, degrees.to_radians(), 0.0])).unwrap();
        contact.linearize(&u);
        contact.end(&u);
        let report = contact.report(0).unwrap();
        // The lowest points of a cylinder that turns about y move towards negative x.
        let drag = -report.force[0] / -report.force[2];
        assert!((drag / friction - 1.0).abs() < 0.01, "{degrees} degrees: {drag}");
        let arc = radius * degrees.to_radians();
        let work = friction * -report.force[2] * arc;
        // The part of the arc in which the springs stretch, and the chords of its parts.
        assert!((report.dissipation / work - 1.0).abs() < 0.01, "{degrees}: {report:?} {work}");
    }
}

/// What sticks goes round with the tool: nothing slides, whatever the way.
#[test]
fn what_sticks_goes_round_with_the_tool() {
    let body = cube(8);
    let u = vec![0.0; body.n_dofs()];
    let outside = Pose::at([0.05, 0.05, SIDE]).moved([0.0; 3], [PI, 0.0, 0.0]);
    let mut contact = Contact::new(&body);
    contact.add(&body, Tool::new(Shape::HalfSpace, Friction::Coulomb(0.4), outside), &u).unwrap();
    let pressed = outside.moved([0.0, 0.0, -3e-4], [0.0; 3]);
    contact.place(0, pressed).unwrap();
    contact.linearize(&u);
    contact.end(&u);
    contact.begin(&u);
    // The body turns with the plate, about its middle.
    let turn = [0.0, 0.0, 1.0];
    let round = Pose::default().moved([0.0; 3], turn);
    let turned: Vec<f64> = body
        .points()
        .iter()
        .flat_map(|x| {
            let arm = crate::mesh::sub(*x, [0.05, 0.05, 0.0]);
            crate::mesh::sub(round.outward(arm), arm)
        })
        .collect();
    contact.place(0, pressed.moved([0.0; 3], turn)).unwrap();
    contact.linearize(&turned);
    contact.end(&turned);
    let report = contact.report(0).unwrap();
    assert!(report.touching > 50 && report.sliding == 0, "{report:?}");
    assert!(report.dissipation < 1e-12 && report.force[0].abs() < 1e-9, "{report:?}");
}

/// A solve turns a tool with friction in load steps, one without in as few as it likes.
#[test]
fn load_steps_turn_a_tool_with_friction_little() {
    let body = cube(2);
    let u = vec![0.0; body.n_dofs()];
    for (friction, least) in [
        (Friction::Coulomb(0.0), 1.0),
        (Friction::Coulomb(0.3), 1.0 / 12.0),
        (Friction::Bonded, 1.0 / 12.0),
    ] {
        let mut contact = Contact::new(&body);
        let mut tool = Tool::new(sphere(0.01), friction, Pose::at([0.05, 0.05, SIDE + 0.02]));
        tool.turn = [0.0, 2.0 * PI, 0.0];
        contact.add(&body, tool, &u).unwrap();
        let reached = contact.reaches(&body, &u, 0.0, 1.0);
        assert!((reached - least).abs() < 1e-12, "{friction:?}: {reached}");
    }
}
