//! Quadrature points whose volume ratio is out of a range, and how it changes with the displacement of their nodes, to
//! first and second order.

use super::batch::deformation;
use super::cells::CellBatches;
use crate::element::{Geometry, Shape};
use crate::tensor::{Mat3, cofactor, determinant, dot, mul_vector, transpose_mul};
use crate::threads::share;
use crate::unroll::tabulate;
use rayon::prelude::*;

/// Sweeps of Jacobi's rotations; they converge quadratically, and five do.
const MAX_SWEEPS: usize = 10;

/// Cells that a thread looks through at once.
const PART: usize = 2048;

/// A quadrature point of a cell at a displacement.
#[derive(Clone, Debug)]
pub struct Outlier {
    /// Its cell.
    pub cell: usize,
    /// Its number in the body: cell by cell, as in [`Body::volume_ratios`](super::Body::volume_ratios).
    pub point: usize,
    /// `J`.
    pub volume_ratio: f64,
    /// Its weight: its share of the cell's volume at rest [m^3].
    pub volume: f64,
    /// `dJ/du` of each node of the cell [1/m].
    pub slopes: Vec<(u32, [f64; 3])>,
    /// `grad N` of each node [1/m].
    gradients: Vec<[f64; 3]>,
    /// `F`.
    deformation: Mat3<f64>,
}

impl Outlier {
    /// The second derivative in `u` of a function of `J`, of which the first and second derivative are given, with
    /// its eigenvalues in `F` replaced by their absolute values: for each pair of nodes `(a, b)`, `a <= b`, entries
    /// `[3 i + k]`.
    ///
    /// In the frames of `F = sum_p s_p u_p v_p` it is known in closed form: `J = s_1 s_2 s_3` along the `u_p v_p`, and
    /// `-+ s_r` for `u_p v_q +- u_q v_p` (Smith, De Goes, Kim, Stable Neo-Hookean Flesh Simulation, ACM TOG 37, 2018).
    pub fn convex_stiffness(
        &self,
        [first, second]: [f64; 2],
    ) -> impl Iterator<Item = (u32, u32, [f64; 9])> {
        let f = &self.deformation;
        let (squares, v) = eigen(transpose_mul(f, f));
        let s = squares.map(|square| square.max(0.0).sqrt());
        let u = v.map(|v| unit(mul_vector(f, &v)));
        // Of the index that is neither p nor q.
        let third = |p: usize, q: usize| if p == q { 0.0 } else { s[3 - p - q] };
        let slope = [s[1] * s[2], s[2] * s[0], s[0] * s[1]];
        let along = absolute(tabulate!(|p, q| second * slope[p] * slope[q] + first * third(p, q)));
        let across = tabulate!(|p, q| first.abs() * third(p, q));
        let turned = self.gradients.iter().map(|gradient| mul_vector(&v, gradient));
        let nodes = self.slopes.iter().map(|(node, _)| *node).zip(turned).collect::<Vec<_>>();
        let pairs = (0..nodes.len()).flat_map({
            let n = nodes.len();
            move |a| (0..n).map(move |b| (a, b))
        });
        pairs.filter_map(move |(a, b)| {
            let ((row, x), (column, y)) = (nodes[a], nodes[b]);
            let shear: [f64; 3] =
                std::array::from_fn(|p| (0..3).map(|q| across[p][q] * x[q] * y[q]).sum());
            let inner = tabulate!(|p, q| {
                let entry = along[p][q] * x[p] * y[q];
                if p == q { entry + shear[p] } else { entry }
            });
            let half = transpose_mul(&u, &inner);
            let entry = |i: usize, k: usize| (0..3).map(|q| half[i][q] * u[q][k]).sum();
            (row <= column).then(|| (row, column, std::array::from_fn(|p| entry(p / 3, p % 3))))
        })
    }
}

/// A symmetric matrix with its eigenvalues replaced by their absolute values.
fn absolute(a: Mat3<f64>) -> Mat3<f64> {
    let (values, vectors) = eigen(a);
    let part = |i: usize, k: usize, n: usize| values[n].abs() * vectors[n][i] * vectors[n][k];
    tabulate!(|i, k| part(i, k, 0) + part(i, k, 1) + part(i, k, 2))
}

/// Eigenvalues and, in rows, eigenvectors of a symmetric matrix, by Jacobi's rotations.
fn eigen(mut a: Mat3<f64>) -> ([f64; 3], Mat3<f64>) {
    let mut v = tabulate!(|i, k| f64::from(i == k));
    for _ in 0..MAX_SWEEPS {
        if a[0][1] == 0.0 && a[0][2] == 0.0 && a[1][2] == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (gap, twice) = (a[q][q] - a[p][p], 2.0 * a[p][q]);
            if twice.abs() <= f64::EPSILON * f64::EPSILON * (a[p][p].abs() + a[q][q].abs()) {
                (a[p][q], a[q][p]) = (0.0, 0.0);
                continue;
            }
            let t = twice.copysign(twice * gap) / (gap.abs() + gap.hypot(twice));
            let c = 1.0 / (1.0 + t * t).sqrt();
            let turn = |x: f64, y: f64| (c * x - t * c * y, t * c * x + c * y);
            for k in 0..3 {
                (a[p][k], a[q][k]) = turn(a[p][k], a[q][k]);
                (v[p][k], v[q][k]) = turn(v[p][k], v[q][k]);
            }
            for row in &mut a {
                (row[p], row[q]) = turn(row[p], row[q]);
            }
        }
    }
    ([a[0][0], a[1][1], a[2][2]], v)
}

fn unit(x: [f64; 3]) -> [f64; 3] {
    let length = dot(&x, &x).sqrt();
    x.map(|x| x / length)
}

impl<E: Shape<N>, const N: usize> CellBatches<E, N> {
    pub fn outliers(&self, geometry: &[Geometry], u: &[f64], range: [f64; 2]) -> Vec<Outlier> {
        let part = |part: usize| {
            let cells = part * PART..((part + 1) * PART).min(self.nodes.len());
            cells.flat_map(move |cell| self.outliers_of(cell, &geometry[cell], u, range))
        };
        let n_parts = self.nodes.len().div_ceil(PART);
        if share(n_parts) {
            (0..n_parts).into_par_iter().flat_map_iter(part).collect()
        } else {
            (0..n_parts).flat_map(part).collect()
        }
    }

    fn outliers_of(
        &self,
        cell: usize,
        g: &Geometry,
        u: &[f64],
        [low, high]: [f64; 2],
    ) -> impl Iterator<Item = Outlier> {
        let nodes = &self.nodes[cell];
        (0..E::POINTS).filter_map(move |point| {
            let slopes = E::slopes(point);
            let value = |a: usize, i: usize| u[3 * nodes[a] as usize + i];
            let f = deformation(slopes, &g.gradients, value);
            let cofactor = cofactor(&f);
            let volume_ratio = determinant(&f, &cofactor);
            if volume_ratio > low && volume_ratio < high {
                return None;
            }
            let gradient = |a: usize| {
                std::array::from_fn(|j| {
                    (0..3).map(|k| slopes[a][k] * g.gradients[k][j]).sum::<f64>()
                })
            };
            // dJ/du_a = cof F grad N_a.
            let slope = |a: usize| (nodes[a], mul_vector(&cofactor, &gradient(a)));
            Some(Outlier {
                cell,
                point: cell * E::POINTS + point,
                volume_ratio,
                volume: g.volume / E::POINTS as f64,
                slopes: (0..N).map(slope).collect(),
                gradients: (0..N).map(gradient).collect(),
                deformation: f,
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::convex::make_convex;
    use crate::law::TangentBlocks;
    use crate::number::Lane;
    use crate::number::{LANES, Lanes};

    /// The closed form against the absolute value of the nine by nine matrix, next to both bounds.
    #[test]
    fn the_stiffness_of_a_volume_ratio_has_absolute_eigenvalues() {
        let gradients = [[-1.0, -2.0, 0.5], [1.0, 0.3, 0.0], [0.2, 1.5, -0.7], [-0.2, 0.2, 0.2]];
        let nodes = [3, 5, 7, 11];
        for (f, derivatives) in [
            ([[2.1, 0.3, -0.4], [0.2, 0.3, 0.1], [0.5, -0.1, 0.12]], [-3.0, 40.0]),
            ([[1.7, 0.2, 0.1], [-0.3, 1.5, 0.4], [0.0, 0.6, 1.4]], [2.0, 0.5]),
            ([[0.4, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.4]], [-1.0, 0.1]),
        ] {
            let cofactor = cofactor(&f);
            let slope = |a: usize| (nodes[a], mul_vector(&cofactor, &gradients[a]));
            let point = Outlier {
                cell: 0,
                point: 0,
                volume_ratio: determinant(&f, &cofactor),
                volume: 1.0,
                slopes: (0..4).map(slope).collect(),
                gradients: gradients.to_vec(),
                deformation: f,
            };
            let blocks = absolute_blocks(&f, &cofactor, derivatives);
            let mut pairs = 0;
            for (row, column, block) in point.convex_stiffness(derivatives) {
                let at = |node: u32| gradients[nodes.iter().position(|&n| n == node).unwrap()];
                let (x, y) = (at(row), at(column));
                for (p, &found) in block.iter().enumerate() {
                    let part = |q: usize| {
                        let (j, l) = (q / 3, q % 3);
                        let entry = if j <= l {
                            blocks[j][l][p / 3][p % 3]
                        } else {
                            blocks[l][j][p % 3][p / 3]
                        };
                        entry[0] * x[j] * y[l]
                    };
                    let exact: f64 = (0..9).map(part).sum();
                    assert!((found - exact).abs() < 1e-9 * derivatives[1].max(1.0), "{f:?} {p}");
                }
                pairs += 1;
            }
            assert_eq!(pairs, 10);
        }
    }

    /// `f'' dJ/dF dJ/dF + f' d2J/dF2`, `d2J/(dF_ij dF_kl) = eps_ikm eps_jln F_mn`, made convex; entry `[j][l][i][k]`.
    fn absolute_blocks(
        f: &Mat3<f64>,
        cofactor: &Mat3<f64>,
        [first, second]: [f64; 2],
    ) -> TangentBlocks<Lane> {
        // Sign of the permutation that begins with a and b, and its last number.
        let third = |a: usize, b: usize| ([0.0, 1.0, -1.0][(3 + b - a) % 3], (6 - a - b) % 3);
        let mut blocks = TangentBlocks::<Lane>::default();
        for p in 0..81 {
            let (j, l, i, k) = (p / 27, p / 9 % 3, p / 3 % 3, p % 3);
            let ((row, m), (column, n)) = (third(i, k), third(j, l));
            let value = second * cofactor[i][j] * cofactor[k][l] + first * row * column * f[m][n];
            blocks[j][l][i][k] = Lanes([value; LANES]);
        }
        make_convex(&mut blocks);
        blocks
    }
}
