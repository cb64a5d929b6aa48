//! The model file: a round trip, and every kind of damage refused with the array's name.

use super::*;
use crate::element::Element;
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};

#[test]
fn the_file_gives_the_model_back() {
    let bytes = MODEL.to_bytes().unwrap();
    let again = ReducedModel::from_bytes(&bytes).unwrap();
    assert!(again.metadata() == MODEL.metadata() && again.arrays() == MODEL.arrays());
    assert_eq!(again.metadata().user.text(), r#"{"note": "a block"}"#);
    assert!(again.to_bytes().unwrap() == bytes);
    let (contact, d) = (MODEL.centroid(5), [0.001, 0.002, -0.003]);
    assert_eq!(again.respond(&contact, d), MODEL.respond(&contact, d));
    assert_eq!(field(&again, &contact, d), field(&MODEL, &contact, d));
    assert!(MODEL.array("surface_modes").is_some() && MODEL.array("modes").is_none());
}

fn sentence(bytes: &[u8]) -> String {
    match ReducedModel::from_bytes(bytes) {
        Ok(_) => "accepted".to_string(),
        Err(viscera_touch::Error::ModelFile(sentence)) => sentence,
        Err(other) => panic!("not an error of the file: {other}"),
    }
}

#[test]
fn a_file_cut_short_or_overwritten_is_refused() {
    let bytes = MODEL.to_bytes().unwrap();
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let in_data = (1..8).map(|k| header + k * (bytes.len() - header) / 8);
    for cut in (0..header).step_by(97).chain(in_data).chain([header, bytes.len() - 1]) {
        let sentence = sentence(&bytes[..cut]);
        assert!(sentence.contains("cut short"), "{cut} bytes: {sentence}");
    }
    // Damage inside the header may leave a readable file; it may never bring the reader down.
    let mut refused = 0;
    for (k, place) in (0..header).step_by(13).enumerate() {
        let mut damaged = bytes.clone();
        damaged[place] = [b'0', b'9', b'"', b'}', 0xff][k % 5];
        refused += (sentence(&damaged) != "accepted") as usize;
    }
    assert!(refused > header / 13 / 2, "{refused} of {} damaged headers refused", header / 13);
}

/// The file with one array changed, or left out.
fn rewritten(name: &str, dtype: Dtype, shape: Option<Vec<usize>>) -> String {
    let bytes = MODEL.to_bytes().unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let views: Vec<(String, TensorView)> = (tensors.tensors().into_iter())
        .filter(|(other, _)| other != name || shape.is_some())
        .map(|(other, view)| match &shape {
            Some(shape) if other == name => {
                let view = TensorView::new(dtype, shape.clone(), view.data()).unwrap();
                (other, view)
            }
            _ => (other, view),
        })
        .collect();
    sentence(&serialize(views, header.metadata().clone()).unwrap())
}

#[test]
fn arrays_missing_or_of_another_form_are_named() {
    let n = MODEL.n_points();
    let edges = MODEL.arrays().edges.len() / 2;
    let cases = [
        (rewritten("points", Dtype::F64, Some(vec![n, 3])), "accepted"),
        (rewritten("norms", Dtype::F32, None), "array norms is missing"),
        (
            rewritten("points", Dtype::I64, Some(vec![n, 3])),
            "array points holds I64 instead of F64",
        ),
        (rewritten("edges", Dtype::F32, Some(vec![edges, 2])), "array edges holds F32"),
        (rewritten("points", Dtype::F64, Some(vec![3, n])), "array points has shape [3, "),
        (rewritten("edges", Dtype::U32, Some(vec![2 * edges])), "array edges has shape"),
        (rewritten("fixed", Dtype::U32, Some(vec![20, 1])), "array fixed has shape [20, 1]"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

fn changed(change: impl Fn(&mut Metadata, &mut Arrays)) -> String {
    let (mut metadata, mut arrays) = MODEL.clone().into_parts();
    change(&mut metadata, &mut arrays);
    sentence(&to_bytes(&metadata, &arrays).unwrap())
}

#[test]
fn lengths_and_indices_that_do_not_fit_are_named() {
    let cases = [
        (changed(|_, a| a.answers.force.truncate(300)), "array force has 300 entries"),
        (changed(|_, a| a.surface_modes.truncate(30)), "array surface_modes has 30 entries"),
        (changed(|_, a| a.answers.norms.push(0.0)), "array norms"),
        (changed(|_, a| a.answers.position_coefficients.push(0.0)), "array position_coefficients"),
        (changed(|_, a| a.patch_weights.push(0.0)), "array patch_weights"),
        (changed(|_, a| a.answers.compliance.clear()), "array compliance has 0 entries"),
        (changed(|_, a| a.points.clear()), "array points is empty"),
        (changed(|_, a| a.touchable.clear()), "array touchable is empty"),
        (changed(|_, a| a.region_start.clear()), "array region_start is empty"),
        (changed(|_, a| a.cells[7] = 80), "cells[7] = 80; it must be below 80"),
        (changed(|_, a| a.touchable[1] = 20), "touchable[1] = 20"),
        (changed(|_, a| a.triangle_edges[4] = u32::MAX), "triangle_edges[4] = 4294967295"),
        (changed(|_, a| a.triangle_edges.swap(0, 1)), "does not join corners of triangle 0"),
        (changed(|_, a| a.position_region[2] = 2), "position_region[2] = 2"),
        (changed(|_, a| a.edge_region[0] = 9), "edge_region[0] = 9"),
        (changed(|_, a| a.patch_nodes[3] = 80), "patch_nodes[3] = 80"),
        (changed(|_, a| a.surface_nodes.swap(0, 1)), "surface_nodes is not ascending"),
        (changed(|_, a| a.patch_start[1] = 9999), "patch_start does not run"),
        (changed(|_, a| a.region_start[0] = 1), "region_start does not run"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

#[test]
fn values_out_of_their_domain_are_named() {
    let no_modes = |_: &mut Metadata, a: &mut Arrays| {
        a.region_start.fill(0);
        a.mode_scale.clear();
        a.surface_modes.clear();
        a.interior_modes.clear();
        a.answers.position_coefficients.clear();
        a.answers.edge_coefficients.clear();
    };
    let cases = [
        (changed(|_, a| a.answers.force[11] = f64::NAN), "force[11] is NaN"),
        (changed(|_, a| a.points[0] = f64::INFINITY), "points[0] is inf"),
        (changed(|_, a| a.answers.compliance[4] = f64::NAN), "compliance[4] is NaN"),
        (changed(|_, a| a.mode_scale[0] = f32::NAN), "mode_scale[0] is NaN"),
        (changed(|_, a| a.answers.norms[1] = f32::INFINITY), "norms[1] is inf"),
        (changed(|_, a| a.patch_weights[0] = 2.0), "patch_weights of position 0"),
        (changed(no_modes), "array mode_scale is empty"),
        (changed(|m, _| m.units = "mm".into()), "units \"mm\"; they are always \"SI\""),
        (changed(|m, _| m.errors.parameter = -5.0), "errors.parameter = -5"),
        (changed(|_, a| a.answers.norms[0] *= -1.0), "norms[0] is -"),
        (changed(|_, a| a.answers.compliance[17] *= -1.0), "compliance[17] is -"),
        (changed(|_, a| a.answers.compression[1] = -1.0), "compression[1] is -1"),
        (changed(|_, a| a.answers.linear_compression[2] = -1.0), "linear_compression[2] is -1"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

/// A bit that differs, wherever it lies: in the length of the header, the header, its padding, an array.
#[test]
fn every_flipped_bit_is_refused() {
    let bytes = MODEL.to_bytes().unwrap();
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let anywhere = noise(400, 11).into_iter().map(|x| (0.5 + 0.5 * x) * (8 * bytes.len()) as f64);
    let anywhere = anywhere.map(|bit| (bit as usize).min(8 * bytes.len() - 1));
    for bit in (0..8 * header).step_by(3).chain(anywhere) {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert_ne!(sentence(&damaged), "accepted", "bit {} of byte {}", bit % 8, bit / 8);
    }
}

/// A bit of the version makes the file one of before there were checksums, or of version 2: they are compared all the same.
#[test]
fn a_flipped_version_hides_no_damage() {
    let mut bytes = MODEL.to_bytes().unwrap();
    let key = b"format_version\\\":";
    let version = key.len() + bytes.windows(key.len()).position(|w| w == key).unwrap();
    for (bit, expected) in [(0, b'2'), (1, b'1')] {
        let mut damaged = bytes.clone();
        damaged[version] ^= 1 << bit;
        assert_eq!(damaged[version], expected);
        assert!(sentence(&damaged).contains("its metadata are damaged: the checksum differs"));
    }
    bytes[version] = b'1';
    *bytes.last_mut().unwrap() ^= 1;
    assert_ne!(sentence(&bytes), "accepted");
}

#[test]
fn damage_is_called_damage() {
    let bytes = MODEL.to_bytes().unwrap();
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 1;
    assert!(sentence(&flipped).contains("is damaged: the checksum differs"));
    let depth = bytes.windows(9).position(|w| w == b"depth\\\":0").unwrap();
    let mut flipped = bytes.clone();
    flipped[depth + 10] ^= 1;
    assert!(sentence(&flipped).contains("its metadata are damaged: the checksum differs"));
}

/// A file by the version before checksums is read, says what it is, and is written with them.
#[test]
fn a_file_of_the_format_before_is_read_and_written_in_this_one() {
    let old = include_bytes!("../../../../tests/data/format-1.viscera");
    let model = ReducedModel::from_bytes(old).unwrap();
    assert!(model.metadata().format_version == 1 && !model.metadata().is_sealed());
    let again = ReducedModel::from_bytes(&model.to_bytes().unwrap()).unwrap();
    assert!(again.metadata().is_sealed() && again.arrays() == model.arrays());
    let contact = model.centroid(0);
    let d = [0.0, 0.0, -model.metadata().depth];
    assert_eq!(again.respond(&contact, d), model.respond(&contact, d));
}

#[test]
fn another_format_is_refused() {
    for version in [0, 5] {
        let metadata = Metadata { format_version: version, ..MODEL.metadata().clone() };
        let error = ReducedModel::new(metadata, MODEL.arrays().clone()).unwrap_err().to_string();
        let expected = format!("format version {version}; this version reads 1 to 4");
        assert!(error.contains(&expected), "{error}");
    }
}

#[test]
fn metadata_out_of_their_domain_are_named() {
    let cases = [
        (changed(|m, _| m.order = 1), "order 1"),
        (changed(|m, _| m.order = 9), "order 9"),
        (changed(|m, _| m.order = 4), "array force has"),
        (changed(|m, _| m.edge_order = 0), "edge order 0"),
        (changed(|m, _| m.edge_order = 4), "edge order 4"),
        (changed(|m, _| m.depth = 0.0), "depth = 0"),
        (changed(|m, _| m.depth = f64::NAN), "metadata is damaged"),
        (changed(|m, _| m.radius = -1.0), "radius = -1"),
        (changed(|m, _| m.norm_length = 0.0), "norm_length = 0"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

#[test]
fn a_file_that_names_no_element_has_linear_cells() {
    let mut written = serde_json::to_value(MODEL.metadata()).unwrap();
    written.as_object_mut().unwrap().remove("element");
    let read: Metadata = serde_json::from_value(written).unwrap();
    assert_eq!(read.element, Element::P1.name());
}
