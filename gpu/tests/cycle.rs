//! The V-cycle on the device against dense matrices in double precision, and how it is refused.

mod support;
use support::problem::*;
use support::*;
use viscera_gpu::{Ending, Error, Hierarchy, Level, Settings, System};

type Dense = Vec<Vec<f64>>;

/// A level of a cycle as matrices: its own, the inverse of its diagonal blocks, what leads to it from below.
struct Matrices {
    size: usize,
    a: Dense,
    inverse: Dense,
    up: Dense,
    largest: f64,
}

/// Levels of `counts` nodes below a problem: aggregates of neighbours, with rigid motions about the origin.
struct Levels {
    all: Vec<Matrices>,
    coarsest: Dense,
}

/// The arrays of a level that a hierarchy borrows.
#[derive(Default)]
struct Arrays {
    pairs: Vec<[u32; 2]>,
    values: Vec<f32>,
    inverses: Vec<f32>,
    starts: Vec<u32>,
    columns: Vec<u32>,
    blocks: Vec<f32>,
}

impl Levels {
    fn new(block: &Block, problem: &Problem, counts: [usize; 2]) -> Self {
        let n = block.points.len();
        let free = |row: usize| f64::from(u8::from(!problem.is_held[row]));
        let mut a: Dense = (0..3 * n)
            .map(|r| (0..3 * n).map(|c| problem.dense[r][c] * free(r) * free(c)).collect())
            .collect();
        let (mut all, mut nodes) = (Vec::new(), n);
        for (k, count) in counts.into_iter().enumerate() {
            let size = if k == 0 { 3 } else { 6 };
            let mut up = vec![vec![0.0; 6 * count]; size * nodes];
            for node in 0..nodes {
                let column = 6 * (node * count / nodes);
                for i in 0..size {
                    let row = &mut up[size * node + i];
                    row[column + i] = 1.0;
                    if k == 0 {
                        let [x, y, z] = block.points[node].map(|x| x / 0.01);
                        let turns = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]][i];
                        (0..3).for_each(|j| row[column + 3 + j] = turns[j]);
                        row.iter_mut().for_each(|p| *p *= free(3 * node + i));
                    }
                    // A little of the next aggregate, as after smoothing.
                    let next = (column + 6) % (6 * count);
                    (0..6).for_each(|j| row[next + j] += 0.1 * row[column + j]);
                }
            }
            let inverse = inverse_of_blocks(&a, size);
            let below = times(&transposed(&up), &times(&a, &up));
            let largest = largest_eigenvalue(&times(&inverse, &a));
            all.push(Matrices { size, a, inverse, up, largest });
            (a, nodes) = (below, count);
        }
        Levels { all, coarsest: inverse_of_blocks(&a, a.len()) }
    }

    /// What a cycle makes of a right-hand side: Chebyshev's polynomial of degree two before and after what comes from
    /// below. The error polynomial is `T(t) / T(s)`, `T(t) = 2 t^2 - 1`, `t = (m - l) / h`, `s = m / h`, with middle `m`
    /// and half width `h` of the interval from a tenth of 1.1 times the largest eigenvalue to 1.1 times that.
    fn cycle(&self, k: usize, b: &[f64]) -> Vec<f64> {
        let Some(Matrices { a, inverse, up, largest, .. }) = self.all.get(k) else {
            return apply(&self.coarsest, b);
        };
        let (high, low) = (1.1 * largest, 0.11 * largest);
        let (m, h) = (0.5 * (high + low), 0.5 * (high - low));
        let end = 2.0 * m * m / (h * h) - 1.0;
        let smooth = |r: &[f64]| {
            let once = apply(inverse, r);
            let twice = apply(inverse, &apply(a, &once));
            let both = once.iter().zip(&twice);
            both.map(|(x, y)| (4.0 * m * x - 2.0 * y) / (h * h * end)).collect::<Vec<f64>>()
        };
        let residual = |x: &[f64]| -> Vec<f64> {
            b.iter().zip(apply(a, x)).map(|(b, product)| b - product).collect()
        };
        let add = |x: Vec<f64>, by: Vec<f64>| x.iter().zip(by).map(|(x, y)| x + y).collect();
        let x = smooth(b);
        let from_below = self.cycle(k + 1, &apply(&transposed(up), &residual(&x)));
        let x: Vec<f64> = add(x, apply(up, &from_below));
        let correction = smooth(&residual(&x));
        add(x, correction)
    }

    fn arrays(&self) -> (Vec<Arrays>, Vec<f32>) {
        let arrays = (0..self.all.len()).map(|k| {
            let Matrices { size, a, inverse, up, .. } = &self.all[k];
            let (n, n_below) = (a.len() / size, up[0].len() / 6);
            let block = |of: &Dense, r: usize, c: usize, rows: usize| -> Vec<f32> {
                let entries = (0..6 * rows).map(|e| of[rows * r + e / 6][6 * c + e % 6]);
                entries.map(|x| x as f32).collect()
            };
            let mut arrays = Arrays { starts: vec![0], ..Arrays::default() };
            for node in 0..n {
                for column in 0..n_below {
                    let own = block(up, node, column, *size);
                    if own.iter().any(|&x| x != 0.0) {
                        arrays.columns.push(column as u32);
                        arrays.blocks.extend(own);
                    }
                }
                arrays.starts.push(arrays.columns.len() as u32);
                if k > 0 {
                    arrays.inverses.extend(block(inverse, node, node, 6));
                    for column in node..n {
                        arrays.pairs.push([node as u32, column as u32]);
                        arrays.values.extend(block(a, node, column, 6));
                    }
                }
            }
            arrays
        });
        let coarsest = self.coarsest.iter().flatten().map(|&x| x as f32).collect();
        (arrays.collect(), coarsest)
    }

    /// Hands the hierarchy over, changed first.
    fn give(
        &self,
        system: &mut System,
        change: impl FnOnce(&mut Vec<Arrays>, &mut Vec<f64>),
    ) -> Result<(), Error> {
        let (mut arrays, coarsest) = self.arrays();
        let mut largest: Vec<f64> = self.all.iter().map(|level| level.largest).collect();
        change(&mut arrays, &mut largest);
        let levels = arrays.iter().zip(largest).map(|(of, largest)| Level {
            pairs: &of.pairs,
            values: &of.values,
            inverses: &of.inverses,
            largest,
            starts: &of.starts,
            columns: &of.columns,
            blocks: &of.blocks,
        });
        system.precondition(&Hierarchy { levels: levels.collect(), coarsest: &coarsest })
    }
}

fn apply(a: &Dense, x: &[f64]) -> Vec<f64> {
    a.iter().map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
}

fn transposed(a: &Dense) -> Dense {
    (0..a[0].len()).map(|c| a.iter().map(|row| row[c]).collect()).collect()
}

fn times(a: &Dense, b: &Dense) -> Dense {
    let columns = transposed(b);
    a.iter().map(|row| apply(&columns, row)).collect()
}

/// The inverse of each diagonal block of this size, zero on rows that are.
fn inverse_of_blocks(a: &Dense, size: usize) -> Dense {
    let mut inverse = vec![vec![0.0; a.len()]; a.len()];
    for first in (0..a.len()).step_by(size) {
        let rows: Vec<usize> = (first..first + size).filter(|&r| a[r][r] != 0.0).collect();
        let n = rows.len();
        let mut both: Dense = rows
            .iter()
            .enumerate()
            .map(|(i, &r)| {
                let unit = (0..n).map(|k| f64::from(u8::from(i == k)));
                rows.iter().map(|&c| a[r][c]).chain(unit).collect()
            })
            .collect();
        for pivot in 0..n {
            let row: Vec<f64> = both[pivot].iter().map(|x| x / both[pivot][pivot]).collect();
            for (i, other) in both.iter_mut().enumerate() {
                let factor = other[pivot];
                other.iter_mut().zip(&row).for_each(|(x, p)| *x -= factor * p);
                if i == pivot {
                    other.copy_from_slice(&row);
                }
            }
        }
        for (i, &r) in rows.iter().enumerate() {
            rows.iter().enumerate().for_each(|(k, &c)| inverse[r][c] = both[i][n + k]);
        }
    }
    inverse
}

fn largest_eigenvalue(a: &Dense) -> f64 {
    let mut x: Vec<f64> = (0..a.len()).map(|k| (0.7 * k as f64).sin()).collect();
    let mut largest = 0.0;
    for _ in 0..100 {
        x = apply(a, &x);
        largest = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        x.iter_mut().for_each(|x| *x /= largest);
    }
    largest
}

fn setting() -> (Block, Problem, Levels) {
    let block = Block::new(3);
    let problem = Problem::new(&block, 0.45);
    let levels = Levels::new(&block, &problem, [9, 3]);
    (block, problem, levels)
}

/// The first step of conjugate gradients goes along the preconditioned right-hand side.
#[test]
fn a_cycle_is_that_of_dense_matrices_in_any_number_of_chunks() {
    let (_, problem, levels) = setting();
    let b: Vec<f64> =
        (0..problem.b.len()).map(|r| if problem.is_held[r] { 0.0 } else { problem.b[r] }).collect();
    let exact = levels.cycle(0, &b);
    for largest in [u64::MAX, 21_000] {
        let Some(gpu) = device_with(largest) else { return };
        let mut system = problem.system(&gpu, &[]);
        levels.give(&mut system, |_, _| ()).unwrap();
        let once = Settings { max_iterations: 1, ..TIGHT };
        let found = system.solve(&problem.b, &once).unwrap().x;
        let along = found.iter().zip(&exact).map(|(x, z)| x * z).sum::<f64>()
            / exact.iter().map(|z| z * z).sum::<f64>();
        let scaled: Vec<f64> = exact.iter().map(|z| along * z).collect();
        let error = distance(&found, &scaled);
        println!("{largest}: {error:.1e}");
        assert!(error < 1e-5, "{error:.1e}");
    }
}

#[test]
fn the_solution_is_that_of_elimination_after_fewer_iterations() {
    let Some(gpu) = device() else { return };
    let (block, problem, levels) = setting();
    for means in [Vec::new(), means(&block)] {
        let exact = problem.exact(&means, 0.0);
        let mut system = problem.system(&gpu, &means);
        let plain = system.solve(&problem.b, &TIGHT).unwrap();
        let before = system.dispatches_per_iteration();
        levels.give(&mut system, |_, _| ()).unwrap();
        assert!(system.dispatches_per_iteration() > before);
        let found = system.solve(&problem.b, &TIGHT).unwrap();
        println!("{} means: {} for {}", means.len(), found.iterations, plain.iterations);
        assert_eq!(found.ending, Ending::Solved);
        // Single precision times the condition number of the matrix.
        assert!(distance(&found.x, &exact) < 3e-5, "{}", distance(&found.x, &exact));
        assert!(3 * found.iterations < plain.iterations);
        for mean in &means {
            let moved: f64 = mean.iter().map(|&(dof, w)| w * found.x[dof as usize]).sum();
            let size = found.x.iter().fold(0.0f64, |size, x| size.max(x.abs()));
            assert!(moved.abs() < 1e-5 * size, "{moved} of {size}");
        }
        // The same again, also with the numbers renewed and other checks.
        levels.give(&mut system, |_, _| ()).unwrap();
        let again = system.solve(&problem.b, &Settings { check_every: 4, ..TIGHT }).unwrap();
        assert_eq!(again.x, found.x);
        let held = found.x.iter().zip(&problem.is_held).filter(|(_, held)| **held);
        assert!(held.into_iter().all(|(x, _)| *x == 0.0));
    }
}

/// What is held later stays at rest, although the hierarchy knows nothing of it.
#[test]
fn an_old_hierarchy_serves_what_was_held_since() {
    let Some(gpu) = device() else { return };
    let (_, mut problem, levels) = setting();
    let mut system = problem.system(&gpu, &[]);
    levels.give(&mut system, |_, _| ()).unwrap();
    let last = problem.b.len();
    problem.is_held[last - 3..].fill(true);
    system.hold(&problem.is_held, &[]).unwrap();
    system.load(&problem.values, 0.0).unwrap();
    let found = system.solve(&problem.b, &TIGHT).unwrap();
    assert_eq!(found.ending, Ending::Solved);
    assert_eq!(found.x[last - 3..], [0.0; 3]);
    assert!(distance(&found.x, &problem.exact(&[], 0.0)) < 3e-5);
}

/// A smoother that takes the largest eigenvalue for a tenth of what it is amplifies: the iterations end, and say no more
/// than that they are spent.
#[test]
fn a_cycle_that_is_not_positive_definite_ends_the_iterations() {
    let Some(gpu) = device() else { return };
    let (_, problem, levels) = setting();
    let mut system = problem.system(&gpu, &[]);
    levels.give(&mut system, |_, largest| largest.iter_mut().for_each(|l| *l *= 0.1)).unwrap();
    let found = system.solve(&problem.b, &TIGHT).unwrap();
    assert_ne!(found.ending, Ending::Solved);
    assert!(found.x.iter().all(|x| x.is_finite()));
}

#[test]
fn a_hierarchy_that_does_not_fit_is_refused_in_a_sentence() {
    let Some(gpu) = device() else { return };
    let (_, problem, levels) = setting();
    type Change = fn(&mut Vec<Arrays>, &mut Vec<f64>);
    let changes: [(Change, &str); 6] = [
        (|of, _| drop(of.remove(0)), "level 0 of multigrid does not fit a matrix of 64 nodes"),
        (|of, _| of[0].columns[5] = 99, "level 0 of multigrid leads to a node that is not there"),
        (|of, _| of[1].blocks.truncate(7), "level 1 of multigrid has blocks that do not fit"),
        (|of, _| of[1].values.truncate(7), "level 1 of multigrid has a matrix that does not fit"),
        (|of, _| of[1].pairs[0] = [3, 1], "level 1 of multigrid has a matrix that does not fit"),
        (|_, largest| largest[1] = f64::NAN, "level 1 of multigrid has the largest eigenvalue NaN"),
    ];
    for (change, told) in changes {
        let mut system = problem.system(&gpu, &[]);
        let error = levels.give(&mut system, change).unwrap_err();
        assert!(matches!(error, Error::Input(_)) && error.to_string().contains(told), "{error}");
        // It goes on with what it had.
        assert_eq!(system.solve(&problem.b, &TIGHT).unwrap().ending, Ending::Solved);
    }
}
