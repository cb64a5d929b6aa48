//! Every way a load case can be refused.

use super::*;

fn refusal(problem: &Problem) -> String {
    match Newton::default().solve(problem, &mut |_| true) {
        Ok(_) => "accepted".to_string(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_start_turned_inside_out_is_refused() {
    let body = bar("neo_hookean", [2, 1, 1]);
    let mut load = problem(&body, clamped(&body));
    let mut start = vec![0.0; body.n_dofs()];
    start[3 * face(&body, 0, 1)[0] as usize] = -2.0 * SIZE[0];
    load.start = Some(start);
    let sentence = refusal(&load);
    assert!(sentence.contains("inside out") && sentence.contains("cell"), "{sentence}");
}

#[test]
fn bodies_that_nothing_holds_are_refused() {
    let body = bar("neo_hookean", [2, 1, 1]);
    assert!(refusal(&problem(&body, Vec::new())).contains("nothing holds the part of 12 points"));
    let in_plane = clamped(&body).into_iter().filter(|(dof, _)| dof % 3 != 1).collect();
    assert!(refusal(&problem(&body, in_plane)).contains("in y"));

    let (points, cells) = block([2, 1, 1], SIZE);
    let n = points.len() as u32;
    let apart = points.iter().map(|x| [x[0], x[1], x[2] + 0.1]);
    let twice: Vec<[u32; 4]> = cells.iter().map(|cell| cell.map(|node| node + n)).collect();
    let both = Body::new(
        points.iter().copied().chain(apart).collect(),
        [cells, twice].concat(),
        body.material().clone(),
    )
    .unwrap();
    let sentence = refusal(&problem(&both, clamped(&body)));
    assert!(sentence.contains("the part of 12 points around point 12 in x"), "{sentence}");
}

#[test]
fn bad_loads_are_refused_with_the_place_and_the_value() {
    let body = bar("neo_hookean", [2, 1, 1]);
    let refused = |change: &dyn Fn(&mut Problem)| {
        let mut load = problem(&body, clamped(&body));
        change(&mut load);
        refusal(&load)
    };
    let cases = [
        (refused(&|_| ()), "accepted"),
        (refused(&|l| l.force[7] = f64::NAN), "force is NaN at point 2"),
        (refused(&|l| l.force.truncate(5)), "force has 5 values; it needs 36"),
        (refused(&|l| l.start = Some(vec![f64::INFINITY; 36])), "start displacement is inf"),
        (refused(&|l| l.pressure.values.push(1.0)), "1 pressures for 0 faces"),
        (
            refused(&|l| {
                l.pressure = Pressure { faces: vec![vec![0, 1, 3]], values: vec![f64::NAN] }
            }),
            "pressure on face 0 is NaN",
        ),
        (
            refused(&|l| l.pressure = Pressure { faces: vec![vec![0, 1, 99]], values: vec![1.0] }),
            "face 0, [0, 1, 99], is none of the mesh",
        ),
        (
            refused(&|l| l.prescribed.push((1, 0.1))),
            "y displacement of point 0 is prescribed twice",
        ),
        (refused(&|l| l.prescribed.push((5, f64::NAN))), "z displacement of point 1 is NaN"),
        (refused(&|l| l.prescribed.push((36, 0.0))), "at point 12; there are 12 points"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

#[test]
fn bad_patches_are_refused_with_their_number() {
    let body = bar("neo_hookean", [2, 1, 1]);
    let refused = |patches: &[(f64, u32, f64)]| {
        let mut load = problem(&body, clamped(&body));
        load.patches.extend(patches.iter().map(|&(weight, node, d)| PatchLoad {
            patch: Patch { nodes: vec![node], weights: vec![weight] },
            displacement: [0.0, d, 0.0],
        }));
        refusal(&load)
    };
    let cases = [
        (refused(&[(1.0, 2, 0.0), (1.0, 5, 0.001)]), "accepted"),
        (refused(&[(0.9, 2, 0.0)]), "patch 0 has 1 nodes and 1 weights with sum 0.9"),
        (refused(&[(1.0, 2, 0.0), (1.0, 12, 0.0)]), "patch 1 uses point 12"),
        (refused(&[(1.0, 2, f64::NAN)]), "patch 0 is displaced by [0.0, NaN, 0.0]"),
        (refused(&[(1.0, 0, 0.0)]), "the x displacement of every point of patch 0 is prescribed"),
        (refused(&[(1.0, 2, 0.0), (1.0, 2, 0.1)]), "patches 0 and 1 are the same"),
    ];
    let mut load = problem(&body, clamped(&body));
    for (nodes, weights) in
        [(vec![2], vec![1.0]), (vec![5], vec![1.0]), (vec![2, 5], vec![0.3, 0.7])]
    {
        load.patches.push(PatchLoad { patch: Patch { nodes, weights }, displacement: [0.0; 3] });
    }
    let sentence = refusal(&load);
    assert!(sentence.contains("patch 2 all but follows from those of the patches"), "{sentence}");
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}

#[test]
fn bad_settings_are_refused() {
    let body = bar("neo_hookean", [2, 1, 1]);
    let load = problem(&body, clamped(&body));
    let usual = Newton::default();
    for (settings, words) in [
        (Newton { tolerance: 0.0, ..usual }, "tolerance of Newton's method is 0;"),
        (Newton { tolerance: f64::NAN, ..usual }, "tolerance of Newton's method is NaN;"),
        (Newton { smallest_step: -1.0, ..usual }, "smallest_step of Newton's method is -1;"),
        (Newton { max_iterations: 0, ..usual }, "max_iterations of Newton's method is 0;"),
    ] {
        let sentence = settings.solve(&load, &mut |_| true).err().unwrap().to_string();
        assert!(sentence.contains(words), "{sentence}");
    }
}
