//! What a correction finds, and what the estimate makes of it.

use super::pade::{PADE, touches};
use super::preload::newton;
use super::*;
use crate::equilibrium::PatchLoad;

/// One iteration from the model's answer leads nearly all the way to the full organ's.
#[test]
fn a_correction_is_nearly_the_error() {
    let zero = vec![0.0; FULL.body.n_dofs()];
    let mut correction = Correction::new(&FULL.body, &FULL.fixed, &[]).unwrap();
    for (contact, n) in touches() {
        let d = n.map(|x| 0.008 * x);
        let patch = PADE.patch(&contact);
        let (u, force) = (field(&PADE, &contact, d), PADE.respond(&contact, d).force);
        let [of_field, of_force] = correction.of(&patch, &u, force).unwrap();
        let full = newton(&zero, None, Some(PatchLoad { patch, displacement: d }));
        let errors = [
            (of_field, relative(&u, &full.displacement)),
            (of_force, relative(&force, &full.patch_forces[0])),
        ];
        for (found, error) in errors {
            // What is left is of second order in the error, which is up to three per cent here.
            assert!(
                (found - error).abs() < 0.1 * error + 1e-6,
                "{found:e}, the error is {error:e}"
            );
        }
    }
}

#[test]
fn there_is_no_correction_where_a_cell_is_turned_inside_out() {
    let mut correction = Correction::new(&FULL.body, &FULL.fixed, &[]).unwrap();
    let contact = touches()[0].0;
    let mut u = vec![0.0; FULL.body.n_dofs()];
    u[3 * FULL.top[0] as usize + 2] = -SIZE[2];
    assert_eq!(correction.of(&PADE.patch(&contact), &u, [1.0; 3]), None);
}

/// Where the organ departs fast the estimate grows with the square of the rest of the series; a file from before that was
/// measured keeps its estimates.
#[test]
fn the_estimate_sees_how_fast_the_organ_departs() {
    let with = |departure| {
        let (metadata, mut arrays) = PADE.clone().into_parts();
        arrays.answers.departure = departure;
        ReducedModel::new(metadata, arrays)
    };
    let n = PADE.n_positions();
    let (older, faster) = (with(Vec::new()).unwrap(), with(vec![200.0; n]).unwrap());
    let mut larger = 0;
    for (contact, n) in touches() {
        let d = n.map(|x| 0.012 * x);
        let rest = PADE.truncation(&contact, d).unwrap();
        let [own, older, faster] =
            [&*PADE, &older, &faster].map(|model| model.respond(&contact, d).error_estimate);
        assert!(own >= older, "{own:e} {older:e}");
        let expected = older.max(200.0 * rest * rest).min(1.0);
        // At a position nothing is interpolated, but for rounding.
        assert!((faster - expected).abs() < 1e-6 * expected, "{faster:e} {expected:e}");
        larger += usize::from(faster > older);
    }
    assert!(larger > 0);
    for (departure, expected) in
        [(vec![0.0; n - 1], "array departure has"), (vec![f32::NAN; n], "departure[0] is NaN")]
    {
        let refused = with(departure);
        assert!(refused.is_err_and(|e| e.to_string().contains(expected)), "{expected}");
    }
}

#[test]
fn departure_is_measured_where_orders_are_summed_in_their_pade_form() {
    let measured = &PADE.arrays().answers.departure;
    assert_eq!(measured.len(), PADE.n_positions());
    assert!(measured.iter().all(|&x| x >= 0.0));
    assert!(MODEL.arrays().answers.departure.is_empty());
}
