//! Energy, force and tangent of a cube of tissue: microseconds per cell on one thread.

use std::hint::black_box;
use std::time::Instant;
use viscera_core::body::Body;
use viscera_core::element::Element;
use viscera_core::law::{Material, ROWS};

const EDGE: f64 = 0.01;
const RUNS: usize = 40;

/// Neo-Hookean and Mooney-Rivlin as users may write them, in the order of the parameters of [`ROWS`]'s samples.
const FORMULAS: [(&str, &[f64]); 2] = [
    ("formula mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", &[3e3, 11e3]),
    ("formula c1*(I1bar - 3) + c2*(I2bar - 3) + kappa/2*(J - 1)**2", &[1.2e3, 0.3e3, 11e3]),
];

/// A cube of `n` cubes to an edge, each of the six tetrahedra between its opposite corners.
fn cube(n: usize) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    const ORDERS: [([usize; 3], bool); 6] = [
        ([0, 1, 2], true),
        ([1, 2, 0], true),
        ([2, 0, 1], true),
        ([0, 2, 1], false),
        ([2, 1, 0], false),
        ([1, 0, 2], false),
    ];
    let index = |i: [usize; 3]| (i[0] * (n + 1) * (n + 1) + i[1] * (n + 1) + i[2]) as u32;
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    for code in 0..(n + 1).pow(3) {
        let corner = [code / (n + 1).pow(2), code / (n + 1) % (n + 1), code % (n + 1)];
        points.push(corner.map(|i| EDGE * i as f64));
        if corner.contains(&n) {
            continue;
        }
        for (axes, is_even) in ORDERS {
            let mut at = corner;
            let mut cell = [index(corner); 4];
            for (step, axis) in axes.into_iter().enumerate() {
                at[axis] += 1;
                cell[step + 1] = index(at);
            }
            if !is_even {
                cell.swap(2, 3);
            }
            cells.push(cell);
        }
    }
    (points, cells)
}

/// Least time of a run [us per cell].
fn per_cell(cells: usize, mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let clock = Instant::now();
        run();
        clock.elapsed().as_secs_f64()
    };
    1e6 * (0..RUNS).map(time).fold(f64::INFINITY, f64::min) / cells as f64
}

fn report(law: &str, row: &[f64], element: Element) {
    let (points, cells) = cube(9);
    let material = Material::new(law, vec![row.to_vec()]).expect("parameters are admissible");
    let body = Body::with_element(element, points, cells, material).expect("cubes are sound");
    let u: Vec<f64> = (0..body.n_dofs()).map(|dof| 2e-4 * (dof as f64).sin()).collect();
    let (mut force, mut tangent) = (vec![0.0; u.len()], body.zero_tangent());
    let n = body.cells().len();
    let energy = per_cell(n, || {
        black_box(body.energy(&u));
    });
    let alone = per_cell(n, || {
        black_box(body.internal_force(&u, &mut force));
    });
    let both = per_cell(n, || body.internal_force_and_tangent(&u, &mut force, &mut tangent));
    let law: String = law.chars().take(31).collect();
    println!("{law:31}  {:15}{energy:7.3}{alone:8.3}{both:8.3}", element.name());
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    println!("microseconds per cell, 4374 cells, one thread; least of {RUNS} runs");
    println!("law                              element         energy   force   force and tangent");
    let laws = ROWS.iter().map(|row| (row.name, row.sample));
    for (law, row) in laws.chain(FORMULAS) {
        Element::ALL.iter().for_each(|&element| pool.install(|| report(law, row, element)));
    }
}
