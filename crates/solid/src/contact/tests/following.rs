//! Friction that follows the pressure along a step, and the faces that are looked at.

use super::*;

/// `F(u + w) - F(u)` is `-K w` and what friction changes by; that is not small.
#[test]
fn forces_change_by_the_tangent_and_by_what_friction_follows() {
    let body = cube(8);
    let (mut contact, u) = pressed(Friction::Coulomb(0.4), &body);
    // A slide that goes on.
    for _ in 0..2 {
        contact.linearize(&u);
        contact.add_stiffness(Curvature::Exact, &mut body.zero_tangent());
    }
    let report = contact.report(0).unwrap();
    assert!(contact.slides() && report.sliding == report.touching, "{report:?}");
    let direction: Vec<f64> = noise(u.len(), 11).iter().map(|w| 1e-8 * w).collect();
    let mut known = vec![0.0; u.len()];
    contact.add_product(-1.0, &direction, &mut known);
    let mut change = vec![0.0; u.len()];
    contact.add_change_of_friction(&direction, &mut change);
    let mut side = |length: f64| {
        let at: Vec<f64> = u.iter().zip(&direction).map(|(u, w)| u + length * w).collect();
        let mut force = vec![0.0; u.len()];
        contact.linearize(&at);
        contact.add_force(&mut force);
        force
    };
    let (ahead, behind) = (side(1.0), side(-1.0));
    let size = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let slope = |dof: usize| 0.5 * (ahead[dof] - behind[dof]);
    let whole = size(&mut (0..u.len()).map(slope));
    let without = size(&mut (0..u.len()).map(|dof| slope(dof) - known[dof]));
    let with = size(&mut (0..u.len()).map(|dof| slope(dof) - known[dof] - change[dof]));
    assert!(without > 0.2 * whole && with < 0.02 * whole, "{with} {without} {whole}");
}

/// A sphere that is dragged through a surface takes at most half as many iterations more than one without friction. It takes
/// twice as many where bounds are those of the pressures before each step.
#[test]
fn frames_in_which_all_slides_settle_nearly_as_soon_as_those_without_friction() {
    let body = cube(8);
    let fixed: Vec<u32> = base(&body).into_iter().map(|(dof, _)| dof).collect();
    let steps = |friction: f64| -> usize {
        let settings =
            StepperSettings { iterations: 30, settled: 1e-4, ..StepperSettings::default() };
        let mut stepper = Stepper::new(&body, &fixed, None, settings).unwrap();
        let start = Pose::at([0.05, 0.045, SIDE + 0.04]);
        let tool = Tool::new(sphere(0.04), Friction::Coulomb(friction), start);
        let number = stepper.add_tool(&body, tool).unwrap();
        let mut one = |frame: usize| {
            let (down, along) = (frame.min(10) as f64, frame.saturating_sub(10) as f64);
            let motion = [1e-3 * along, 5e-4 * along, -4e-4 * down - 2e-4 * along];
            stepper.place_tool(number, start.moved(motion, [0.0; 3])).unwrap();
            let frame = stepper.frame(&body, &Input::default()).unwrap();
            assert!(frame.is_settled, "{frame:?}");
            frame.steps
        };
        (0..30).map(&mut one).skip(15).sum()
    };
    let [without, with] = [0.0, 0.2].map(steps);
    assert!(with as f64 <= 1.5 * without as f64, "{with} steps, {without} without friction");
}

/// A tool that wanders near a body that is shaken, over it, into it and away: what touches is what a tool finds that looks at
/// all of the surface.
#[test]
fn faces_that_are_far_away_are_left_out_until_they_are_near() {
    let body = cube(6);
    for shape in [sphere(0.02), Shape::HalfSpace, solid()] {
        let down = Pose {
            rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
            position: [0.03, 0.04, SIDE + 0.05],
        };
        let tool = Tool::new(shape, Friction::Coulomb(0.0), down);
        let mut contact = Contact::new(&body);
        contact.add(&body, tool.clone(), &vec![0.0; body.n_dofs()]).unwrap();
        let mut touched = 0;
        for frame in 0..40u64 {
            let k = frame as f64;
            let motion = [1e-3 * k, 5e-4 * k, -0.055 * (0.15 * k).sin().abs()];
            let pose = down.moved(motion, [0.0; 3]);
            let size = 1e-4 * (1.0 + 10.0 * (0.4 * k).sin());
            let u: Vec<f64> = noise(body.n_dofs(), frame).iter().map(|u| size * u).collect();
            contact.place(0, pose).unwrap();
            contact.linearize(&u);
            let mut anew = Contact::new(&body);
            anew.add(&body, tool.clone(), &vec![0.0; body.n_dofs()]).unwrap();
            anew.place(0, pose).unwrap();
            anew.forget_near();
            anew.linearize(&u);
            assert_eq!(contact.report(0), anew.report(0), "{frame}");
            touched += contact.report(0).unwrap().touching;
        }
        assert!(touched > 50, "{touched}");
    }
}

impl Contact {
    /// The next linearization looks at all faces.
    fn forget_near(&mut self) {
        self.each(|held| held.forget_near());
    }
}
