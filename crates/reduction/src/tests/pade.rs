//! Models that sum their orders in the Padé form: further than the polynomial, and as smooth.

use super::preload::newton;
use super::*;
use crate::equilibrium::PatchLoad;
use viscera_touch::truncation_share;

pub(super) static PADE: LazyLock<ReducedModel> = LazyLock::new(|| {
    let reduction = Reduction { pade: true, order: 4, tolerance: 2e-4, depth: 0.012, ..settings() };
    reduce(&reduction).unwrap()
});

/// The same model, its orders summed as a polynomial.
static POLYNOMIAL: LazyLock<ReducedModel> = LazyLock::new(|| {
    let (metadata, mut arrays) = PADE.clone().into_parts();
    arrays.answers.sketch.clear();
    ReducedModel::new(metadata, arrays).unwrap()
});

/// Contacts at positions, where nothing is interpolated, and directions.
pub(super) fn touches() -> Vec<(Contact, [f64; 3])> {
    let mut touches = Vec::new();
    for (k, d) in directions().into_iter().enumerate().step_by(3) {
        let node = PADE.arrays().positions[k % PADE.n_positions()] as usize;
        let contact = PADE.locate(FULL.body.points()[node]).unwrap();
        touches.push((contact, d.map(|x| x / DEPTH)));
    }
    touches
}

#[test]
fn it_is_nearer_to_newton_than_the_polynomial_and_says_how_near() {
    let zero = vec![0.0; FULL.body.n_dofs()];
    for depth in [0.004, 0.008] {
        let (mut pade, mut polynomial) = (Vec::new(), Vec::new());
        for (contact, n) in touches() {
            let d = n.map(|x| depth * x);
            let load = PatchLoad { patch: PADE.patch(&contact), displacement: d };
            let full = newton(&zero, None, Some(load));
            let error = |model: &ReducedModel| {
                let answer = model.respond(&contact, d);
                let force = relative(&answer.force, &full.patch_forces[0]);
                force.max(relative(&field(model, &contact, d), &full.displacement))
            };
            let estimate = PADE.respond(&contact, d).shape_error_estimate;
            assert!(error(&PADE) < 1.2 * estimate, "{:e}, said {estimate:e}", error(&PADE));
            pade.push(error(&PADE));
            polynomial.push(error(&POLYNOMIAL));
        }
        let median = |mut errors: Vec<f64>| {
            errors.sort_by(f64::total_cmp);
            errors[errors.len() / 2]
        };
        let (pade, polynomial) = (median(pade), median(polynomial));
        assert!(pade < 0.8 * polynomial, "{depth}: {pade:e} against {polynomial:e}");
    }
}

/// What was measured between positions scales the estimate; without it that is the older one.
#[test]
fn the_estimate_is_in_units_of_what_was_measured_between_positions() {
    let [force, field] = PADE.metadata().interpolation_shares.unwrap();
    assert!(force > 0.0 && force < 1.0 && field > 0.0 && field < 1.0, "{force} {field}");
    let with = |interpolation_shares| {
        let metadata = Metadata { interpolation_shares, ..PADE.metadata().clone() };
        ReducedModel::new(metadata, PADE.arrays().clone())
    };
    let (none, twice) = (with(None).unwrap(), with(Some([2.0 * force, field])).unwrap());
    for (triangle, d) in noise(12, 3).chunks_exact(3).enumerate() {
        let d: [f64; 3] = std::array::from_fn(|i| 0.005 * d[i]);
        let between = inside(triangle, [0.25, 0.15, 0.6]);
        let [own, other] = [&*PADE, &twice].map(|model| model.respond(&between, d));
        assert!(other.error_estimate > own.error_estimate, "between positions");
        assert!(other.shape_error_estimate >= own.shape_error_estimate);
        assert_ne!(none.respond(&between, d).error_estimate, own.error_estimate);
        let corner = inside(triangle, [1.0, 0.0, 0.0]);
        let [own, other] = [&*PADE, &twice].map(|model| model.respond(&corner, d).error_estimate);
        assert!((other - own).abs() < 1e-6 * own, "nothing is interpolated at a position");
    }
    for share in [-1.0, f64::NAN] {
        let refused = with(Some([share, 0.1]));
        assert!(refused.is_err_and(|e| e.to_string().contains("interpolation_shares")));
    }
}

/// So does what one order more was measured to change, at positions too; a negative number is refused.
#[test]
fn the_estimate_is_in_units_of_what_one_order_more_changes() {
    let share = PADE.metadata().truncation_share.unwrap();
    assert!(share > 0.05 && share < 1.0, "{share}");
    let with = |share| {
        let metadata = Metadata { truncation_share: Some(share), ..PADE.metadata().clone() };
        ReducedModel::new(metadata, PADE.arrays().clone())
    };
    let (corner, d) = (inside(3, [1.0, 0.0, 0.0]), [0.001, -0.002, -0.004]);
    let estimate = |share| with(share).unwrap().respond(&corner, d).error_estimate;
    // By its root, and above 1 by itself.
    for (share, ratio) in [(share, 0.5), (4.0, 0.25)] {
        let [own, other] = [share, share / 4.0].map(estimate);
        assert!((other - ratio * own).abs() < 1e-6 * own, "{own:e} {other:e}");
    }
    let rest = PADE.truncation(&corner, d).unwrap();
    for error in [0.3, 3.0].map(|part| part * rest) {
        let found = estimate(truncation_share(error, rest));
        assert!((found - error).abs() < 1e-3 * error, "{found:e} {error:e}");
    }
    assert!(with(-1.0).is_err_and(|e| e.to_string().contains("truncation_share")));
}

/// A file from before poles were seen has shares in units that do not grow near them, and keeps its estimates.
#[test]
fn the_estimate_grows_near_a_pole_but_not_that_of_older_files() {
    assert!(PADE.metadata().is_pole_aware);
    let metadata = Metadata { is_pole_aware: false, ..PADE.metadata().clone() };
    let older = ReducedModel::new(metadata, PADE.arrays().clone()).unwrap();
    let mut ratios = Vec::new();
    for (contact, n) in touches() {
        let d = n.map(|x| 0.012 * x);
        let [own, other] = [&*PADE, &older].map(|model| model.respond(&contact, d));
        assert_eq!(own.force, other.force);
        if own.error_estimate < 1.0 {
            let scale = [&*PADE, &older].map(|model| model.truncation(&contact, d).unwrap());
            ratios.push(own.error_estimate / other.error_estimate);
            let magnification = scale[0] / scale[1];
            assert!((ratios.last().unwrap() / magnification - 1.0).abs() < 1e-9);
        }
    }
    assert!(ratios.iter().all(|&ratio| (1.0..=10.0 + 1e-9).contains(&ratio)));
    assert!(ratios.iter().any(|&ratio| ratio > 1.1) && ratios.contains(&1.0), "{ratios:?}");
}

#[test]
fn small_touches_are_those_of_the_polynomial() {
    let contact = inside(5, [0.2, 0.5, 0.3]);
    let gap = |depth: f64| {
        let d = [0.6 * depth, 0.0, -0.8 * depth];
        let pade = PADE.respond(&contact, d).force;
        relative(&pade, &POLYNOMIAL.respond(&contact, d).force)
    };
    let rate = (gap(0.002) / gap(0.001)).log2();
    assert!((rate - 4.0).abs() < 0.5, "order 4 and all below it are the series: {rate}");
}

/// Through the blend of sketches and the derivative of the weights.
#[test]
fn its_stiffness_is_the_derivative_of_its_force() {
    for (triangle, d) in noise(12, 3).chunks_exact(3).enumerate() {
        let contact = inside(triangle, [0.25, 0.15, 0.6]);
        let d: [f64; 3] = std::array::from_fn(|i| 0.01 * d[i]);
        let stiffness = PADE.respond(&contact, d).stiffness;
        for j in 0..3 {
            let moved = |step: f64| {
                let mut d = d;
                d[j] += step;
                PADE.respond(&contact, d).force
            };
            let (plus, minus) = (moved(1e-7), moved(-1e-7));
            let difference: [f64; 3] = std::array::from_fn(|i| (plus[i] - minus[i]) / 2e-7);
            let column = [stiffness[0][j], stiffness[1][j], stiffness[2][j]];
            assert!(relative(&difference, &column) < 1e-6);
        }
    }
}

#[test]
fn cut_after_an_order_it_is_the_polynomial() {
    let (contact, d) = (inside(5, [0.2, 0.5, 0.3]), [0.002, -0.004, -0.006]);
    for order in 1..4 {
        let force = PADE.force_to_order(&contact, d, order);
        assert_eq!(force, POLYNOMIAL.force_to_order(&contact, d, order));
    }
    assert_eq!(PADE.force_to_order(&contact, d, 4), PADE.respond(&contact, d).force);
}

/// A rational force is no slope of an energy, but nearly: a closed loop costs what the error is.
#[test]
fn a_closed_loop_costs_no_more_than_the_error() {
    let lost = super::work::lost(&PADE, 0.008);
    assert!(lost > 1e-9 && lost < 0.01, "{lost:e}");
    assert!(super::work::lost(&POLYNOMIAL, 0.008) < 1e-9);
}
