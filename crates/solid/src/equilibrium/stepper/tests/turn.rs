//! Patches that turn: the rotation they reach, the balance of moments, torques.

use super::*;
use crate::mesh::cross;

fn face(body: &Body) -> Patch {
    let nodes = nodes(body, |x| x[0] == 0.4);
    let weights = vec![1.0 / nodes.len() as f64; nodes.len()];
    Patch { nodes, weights }
}

/// Arms of a patch at rest, turned about x.
fn turned(body: &Body, patch: &Patch, angle: f64) -> Vec<[f64; 3]> {
    let (sin, cos) = angle.sin_cos();
    let turn = |[x, y, z]: [f64; 3]| [x, cos * y - sin * z, sin * y + cos * z];
    patch.nodes.iter().map(|&node| turn(body.points()[node as usize])).collect()
}

/// Force and moment about the origin of the reactions of the root.
fn support(body: &Body, stepper: &Stepper) -> [[f64; 3]; 2] {
    let reactions: Vec<f64> = stepper.reactions().collect();
    let mut sum = [[0.0; 3]; 2];
    for node in nodes(body, |x| x[0] == 0.0) {
        let force: [f64; 3] = std::array::from_fn(|i| reactions[3 * node as usize + i]);
        let moment = cross(body.points()[node as usize], force);
        for i in 0..3 {
            sum[0][i] += force[i];
            sum[1][i] += moment[i];
        }
    }
    sum
}

fn centre(body: &Body, patch: &Patch, u: &[f64]) -> [f64; 3] {
    let nodes = patch.nodes.iter().zip(&patch.weights);
    nodes.fold([0.0; 3], |sum, (&node, w)| {
        std::array::from_fn(|i| {
            sum[i] + w * (body.points()[node as usize][i] + u[3 * node as usize + i])
        })
    })
}

/// Force and moment of tool and support add up to nothing, with every solver.
fn assert_balanced(body: &Body, stepper: &Stepper, frame: &Frame, torque: [f64; 3]) {
    let at = centre(body, &face(body), stepper.displacement());
    let force = frame.patch_forces.first().copied().unwrap_or_default();
    let lever = cross(at, force);
    let [carried, moment] = support(body, stepper);
    let size = torque.iter().fold(0.0f64, |size, t| size.max(t.abs()));
    for i in 0..3 {
        assert!((force[i] + carried[i]).abs() < 1e-5 * size / 0.2, "{force:?} {carried:?}");
        assert!((torque[i] + lever[i] + moment[i]).abs() < 1e-5 * size, "{torque:?} {moment:?}");
    }
}

#[test]
fn a_turned_patch_reaches_its_rotation_and_is_balanced_by_the_support() {
    let body = bar("neo_hookean");
    let patch = face(&body);
    let mut torques = Vec::new();
    for method in methods() {
        let settings =
            StepperSettings { method, iterations: 10, settled: 1e-8, ..Default::default() };
        let mut stepper = Stepper::new(&body, &root(&body), None, settings).unwrap();
        stepper.grasp(&body, &[], std::slice::from_ref(&patch)).unwrap();
        let mut last = None;
        for k in 1..=8 {
            let turn = Turn { patch: 0, arms: turned(&body, &patch, 0.1 * f64::from(k)) };
            let input = Input { means: &[[0.0; 3]], turns: &[turn], ..STILL };
            last = Some(stepper.frame(&body, &input).unwrap());
        }
        let frame = last.unwrap();
        assert!(frame.is_settled, "{method:?} {frame:?}");
        // The sum of w_i (R r_i) x x_i, by which the rotation is held.
        let at = centre(&body, &patch, stepper.displacement());
        let skew = turned(&body, &patch, 0.8).iter().zip(&patch.nodes).fold(
            [0.0; 3],
            |sum, (&q, &node)| {
                let x: [f64; 3] = std::array::from_fn(|i| {
                    body.points()[node as usize][i] + stepper.displacement()[3 * node as usize + i]
                        - at[i]
                });
                let part = cross(q, x);
                std::array::from_fn(|i| sum[i] + part[i])
            },
        );
        assert!(skew.iter().all(|s| s.abs() < 1e-12), "{method:?} {skew:?}");
        let torque = frame.patch_torques[0];
        assert!(torque[0] > 0.0 && torque[1].abs() < 1e-2 * torque[0], "{torque:?}");
        assert_balanced(&body, &stepper, &frame, torque);
        torques.push(torque[0]);
    }
    assert!(torques.iter().all(|t| (t - torques[0]).abs() < 1e-6 * torques[0]), "{torques:?}");
}

/// A torque takes the patch to the rotation by which the same torque holds it, if nothing else holds the patch.
#[test]
fn a_torque_is_carried_by_the_support_and_is_what_holds_the_rotation() {
    let body = bar("neo_hookean");
    let place = face(&body);
    let settings = StepperSettings { iterations: 40, settled: 1e-9, ..Default::default() };
    let mut stepper = Stepper::new(&body, &root(&body), None, settings).unwrap();
    let wanted = [2.0, 0.5, -1.0];
    let torque = Torque { place: place.clone(), torque: wanted };
    let frame = stepper.frame(&body, &Input { torques: &[torque], ..STILL }).unwrap();
    assert!(frame.is_settled, "{frame:?}");
    assert_balanced(&body, &stepper, &frame, wanted);
}

#[test]
fn turns_that_mean_nothing_are_refused() {
    let body = bar("neo_hookean");
    let line = tip(&body);
    let mut stepper = held(&body, StepperSettings::default());
    let mut refused = |turn: Turn, word: &str| {
        let input = Input { means: &[[0.0; 3]], turns: &[turn], ..STILL };
        let error = stepper.frame(&body, &input).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    };
    let arms = turned(&body, &line, 0.1);
    refused(Turn { patch: 0, arms: arms.clone() }, "lie on a line");
    refused(Turn { patch: 1, arms: arms.clone() }, "there are 1 patches");
    refused(Turn { patch: 0, arms: arms[1..].to_vec() }, "an arm for each");
    refused(Turn { patch: 0, arms: vec![[f64::NAN; 3]; arms.len()] }, "finite");
    let torque = Torque { place: face(&body), torque: [f64::INFINITY; 3] };
    let input = Input { means: &[[0.0; 3]], torques: &[torque], ..STILL };
    assert!(stepper.frame(&body, &input).unwrap_err().to_string().contains("finite"));
}
