//! Conjugate gradients on the device against dense solutions in double precision, and every way in which they end.

mod support;
use std::sync::Arc;
use std::time::Instant;
use support::*;
use viscera_gpu::{Ending, Error, Gpu, Law, MOST_MEANS, Mean, Settings, Solution, System};

const TIGHT: Settings =
    Settings { tolerance: 1e-6, max_iterations: 2000, check_every: 16, deadline: None };

/// Solutions from zero that are added to nothing.
trait Alone {
    fn alone(&mut self, b: &[f64], settings: &Settings) -> Result<Solution, Error>;
}

impl Alone for System {
    fn alone(&mut self, b: &[f64], settings: &Settings) -> Result<Solution, Error> {
        self.solve(b, &[], &vec![0.0; b.len()], settings)
    }
}

/// A block's tangent at rest in double precision: linear elasticity, whose blocks are those of differences of forces.
struct Problem {
    pairs: Vec<(u32, u32)>,
    values: Vec<f64>,
    dense: Vec<Vec<f64>>,
    is_held: Vec<bool>,
    b: Vec<f64>,
}

impl Problem {
    fn new(block: &Block, nu: f64) -> Self {
        let (mu, lam) = moduli(nu);
        let rows = [vec![mu, lam]];
        let solid = block.solid(&Law::Linear, &rows);
        let n = 3 * block.points.len();
        let size = 1e-3;
        let column = |dof: usize| {
            let mut u = vec![0.0; n];
            u[dof] = size;
            internal_force(&solid, &u).into_iter().map(|f| f / size).collect::<Vec<f64>>()
        };
        let columns: Vec<Vec<f64>> = (0..n).map(column).collect();
        let entry = |r: usize, c: usize| 0.5 * (columns[c][r] + columns[r][c]);
        let pairs = block.pairs();
        let of_block = |&(r, c): &(u32, u32)| {
            (0..9).map(move |k| (3 * r as usize + k / 3, 3 * c as usize + k % 3))
        };
        let values = pairs.iter().flat_map(of_block).map(|(r, c)| entry(r, c)).collect();
        let dense = (0..n).map(|r| (0..n).map(|c| entry(r, c)).collect()).collect();
        let b = (0..n).map(|k| (1.3 * k as f64).sin()).collect();
        Problem { pairs, values, dense, is_held: block.is_held(), b }
    }

    fn system(&self, gpu: &Arc<Gpu>, means: &[Mean]) -> System {
        let mut system = System::new(gpu, self.b.len() / 3, &self.pairs).unwrap();
        system.hold(&self.is_held, means).unwrap();
        system.load(&self.values, 0.0).unwrap();
        system
    }

    /// Gaussian elimination of `[A W^T; W 0]`, with rows of the identity for held degrees of freedom.
    fn exact(&self, means: &[Mean], shift: f64) -> Vec<f64> {
        let (n, k) = (self.b.len(), means.len());
        let mut a = vec![vec![0.0; n + k + 1]; n + k];
        for r in 0..n {
            for c in 0..n {
                let is_free = !self.is_held[r] && !self.is_held[c];
                let diagonal = f64::from(u8::from(r == c));
                a[r][c] = if is_free { self.dense[r][c] + shift * diagonal } else { diagonal };
            }
            a[r][n + k] = if self.is_held[r] { 0.0 } else { self.b[r] };
        }
        for (m, mean) in means.iter().enumerate() {
            for &(dof, weight) in mean {
                a[dof as usize][n + m] = weight;
                a[n + m][dof as usize] = weight;
            }
        }
        for pivot in 0..n + k {
            let best =
                (pivot..n + k).max_by(|&r, &s| a[r][pivot].abs().total_cmp(&a[s][pivot].abs()));
            a.swap(pivot, best.unwrap());
            let row = a[pivot].clone();
            for r in (0..n + k).filter(|&r| r != pivot) {
                let factor = a[r][pivot] / row[pivot];
                (pivot..=n + k).for_each(|c| a[r][c] -= factor * row[c]);
            }
        }
        (0..n).map(|r| a[r][n + k] / a[r][r]).collect()
    }
}

/// Three means of a few points of the free end, weights of each summing to 1.
fn means(block: &Block) -> Vec<Mean> {
    let nodes: Vec<u32> = (0..4).map(|k| (block.points.len() - 2 * k - 1) as u32).collect();
    let row = |i: u32| (1..).zip(&nodes).map(|(w, n)| (3 * n + i, f64::from(w) / 10.0)).collect();
    (0..3).map(row).collect()
}

#[test]
fn the_solution_is_that_of_elimination() {
    let Some(gpu) = device() else { return };
    let block = Block::new(2);
    for nu in [0.3, 0.45, 0.49] {
        let problem = Problem::new(&block, nu);
        for means in [Vec::new(), means(&block)] {
            let exact = problem.exact(&means, 0.0);
            let start: Vec<f64> =
                (0..exact.len()).map(|k| exact[k] * (2.1 * k as f64).cos()).collect();
            let found =
                problem.system(&gpu, &means).solve(&problem.b, &[], &start, &TIGHT).unwrap();
            let sum = |c: usize| (start[c] + exact[c]).abs();
            let row = |r: usize| -> f64 {
                (0..exact.len()).map(|c| problem.dense[r][c].abs() * sum(c)).sum()
            };
            let free = (0..exact.len()).filter(|r| !problem.is_held[*r]);
            let magnitude = free.map(|r| row(r) * row(r)).sum::<f64>().sqrt();
            assert!((found.magnitude - magnitude).abs() < 1e-3 * magnitude, "{}", found.magnitude);
            let error = distance(&found.x, &exact);
            println!("nu {nu}, {} means: {error:.1e} in {}", means.len(), found.iterations);
            assert_eq!(found.ending, Ending::Solved);
            // Single precision times the condition number of the matrix.
            assert!(error < 3e-5, "nu {nu}, {} means: {error:.1e}", means.len());
            for mean in &means {
                let moved: f64 = mean.iter().map(|&(dof, w)| w * found.x[dof as usize]).sum();
                let size = found.x.iter().fold(0.0f64, |size, x| size.max(x.abs()));
                assert!(moved.abs() < 1e-5 * size, "{moved} of {size}");
            }
            let held = found.x.iter().zip(&problem.is_held).filter(|(_, held)| **held);
            assert!(held.into_iter().all(|(x, _)| *x == 0.0));
        }
    }
}

/// Earlier steps that lead to the solution leave nothing to iterate; those of no use, or of use twice, do no harm.
#[test]
fn a_solve_sets_out_from_earlier_steps() {
    let Some(gpu) = device() else { return };
    let block = Block::new(2);
    let problem = Problem::new(&block, 0.3);
    let exact = problem.exact(&[], 0.0);
    let n = exact.len();
    let free = |k: usize| f64::from(u8::from(!problem.is_held[k]));
    let aside: Vec<f64> = (0..n).map(|k| free(k) * 1e-3 * (0.7 * k as f64).cos()).collect();
    let mix =
        |a: f64, b: f64| -> Vec<f64> { (0..n).map(|k| a * exact[k] + b * aside[k]).collect() };
    let (one, other, zero, far) = (mix(0.5, 1.0), mix(1.0, -1.0), vec![0.0; n], mix(0.0, 1e30));
    let mut system = problem.system(&gpu, &[]);
    let alone = system.alone(&problem.b, &TIGHT).unwrap();
    let loose = Settings { tolerance: 1e-4, ..TIGHT };
    let mut from = |steps: &[&[f64]], settings: &Settings| {
        let found = system.solve(&problem.b, steps, &zero, settings).unwrap();
        let error = distance(&found.x, &exact);
        assert!(found.ending == Ending::Solved && found.residual <= settings.tolerance);
        (found.iterations, error)
    };
    for steps in [&[&one[..], &other][..], &[&one, &one, &other], &[&zero, &other, &one]] {
        let (iterations, error) = from(steps, &loose);
        assert!(iterations == 0 && error < 1e-3, "{iterations}, {error:.1e}");
    }
    for steps in [&[&aside[..]][..], &[&zero], &[&far, &aside, &zero]] {
        let (iterations, error) = from(steps, &TIGHT);
        assert!(iterations <= alone.iterations + 2 && error < 3e-5, "{iterations}, {error:.1e}");
    }
    let many = [&zero[..]; 4];
    let told = system.solve(&problem.b, &many, &zero, &TIGHT).unwrap_err().to_string();
    assert!(told.contains("4 steps; at most 3"), "{told}");
}

/// Refinement with the residual in double precision removes the error of single precision.
#[test]
fn refinement_in_double_precision_converges_to_its_rounding() {
    let Some(gpu) = device() else { return };
    let block = Block::new(2);
    for nu in [0.3, 0.45, 0.49, 0.499] {
        let problem = Problem::new(&block, nu);
        let mut system = problem.system(&gpu, &[]);
        let exact = problem.exact(&[], 0.0);
        let (mut x, mut errors) = (vec![0.0; problem.b.len()], Vec::new());
        for _ in 0..8 {
            let residual: Vec<f64> = (0..x.len())
                .map(|r| {
                    problem.b[r] - problem.dense[r].iter().zip(&x).map(|(k, x)| k * x).sum::<f64>()
                })
                .collect();
            let found = system.alone(&residual, &TIGHT).unwrap();
            x.iter_mut().zip(&found.x).for_each(|(x, d)| *x += d);
            errors.push(distance(&x, &exact));
        }
        println!("nu {nu}: {errors:?}");
        // Accuracy of single precision alone.
        assert!(errors[0] < if nu < 0.495 { 3e-5 } else { 3e-4 }, "nu {nu}: {errors:?}");
        assert!(errors[7] < 1e-9, "nu {nu}: {errors:?}");
    }
}

#[test]
fn the_same_again_gives_the_same_bits_in_any_number_of_chunks_and_batches() {
    let block = Block::new(4);
    let problem = Problem::new(&block, 0.45);
    let mut seen = Vec::new();
    for (largest, check_every) in [(u64::MAX, 16), (u64::MAX, 16), (u64::MAX, 2), (40_000, 16)] {
        let Some(gpu) = device_with(largest) else { return };
        let mut system = problem.system(&gpu, &means(&block));
        assert_eq!(system.n_chunks() > 1, largest == 40_000);
        let found = system.alone(&problem.b, &Settings { check_every, ..TIGHT }).unwrap();
        let again = system.alone(&problem.b, &Settings { check_every, ..TIGHT }).unwrap();
        assert_eq!(found.x, again.x);
        seen.push(found);
    }
    assert_eq!(seen[0].x, seen[1].x);
    assert_eq!(seen[0].x, seen[2].x);
    // Other chunks, other partial sums: equal up to rounding.
    assert!(distance(&seen[3].x, &seen[0].x) < 1e-4);
}

#[test]
fn a_shift_is_added_and_budgets_are_kept() {
    let Some(gpu) = device() else { return };
    let problem = Problem::new(&Block::new(2), 0.3);
    let mut system = problem.system(&gpu, &[]);
    system.load(&problem.values, 50.0).unwrap();
    let found = system.alone(&problem.b, &TIGHT).unwrap();
    assert!(distance(&found.x, &problem.exact(&[], 50.0)) < 1e-4);

    let short = Settings { max_iterations: 5, ..TIGHT };
    let found = system.alone(&problem.b, &short).unwrap();
    assert_eq!((found.ending, found.iterations), (Ending::Spent, 5));
    assert!(found.residual > 1e-6 && found.residual < 1.0);

    // Time that is up leaves what one batch found.
    system.load(&problem.values, 0.0).unwrap();
    let late = Settings { deadline: Some(Instant::now()), ..TIGHT };
    let found = system.alone(&problem.b, &late).unwrap();
    assert_eq!((found.ending, found.iterations), (Ending::Spent, late.check_every));
    assert!(found.residual > 1e-6 && found.residual < 1.0);

    // So does a caller who wants no more.
    let mut fresh = problem.system(&gpu, &[]);
    let start = vec![0.0; problem.b.len()];
    let found = fresh.solve_while(&problem.b, &[], &start, &TIGHT, &|| false).unwrap();
    assert_eq!((found.ending, found.iterations), (Ending::Spent, TIGHT.check_every));
}

#[test]
fn negative_curvature_is_told_with_its_direction() {
    let Some(gpu) = device() else { return };
    let problem = Problem::new(&Block::new(2), 0.3);
    let mut system = problem.system(&gpu, &[]);
    let middle = problem.dense.iter().enumerate().map(|(k, row)| row[k]).sum::<f64>()
        / problem.b.len() as f64;
    system.load(&problem.values, -0.5 * middle).unwrap();
    let found = system.alone(&problem.b, &TIGHT).unwrap();
    assert_eq!(found.ending, Ending::Indefinite);
    let p = &system.direction().unwrap();
    let along = |r: usize| {
        problem.dense[r].iter().zip(p).map(|(k, p)| k * p).sum::<f64>() - 0.5 * middle * p[r]
    };
    let curvature: f64 = (0..p.len()).map(|r| p[r] * along(r)).sum();
    assert!(curvature < 0.0 && p.iter().any(|&p| p != 0.0));
}

#[test]
fn nothing_to_solve_is_solved_by_nothing() {
    let Some(gpu) = device() else { return };
    let problem = Problem::new(&Block::new(1), 0.3);
    let found = problem.system(&gpu, &[]).alone(&vec![0.0; problem.b.len()], &TIGHT).unwrap();
    assert!(found.ending == Ending::Solved && found.x.iter().all(|&x| x == 0.0));
}

#[test]
fn a_lost_device_says_so_and_another_may_be_opened() {
    let Some(gpu) = device_with(u64::MAX) else { return };
    let problem = Problem::new(&Block::new(1), 0.3);
    let mut system = problem.system(&gpu, &[]);
    let found = system.alone(&problem.b, &TIGHT).unwrap();
    gpu.destroy();
    let error = system.alone(&problem.b, &TIGHT).unwrap_err();
    assert!(matches!(error, Error::Lost(_)), "{error:?}");
    assert!(error.to_string().starts_with("the graphics processor was lost"), "{error}");
    assert!(system.load(&problem.values, 0.0).is_err());
    assert!(System::new(&gpu, problem.b.len() / 3, &problem.pairs).is_err());

    let Some(gpu) = device_with(u64::MAX) else { return };
    let again = problem.system(&gpu, &[]).alone(&problem.b, &TIGHT).unwrap();
    assert_eq!(again.x, found.x);
}

#[test]
fn limits_and_bad_input_are_told_in_a_sentence() {
    let Some(gpu) = device() else { return };
    let block = Block::new(1);
    let problem = Problem::new(&block, 0.3);
    let mut system = problem.system(&gpu, &[]);
    let many: Vec<Mean> = (0..=MOST_MEANS as u32).map(|k| vec![(12 + k % 9, 1.0)]).collect();
    let told = |error: Result<(), Error>| error.unwrap_err().to_string();
    assert!(
        told(system.hold(&problem.is_held, &many))
            .contains("49 means are held; the kernels take 48")
    );
    assert!(told(system.hold(&problem.is_held, &[vec![(0, 1.0)]])).contains("mean 0 has no free"));
    assert!(told(system.hold(&[true], &[])).contains("1 flags"));
    assert!(told(system.load(&problem.values[9..], 0.0)).contains("do not fit the blocks"));
    let mut solve = |b: &[f64], settings| told(system.alone(b, &settings).map(|_| ()));
    assert!(solve(&[1.0], TIGHT).contains("1 values"));
    let mut b = problem.b.clone();
    b[5] = f64::NAN;
    assert!(solve(&b, TIGHT).contains("point 1"));
    assert!(solve(&problem.b, Settings { tolerance: 0.0, ..TIGHT }).contains("tolerance 0"));

    let Some(small) = device_with(1000) else { return };
    let error = System::new(&small, problem.b.len() / 3, &problem.pairs).err().unwrap();
    assert!(
        matches!(error, Error::Limit(_)) && error.to_string().contains("not even 32 nodes"),
        "{error}"
    );
}

/// A thread that polls the device may receive the callbacks of others. Each must still get its own result.
#[test]
fn threads_share_a_device() {
    let Some(gpu) = device() else { return };
    let block = Block::new(1);
    let problem = Problem::new(&block, 0.3);
    let alone = problem.system(&gpu, &[]).alone(&problem.b, &TIGHT).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                let mut system = problem.system(&gpu, &[]);
                for _ in 0..60 {
                    assert_eq!(system.alone(&problem.b, &TIGHT).unwrap().x, alone.x);
                }
            });
        }
    });
}
