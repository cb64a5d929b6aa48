//! A block in a hand: frames are the equilibrium's, requests that make no sense are sentences and change nothing.

use crate::Live;
use crate::specimen::FACTS;
use safetensors::tensor::{Dtype, TensorView, serialize};
use serde_json::{Value, json};
use viscera_core::body::Body;
use viscera_core::equilibrium::{Newton, PatchLoad, Pressure, Problem};
use viscera_core::law::Material;
use viscera_core::mesh::Surface;

const TIP: [f64; 3] = [0.4, 0.05, 0.1];

/// A bar of six tetrahedra to the cube, 0.4 x 0.1 x 0.1 m, and its nodes at x = 0.
fn bar() -> (Vec<[f64; 3]>, Vec<[u32; 4]>, Vec<u32>) {
    let (nx, n) = (8u32, 2u32);
    let node = |i: u32, j: u32, k: u32| i + (nx + 1) * (j + (n + 1) * k);
    let mut points = Vec::new();
    for k in 0..=n {
        for j in 0..=n {
            points.extend((0..=nx).map(|i| [i, j, k].map(|a| 0.05 * f64::from(a))));
        }
    }
    let mut cells = Vec::new();
    for (i, j, k) in (0..nx * n * n).map(|c| (c % nx, c / nx % n, c / nx / n)) {
        let v = |b: u32| node(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2));
        // Kuhn's six tetrahedra along the diagonal 0-7.
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            cells.push([v(0), v(a), v(b), v(7)]);
        }
    }
    let fixed = (0..points.len() as u32).filter(|&p| points[p as usize][0] == 0.0).collect();
    (points, cells, fixed)
}

/// The bytes of a case of that bar, as `viscera.viewer.live` packs them.
fn case(change: impl Fn(&mut Value)) -> Vec<u8> {
    let (points, cells, fixed) = bar();
    let mut about = json!({
        "name": "Bar", "law": "NeoHookean", "element": "P1", "radius": 0.06, "diagonal": 0.43,
        "gravity": [0.0, 0.0, 0.0], "laws": {"NeoHookean": "neo_hookean", "Linear": "linear"},
    });
    change(&mut about);
    let doubles = |values: &[f64]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let indices = |values: &[u32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let moduli = doubles(&[4e4, 1e5]);
    let arrays: Vec<(&str, Dtype, Vec<usize>, Vec<u8>)> = vec![
        ("points", Dtype::F64, vec![points.len(), 3], doubles(points.as_flattened())),
        ("cells", Dtype::U32, vec![cells.len(), 4], indices(cells.as_flattened())),
        ("fixed", Dtype::U32, vec![fixed.len()], indices(&fixed)),
        ("density", Dtype::F64, vec![1], doubles(&[1000.0])),
        ("NeoHookean", Dtype::F64, vec![1, 2], moduli.clone()),
        ("Linear", Dtype::F64, vec![1, 2], moduli),
    ];
    let views = arrays.iter().map(|(name, dtype, shape, bytes)| {
        (*name, TensorView::new(*dtype, shape.clone(), bytes).unwrap())
    });
    let notes = [("viscera".to_string(), about.to_string())];
    serialize(views, Some(notes.into_iter().collect())).unwrap()
}

fn live() -> Live {
    Live::open(&case(|_| ())).unwrap()
}

/// The last frame of so many.
fn settle(live: &mut Live, request: Value) -> Vec<f32> {
    live.answer(&request.to_string()).unwrap();
    (0..10).fold(Vec::new(), |_, _| live.answer("{}").unwrap())
}

#[test]
fn a_hand_finds_the_equilibrium() {
    let (points, cells, fixed) = bar();
    let push = [0.0, 0.01, -0.02];
    let material = Material::new("neo_hookean", vec![vec![4e4, 1e5]]).unwrap();
    let body = Body::new(points, cells, material).unwrap();
    let surface = Surface::new(body.points(), &body.surface());
    let patch = surface.patch_at_point(TIP, 0.06, &|node| fixed.contains(&node)).unwrap();
    let problem = Problem {
        body: &body,
        prescribed: fixed.iter().flat_map(|n| (0..3).map(move |i| (3 * n + i, 0.0))).collect(),
        force: vec![0.0; body.n_dofs()],
        pressure: Pressure::default(),
        patches: vec![PatchLoad { patch, displacement: push }],
        start: None,
    };
    let exact = Newton::default().solve(&problem, &mut |_| true).unwrap();
    let frame = settle(&mut live(), json!({"grab": TIP, "move": push}));
    assert_eq!(frame.len(), 1 + FACTS + 3 * surface.nodes().len());
    let size = exact.displacement.iter().fold(0.0f64, |m, u| m.max(u.abs()));
    for (k, &node) in surface.nodes().iter().enumerate() {
        for i in 0..3 {
            let error =
                f64::from(frame[1 + FACTS + 3 * k + i]) - exact.displacement[3 * node as usize + i];
            assert!(error.abs() < 1e-6 * size, "node {node}");
        }
    }
    for i in 0..3 {
        let error = f64::from(frame[1 + i]) - exact.patch_forces[0][i];
        assert!(error.abs() < 1e-6 * exact.patch_forces[0][2].abs());
    }
    let gain = body.volume(&exact.displacement) / body.rest_volume() - 1.0;
    assert!((f64::from(frame[8]) - gain).abs() < 1e-6);
}

#[test]
fn two_hands_find_the_equilibrium_and_let_go_one_by_one() {
    let (points, cells, fixed) = bar();
    let places = [[0.2, 0.05, 0.1], [0.4, 0.05, 0.0]];
    let pushes = [[0.0, 0.0, -0.01], [0.0, 0.01, 0.005]];
    let material = Material::new("neo_hookean", vec![vec![4e4, 1e5]]).unwrap();
    let body = Body::new(points, cells, material).unwrap();
    let surface = Surface::new(body.points(), &body.surface());
    let load = |hand: usize| {
        let patch = surface.patch_at_point(places[hand], 0.06, &|node| fixed.contains(&node));
        PatchLoad { patch: patch.unwrap(), displacement: pushes[hand] }
    };
    let solve = |patches: Vec<PatchLoad>| {
        let problem = Problem {
            body: &body,
            prescribed: fixed.iter().flat_map(|n| (0..3).map(move |i| (3 * n + i, 0.0))).collect(),
            force: vec![0.0; body.n_dofs()],
            pressure: Pressure::default(),
            patches,
            start: None,
        };
        Newton::default().solve(&problem, &mut |_| true).unwrap().patch_forces
    };
    let check = |frame: &[f32], first: [f64; 3], second: [f64; 3]| {
        let size = [first, second].into_iter().flatten().fold(0.0f64, |m, f| m.max(f.abs()));
        for i in 0..3 {
            assert!((f64::from(frame[1 + i]) - first[i]).abs() < 1e-5 * size);
            assert!((f64::from(frame[1 + FACTS - 3 + i]) - second[i]).abs() < 1e-5 * size);
        }
    };
    let mut live = live();
    let second = json!({"grab": places[1], "move": pushes[1]});
    let frame = settle(&mut live, json!({"grab": places[0], "move": pushes[0], "second": second}));
    let exact = solve(vec![load(0), load(1)]);
    check(&frame, exact[0], exact[1]);
    let frame = settle(&mut live, json!({"release": true}));
    check(&frame, [0.0; 3], solve(vec![load(1)])[0]);
    let frame = settle(&mut live, json!({"second": {"release": true}}));
    assert!(frame[1..4].iter().chain(&frame[1 + FACTS - 3..]).all(|x| x.abs() < 1e-9));
}

#[test]
fn two_hands_at_one_place_are_a_sentence_and_the_first_holds_on() {
    let mut live = live();
    let held = settle(&mut live, json!({"grab": TIP, "move": [0.0, 0.0, -0.02]}));
    for place in [TIP, [0.398, 0.05, 0.1]] {
        let second = json!({"second": {"grab": place, "move": [0.0, 0.0, -0.01]}}).to_string();
        let sentence = live.answer(&second).unwrap_err().to_string();
        assert!(sentence.contains("both hands hold the same place; take hold elsewhere"));
    }
    let after = live.answer("{}").unwrap();
    assert!((after[3] - held[3]).abs() < 1e-6 * held[3].abs());
}

#[test]
fn where_nothing_can_be_held_is_said_in_millimetres() {
    for (grab, words) in [
        (
            [-0.0700004, 1e-17, 0.05],
            "no free surface within 60 mm of the point (-70, 0, 50) mm; take hold elsewhere",
        ),
        (
            [-0.0300004, 1e-17, 0.05],
            "the surface is fixed at the point (-30, 0, 50) mm; take hold beside it",
        ),
    ] {
        let refusal = live().answer(&json!({"grab": grab}).to_string()).unwrap_err().to_string();
        assert!(refusal.contains(words), "{refusal}");
    }
}

#[test]
fn loads_that_are_left_out_are_told() {
    let told = |live: Live| serde_json::from_str::<Value>(&live.describe()).unwrap();
    let bytes = case(|about| about["left_out"] = json!(["force", "pressure"]));
    assert_eq!(told(Live::open(&bytes).unwrap())["left_out"], json!(["force", "pressure"]));
    assert_eq!(told(live())["left_out"], json!([]));
}

#[test]
fn stress_is_asked_for_and_is_that_of_a_bar_under_tension() {
    let mut live = live();
    let plain = settle(&mut live, json!({"laws": ["Linear"]}));
    // The end drawn out: across the middle, on the surface, about the force over the area.
    let frame = settle(
        &mut live,
        json!({"stress": true, "grab": [0.4, 0.05, 0.05], "move": [4e-4, 0.0, 0.0]}),
    );
    let n = (plain.len() - 1 - FACTS) / 3;
    assert_eq!(frame.len(), plain.len() + n);
    let (points, cells, _) = bar();
    let nodes = Surface::new(&points, &viscera_core::mesh::surface(&points, &cells));
    let force = f64::from(frame[1]);
    let middle = nodes.nodes().iter().zip(&frame[1 + FACTS + 3 * n..]);
    let middle: Vec<f64> = middle
        .filter(|(node, _)| (points[**node as usize][0] - 0.2).abs() < 1e-9)
        .map(|(_, &stress)| f64::from(stress))
        .collect();
    let mean = middle.iter().sum::<f64>() / middle.len() as f64;
    assert!((mean / (force / 0.01) - 1.0).abs() < 0.05);
    assert_eq!(live.answer(r#"{"stress": false}"#).unwrap().len(), plain.len());
}

#[test]
fn letting_go_brings_it_back() {
    let mut live = live();
    settle(&mut live, json!({"grab": TIP, "move": [0.0, 0.0, -0.02]}));
    let frame = settle(&mut live, json!({"release": true}));
    assert!(frame[1..4].iter().chain(&frame[1 + FACTS..]).all(|x| x.abs() < 1e-9));
}

#[test]
fn linear_elasticity_alone_answers_twice_the_push_with_twice_the_force() {
    let mut live = live();
    settle(&mut live, json!({"laws": ["Linear", "NeoHookean"]}));
    let [once, twice] = [-0.01, -0.02]
        .map(|push| settle(&mut live, json!({"grab": TIP, "move": [0.0, 0.0, push]})));
    let second = 1 + (once.len() - 1) / 2;
    let off = |at: usize| (twice[at + 2] / once[at + 2] - 2.0).abs();
    assert!(once[0] == 2.0 && off(1) < 1e-4 && off(second) > 1e-3);
}

#[test]
fn a_request_that_makes_no_sense_changes_nothing() {
    let mut live = live();
    let held = settle(&mut live, json!({"grab": TIP, "move": [0.0, 0.0, -0.02]}));
    for (request, words) in [
        ("not JSON", "a request is a JSON object"),
        ("[1, 2]", "a request is a JSON object"),
        (r#"{"grap": [0, 0, 0]}"#, "expected one of"),
        (r#"{"move": [0, 0]}"#, "an array of length 3"),
        (r#"{"move": [0, 0, NaN]}"#, "cannot be read"),
        (r#"{"move": [0, 0, 1e999]}"#, "out of range"),
        (r#"{"move": [0, 0, 1e7]}"#, "must be below"),
        (r#"{"gravity": "down"}"#, "an array of length 3"),
        (r#"{"laws": []}"#, "one or two names"),
        (r#"{"laws": ["Rubber"]}"#, "no law is called \"Rubber\""),
        (r#"{"grab": [100, 0, 0], "laws": ["Linear"]}"#, "no free surface"),
        (r#"{"second": {"grab": [100, 0, 0]}, "laws": ["Linear"]}"#, "no free surface"),
        (r#"{"second": {"move": [0, 1e7, 0]}}"#, "move of the second hand"),
    ] {
        let sentence = live.answer(request).unwrap_err().to_string();
        assert!(sentence.contains(words), "{request}: {sentence}");
    }
    let after = live.answer("{}").unwrap();
    let same = after.iter().zip(&held).filter(|(a, b)| (*a - *b).abs() > 1e-9).count();
    assert!(same <= 2, "but for the residual and the time the frame is the same");
}

#[test]
fn a_damaged_case_is_a_sentence() {
    let whole = case(|_| ());
    let refusal = |bytes: &[u8]| Live::open(bytes).err().expect("refused").to_string();
    assert!(refusal(b"nothing").contains("not a usable case"));
    assert!(refusal(&whole[..whole.len() / 2]).contains("not a usable case"));
    for (change, words) in [
        (json!({"radius": -1.0}), "must be positive"),
        (json!({"law": "Rubber"}), "not among its laws"),
        (json!({"element": "Q8"}), "Q8"),
        (json!({"laws": {"NeoHookean": "rubber"}}), "no law is called \"rubber\""),
        (json!({"laws": {"NeoHookean": "neo_hookean", "Ogden": "ogden"}}), "no array \"Ogden\""),
        (json!({"speed": 3}), "speed"),
    ] {
        let bytes = case(|about| {
            let Value::Object(change) = &change else { return };
            change.iter().for_each(|(key, value)| about[key] = value.clone());
        });
        let sentence = refusal(&bytes);
        assert!(sentence.contains(words), "{change}: {sentence}");
    }
}
