//! What further threads gain: assembly, products, and whole solutions, beside a loop that only reads and writes memory.
//!
//! It runs itself several times, since the number of threads is chosen when a process starts.

use std::hint::black_box;
use std::process::Command;
use std::time::Instant;
use viscera_core::body::Body;
use viscera_core::element::Element;
use viscera_core::equilibrium::{
    ConjugateGradients, Method, Newton, Preconditioner, Pressure, Problem, Status,
};
use viscera_core::law::Material;
use viscera_core::linear::{Cholesky, Factorization, Precision};
use viscera_core::mesh::samples::block;

const SIDE: f64 = 0.1;
const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.45;
const STRETCH: f64 = 0.25;

/// Cubes of six tetrahedra along an edge: of an organ in a simulator, and larger ones.
const ORGAN: usize = 15;
const EDGES: [usize; 2] = [22, 37];

/// Numbers of each array of the triad.
const TRIAD: usize = 16_000_000;

/// Processes of each number of threads, one after the other.
const ROUNDS: usize = 4;

/// An argument of the processes that measure.
const MEASURE: &str = "--measure";

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.iter().any(|argument| argument == MEASURE) {
        return measure();
    }
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let mut best: [Vec<(String, f64)>; 2] = Default::default();
    for _ in 0..ROUNDS {
        for (best, threads) in best.iter_mut().zip([1, all]) {
            keep_least(best, &measured(&arguments[0], threads));
        }
    }
    println!("{:45}{:>11}{:>11}{:>7}", "", "1 thread", format!("{all} threads"), "gain");
    for ((name, one), (_, more)) in best[0].iter().zip(&best[1]) {
        println!("{name:45}{one:11.3}{more:11.3}{:7.2}", one / more);
    }
}

/// What a process with so many threads prints.
fn measured(program: &str, threads: usize) -> Vec<(String, f64)> {
    let mut command = Command::new(program);
    let output = command.arg(MEASURE).env("RAYON_NUM_THREADS", threads.to_string()).output();
    let output = output.expect("the measurement runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let row = |line: &str| {
        let (name, number) = line.rsplit_once(' ').expect("a name and a number");
        (name.to_owned(), number.parse().expect("a number"))
    };
    String::from_utf8_lossy(&output.stdout).lines().map(row).collect()
}

/// The machine may be disturbed in any round: what counts is the least.
fn keep_least(best: &mut Vec<(String, f64)>, found: &[(String, f64)]) {
    if best.is_empty() {
        best.extend_from_slice(found);
    }
    best.iter_mut().zip(found).for_each(|(best, found)| best.1 = best.1.min(found.1));
}

fn measure() {
    triad();
    organ();
    for edge in EDGES {
        let body = cube(edge);
        let (n, cells) = (body.n_dofs(), body.cells().len());
        let u: Vec<f64> = (0..n).map(|dof| 2e-4 * (dof as f64).sin()).collect();
        let (mut force, mut tangent) = (vec![0.0; n], body.zero_tangent());
        let assembly = least(20, || body.internal_force_and_tangent(&u, &mut force, &mut tangent));
        println!("{cells} cells, force and tangent [ms] {}", 1e3 * assembly);
        let product = least(100, || tangent.multiply(&u, black_box(&mut force)));
        println!("{cells} cells, product with a vector [ms] {}", 1e3 * product);
        for preconditioner in [
            Preconditioner::BlockJacobi,
            Preconditioner::IncompleteCholesky,
            Preconditioner::Multigrid,
        ] {
            let seconds = least(1, || solve(&body, conjugate_gradients(preconditioner)));
            println!("{cells} cells, solution by {} [s] {seconds}", preconditioner.name());
        }
    }
}

/// `a = b + 3 c` (McCalpin's STREAM), by the threads that share all other loops.
fn triad() {
    use rayon::prelude::*;
    let (b, c) = (vec![1.0f64; TRIAD], vec![2.0f64; TRIAD]);
    let mut a = vec![0.0f64; TRIAD];
    let seconds = least(10, || {
        let parts = a.par_chunks_mut(100_000).zip(b.par_chunks(100_000)).zip(c.par_chunks(100_000));
        parts.for_each(|((a, b), c)| {
            a.iter_mut().zip(b).zip(c).for_each(|((a, b), c)| *a = b + 3.0 * c);
        });
        black_box(&a);
    });
    println!("triad of {TRIAD} numbers [ms] {}", 1e3 * seconds);
}

fn cube(edge: usize) -> Body {
    let (points, cells) = block([edge; 3], [SIDE; 3]);
    let (mu, lam) = (
        YOUNG / (2.0 * (1.0 + POISSON)),
        YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)),
    );
    let material =
        Material::new("neo_hookean", vec![vec![mu, lam]]).expect("parameters are admissible");
    Body::with_element(Element::P1, points, cells, material).expect("cubes are sound")
}

/// What a frame asks of a factor, by its precision; and whole solutions.
fn organ() {
    let body = cube(ORGAN);
    let cells = body.cells().len();
    factor::<f64>(&body, "double");
    factor::<f32>(&body, "single");
    let lagged = conjugate_gradients(Preconditioner::LaggedCholesky);
    for (method, name) in [(Method::Cholesky, "cholesky"), (lagged, "lagged_cholesky")] {
        let seconds = least(3, || solve(&body, method));
        println!("{cells} cells, solution by {name} [s] {seconds}");
    }
}

/// A factor of the tangent at rest with one side held, and one right-hand side.
fn factor<T: Precision>(body: &Body, precision: &str) {
    let free: Vec<u32> =
        (0..body.n_dofs() as u32).filter(|&dof| body.points()[dof as usize / 3][0] > 0.0).collect();
    let (pattern, places) = body.pattern().restrict(&free);
    let (rest, mut tangent) = (vec![0.0; body.n_dofs()], body.zero_tangent());
    body.internal_force_and_tangent(&rest, &mut rest.clone(), &mut tangent);
    let values: Vec<f64> = places.iter().map(|&place| tangent.values()[place as usize]).collect();
    let mut cholesky = Cholesky::<T>::with_precision(&pattern).expect("the pattern is sound");
    let seconds = least(20, || cholesky.factorize(&values).expect("the body is held"));
    let cells = body.cells().len();
    println!("{cells} cells, factor in {precision} precision [ms] {}", 1e3 * seconds);
    let (rows, mut column) = (cholesky.order().to_vec(), cholesky.column());
    let (b, mut x) = (vec![1.0; rows.len()], vec![0.0; rows.len()]);
    let seconds = least(50, || {
        cholesky.solve_column(&rows, &b, &mut x, &mut column).expect("there is a factor");
    });
    println!("{cells} cells, substitution in {precision} precision [ms] {}", 1e3 * seconds);
}

fn conjugate_gradients(preconditioner: Preconditioner) -> Method {
    Method::ConjugateGradients(ConjugateGradients {
        preconditioner,
        max_iterations: 2000,
        ..ConjugateGradients::default()
    })
}

/// Clamped at one side, the opposite one drawn out, in four steps.
fn solve(body: &Body, method: Method) {
    let side = |x: f64| {
        let at = move |&node: &usize| (body.points()[node][0] - x).abs() < 1e-9;
        (0..body.points().len()).filter(at).map(|node| 3 * node as u32)
    };
    let held = side(0.0).flat_map(|dof| (0..3).map(move |i| (dof + i, 0.0)));
    let moved = side(SIDE)
        .flat_map(|dof| (0..3).map(move |i| (dof + i, if i == 0 { STRETCH * SIDE } else { 0.0 })));
    let problem = Problem {
        body,
        prescribed: held.chain(moved).collect(),
        force: vec![0.0; body.n_dofs()],
        pressure: Pressure::default(),
        patches: Vec::new(),
        start: None,
    };
    let newton = Newton { steps: 4, tolerance: 1e-8, method, ..Newton::default() };
    let solved = newton.solve(&problem, &mut |_| true).expect("the problem is sound");
    assert_eq!(solved.status, Status::Converged);
}

/// Least time of some runs [s].
fn least(runs: usize, mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let clock = Instant::now();
        run();
        clock.elapsed().as_secs_f64()
    };
    (0..runs).map(time).fold(f64::INFINITY, f64::min)
}
