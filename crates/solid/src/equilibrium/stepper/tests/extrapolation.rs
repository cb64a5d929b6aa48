//! Frames that set out from where the last motion leads, beside those that set out from the last state.

use super::*;

/// Residuals of frames of one iteration, with the hand in these places.
fn residuals(settings: &StepperSettings, hands: &[[f64; 3]]) -> Vec<f64> {
    let body = bar("neo_hookean");
    let mut stepper = held(&body, settings.clone());
    hands.iter().map(|&d| stepper.frame(&body, &press(&[d])).unwrap().residual).collect()
}

fn both(hands: &[[f64; 3]]) -> [Vec<f64>; 2] {
    [true, false].map(|extrapolates| {
        residuals(&StepperSettings { extrapolates, ..Default::default() }, hands)
    })
}

#[test]
fn a_hand_that_goes_on_leaves_a_far_smaller_residual() {
    let hands: Vec<_> = (1..=12).map(|k| [0.0, 0.0, 0.1 * DEPTH * f64::from(k)]).collect();
    let [ahead, from_rest] = both(&hands);
    assert_eq!(ahead[..2], from_rest[..2], "of the first frame there is no motion before");
    for (with, without) in ahead.iter().zip(&from_rest).skip(3) {
        assert!(*with < 0.1 * without, "{with} and {without}");
    }
}

#[test]
fn a_hand_that_stops_or_turns_back_is_not_run_ahead_of() {
    let out = (1..=4).map(|k| [0.0, 0.0, 0.1 * DEPTH * f64::from(k)]);
    let stop: Vec<_> = out.clone().chain([[0.0, 0.0, 0.4 * DEPTH]; 4]).collect();
    let [ahead, _] = both(&stop);
    assert!(ahead[7] < 1e-9, "{ahead:?}");
    let back: Vec<_> = out.chain([[0.0, 0.0, 0.3 * DEPTH], [0.0, 0.0, 0.2 * DEPTH]]).collect();
    let [ahead, from_rest] = both(&back);
    assert!(ahead[4] < 2.0 * from_rest[4] && ahead[5] < from_rest[5], "{ahead:?} {from_rest:?}");
}

#[test]
fn with_inertia_a_frame_sets_out_from_the_last_state() {
    let hands: Vec<_> = (1..=5).map(|k| [0.0, 0.0, 0.1 * DEPTH * f64::from(k)]).collect();
    let [with, without] = [true, false].map(|extrapolates| {
        let settings = dynamic(TRAPEZOID, Mass::Lumped, 0.01);
        residuals(&StepperSettings { extrapolates, ..settings }, &hands)
    });
    assert_eq!(with, without);
}

/// A hand that has dragged the body on and is then torn away: the last motion, continued, would turn cells inside out.
#[test]
fn a_motion_that_would_crush_cells_is_not_continued() {
    let body = bar("neo_hookean");
    let mut stepper = held(&body, StepperSettings { iterations: 20, ..Default::default() });
    for d in [[0.0; 3], [0.0, 0.0, 0.001], [0.0, 0.0, 0.4], [0.0, 0.0, 5.0]] {
        let frame = stepper.frame(&body, &press(&[d])).unwrap();
        let (jacobian, _) = body.smallest_jacobian(stepper.displacement());
        assert!(jacobian > 0.0 && frame.residual.is_finite(), "{d:?}: J = {jacobian}");
    }
}
