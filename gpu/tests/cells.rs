//! Forces and tangents on the device against energies in double precision.

mod support;
use support::*;
use viscera_gpu::plan::Plan;
use viscera_gpu::{CellBuffers, Law};

#[test]
fn forces_are_the_derivative_of_the_energy() {
    let Some(gpu) = device() else { return };
    let block = Block::new(2);
    for nu in [0.3, 0.45, 0.49] {
        for (name, law, row) in laws(nu) {
            let rows = [row];
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
    let way = block.bent(1.0);
    for nu in [0.3, 0.49] {
        for (name, law, row) in laws(nu) {
            let rows = [row];
            let solid = block.solid(&law, &rows);
            let (cells, mut system) = CellBuffers::new(&gpu, &solid, &block.pairs()).unwrap();
            for strain in [0.0, 0.1] {
                let u = block.bent(strain);
                cells.linearize(&mut system, &u, 0.0).unwrap();
                let found = system.multiply(&way).unwrap();
                let h = 1e-3;
                let at = |t: f64| {
                    let moved: Vec<f64> = u.iter().zip(&way).map(|(u, w)| u + t * h * w).collect();
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
    let law = neo_hookean();
    let row = |cell: usize| vec![2e3 + 10.0 * cell as f64, 1e4 + 7.0 * cell as f64];
    let rows: Vec<Vec<f64>> = (0..block.cells.len()).map(row).collect();
    let solid = block.solid(&law, &rows);
    let u = block.bent(0.1);
    let mut forces = Vec::new();
    for largest in [u64::MAX, 400_000] {
        let Some(gpu) = device_with(largest) else { return };
        let (cells, mut system) = CellBuffers::new(&gpu, &solid, &block.pairs()).unwrap();
        assert_eq!(system.n_chunks() > 1, largest < u64::MAX);
        // The plan on paper is of the same layout.
        let plan = Plan::new(&solid, &block.pairs(), largest).unwrap();
        assert_eq!(plan.chunks, system.n_chunks());
        let of_iteration: usize = plan.iteration.iter().map(|work| work.dispatches).sum();
        assert_eq!(of_iteration, system.dispatches_per_iteration());
        assert_eq!(plan.repeated, cells.n_responses() as f64 / block.cells.len() as f64);
        let of_matrix = plan.iteration[0].bytes - 28.0 * block.points.len() as f64;
        assert_eq!(of_matrix, system.matrix_bytes() as f64);

        cells.linearize(&mut system, &u, 0.0).unwrap();
        forces.push(cells.internal_force(&system, &u).unwrap());
        forces.push(system.multiply(&u).unwrap());
    }
    assert!(distance(&forces[0], &internal_force(&solid, &u)) < 1e-5);
    // The same cells in the same order: the same bits.
    assert_eq!(forces[0], forces[2]);
    assert_eq!(forces[1], forces[3]);
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
    assert_eq!(error.to_string(), "cell 3 has no volume, or is inside out");
    let error = CellBuffers::new(&gpu, &block.solid(&law, &rows), &pairs[1..]).err().unwrap();
    assert!(error.to_string().contains("row 0 has no block on the diagonal"), "{error}");
}
