//! Fuzz targets for the reader of model files, the on-line evaluator, and the stepper of a case.
//!
//! A fuzzer searches for inputs (`make fuzz`), and the tests replay those in `corpus/`. No input may cause a panic, a
//! trusted answer is finite, and a model that was read and written again is the same.

mod arrays;

use arrays::Field;
use std::sync::LazyLock;
use viscera_live::Live;
use viscera_touch::{Metadata, ReducedModel, Trust};

/// A valid model of a small block, from which edits start. Its checksums refuse changed bytes, so a file of the older
/// format without checksums lies beside it: with that one the fuzzer reaches the code behind the checksums.
pub const BLOCK: &[u8] = include_bytes!("../corpus/file/block.viscera");

/// A valid case of a cube.
pub const CASE: &[u8] = include_bytes!("../corpus/case/cube.case");

static MODEL: LazyLock<ReducedModel> =
    LazyLock::new(|| ReducedModel::from_bytes(BLOCK).expect("the corpus holds a valid block"));

/// Reads any bytes as a model file; returns whether they were accepted.
pub fn file(bytes: &[u8]) -> bool {
    let Ok(model) = ReducedModel::from_bytes(bytes) else { return false };
    let depth = model.metadata().depth;
    for triangle in 0..(model.arrays().touchable.len() / 3).min(4) {
        let point = model.centroid(triangle).point;
        for d in [[0.0; 3], [0.0, 0.0, -depth], [depth, 0.5 * depth, -2.0 * depth], [1e200; 3]] {
            touch(&model, point, d);
        }
    }
    true
}

/// Edits a valid model, and touches it if it is still accepted.
pub fn edits(bytes: &[u8]) -> bool {
    let mut script = Script(bytes);
    let (mut metadata, mut arrays) = (MODEL.metadata().clone(), MODEL.arrays().clone());
    for _ in 0..script.byte() % 8 {
        match script.byte() {
            which @ 0..=223 => Field::of(&mut arrays, which).edit(&mut script),
            which => edit_metadata(&mut metadata, which, &mut script),
        }
    }
    let Ok(model) = ReducedModel::new(metadata, arrays) else { return false };
    let written = model.to_bytes().expect("a model that is accepted can be written");
    let again = ReducedModel::from_bytes(&written).expect("what was written can be read");
    let format_version = again.metadata().format_version;
    let expected = Metadata { format_version, ..model.metadata().clone() };
    assert!(again.arrays() == model.arrays() && *again.metadata() == expected);
    while !script.0.is_empty() {
        let point = std::array::from_fn(|_| script.coordinate(0.05));
        let d = std::array::from_fn(|_| script.coordinate(0.01));
        touch(&model, point, d);
    }
    true
}

/// Reads any bytes as a case; returns whether they were accepted and stepped.
pub fn case(bytes: &[u8]) -> bool {
    Live::open(bytes).is_ok_and(|live| follow(live, &["{}", r#"{"grab": [0.04, 0.04, 0.04]}"#]))
}

/// Reads any bytes as requests of a page, one per line; returns whether one was followed.
pub fn requests(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let lines: Vec<&str> = text.lines().take(8).collect();
    follow(Live::open(CASE).expect("the corpus holds a valid case"), &lines)
}

/// Whether one of the requests was followed; asserts that frames are finite.
fn follow(mut live: Live, requests: &[&str]) -> bool {
    let frames = requests.iter().filter_map(|request| live.answer(request).ok());
    let sound = frames.map(|frame| assert!(frame.iter().all(|x| x.is_finite())));
    sound.count() > 0
}

/// All calls of a haptic loop.
fn touch(model: &ReducedModel, point: [f64; 3], d: [f64; 3]) {
    let Some(contact) = model.locate(point) else { return };
    model.is_on_surface(&contact);
    let response = model.respond(&contact, d);
    if response.trust == Trust::Trusted {
        let numbers = response.force.iter().chain(response.stiffness.iter().flatten());
        assert!(numbers.chain([&response.error_estimate]).all(|x| x.is_finite()), "{response:?}");
    }
    let mut workspace = vec![0.0; model.field_workspace_len()];
    let mut field = vec![0.0; 3 * model.n_points()];
    model.displacement(&contact, d, &mut workspace, &mut field);
    model.energy(&contact, d);
    let below = contact.point.map(|x| 0.99 * x);
    if let Ok(mut places) = model.places_at(&[contact.point, below]) {
        model.move_places(&mut places, &contact, d, &mut [[0.0; 3]; 2]);
    }
    model.patch(&contact);
}

fn edit_metadata(metadata: &mut Metadata, which: u8, script: &mut Script) {
    match which % 6 {
        0 => metadata.order = usize::from(script.byte()),
        1 => metadata.edge_order = usize::from(script.byte()),
        2 => metadata.depth = script.number(),
        3 => metadata.radius = script.number(),
        4 => metadata.diagonal = script.number(),
        _ => metadata.format_version = u32::from(script.byte()),
    }
}

/// The bytes of the fuzzer, read as choices; zeros after their end.
pub(crate) struct Script<'a>(&'a [u8]);

impl Script<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut taken = [0; N];
        let n = N.min(self.0.len());
        taken[..n].copy_from_slice(&self.0[..n]);
        self.0 = &self.0[n..];
        taken
    }

    fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    fn index(&mut self) -> usize {
        usize::from(u16::from_le_bytes(self.bytes()))
    }

    /// Any number, also NaN and infinity.
    fn number(&mut self) -> f64 {
        f64::from_le_bytes(self.bytes())
    }

    /// A number in (-size, size), or any.
    fn coordinate(&mut self, size: f64) -> f64 {
        match self.byte() {
            0..=15 => self.number(),
            _ => size * f64::from(i16::from_le_bytes(self.bytes())) / 32768.0,
        }
    }
}
