//! The parts of a cycle against dense matrices, what it is good for, and every failure.

use super::super::BlockMatrix;
use super::super::conjugate_gradients::{
    BlockJacobi, Info, Operator, Preconditioner, Settings, Workspace, solve,
};
use super::super::test_matrices::{load, relative_difference};
use super::prolongation::Modes;
use super::*;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// Linear elasticity (Young's modulus 1) of a box on linear tetrahedra, six to a brick.
struct Elastic {
    points: Vec<[f64; 3]>,
    pairs: Vec<(u32, u32)>,
    values: Vec<f64>,
    is_held: Vec<bool>,
}

impl Elastic {
    fn new(counts: [usize; 3], poisson: f64) -> Self {
        let [nx, ny, nz] = counts.map(|n| n + 1);
        let id = |p: [usize; 3]| p[0] + nx * (p[1] + ny * p[2]);
        let place = |k: usize| [k % nx, k / nx % ny, k / (nx * ny)].map(|x| x as f64);
        let points: Vec<[f64; 3]> = (0..nx * ny * nz).map(place).collect();
        let (mu, lambda) =
            (0.5 / (1.0 + poisson), poisson / (1.0 + poisson) / (1.0 - 2.0 * poisson));
        let mut blocks = std::collections::BTreeMap::<(usize, usize), [f64; 9]>::new();
        for brick in 0..counts.iter().product() {
            let corner =
                [brick % counts[0], brick / counts[0] % counts[1], brick / (counts[0] * counts[1])];
            for walk in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                // Along the edges of the brick, axis after axis: slopes of the shape functions are differences of
                // unit vectors.
                let (mut at, mut nodes) = (corner, vec![id(corner)]);
                let mut slopes = [[0.0; 3]; 4];
                for (k, axis) in walk.into_iter().enumerate() {
                    at[axis] += 1;
                    nodes.push(id(at));
                    (slopes[k][axis], slopes[k + 1][axis]) = (-1.0, 1.0);
                }
                for (a, &row) in nodes.iter().enumerate() {
                    for (b, &column) in nodes.iter().enumerate().filter(|&(_, &c)| row <= c) {
                        let (g, h) = (slopes[a], slopes[b]);
                        let dot: f64 = (0..3).map(|i| g[i] * h[i]).sum();
                        let block = blocks.entry((column, row)).or_default();
                        for i in 0..3 {
                            for k in 0..3 {
                                let shear = g[k] * h[i] + if i == k { dot } else { 0.0 };
                                block[3 * i + k] += (lambda * g[i] * h[k] + mu * shear) / 6.0;
                            }
                        }
                    }
                }
            }
        }
        Elastic {
            is_held: points.iter().flat_map(|point| [point[0] == 0.0; 3]).collect(),
            points,
            pairs: blocks.keys().map(|&(column, row)| (row as u32, column as u32)).collect(),
            values: blocks.into_values().flatten().collect(),
        }
    }

    fn multigrid(&self) -> Multigrid {
        self.multigrid_to(COARSEST)
    }

    fn multigrid_to(&self, n_coarsest: usize) -> Multigrid {
        let pairs = self.pairs.iter().copied();
        let mut multigrid =
            Multigrid::with_levels(n_coarsest, Parts::new, &self.points, pairs).unwrap();
        multigrid.hold(&self.is_held);
        multigrid.factorize(&self.values, 0.0).unwrap();
        multigrid
    }

    fn solve(&self, preconditioner: &mut impl Preconditioner) -> Info {
        let mut b = load(self.n(), 0);
        b.iter_mut().zip(&self.is_held).for_each(|(b, &held)| *b = if held { 0.0 } else { *b });
        let mut x = vec![0.0; b.len()];
        let workspace = &mut Workspace::new(b.len());
        let info =
            solve(&mut x, self, preconditioner, &b, &Settings::default(), workspace).unwrap();
        let mut y = vec![0.0; b.len()];
        self.apply(&x, &mut y);
        assert!(relative_difference(&y, &b) <= 1.01e-8);
        info
    }

    fn dense(&self) -> Mat<f64> {
        columns(self.n(), |x, y| self.apply(x, y))
    }
}

impl Operator for Elastic {
    fn n(&self) -> usize {
        self.is_held.len()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for (&(row, column), block) in self.pairs.iter().zip(self.values.chunks_exact(9)) {
            let (row, column) = (3 * row as usize, 3 * column as usize);
            for i in 0..3 {
                for k in 0..3 {
                    y[row + i] += block[3 * i + k] * x[column + k];
                    if row != column {
                        y[column + k] += block[3 * i + k] * x[row + i];
                    }
                }
            }
        }
        y.iter_mut().zip(&self.is_held).for_each(|(y, &held)| *y = if held { 0.0 } else { *y });
    }
}

/// The dense matrix of a linear map.
fn columns(n: usize, mut map: impl FnMut(&[f64], &mut [f64])) -> Mat<f64> {
    let (mut x, mut y, mut dense) = (vec![0.0; n], vec![0.0; n], Mat::zeros(n, n));
    for column in 0..n {
        x[column] = 1.0;
        map(&x, &mut y);
        x[column] = 0.0;
        (0..n).for_each(|row| dense[(row, column)] = y[row]);
    }
    dense
}

fn dense_prolongation<const B: usize>(p: &Prolongation<B>, n: usize) -> Mat<f64> {
    let mut dense = Mat::zeros(B * n, MODES * p.n_coarse());
    for node in 0..n {
        let (aggregates, blocks) = p.row(node);
        for (&aggregate, block) in aggregates.iter().zip(blocks) {
            for i in 0..B {
                for mode in 0..MODES {
                    dense[(B * node + i, MODES * aggregate as usize + mode)] =
                        f64::from(block[i][mode]);
                }
            }
        }
    }
    dense
}

fn dense_below<const B: usize, const W: usize>(level: &Level<B, W>) -> Mat<f64> {
    let upper = &level.below_upper;
    let mut dense = Mat::zeros(MODES * upper.n(), MODES * upper.n());
    for column in 0..upper.n() {
        for (place, &row) in upper.column(column).zip(upper.rows(column)) {
            for i in 0..MODES {
                for k in 0..MODES {
                    let value = level.below[SQUARE * place + MODES * i + k];
                    let (r, c) = (MODES * row as usize + i, MODES * column + k);
                    (dense[(r, c)], dense[(c, r)]) = (value, value);
                }
            }
        }
    }
    dense
}

#[test]
fn matrices_below_are_galerkin_products() {
    let elastic = Elastic::new([9, 6, 5], 0.3);
    let shift = 0.01;
    let mut multigrid = elastic.multigrid_to(8);
    multigrid.factorize(&elastic.values, shift).unwrap();
    assert_eq!(multigrid.levels().len(), 3, "two products to check: {:?}", multigrid.levels());
    let shifted = Mat::from_fn(elastic.n(), elastic.n(), |i, k| f64::from(i == k) * shift);
    let p = dense_prolongation(&multigrid.finest.prolongation, elastic.points.len());
    let below = dense_below(&multigrid.finest);
    let expected = p.transpose() * (elastic.dense() + shifted) * &p;
    assert!((&below - &expected).norm_l2() < 1e-12 * expected.norm_l2());
    let next = &multigrid.coarse[0];
    let p = dense_prolongation(&next.prolongation, next.b.len());
    let expected = p.transpose() * below * &p;
    assert!((dense_below(next) - &expected).norm_l2() < 1e-12 * expected.norm_l2());
}

#[test]
fn products_by_stretches_are_the_same_by_any_number_of_threads() {
    let elastic = Elastic::new([9, 6, 5], 0.3);
    let mut multigrid = elastic.multigrid_to(8);
    multigrid.factorize(&elastic.values, 0.01).unwrap();
    let Level { smoother, prolongation, below_upper: coarse, below, .. } = &multigrid.finest;
    let fine = &smoother.pattern;
    let values = &elastic.values;
    let product = galerkin::Product { fine, values, shift: 0.01, prolongation, coarse };
    let stretches = galerkin::stretches_of(13, fine, prolongation, coarse);
    assert!(stretches.len() > 2 * crate::threads::FEWEST);
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut out = vec![f64::NAN; below.len()];
        pool.install(|| product.compute(&stretches, &mut out));
        out
    };
    let (alone, size) = (by(1), below.iter().fold(0.0f64, |size, x| size.max(x.abs())));
    assert!(alone.iter().zip(below).all(|(a, b)| (a - b).abs() < 1e-13 * size));
    assert!([2, 3].into_iter().all(|threads| by(threads) == alone));
}

#[test]
fn rigid_motions_are_known_on_every_level() {
    let mut elastic = Elastic::new([9, 6, 5], 0.3);
    elastic.is_held.fill(false);
    let pairs = elastic.pairs.iter().copied();
    let mut multigrid = Multigrid::with_levels(8, Parts::new, &elastic.points, pairs).unwrap();
    // A little stiffness, so that the coarsest matrix has a factor; rigid motions feel hardly any.
    multigrid.factorize(&elastic.values, 1e-9).unwrap();
    let mut modes = rigid_modes(&elastic.points);
    let check = |p: &Mat<f64>, fine: &Modes, coarse: &Modes| {
        let fine = Mat::from_fn(fine.len(), MODES, |i, k| fine[i][k]);
        let coarse = Mat::from_fn(coarse.len(), MODES, |i, k| coarse[i][k]);
        let gap = (p * coarse - fine).norm_max();
        assert!(gap < 1e-5, "{gap}");
    };
    let Multigrid { finest, coarse, .. } = &mut multigrid;
    let p = dense_prolongation(&finest.prolongation, elastic.points.len());
    let below = finest.prolongation.orthonormalize(&modes);
    check(&p, &modes, &below);
    modes = below;
    let p = dense_prolongation(&coarse[0].prolongation, coarse[0].b.len());
    check(&p, &modes, &coarse[0].prolongation.orthonormalize(&modes));
}

/// What a prolongation does to a smooth field is not the only promise: the cycle is symmetric and positive definite, and
/// near the inverse, as conjugate gradients need.
#[test]
fn a_cycle_is_symmetric_and_positive_definite() {
    let elastic = Elastic::new([6, 3, 4], 0.45);
    let mut multigrid = elastic.multigrid();
    let cycle = columns(elastic.n(), |r, z| multigrid.apply(r, z));
    let asymmetry = (&cycle - cycle.transpose()).norm_l2() / cycle.norm_l2();
    assert!(asymmetry < 1e-5, "{asymmetry}");
    let free: Vec<usize> = (0..elastic.n()).filter(|&row| !elastic.is_held[row]).collect();
    let (k, m) = (elastic.dense(), cycle);
    let pick = |a: &Mat<f64>| Mat::from_fn(free.len(), free.len(), |i, j| a[(free[i], free[j])]);
    let (k, m) = (pick(&k), pick(&m));
    let l = k.llt(Side::Lower).unwrap();
    let product = l.L().transpose() * m * l.L();
    let eigenvalues = product.self_adjoint_eigenvalues(Side::Lower).unwrap();
    assert!(eigenvalues[0] > 0.05 && *eigenvalues.last().unwrap() < 1.001, "{eigenvalues:?}");
}

/// Sweeps in parts are those of Gauss-Seidel in another order of nodes, by any number of threads.
#[test]
fn parts_are_swept_in_turns() {
    let elastic = Elastic::new([3, 3, 24], 0.3);
    let upper = || Upper::new(elastic.points.len(), elastic.pairs.iter().copied()).unwrap();
    // Numbered along the longest side, so that parts touch those beside them alone.
    let parts = Parts::cut(5, &upper());
    let mut smoother = Smoother::<3, 4>::new(upper(), parts);
    smoother.fill(&elastic.values, 0.5, |_| true).unwrap();
    let parts: Vec<_> = smoother.parts.all().iter().map(|part| part.nodes.clone()).collect();
    assert!(parts.len() == 5 && parts.windows(2).all(|pair| pair[0].end == pair[1].start));
    let turn = |parity: usize| parts.iter().skip(parity).step_by(2).cloned().flatten();
    let order: Vec<usize> = turn(0).chain(turn(1)).collect();
    let mut rank = vec![0; order.len()];
    order.iter().enumerate().for_each(|(at, &node)| rank[node] = at);
    let free = Elastic { is_held: vec![false; elastic.n()], ..elastic };
    let shifted = |row: usize, column: usize| if row == column { 0.5 } else { 0.0 };
    let n = free.n();
    let a = free.dense() + Mat::from_fn(n, n, shifted);
    let is_left = |row: usize, column: usize| rank[row / 3] >= rank[column / 3];
    let [left, right] = [true, false].map(|wanted| {
        Mat::from_fn(n, n, |i, k| if is_left(i, k) == wanted { a[(i, k)] } else { 0.0 })
    });
    let vector = |seed: usize| Mat::from_fn(n, 1, |i, _| ((37 * i + 11 * seed) as f64).sin());
    let (b, x) = (vector(1), vector(2));
    let lu = |m: &Mat<f64>| m.partial_piv_lu();
    let down = lu(&left).solve(&b);
    let diagonal = Mat::from_fn(n, n, |i, k| if i / 3 == k / 3 { a[(i, k)] } else { 0.0 });
    let upper_part = &right + &diagonal;
    let up = lu(&upper_part).solve(&b - (&left - &diagonal) * &x);
    let expected = [down.clone(), &right * &down, up, lu(&diagonal).solve(&a * &x)];
    let packed = |m: &Mat<f64>| -> Vec<[f32; 4]> {
        let at = |i: usize| m[(i, 0)] as f32;
        (0..n / 3).map(|node| [at(3 * node), at(3 * node + 1), at(3 * node + 2), 0.0]).collect()
    };
    let mut by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (b, mut down, mut y) = (packed(&b), packed(&x), packed(&x));
        let mut up = packed(&x);
        pool.install(|| {
            let rest = smoother.forward(&b, &mut down).to_vec();
            smoother.backward(&b, &mut up);
            smoother.jacobi(&packed(&x), &mut y);
            [down, rest, up, y]
        })
    };
    let alone = by(1);
    for (found, expected) in alone.iter().zip(&expected) {
        let size = expected.norm_max();
        for (found, expected) in found.iter().zip(packed(expected)) {
            let close = (0..3).all(|i| f64::from((found[i] - expected[i]).abs()) < 1e-5 * size);
            assert!(close, "{found:?} {expected:?}");
        }
    }
    assert!([2, 3].into_iter().all(|threads| by(threads) == alone));
}

/// A level in parts serves as well as one that is whole, by any number of threads.
#[test]
fn a_cycle_in_parts_is_as_good() {
    let elastic = Elastic::new([4, 4, 48], 0.3);
    let pairs = || elastic.pairs.iter().copied();
    let whole = elastic.solve(&mut elastic.multigrid()).iterations;
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let parts = |upper: &Upper| Parts::cut(9, upper);
        let mut multigrid =
            Multigrid::with_levels(COARSEST, parts, &elastic.points, pairs()).unwrap();
        assert!(multigrid.finest.smoother.parts.len() == 9);
        pool.install(|| {
            multigrid.hold(&elastic.is_held);
            multigrid.factorize(&elastic.values, 0.0).unwrap();
            let mut z = vec![0.0; elastic.n()];
            multigrid.apply(&load(elastic.n(), 3), &mut z);
            (z, elastic.solve(&mut multigrid).iterations)
        })
    };
    let alone = by(1);
    assert!(alone.1 <= whole + 2, "{} {whole}", alone.1);
    assert!([2, 3].into_iter().all(|threads| by(threads) == alone));
}

#[test]
fn nodes_numbered_far_from_their_neighbours_are_one_part() {
    let elastic = Elastic::new([40, 20, 20], 0.3);
    let n = elastic.points.len() as u32;
    let upper = Upper::new(n as usize, elastic.pairs.iter().copied()).unwrap();
    assert!(Parts::new(&upper).len() >= 6);
    let far = (0..n).flat_map(|k| [(k % (n / 2), k), (k, k)].into_iter().skip((k < n / 2).into()));
    assert_eq!(Parts::new(&Upper::new(n as usize, far).unwrap()).len(), 1);
    let small = Elastic::new([6, 3, 4], 0.3);
    let upper = Upper::new(small.points.len(), small.pairs.iter().copied()).unwrap();
    assert_eq!(Parts::new(&upper).len(), 1);
}

#[test]
fn iterations_hardly_grow_with_the_mesh() {
    let counts = [4, 8, 16].map(|n| {
        let elastic = Elastic::new([n; 3], 0.3);
        let mut block_jacobi = BlockJacobi::new(elastic.points.len());
        let mut matrix = BlockMatrix::new(elastic.points.len(), elastic.pairs.iter().copied());
        matrix.hold(&elastic.is_held);
        matrix.fill(&elastic.values, 0.0);
        let blocks = (0..elastic.points.len()).map(|node| matrix.diagonal_block(node));
        block_jacobi.factorize(blocks, |row| elastic.is_held[row]).unwrap();
        [
            elastic.solve(&mut elastic.multigrid()).iterations,
            elastic.solve(&mut block_jacobi).iterations,
        ]
    });
    assert!(2 * counts[2][0] <= 3 * counts[1][0], "{counts:?}");
    assert!(5 * counts[2][1] >= 8 * counts[1][1], "{counts:?}");
    assert!(counts[2][0] < 25, "{counts:?}");
}

#[test]
fn numbers_are_renewed_on_the_same_aggregates() {
    let mut elastic = Elastic::new([6, 3, 4], 0.3);
    let r = load(elastic.n(), 1);
    let cycle = |multigrid: &mut Multigrid| {
        let mut z = vec![f64::NAN; r.len()];
        multigrid.apply(&r, &mut z);
        z
    };
    let mut multigrid = elastic.multigrid();
    let first = cycle(&mut multigrid);
    // Another matrix, other rows held, and back: the same bits.
    elastic.is_held.iter_mut().skip(100).step_by(7).for_each(|held| *held = true);
    multigrid.hold(&elastic.is_held);
    multigrid.factorize(&elastic.values.iter().map(|v| 2.0 * v).collect::<Vec<_>>(), 0.1).unwrap();
    let held = cycle(&mut multigrid);
    assert!(held.iter().zip(&elastic.is_held).all(|(z, held)| (*z == 0.0) == *held));
    elastic.is_held = elastic.points.iter().flat_map(|point| [point[0] == 0.0; 3]).collect();
    multigrid.hold(&elastic.is_held);
    multigrid.factorize(&elastic.values, 0.0).unwrap();
    assert_eq!(cycle(&mut multigrid), first);
}

/// Aggregates whose nodes are in a line, or that are one node, have fewer modes than six.
#[test]
fn nodes_in_a_line_have_fewer_modes() {
    let n = 300;
    let points = (0..n).map(|k| [k as f64, 0.0, 0.0]).collect();
    let identity = |factor: f64| (0..9).map(move |k| if k % 4 == 0 { factor } else { 0.0 });
    let pairs = (0..n as u32).flat_map(|k| [(k.saturating_sub(1), k), (k, k)]).skip(1).collect();
    let values = (0..n).flat_map(|_| identity(-1.0).chain(identity(2.0))).skip(9).collect();
    let line = Elastic { points, pairs, values, is_held: vec![false; 3 * n] };
    let mut multigrid = line.multigrid();
    assert!(multigrid.levels().len() > 2);
    let unknowns = multigrid.finest.prolongation.unknowns();
    assert!(unknowns.chunks_exact(MODES).all(|modes| modes.iter().filter(|m| **m).count() == 5));
    assert!(line.solve(&mut multigrid).iterations < 60);
}

#[test]
fn an_indefinite_matrix_is_refused_where_a_pivot_shows_it() {
    let elastic = Elastic::new([6, 3, 4], 0.3);
    let mut multigrid = elastic.multigrid();
    // By much, in the diagonal blocks; by little, in the coarsest matrix alone.
    for shift in [-10.0, -0.01] {
        match multigrid.factorize(&elastic.values, shift) {
            Err(FactorError::NotPositiveDefinite { row }) => assert!(row < elastic.n()),
            other => panic!("{shift}: {other:?}"),
        }
    }
    assert!(multigrid.factorize(&elastic.values, 0.0).is_ok());
}

#[test]
fn refuses_bad_arguments() {
    let elastic = Elastic::new([2, 1, 1], 0.3);
    let mut multigrid = elastic.multigrid();
    let mut values = elastic.values.clone();
    values[5] = f64::NAN;
    let refused = multigrid.factorize(&values, 0.0);
    assert_eq!(refused, Err(FactorError::NotFinite { position: 5 }));
    let (expected, found) = (values.len(), values.len() - 9);
    let refused = multigrid.factorize(&values[9..], 0.0);
    assert_eq!(refused, Err(FactorError::Length { argument: "values", expected, found }));
    let swapped = [(0, 1), (0, 0), (1, 1)];
    let without_diagonal = [(0, 0), (0, 1)];
    let below_the_diagonal = [(0, 0), (1, 0), (1, 1)];
    let outside = [(0, 0), (1, 1), (2, 2)];
    for pairs in [&swapped[..], &without_diagonal, &below_the_diagonal, &outside] {
        let refused = Multigrid::new(&[[0.0; 3]; 2], pairs.iter().copied());
        assert!(matches!(refused, Err(FactorError::InvalidPattern { .. })), "{pairs:?}");
    }
}
