//! How far a step may lead a body into a tool.

use super::*;

/// Random steps, far longer than the tools are thick, into tools that stand above a cube.
#[test]
fn no_step_leads_a_sample_to_the_middle_of_a_tool() {
    let body = cube(3);
    let u = vec![0.0; body.n_dofs()];
    for shape in shapes().into_iter().filter(|shape| shape.reach().is_finite()) {
        let mut contact = Contact::new(&body);
        let pose = tilted([0.05, 0.04, SIDE + shape.reach()]);
        let tool = Tool::new(shape, Friction::Coulomb(0.2), pose);
        let number = contact.add(&body, tool, &u).unwrap();
        contact.begin(&u);
        contact.linearize(&u);
        let tool = contact.tools[number].as_ref().unwrap();
        let gap = |u: &[f64], sample: usize| {
            tool.tool.shape.distance(tool.pose.inward(tool.samples.place(sample, u))).gap
        };
        let deeper = match &tool.tool.shape {
            Shape::Rounded { half, radius } => {
                0.5 * (half.iter().copied().fold(f64::INFINITY, f64::min) + radius)
            }
            _ => 0.5 * 0.02,
        };
        let mut is_cut = false;
        for seed in 0..20 {
            let step: Vec<f64> = noise(body.n_dofs(), seed).iter().map(|w| 0.2 * w).collect();
            let length = contact.longest(&u, &step);
            is_cut |= length < 1.0;
            let after: Vec<f64> = step.iter().map(|s| length * s).collect();
            for sample in 0..tool.samples.len() {
                let (from, to) = (gap(&u, sample), gap(&after, sample));
                assert!(to > from.min(0.0) - deeper - 1e-12, "{:?}: {from} {to}", tool.tool.shape);
            }
        }
        assert!(is_cut, "{:?}", tool.tool.shape);
    }
}

/// What moves along a tool, or away from it, goes as far as it will, and so does what a half-space is to push back.
#[test]
fn a_step_along_a_tool_is_not_cut() {
    let body = cube(3);
    let u = vec![0.0; body.n_dofs()];
    let plate = Shape::Rounded { half: [0.2, 0.2, 0.004], radius: 0.001 };
    let pose = Pose::at([0.05, 0.05, SIDE + 0.005]);
    let mut contact = Contact::new(&body);
    contact.add(&body, Tool::new(plate, Friction::Coulomb(0.0), pose), &u).unwrap();
    contact.begin(&u);
    let shift = |by: [f64; 3]| -> Vec<f64> { (0..u.len()).map(|dof| by[dof % 3]).collect() };
    assert_eq!(contact.longest(&u, &shift([0.05, 0.0, 0.0])), 1.0);
    assert_eq!(contact.longest(&u, &shift([0.0, 0.0, -0.05])), 1.0);
    let into = contact.longest(&u, &shift([0.0, 0.0, 0.05]));
    assert!((into - 0.5 * 0.005 / 0.05).abs() < 1e-9, "{into}");

    // A half-space has no other side.
    let mut contact = Contact::new(&body);
    let floor = Tool::new(Shape::HalfSpace, Friction::Coulomb(0.0), Pose::at([0.0; 3]));
    contact.add(&body, floor, &u).unwrap();
    contact.begin(&u);
    assert_eq!(contact.longest(&u, &shift([0.0, 0.0, -0.05])), 1.0);
}

/// Of a body that next to nothing holds: it stops no deeper in the half-space than it is large.
#[test]
fn a_fall_ends_in_a_half_space() {
    let body = cube(3);
    let u = vec![0.0; body.n_dofs()];
    let mut contact = Contact::new(&body);
    let down = |by: f64| -> Vec<f64> { (0..u.len()).map(|dof| [0.0, 0.0, -by][dof % 3]).collect() };
    assert!(!contact.is_fall(&down(1e4)), "nothing is below");
    let floor = Tool::new(Shape::HalfSpace, Friction::Coulomb(0.0), Pose::at([0.0, 0.0, -0.02]));
    contact.add(&body, floor, &u).unwrap();
    contact.begin(&u);
    let size = diagonal(body.points());
    assert!(!contact.is_fall(&down(0.9 * size)) && contact.is_fall(&down(1.1 * size)));
    let reached = 1e4 * contact.longest(&u, &down(1e4));
    assert!((reached - size - 0.02).abs() < 1e-9, "{reached}");
}
