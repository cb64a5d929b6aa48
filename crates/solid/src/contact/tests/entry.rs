//! Tools that are in the body, or were moved through it.

use super::*;

/// A needle between the samples of a coarse surface: they are all far from it, and it is inside all the same.
#[test]
fn a_tool_too_thin_for_the_surface_is_noticed() {
    let body = cube(2);
    let needle = Shape::Rounded { half: [0.0, 0.0, 0.04], radius: 1e-3 };
    let above = Pose::at([0.043, 0.051, SIDE + 0.0415]);
    let mut tool = Tool::new(needle, Friction::Coulomb(0.0), above);

    let problem = problem(&body, base(&body));
    let fixed: Vec<u32> = problem.prescribed.iter().map(|(dof, _)| *dof).collect();
    let mut stepper = Stepper::new(&body, &fixed, None, StepperSettings::default()).unwrap();
    let number = stepper.add_tool(&body, tool.clone()).unwrap();
    let mut frame_at = |pose| {
        stepper.place_tool(number, pose).unwrap();
        let is_settled = stepper.frame(&body, &Input::default()).unwrap().is_settled;
        [is_settled, stepper.contact().report(number).unwrap().is_inside]
    };
    assert_eq!(frame_at(above), [true, false]);
    assert_eq!(frame_at(Pose::at([0.043, 0.051, SIDE - 0.01])), [false, true]);
    assert_eq!(frame_at(above), [true, false]);
    tool.displacement = [0.0, 0.0, -0.05];
    let mut contact = Contact::new(&body);
    contact.add(&body, tool, &vec![0.0; body.n_dofs()]).unwrap();
    let found = Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
    assert_eq!(found.status, Status::StepTooSmall);
    assert!(found.message.contains("tool 0, a capsule, goes into the organ"), "{}", found.message);
    assert!(found.load > 0.0 && found.load < 0.1, "{}", found.load);
}

/// A ball that goes as far as the body is thick in one load step, or in one frame: it would come out on the other side.
#[test]
fn a_ball_is_not_moved_through_the_surface_in_one_step() {
    let body = cube(4);
    let radius = 0.2 * SIDE;
    let ball = sphere(radius);
    let above = Pose::at([0.6 * SIDE, 0.45 * SIDE, SIDE + 1.01 * radius]);
    let problem = problem(&body, base(&body));
    let force = |depth: f64, steps: usize| {
        let mut tool = Tool::new(ball.clone(), Friction::Coulomb(0.0), above);
        tool.displacement = [0.0, 0.0, -depth];
        let mut contact = Contact::new(&body);
        contact.add(&body, tool, &vec![0.0; body.n_dofs()]).unwrap();
        let newton = Newton { steps, ..Newton::default() };
        let found = newton.solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
        (found.status, contact.report(0).unwrap().force[2])
    };
    let (expected, at_once) = (force(0.3 * SIDE, 40), force(0.3 * SIDE, 1));
    assert_eq!([expected.0, at_once.0], [Status::Converged; 2]);
    let ratio = at_once.1 / expected.1;
    assert!(expected.1 < 0.0 && (ratio - 1.0).abs() < 1e-4, "{expected:?} {at_once:?}");

    let fixed: Vec<u32> = problem.prescribed.iter().map(|(dof, _)| *dof).collect();
    let settings = StepperSettings { iterations: 20, ..StepperSettings::default() };
    let mut stepper = Stepper::new(&body, &fixed, None, settings).unwrap();
    let tool = Tool::new(ball.clone(), Friction::Coulomb(0.0), above);
    let number = stepper.add_tool(&body, tool).unwrap();
    let mut frame_at = |z: f64| {
        let mut pose = above;
        pose.position[2] = z;
        stepper.place_tool(number, pose).unwrap();
        let is_settled = stepper.frame(&body, &Input::default()).unwrap().is_settled;
        [is_settled, stepper.contact().report(number).unwrap().is_inside]
    };
    assert_eq!(frame_at(SIDE + 0.95 * radius), [true, false]);
    assert_eq!(frame_at(-1.5 * radius), [false, true]);
    assert_eq!(frame_at(-1.5 * radius), [true, false]);
}
