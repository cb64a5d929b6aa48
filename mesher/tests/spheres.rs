//! Meshes of label maps that are known: their volumes, angles, faces.

use std::collections::HashMap;
use viscera_mesher::quality::{FACES, dihedral_angles, volume6};
use viscera_mesher::{Error, Labels, Mesh, mesh};

const N: usize = 40;
const IDENTITY: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// A map whose labels a function of the place relative to the middle gives.
fn painted(label: impl Fn([f64; 3]) -> u16) -> Vec<u16> {
    let middle = 0.5 * (N as f64 - 1.0);
    let place = |v: usize| [v / (N * N), v / N % N, v % N].map(|i| i as f64 - middle);
    (0..N * N * N).map(|v| label(place(v))).collect()
}

fn distance(x: [f64; 3], centre: [f64; 3]) -> f64 {
    (0..3).map(|k| (x[k] - centre[k]).powi(2)).sum::<f64>().sqrt()
}

fn made(values: &[u16], labels: &[u16], edge: f64) -> Mesh {
    let map = Labels { dims: [N; 3], values, affine: IDENTITY, volumes: None };
    mesh(&map, labels, &vec![edge; labels.len()], |_, _| true).expect("a mesh")
}

fn corners(mesh: &Mesh, cell: [u32; 4]) -> [[f64; 3]; 4] {
    cell.map(|i| mesh.points[i as usize])
}

fn least_angle(mesh: &Mesh) -> f64 {
    let least = |&cell: &[u32; 4]| {
        let x = corners(mesh, cell);
        let angle = dihedral_angles(x).into_iter().fold(180.0, f64::min);
        if volume6(x) > 0.0 { angle } else { -angle }
    };
    mesh.cells.iter().map(least).fold(180.0, f64::min)
}

/// Relative errors of the labels' volumes.
fn volume_errors(mesh: &Mesh) -> Vec<f64> {
    let mut volumes = vec![0.0; mesh.volumes.len()];
    for (&cell, &owner) in mesh.cells.iter().zip(&mesh.owner) {
        volumes[owner] += volume6(corners(mesh, cell)) / 6.0;
    }
    volumes.iter().zip(&mesh.volumes).map(|(v, voxels)| v / voxels - 1.0).collect()
}

/// Corners of the faces that one cell has, and panics where three share one or two lie on the same side of it.
fn outer_faces(mesh: &Mesh) -> Vec<[u32; 3]> {
    let mut faces: HashMap<[u32; 3], Vec<bool>> = HashMap::new();
    for cell in &mesh.cells {
        for face in FACES {
            let mut nodes = face.map(|k| cell[k]);
            let [a, b, c] = nodes;
            let is_ascending = (a < b) ^ (b < c) ^ (c < a);
            nodes.sort_unstable();
            faces.entry(nodes).or_default().push(is_ascending);
        }
    }
    for (face, turns) in &faces {
        assert!(turns.len() == 1 || turns.len() == 2 && turns[0] != turns[1], "face {face:?}");
    }
    faces.into_iter().filter(|(_, turns)| turns.len() == 1).map(|(face, _)| face).collect()
}

#[test]
fn a_ball_keeps_its_volume_and_has_good_angles() {
    let values = painted(|x| u16::from(distance(x, [0.0; 3]) < 12.0));
    let mesh = made(&values, &[1], 2.0);
    assert!(volume_errors(&mesh)[0].abs() < 1e-3);
    assert!(least_angle(&mesh) > 30.0);
    let radius = (0.75 / std::f64::consts::PI * mesh.volumes[0]).cbrt();
    for i in outer_faces(&mesh).into_iter().flatten() {
        let off = distance(mesh.points[i as usize], [0.5 * (N as f64 - 1.0); 3]) - radius;
        assert!(off.abs() < 0.35, "{off}: a staircase's corners are half a voxel and more off");
    }
}

#[test]
fn three_labels_that_meet_share_their_nodes() {
    // A ball, a rod that leaves it, and a cap on both: they meet along lines, and at points.
    let values = painted(|x| match x {
        [a, b, _] if a.hypot(b) < 4.0 => 2,
        _ if distance(x, [0.0; 3]) > 13.0 => 0,
        [a, _, _] if a > 7.0 => 3,
        _ => 1,
    });
    let mesh = made(&values, &[1, 2, 3], 1.7);
    assert!(least_angle(&mesh) > 8.0, "{}", least_angle(&mesh));
    for error in volume_errors(&mesh) {
        assert!(error.abs() < 0.01, "{error}");
    }
    // Euler's number of a closed surface says that nothing hangs loose: 2 for a ball with two handles less.
    let faces = outer_faces(&mesh);
    let mut nodes: Vec<u32> = faces.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    assert_eq!(nodes.len() as i64 - faces.len() as i64 / 2, 2);
}

/// Mean length of each cell's edges.
fn edges(mesh: &Mesh) -> Vec<f64> {
    let mean = |&cell: &[u32; 4]| {
        let x = corners(mesh, cell);
        let pairs = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
        pairs.map(|(i, j)| distance(x[i], x[j])).sum::<f64>() / 6.0
    };
    mesh.cells.iter().map(mean).collect()
}

#[test]
fn edges_are_short_at_a_vessel_and_grow_away_from_it() {
    // A vessel that leaves a ball on one side; edges of 1.6 and 6.4, and so a level between them.
    let depth = |[a, b, _]: [f64; 3]| (a - 10.0).hypot(b) - 3.0;
    let values = painted(|x| match x {
        [_, _, c] if depth(x) < 0.0 && c < 15.0 => 2,
        _ if distance(x, [0.0; 3]) < 17.5 => 1,
        _ => 0,
    });
    let map = Labels { dims: [N; 3], values: &values, affine: IDENTITY, volumes: None };
    let mesh = mesh(&map, &[1, 2], &[6.4, 1.6], |_, _| true).expect("a mesh");
    assert_eq!(mesh.edges, [6.4, 1.6]);
    assert!(least_angle(&mesh) > 15.0, "{}", least_angle(&mesh));
    for error in volume_errors(&mesh) {
        assert!(error.abs() < 0.01, "{error}");
    }
    let volume: f64 = mesh.volumes.iter().sum();
    let even = 12.0 * volume * (0.911_f64 / 1.6).powi(3);
    assert!((mesh.cells.len() as f64) < 0.35 * even, "{} of {even}", mesh.cells.len());
    let mut far = Vec::new();
    for ((&cell, edge), &owner) in mesh.cells.iter().zip(edges(&mesh)).zip(&mesh.owner) {
        let x = corners(&mesh, cell);
        let middle = std::array::from_fn(|k| {
            x.iter().map(|x| x[k]).sum::<f64>() / 4.0 - 0.5 * (N as f64 - 1.0)
        });
        if owner == 1 || depth(middle) < 0.8 {
            assert!(edge < 1.4 * 1.6, "{edge} in or at the vessel");
        } else if depth(middle) > 14.0 && distance(middle, [0.0; 3]) < 14.0 {
            far.push(edge);
        }
    }
    let mean = far.iter().sum::<f64>() / far.len() as f64;
    assert!((mean / 6.4 - 1.0).abs() < 0.1, "{mean}, of {} cells", far.len());
    assert!(outer_faces(&mesh).len() > 500, "and no face has three cells");
}

#[test]
fn what_the_image_cuts_ends_flat() {
    let values = painted(|x| u16::from(distance(x, [0.0, 0.0, 14.0]) < 11.0));
    let mesh = made(&values, &[1], 2.0);
    assert!(least_angle(&mesh) > 20.0);
    assert!(volume_errors(&mesh)[0].abs() < 2e-3);
    let end = N as f64 - 0.5;
    let height = mesh.points.iter().map(|x| x[2]).fold(0.0, f64::max);
    assert!((height - end).abs() < 1e-6);
    assert!(mesh.cut.len() > 50);
    assert!(mesh.cut.iter().all(|&i| (mesh.points[i as usize][2] - end).abs() < 1e-6));
    let is_cut = |face: &[u32; 3]| face.iter().all(|i| mesh.cut.binary_search(i).is_ok());
    let area = |face: [u32; 3]| {
        let [a, b, c] = face.map(|i| mesh.points[i as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
    };
    let flat: f64 = outer_faces(&mesh).into_iter().filter(is_cut).map(area).sum();
    let last = (0..N * N).filter(|i| values[i * N + N - 1] == 1).count() as f64;
    assert!((flat / last - 1.0).abs() < 0.05, "{flat} of {last}, the area of the last slice");
}

#[test]
fn the_same_mesh_on_any_number_of_threads() {
    let values = painted(|x| match distance(x, [0.0; 3]) {
        r if r < 5.0 => 2,
        r if r < 10.0 => 1,
        _ => 0,
    });
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| made(&values, &[1, 2], 2.0))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn a_skewed_grid_gives_a_mesh_in_its_places() {
    let values = painted(|x| u16::from(distance(x, [0.0; 3]) < 12.0));
    // Left-handed, turned, anisotropic.
    let affine = [[0.0, 2e-3, 0.0, 0.1], [1.5e-3, 0.0, 0.0, -0.2], [0.0, 0.0, 3e-3, 0.5]];
    let map = Labels { dims: [N; 3], values: &values, affine, volumes: None };
    let mesh = mesh(&map, &[1], &[5e-3], |_, _| true).expect("a mesh");
    assert!(volume_errors(&mesh)[0].abs() < 2e-3);
    assert!(least_angle(&mesh) > 25.0);
    for (k, expected) in
        [0.1 + 2e-3 * 19.5, -0.2 + 1.5e-3 * 19.5, 0.5 + 3e-3 * 19.5].into_iter().enumerate()
    {
        let ends = mesh.points.iter().map(|x| x[k]);
        let middle = 0.5
            * (ends.clone().fold(f64::INFINITY, f64::min) + ends.fold(f64::NEG_INFINITY, f64::max));
        assert!((middle - expected).abs() < 1e-3);
    }
}

#[test]
fn a_volume_that_is_known_better_is_kept() {
    let values = painted(|x| u16::from(distance(x, [0.0; 3]) < 12.0));
    let volumes = [7500.0];
    let map = Labels { dims: [N; 3], values: &values, affine: IDENTITY, volumes: Some(&volumes) };
    let made = mesh(&map, &[1], &[2.0], |_, _| true).expect("a mesh");
    assert_eq!(made.volumes, volumes);
    assert!(volume_errors(&made)[0].abs() < 1e-3);
    let two = Labels { volumes: Some(&[1.0, 2.0]), ..map };
    assert_eq!(mesh(&two, &[1], &[2.0], |_, _| true), Err(Error::BadMap));
}

#[test]
fn a_crumb_apart_is_dropped_and_counted() {
    let values = painted(|x| {
        u16::from(distance(x, [-4.0, 0.0, 0.0]) < 10.0 || distance(x, [14.0, 0.0, 0.0]) < 3.0)
    });
    let mesh = made(&values, &[1], 2.0);
    assert_eq!(mesh.dropped.count, 1);
    assert!((mesh.dropped.volumes[0] / 113.0 - 1.0).abs() < 0.3, "{}", mesh.dropped.volumes[0]);
    assert!(mesh.points.iter().all(|x| x[0] < 28.0));
}

#[test]
fn bad_input_is_told() {
    let values = painted(|x| u16::from(distance(x, [0.0; 3]) < 2.0));
    let map = Labels { dims: [N; 3], values: &values, affine: IDENTITY, volumes: None };
    assert_eq!(mesh(&map, &[7], &[2.0], |_, _| true), Err(Error::Absent(7)));
    assert_eq!(mesh(&map, &[1], &[1e-4], |_, _| true), Err(Error::TooFine));
    assert_eq!(mesh(&map, &[], &[], |_, _| true), Err(Error::TooManyLabels(0)));
    let flat = Labels { affine: [[0.0; 4]; 3], ..map };
    assert_eq!(mesh(&flat, &[1], &[2.0], |_, _| true), Err(Error::BadMap));
    for edges in [&[f64::NAN][..], &[0.0], &[2.0, 2.0]] {
        assert_eq!(mesh(&map, &[1], edges, |_, _| true), Err(Error::BadEdges));
    }
}

#[test]
fn who_watches_can_end_the_work() {
    let values = painted(|x| u16::from(distance(x, [0.0; 3]) < 12.0));
    let map = Labels { dims: [N; 3], values: &values, affine: IDENTITY, volumes: None };
    let mut told = Vec::new();
    let stopped = mesh(&map, &[1], &[4.0], |done, total| {
        told.push((done, total));
        done < 5
    });
    assert_eq!(stopped, Err(Error::Cancelled));
    assert_eq!(told.iter().map(|event| event.0).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
    let mut last = (0, 0);
    mesh(&map, &[1], &[4.0], |done, total| {
        last = (done, total);
        true
    })
    .expect("a mesh");
    assert_eq!(last.0 + 1, last.1, "the steps add up to what was announced");
}

#[test]
fn a_small_label_stays_in_its_place() {
    // 1.7 edges across: the lattice has too few cells there, so the bias becomes large.
    let centre = [0.0, 0.0, 5.5];
    let values = painted(|x| match distance(x, [0.0; 3]) {
        r if r > 19.0 => 0,
        _ => 1 + u16::from(distance(x, centre) < 5.0),
    });
    let mesh = made(&values, &[1, 2], 6.0);
    for error in volume_errors(&mesh) {
        assert!(error.abs() < 0.03, "{error}");
    }
    for (&cell, _) in mesh.cells.iter().zip(&mesh.owner).filter(|(_, owner)| **owner == 1) {
        for x in corners(&mesh, cell) {
            let x = x.map(|x| x - 0.5 * (N as f64 - 1.0));
            assert!(distance(x, centre) < 10.0, "{x:?} is far from the label");
        }
    }
}

#[test]
fn what_is_dropped_leaves_the_rest_its_volume() {
    let is_in = |x: [f64; 3], low: f64, high: f64| x.iter().all(|x| (low..high).contains(x));
    let values = painted(|x| u16::from(is_in(x, -16.0, 4.0) || is_in(x, 9.0, 15.0)));
    let mesh = made(&values, &[1], 4.0);
    assert_eq!((mesh.dropped.count, mesh.volumes[0]), (1, 8216.0));
    assert!((mesh.dropped.volumes[0] - 216.0).abs() < 1e-9, "{}", mesh.dropped.volumes[0]);
    assert!((volume_errors(&mesh)[0] + 216.0 / 8216.0).abs() < 1e-3);
}

#[test]
fn a_tangle_is_told_with_its_place() {
    let told = Error::Tangled([0.012, -0.0034, 0.1]).to_string();
    assert!(told.starts_with("the surfaces between labels tangle at (12.0, -3.4, 100.0) mm; "));
}
