//! What a correction finds, and what the estimate makes of it.

use super::pade::{PADE, touches};
use super::preload::newton;
use super::*;
use crate::body::Curvature;
use crate::equilibrium::PatchLoad;
use viscera_touch::{DIRECTIONS, Trust};

/// One iteration from the model's answer leads nearly all the way to the full organ's.
#[test]
fn a_correction_is_nearly_the_error() {
    let zero = vec![0.0; FULL.body.n_dofs()];
    let mut correction = Correction::new(&FULL.body, &FULL.fixed, &[]).unwrap();
    for (contact, n) in touches() {
        let d = n.map(|x| 0.008 * x);
        let patch = PADE.patch(&contact);
        let (u, force) = (field(&PADE, &contact, d), PADE.respond(&contact, d).force);
        let [of_field, of_force] = correction.of(&patch, &u, force, Curvature::Exact).unwrap();
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
    assert_eq!(correction.of(&PADE.patch(&contact), &u, [1.0; 3], Curvature::Exact), None);
}

/// Where the organ departs fast the estimate grows with the cube of the rest of the series; a file from before that was
/// measured keeps its estimates.
#[test]
fn the_estimate_sees_how_fast_the_organ_departs() {
    let with = |departure| {
        let (metadata, mut arrays) = PADE.clone().into_parts();
        arrays.answers.departure = departure;
        ReducedModel::new(metadata, arrays)
    };
    let n = PADE.n_positions();
    let (older, faster) = (with(Vec::new()).unwrap(), with(vec![2e4; DIRECTIONS * n]).unwrap());
    let mut larger = 0;
    for (contact, n) in touches() {
        let d = n.map(|x| 0.012 * x);
        let rest = PADE.truncation(&contact, d).unwrap();
        let [own, older, faster] =
            [&*PADE, &older, &faster].map(|model| model.respond(&contact, d).error_estimate);
        assert!(own >= older, "{own:e} {older:e}");
        let along = |k: &[f64; 3]| (0..3).map(|i| k[i] * n[i]).sum::<f64>() / norm(&n);
        let nearest = viscera_touch::directions().iter().map(along).fold(0.0, f64::max);
        let expected = older.max(2e4 * nearest.powi(2) * rest.powi(3)).min(1.0);
        // At a position nothing is interpolated, but for rounding.
        assert!((faster - expected).abs() < 1e-6 * expected, "{faster:e} {expected:e}");
        larger += usize::from(faster > older);
    }
    assert!(larger > 0);
    for (departure, expected) in [
        (vec![0.0; n], "array departure has"),
        (vec![f32::NAN; DIRECTIONS * n], "departure[0] is NaN"),
    ] {
        let refused = with(departure);
        assert!(refused.is_err_and(|e| e.to_string().contains(expected)), "{expected}");
    }
}

#[test]
fn departure_counts_along_its_own_direction_alone() {
    let (contact, rays) = (touches()[0].0, viscera_touch::directions());
    let (metadata, mut arrays) = PADE.clone().into_parts();
    let mut departure = vec![0.0; DIRECTIONS * PADE.n_positions()];
    departure.iter_mut().step_by(DIRECTIONS).for_each(|first| *first = 5e4);
    arrays.answers.departure = departure;
    let one = ReducedModel::new(metadata, arrays).unwrap();
    let estimates = |share: f64| {
        let d = rays[0].map(|x| share * x);
        [&*PADE, &one].map(|model| model.respond(&contact, d).error_estimate)
    };
    let ([before, after], opposite) = (estimates(0.012), estimates(-0.012));
    assert!(after > 1.5 * before, "{after:e} {before:e}");
    assert_eq!(opposite[0], opposite[1]);
}

#[test]
fn departure_is_measured_where_orders_are_summed_in_their_pade_form() {
    let measured = &PADE.arrays().answers.departure;
    assert_eq!(measured.len(), DIRECTIONS * PADE.n_positions());
    assert!(measured.iter().all(|&x| x >= 0.0));
    assert!(MODEL.arrays().answers.departure.is_empty());
}

/// Whenever progress says stop while a model is checked, nothing is returned.
#[test]
fn a_stop_is_heeded_in_every_part_of_the_check() {
    let settings = Reduction { pade: true, order: 3, depth: 0.012, ..settings() };
    for allowed in 0.. {
        let mut asked = 0;
        let mut progress = |progress: Progress| {
            asked += usize::from(progress.stage == "check");
            asked <= allowed
        };
        match settings.run(&FULL.body, &FULL.surface, &FULL.fixed, &mut progress) {
            Err(error) => assert!(matches!(error, Error::Cancelled), "{error}"),
            Ok(_) => {
                // Between positions, and the departure, at least once each.
                assert!(allowed >= 2, "{allowed}");
                break;
            }
        }
    }
}

/// The law of Saint Venant and Kirchhoff softens under compression, which four orders show too late.
#[test]
fn trust_is_taken_from_touches_that_depart_and_from_few_others() {
    let (size, depth) = ([0.03, 0.03, 0.04], 0.0058);
    let (points, cells) = block([3, 3, 5], size);
    let at = |z: f64| -> Vec<u32> {
        (0..points.len() as u32).filter(|&n| (points[n as usize][2] - z).abs() < 1e-12).collect()
    };
    let surface = Surface::new(&points, &surface(&points, &cells));
    let (fixed, touchable) = (at(0.0), at(size[2]));
    let law = Material::new("saint_venant_kirchhoff", vec![vec![1e3, 1e4]]).unwrap();
    let body = Body::new(points, cells, law).unwrap();
    let settings = Reduction { touchable, depth, order: 4, pade: true, ..settings() };
    let model = settings.run(&body, &surface, &fixed, &mut |_| true).unwrap();
    let (metadata, mut arrays) = model.clone().into_parts();
    arrays.answers.departure.clear();
    let without = ReducedModel::new(metadata, arrays).unwrap();
    let mut correction = Correction::new(&body, &fixed, &[]).unwrap();
    let (mut departed, mut right, mut lost) = (0, 0, 0);
    for position in 0..model.n_positions() {
        let contact = model.locate(model.position(position)).unwrap();
        for (k, n) in viscera_touch::directions().iter().enumerate() {
            let touch = |share: f64| n.map(|x| share * depth * x);
            let is_trusted =
                |model: &ReducedModel, d| model.respond(&contact, d).trust == Trust::Trusted;
            let shares = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5];
            let Some(deepest) =
                shares.into_iter().find(|&share| is_trusted(&without, touch(share)))
            else {
                continue;
            };
            let d = touch(0.9 * deepest);
            let (u, answer) = (field(&model, &contact, d), model.respond(&contact, d));
            let of_both = correction.of(&model.patch(&contact), &u, answer.force, Curvature::Exact);
            let allowed = viscera_touch::allowance(norm(&d) / model.metadata().diagonal);
            let is_right = of_both.is_some_and(|[field, force]| field.max(force) < allowed);
            right += usize::from(is_right);
            lost += usize::from(is_right && !is_trusted(&model, d));
            // The others are tried where a neighbour has departed.
            if !is_right && (position + k) % 2 == 0 {
                departed += 1;
                assert!(!is_trusted(&model, d), "position {position}, {d:?}: {of_both:?}");
            }
        }
    }
    assert!(departed > 0);
    assert!(20 * lost < right, "{lost} of {right}");
}
