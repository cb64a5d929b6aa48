//! Fewer modes and the surface alone: what they keep, what they lose, and what they say of it.

use super::family::FAMILY;
use super::*;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

const COARSE: f64 = 0.02;

static SMALL: LazyLock<ReducedModel> = LazyLock::new(|| recompressed(&MODEL, COARSE).unwrap());

/// Touches within all triangles, of all depths.
fn touches() -> Vec<(Contact, [f64; 3])> {
    let random = noise(6 * 40 * MODEL.triangles().len(), 17);
    let touch = |(k, r): (usize, &[f64])| {
        let corners = [1.0 + r[0], 1.0 + r[1], 1.0 + r[2]];
        let sum: f64 = corners.iter().sum();
        let direction: [f64; 3] = [r[3], r[4], r[5]];
        let depth = DEPTH * (k % 20 + 1) as f64 / 20.0;
        let contact = inside(k % MODEL.triangles().len(), corners.map(|w| w / sum));
        (contact, direction.map(|x| depth * x / norm(&direction)))
    };
    random.chunks_exact(6).enumerate().map(touch).collect()
}

#[test]
fn forces_and_their_trust_are_those_of_the_model() {
    for (contact, d) in touches() {
        let (small, full) = (SMALL.respond(&contact, d), MODEL.respond(&contact, d));
        assert!(small.force == full.force && small.stiffness == full.stiffness);
        assert!(small.error_estimate == full.error_estimate && small.trust == full.trust);
        assert!(small.shape_error_estimate > full.shape_error_estimate);
    }
    let trusts: BTreeSet<bool> =
        touches().iter().map(|(c, d)| SMALL.respond(c, *d).shape_trust == Trust::Trusted).collect();
    assert_eq!(trusts.len(), 2, "some shapes are trusted, and some are not");
}

/// At touches that the compression has not seen: between positions, in any direction, shallow and deep.
#[test]
fn the_estimate_of_the_shape_covers_what_is_lost() {
    let mut largest: f64 = 0.0;
    for (contact, d) in touches() {
        let lost = relative(&field(&SMALL, &contact, d), &field(&MODEL, &contact, d));
        let (small, full) = (SMALL.respond(&contact, d), MODEL.respond(&contact, d));
        let admitted = small.shape_error_estimate - full.shape_error_estimate;
        // Single precision, and modes left out below 1e-5 of the tool's displacement.
        assert!(lost < admitted + 2e-5, "{lost:e}, said {admitted:e}");
        largest = largest.max(lost / admitted);
    }
    assert!(largest > 0.2, "an estimate, no blanket: {largest}");
}

#[test]
fn the_tolerance_is_kept_and_the_model_smaller() {
    assert!(SMALL.n_modes() < MODEL.n_modes());
    assert!(SMALL.to_bytes().unwrap().len() < MODEL.to_bytes().unwrap().len());
    for &node in &MODEL.arrays().positions {
        let contact = MODEL.locate(FULL.body.points()[node as usize]).unwrap();
        let squares = directions()
            .into_iter()
            .map(|d| relative(&field(&SMALL, &contact, d), &field(&MODEL, &contact, d)).powi(2));
        let mean = (squares.sum::<f64>() / directions().len() as f64).sqrt();
        assert!(mean < COARSE, "position {node}: {mean:e}");
    }
    let (errors, tolerance) = (SMALL.metadata().errors, SMALL.metadata().tolerance);
    assert!(errors.compression > MODEL.metadata().errors.compression && errors.compression < 0.1);
    assert!((tolerance - TOLERANCE - COARSE).abs() < 1e-15);
    assert!(MODEL.arrays().answers.linear_compression.iter().all(|&e| e < 1e-4), "kept exactly");
}

#[test]
fn a_family_is_compressed_at_all_its_values() {
    let mut small = recompressed(&FAMILY, COARSE).unwrap();
    assert!(small.n_modes() < FAMILY.n_modes());
    for value in [1.0, 3.1, 9.0] {
        let mut full = FAMILY.clone();
        full.set_parameter(value).unwrap();
        small.set_parameter(value).unwrap();
        let (contact, d) = (inside(4, [0.2, 0.5, 0.3]), [0.001, -0.002, -0.003]);
        assert_eq!(small.respond(&contact, d).force, full.respond(&contact, d).force);
        let lost = relative(&field(&small, &contact, d), &field(&full, &contact, d));
        assert!(lost > 0.0 && lost < small.respond(&contact, d).shape_error_estimate);
    }
}

#[test]
fn the_surface_alone_answers_alike() {
    let alone = MODEL.surface_alone(&[]).unwrap();
    let surface = |model: &ReducedModel, contact: &Contact, d: [f64; 3]| {
        let mut workspace = vec![0.0; model.field_workspace_len()];
        let mut out = vec![0.0; 3 * MODEL.arrays().surface_nodes.len()];
        model.surface_displacement(contact, d, &mut workspace, &mut out);
        out
    };
    for (contact, d) in touches().into_iter().step_by(40) {
        assert_eq!(alone.respond(&contact, d), MODEL.respond(&contact, d));
        assert_eq!(surface(&alone, &contact, d), surface(&MODEL, &contact, d));
    }
    assert!(
        alone.n_points() == MODEL.arrays().surface_nodes.len() && alone.arrays().cells.is_empty()
    );
    let again = ReducedModel::from_bytes(&alone.to_bytes().unwrap()).unwrap();
    assert!(again.arrays() == alone.arrays());
    assert!(recompressed(&alone, COARSE).unwrap().n_modes() < alone.n_modes());
    assert!(FAMILY.surface_alone(&[]).unwrap().metadata().parameter.is_none());
}

#[test]
fn nodes_inside_move_as_in_the_whole_model() {
    let inside = &MODEL.interior_nodes()[..3];
    let some = MODEL.surface_alone(inside).unwrap();
    let mut nodes = [&MODEL.arrays().surface_nodes[..], inside].concat();
    nodes.sort_unstable();
    let mut workspace = vec![0.0; MODEL.field_workspace_len()];
    let (mut part, mut whole) = (vec![0.0; 3 * nodes.len()], vec![0.0; 3 * MODEL.n_points()]);
    for (contact, d) in touches().into_iter().step_by(400) {
        some.surface_displacement(&contact, d, &mut workspace, &mut part);
        MODEL.displacement(&contact, d, &mut workspace, &mut whole);
        let at = |&node: &u32| whole[3 * node as usize..3 * node as usize + 3].to_vec();
        assert_eq!(part, nodes.iter().flat_map(at).collect::<Vec<f32>>());
    }
    assert!(MODEL.surface_alone(&[MODEL.n_points() as u32]).is_err());
}

#[test]
fn a_compression_that_is_not_wanted_any_more_ends_within_a_region() {
    let asked = AtomicUsize::new(0);
    let regions = MODEL.arrays().region_start.len() - 1;
    for last in [0, regions] {
        asked.store(0, Ordering::Relaxed);
        let found =
            recompressed_while(&MODEL, COARSE, &|| asked.fetch_add(1, Ordering::Relaxed) < last);
        assert!(matches!(found.map(|_| ()), Err(Error::Cancelled)));
    }
    let all = recompressed_while(&MODEL, COARSE, &|| true).unwrap();
    assert!(all.arrays() == SMALL.arrays());
}

#[test]
fn tolerances_without_meaning_are_refused() {
    for tolerance in [0.0, -1.0, 1.0, f64::NAN, f64::INFINITY] {
        let error = recompressed(&MODEL, tolerance).unwrap_err().to_string();
        assert!(error.contains("it must be above 0 and below 1"), "{error}");
    }
}
