//! Surfaces of a pair that go through each other, and that do not.

use super::pairs::blocks;
use super::*;

/// The displacement of the two blocks with the upper one moved by `upper`, and both by `both`.
fn moved(body: &Body, upper: [f64; 3], both: [f64; 3]) -> Vec<f64> {
    let of = |x: &[f64; 3]| {
        let is_upper = f64::from(u8::from(x[2] > 1.005 * SIDE));
        std::array::from_fn::<f64, 3, _>(|i| is_upper * upper[i] + both[i])
    };
    body.points().iter().flat_map(of).collect()
}

/// Whether the surfaces have gone through each other after each of some steps.
fn passed(body: &Body, steps: impl IntoIterator<Item = Vec<f64>>) -> Vec<bool> {
    let (mut contact, mut u) = (Contact::new(body), vec![0.0; body.n_dofs()]);
    let mut after = |next: Vec<f64>| {
        contact.begin(&u);
        contact.linearize(&next);
        let entry = contact.find_entry(body, &next);
        assert!(entry.is_none_or(|entry| entry == Entry::Pair(0)));
        assert_eq!(contact.pair_report(0).unwrap().is_inside, entry.is_some());
        contact.end(&next);
        u = next;
        entry.is_some()
    };
    steps.into_iter().map(&mut after).collect()
}

/// Into the lower block, through it, and back; in ten steps or at once.
#[test]
fn what_goes_through_is_told_until_it_has_gone_back() {
    for n in [[2, 3], [3, 2], [1, 1]] {
        let body = blocks(n, 0.01 * SIDE, [0.0; 2]);
        let down = |depth: f64| moved(&body, [0.03 * SIDE, 0.02 * SIDE, -depth * SIDE], [0.0; 3]);
        let depths = [0.005, 0.02, 0.6, 1.0, 1.7, 2.5, 3.0, 1.2, 0.6, 0.02, 0.0, -0.5];
        let expected = depths.map(|depth| depth > 0.1);
        assert_eq!(passed(&body, depths.map(down)), expected, "{n:?}");
        let at_once = [0.0, 2.5, 2.5, 0.0].map(down);
        assert_eq!(passed(&body, at_once), [false, true, true, false], "{n:?}");
        // Where both go, together, does not matter.
        let far = |depth: f64| {
            moved(&body, [0.03 * SIDE, 0.02 * SIDE, -depth * SIDE], [5.0, 3.0, -4.0 * depth])
        };
        assert_eq!(passed(&body, [0.0, 2.5, 0.0].map(far)), [false, true, false], "{n:?}");
    }
}

/// Slides along the surface and over its edge, down beside the lower block and under it, up again on the other side.
#[test]
fn what_goes_round_is_not_told() {
    let body = blocks([2, 3], 0.01 * SIDE, [0.0; 2]);
    let ways = [
        [0.3, 0.0, -0.015],
        [0.9, 0.0, -0.015],
        [1.02, 0.0, -0.1],
        [1.2, 0.0, -1.0],
        [1.1, 0.0, -2.05],
        [0.0, 0.0, -2.05],
        [-1.1, 0.0, -2.1],
        [-1.1, 0.0, 0.1],
        [0.0, 0.0, 0.0],
    ];
    let at = |way: [f64; 3]| moved(&body, way.map(|part| part * SIDE), [0.0; 3]);
    assert_eq!(passed(&body, ways.map(at)), [false; 9]);
}
