//! Forces and tangents on the device against energies in double precision.

mod support;
use support::*;
use viscera_gpu::plan::Plan;
use viscera_gpu::{CellBuffers, Clusters, Law, Solid, Tangent};

#[test]
fn forces_are_the_derivative_of_the_energy() {
    let Some(gpu) = device() else { return };
    let block = Block::new(2);
    for nu in [0.3, 0.45, 0.49] {
        for (name, law, rows) in laws(nu) {
            let solid = block.solid(&law, &rows);
            let (cells, system) = CellBuffers::new(&gpu, &solid, &block.pairs()).unwrap();
            for strain in [1e-4, 0.02, 0.2] {
                let u = block.bent(strain);
                let exact = internal_force(&solid, &u);
                let found = cells.internal_force(&system, &u).unwrap();
                let error = distance(&found, &exact);
                println!("force {name} nu {nu} strain {strain}: {error:.1e}");
                assert!(error < 3e-6, "{name}, nu {nu}, strain {strain}: {error:.1e}");
            }
            let still = cells.internal_force(&system, &vec![0.0; 3 * block.points.len()]).unwrap();
            assert!(still.iter().all(|&f| f == 0.0), "{name} has a force at rest");
        }
    }
}

#[test]
fn tangents_are_the_derivative_of_the_force() {
    let Some(gpu) = device() else { return };
    let block = Block::new(2);
    let direction = block.bent(1.0);
    for nu in [0.3, 0.49] {
        for (name, law, rows) in laws(nu) {
            let solid = block.solid(&law, &rows);
            let (mut cells, mut system) = CellBuffers::new(&gpu, &solid, &block.pairs()).unwrap();
            for strain in [0.0, 0.1] {
                let u = block.bent(strain);
                cells.form(&mut system, &Tangent::at(&u)).unwrap();
                let found = system.multiply(&direction).unwrap();
                let h = 1e-3;
                let at = |t: f64| {
                    let moved: Vec<f64> =
                        u.iter().zip(&direction).map(|(u, w)| u + t * h * w).collect();
                    internal_force(&solid, &moved)
                };
                let (near, far) = ([at(1.0), at(-1.0)], [at(2.0), at(-2.0)]);
                let exact: Vec<f64> = (0..u.len())
                    .map(|k| {
                        (8.0 * (near[0][k] - near[1][k]) - (far[0][k] - far[1][k])) / (12.0 * h)
                    })
                    .collect();
                let error = distance(&found, &exact);
                println!("tangent {name} nu {nu} strain {strain}: {error:.1e}");
                assert!(error < 5e-6, "{name}, nu {nu}, strain {strain}: {error:.1e}");
            }
        }
    }
}

#[test]
fn every_cell_has_its_own_parameters_in_any_number_of_chunks() {
    let block = Block::new(6);
    let row = |cell: usize| vec![2e3 + 10.0 * cell as f64, 1e4 + 7.0 * cell as f64];
    let (law, rows) = recorded("neo_hookean", (0..block.cells.len()).map(row).collect());
    let solid = block.solid(&law, &rows);
    let u = block.bent(0.1);
    let mut forces = Vec::new();
    for largest in [u64::MAX, 400_000] {
        let Some(gpu) = device_with(largest) else { return };
        let (mut cells, mut system) = CellBuffers::new(&gpu, &solid, &block.pairs()).unwrap();
        assert_eq!(system.n_chunks() > 1, largest < u64::MAX);
        // The estimate has the same layout.
        let plan = Plan::new(&solid, &block.pairs(), largest).unwrap();
        assert_eq!(plan.chunks, system.n_chunks());
        let of_iteration: usize = plan.iteration.iter().map(|work| work.dispatches).sum();
        assert_eq!(of_iteration, system.dispatches_per_iteration());
        assert_eq!(plan.repeated, cells.n_responses() as f64 / block.cells.len() as f64);
        let of_matrix = plan.iteration[0].bytes - 144.0 * block.points.len() as f64;
        assert_eq!(of_matrix, system.matrix_bytes() as f64);

        cells.form(&mut system, &Tangent::at(&u)).unwrap();
        forces.push(cells.internal_force(&system, &u).unwrap());
        forces.push(system.multiply(&u).unwrap());
    }
    assert!(distance(&forces[0], &internal_force(&solid, &u)) < 1e-5);
    // The same cells in the same order: the same bits.
    assert_eq!(forces[0], forces[2]);
    assert_eq!(forces[1], forces[3]);
}

/// `factor (K + sum m j (x) j) + rest + shift I`, in any number of chunks, and `K` alone afterwards.
#[test]
fn clusters_inertia_and_shifts_are_added() {
    let block = Block::new(4);
    let (law, rows) = recorded("neo_hookean", vec![vec![2e3, 8e3]]);
    // Each cube of six cells is a cluster.
    let of: Vec<u32> = (0..block.cells.len() as u32).map(|cell| cell / 6).collect();
    let (mut starts, mut nodes) = (vec![0u32], Vec::new());
    for cube in block.cells.chunks(6) {
        let mut own: Vec<u32> = cube.iter().flatten().copied().collect();
        own.sort_unstable();
        own.dedup();
        nodes.extend(own);
        starts.push(nodes.len() as u32);
    }
    let clusters = Clusters { of: &of, starts: &starts, nodes: &nodes };
    let mut pairs: Vec<(u32, u32)> = starts
        .windows(2)
        .flat_map(|w| {
            let own = &nodes[w[0] as usize..w[1] as usize];
            own.iter().flat_map(|&a| own.iter().map(move |&b| (a, b))).filter(|(a, b)| a <= b)
        })
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    let (u, x) = (block.bent(0.05), block.bent(1.0));
    let wave = |k: usize| (0.7 * k as f64).sin();
    let slopes: Vec<[f64; 3]> =
        (0..nodes.len()).map(|k| [wave(k), wave(2 * k), wave(3 * k)]).collect();
    let of_node = starts.windows(2).zip(0..).flat_map(|(w, k)| (w[0]..w[1]).map(move |_| k));
    let modulus =
        |cluster: usize| if cluster.is_multiple_of(3) { -4.0 } else { 30.0 + cluster as f64 };
    let weighted: Vec<[f64; 3]> =
        slopes.iter().zip(of_node).map(|(j, c)| j.map(|j| modulus(c) * j)).collect();
    let rest = [
        (3, 3, [40.0, 1.0, 2.0, 1.0, 50.0, 3.0, 2.0, 3.0, 60.0]),
        (3, 4, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
    ];
    let pressures = vec![0.0; starts.len() - 1];
    let (factor, shift) = (1.7, 12.0);
    let mut seen = Vec::new();
    for largest in [u64::MAX, 150_000] {
        let Some(gpu) = device_with(largest) else { return };
        let alone = block.solid(&law, &rows);
        let (mut cells, mut system) = CellBuffers::new(&gpu, &alone, &pairs).unwrap();
        cells.form(&mut system, &Tangent::at(&u)).unwrap();
        let of_cells = system.multiply(&x).unwrap();
        let solid = Solid { clusters: Some(clusters), ..alone };
        let (mut cells, mut system) = CellBuffers::new(&gpu, &solid, &pairs).unwrap();
        assert_eq!(system.n_chunks() > 1, largest < u64::MAX);
        let tangent = Tangent {
            pressures: &pressures,
            slopes: [&slopes, &weighted],
            factor,
            rest: Some(&rest),
            shift,
            ..Tangent::at(&u)
        };
        cells.form(&mut system, &tangent).unwrap();
        let found = system.multiply(&x).unwrap();
        let mut exact: Vec<f64> =
            of_cells.iter().zip(&x).map(|(k, x)| factor * k + shift * x).collect();
        for w in starts.windows(2) {
            let own = w[0] as usize..w[1] as usize;
            let along: f64 = own
                .clone()
                .flat_map(|k| (0..3).map(move |i| (k, i)))
                .map(|(k, i)| slopes[k][i] * x[3 * nodes[k] as usize + i])
                .sum();
            for k in own {
                (0..3).for_each(|i| {
                    exact[3 * nodes[k] as usize + i] += factor * along * weighted[k][i];
                });
            }
        }
        for (row, column, block) in &rest {
            let (row, column) = (3 * *row as usize, 3 * *column as usize);
            for k in 0..9 {
                exact[row + k / 3] += block[k] * x[column + k % 3];
                if row != column {
                    exact[column + k % 3] += block[k] * x[row + k / 3];
                }
            }
        }
        let error = distance(&found, &exact);
        assert!(error < 1e-5, "{error:.1e}");
        // Added blocks stay until they are replaced.
        cells.form(&mut system, &Tangent { rest: None, ..tangent }).unwrap();
        assert_eq!(system.multiply(&x).unwrap(), found);
        let zero = vec![[0.0; 3]; nodes.len()];
        let bare = Tangent { pressures: &pressures, slopes: [&zero, &zero], ..Tangent::at(&u) };
        cells.form(&mut system, &Tangent { rest: Some(&[]), ..bare }).unwrap();
        assert!(distance(&system.multiply(&x).unwrap(), &of_cells) < 1e-6);
        seen.push(found);

        let refused = |tangent: Tangent<'_>, cells: &mut CellBuffers, system: &mut _| {
            cells.form(system, &tangent).unwrap_err().to_string()
        };
        let short = Tangent { pressures: &[], ..bare };
        assert!(refused(short, &mut cells, &mut system).contains("64 clusters"));
        let far = [(0, 124, [0.0; 9])];
        let far = Tangent { rest: Some(&far), ..bare };
        assert!(refused(far, &mut cells, &mut system).contains("(0, 124)"));
    }
    assert_eq!(seen[0], seen[1]);
}

#[test]
fn input_without_sense_is_refused_in_a_sentence() {
    let Some(gpu) = device() else { return };
    let block = Block::new(1);
    let (pairs, law) = (block.pairs(), Law::Linear);
    let refusal = |rows: &[Vec<f64>]| {
        CellBuffers::new(&gpu, &block.solid(&law, rows), &pairs).err().unwrap().to_string()
    };
    assert!(refusal(&[vec![1.0]]).contains("row 0 of parameters"));
    assert!(refusal(&[vec![1.0, f64::NAN]]).contains("finite"));
    assert!(refusal(&[vec![1.0, 1.0], vec![1.0, 1.0]]).contains("2 rows"));
    let mut turned = Block::new(1);
    turned.cells[3].swap(0, 1);
    let rows = [vec![1.0, 1.0]];
    let error = CellBuffers::new(&gpu, &turned.solid(&law, &rows), &pairs).err().unwrap();
    assert_eq!(
        error.to_string(),
        "cell 3 has no volume or is inverted; remove it or turn it round"
    );
    let error = CellBuffers::new(&gpu, &block.solid(&law, &rows), &pairs[1..]).err().unwrap();
    assert!(error.to_string().contains("row 0 has no block on the diagonal"), "{error}");
}
