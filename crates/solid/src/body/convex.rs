//! The tangent made convex cell by cell, for Newton steps where the energy is not convex.
//!
//! A crushed or buckling cell has directions of negative curvature. With the eigenvalues of its own tangent replaced by
//! their absolute values, `|K| = V |Lambda| V^T`, every cell adds a positive semidefinite part, the step is one of
//! descent, and cells that are sound keep their tangent to the last bit. A multiple of the identity added to the whole
//! tangent would be as safe, and freeze the body for the sake of one cell.
//! Chen, Hsieh, Jacobson et al., Stabler Neo-Hookean Simulation: Absolute Eigenvalue Filtering for Projected Newton,
//! SIGGRAPH 2024.

use crate::law::TangentBlocks;
use crate::number::{LANES, Lane};
use crate::simd::{Kernel, dispatch_solver};
use std::hint::black_box;

/// Rows of a cell's tangent: three vectors times three components.
const N: usize = 9;

/// A pivot below this part of the largest diagonal entry counts as zero, since a cell at rest has no stiffness against
/// rotations.
const ROUNDING: f64 = 1e-10;

/// The sum of squared off-diagonal entries, as a part of that of all entries, at which the iteration ends; the absolute
/// value need not be exact to the last digit.
const DIAGONAL: f64 = 1e-20;
/// Sweeps of rotations; they converge quadratically, and five do.
const MAX_SWEEPS: usize = 16;

type Dense = [[f64; N]; N];
type DenseLanes = [[Lane; N]; N];

/// Replaces the tangent of each cell that is not positive semidefinite by its absolute value.
pub(super) fn make_convex(blocks: &mut TangentBlocks<Lane>) {
    let (mut bent, mut is_bent) = ([[Lane::default(); N]; N], [false; LANES]);
    for lane in 0..LANES {
        let tangent = of_lane(blocks, lane);
        is_bent[lane] = is_finite(&tangent) && !is_convex(&tangent);
        if is_bent[lane] {
            for (out, row) in bent.iter_mut().zip(&tangent) {
                out.iter_mut().zip(row).for_each(|(out, x)| out[lane] = *x);
            }
        }
    }
    if is_bent == [false; LANES] {
        return;
    }
    let absolute = dispatch_solver(Absolute { a: bent, n: black_box(N) });
    for lane in (0..LANES).filter(|&lane| is_bent[lane]) {
        for r in 0..N {
            for c in 3 * (r / 3)..N {
                blocks[r / 3][c / 3][r % 3][c % 3][lane] = absolute[r][c][lane];
            }
        }
    }
}

fn of_lane(blocks: &TangentBlocks<Lane>, lane: usize) -> Dense {
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let (r, c) = if r / 3 <= c / 3 { (r, c) } else { (c, r) };
            blocks[r / 3][c / 3][r % 3][c % 3][lane]
        })
    })
}

fn is_finite(tangent: &Dense) -> bool {
    tangent.iter().flatten().all(|value| value.is_finite())
}

/// Whether Cholesky's method succeeds, up to rounding.
fn is_convex(tangent: &Dense) -> bool {
    let largest = (0..N).fold(0.0f64, |largest, k| largest.max(tangent[k][k]));
    let mut l = [[0.0; N]; N];
    for column in 0..N {
        let known = |row: usize, l: &Dense| -> f64 {
            tangent[row][column] - (0..column).map(|k| l[row][k] * l[column][k]).sum::<f64>()
        };
        let pivot = known(column, &l) + ROUNDING * largest;
        if pivot <= 0.0 {
            return false;
        }
        l[column][column] = pivot.sqrt();
        for row in column + 1..N {
            l[row][column] = known(row, &l) / l[column][column];
        }
    }
    true
}

/// `V |Lambda| V^T` of the matrix in every lane, by Jacobi's rotations: cells side by side, where a library would take
/// one after the other and several times as long for each.
struct Absolute {
    a: DenseLanes,
    /// Its number of rows, hidden from the compiler: unrolling the rotations of a sweep would take it a minute and gain
    /// nothing.
    n: usize,
}

impl Kernel for Absolute {
    type Output = DenseLanes;

    #[inline(always)]
    fn run(self) -> DenseLanes {
        let Absolute { mut a, n } = self;
        // Rows: eigenvectors.
        let mut v = [[Lane::default(); N]; N];
        (0..N).for_each(|k| v[k][k] = v[k][k] + 1.0);
        for _ in 0..MAX_SWEEPS {
            if is_diagonal(&a) {
                break;
            }
            for p in 0..n {
                for q in p + 1..n {
                    let [c, s] = rotation(a[p][p], a[q][q], a[p][q]);
                    turn_rows(&mut a, (p, q), c, s);
                    for row in &mut a {
                        (row[p], row[q]) = turned(row[p], row[q], c, s);
                    }
                    turn_rows(&mut v, (p, q), c, s);
                }
            }
        }
        let mut absolute = [[Lane::default(); N]; N];
        for (k, v) in v.iter().enumerate().take(n) {
            let mut size = a[k][k];
            (0..LANES).for_each(|lane| size[lane] = size[lane].abs());
            for r in 0..n {
                let part = v[r] * size;
                (0..N).for_each(|c| absolute[r][c] = absolute[r][c] + part * v[c]);
            }
        }
        absolute
    }
}

#[inline(always)]
fn is_diagonal(a: &DenseLanes) -> bool {
    let (mut all, mut outside) = (Lane::default(), Lane::default());
    for r in 0..N {
        all = all + a[r][r] * a[r][r];
        for c in r + 1..N {
            outside = outside + a[r][c] * a[r][c];
        }
    }
    (0..LANES).all(|lane| outside[lane] <= DIAGONAL * (all[lane] + outside[lane]))
}

/// Cosine and sine of the smaller rotation that makes the entry `pq` vanish.
#[inline(always)]
fn rotation(pp: Lane, qq: Lane, pq: Lane) -> [Lane; 2] {
    let (mut c, mut s) = (Lane::default(), Lane::default());
    for lane in 0..LANES {
        let (gap, twice) = (qq[lane] - pp[lane], 2.0 * pq[lane]);
        let root = (gap * gap + twice * twice).sqrt();
        let tangent = twice.copysign(twice * gap) / (gap.abs() + root + f64::MIN_POSITIVE);
        c[lane] = 1.0 / (1.0 + tangent * tangent).sqrt();
        s[lane] = tangent * c[lane];
    }
    [c, s]
}

#[inline(always)]
fn turned(p: Lane, q: Lane, c: Lane, s: Lane) -> (Lane, Lane) {
    (c * p - s * q, s * p + c * q)
}

#[inline(always)]
fn turn_rows(a: &mut DenseLanes, (p, q): (usize, usize), c: Lane, s: Lane) {
    for k in 0..N {
        (a[p][k], a[q][k]) = turned(a[p][k], a[q][k], c, s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::Lanes;

    /// A matrix of these eigenvalues in a fixed orthonormal basis, in every lane.
    fn with_eigenvalues(values: [f64; N]) -> TangentBlocks<Lane> {
        // Householder's reflection at (1, 2, .., 9).
        let v: Vec<f64> = (1..=N).map(|k| k as f64).collect();
        let square: f64 = v.iter().map(|x| x * x).sum();
        let q = |r: usize, c: usize| f64::from(r == c) - 2.0 * v[r] * v[c] / square;
        let entry = |r, c| (0..N).map(|k| q(r, k) * values[k] * q(c, k)).sum::<f64>();
        let mut blocks = TangentBlocks::<Lane>::default();
        for a in 0..3 {
            for b in a..3 {
                for i in 0..3 {
                    for j in 0..3 {
                        blocks[a][b][i][j] = Lanes([entry(3 * a + i, 3 * b + j); LANES]);
                    }
                }
            }
        }
        blocks
    }

    #[test]
    fn a_convex_cell_stays_as_it_is_and_another_gets_absolute_eigenvalues() {
        let sound = with_eigenvalues([1.0, 2.0, 3.0, 1e4, 5.0, 0.0, 0.0, 0.0, 1.0]);
        let mut same = sound;
        make_convex(&mut same);
        assert_eq!(of_lane(&same, 0), of_lane(&sound, 0));

        let mut bent = with_eigenvalues([-1.0, 2.0, -3.0, 1e4, 5.0, 0.0, 0.0, -7.0, 1.0]);
        let straight = with_eigenvalues([1.0, 2.0, 3.0, 1e4, 5.0, 0.0, 0.0, 7.0, 1.0]);
        make_convex(&mut bent);
        for lane in 0..LANES {
            let (bent, straight) = (of_lane(&bent, lane), of_lane(&straight, lane));
            let gap = |r: usize, c: usize| (bent[r][c] - straight[r][c]).abs();
            assert!((0..N * N).all(|k| gap(k / N, k % N) < 1e-10 * 1e4));
        }
    }

    /// Cells side by side do not see each other, and one that is not a number stays what it is.
    #[test]
    fn every_lane_is_alone() {
        let values = [
            [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1.0],
            [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            [-1e-8, 1e8, 0.0, 0.0, 0.0, 0.0, 2.0, 2.0, -2.0],
            [f64::NAN; N],
        ];
        let alone = values.map(with_eigenvalues);
        let mut blocks = alone[0];
        for (lane, single) in alone.iter().enumerate() {
            let (all, single) = (blocks.as_flattened_mut(), single.as_flattened());
            for (all, single) in
                all.iter_mut().flatten().flatten().zip(single.iter().flatten().flatten())
            {
                all[lane] = single[lane];
            }
        }
        make_convex(&mut blocks);
        for (lane, values) in values.iter().enumerate().take(3) {
            let straight = with_eigenvalues(values.map(f64::abs));
            let (found, exact) = (of_lane(&blocks, lane), of_lane(&straight, lane));
            let size = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let gap = |k: usize| (found[k / N][k % N] - exact[k / N][k % N]).abs();
            assert!((0..N * N).all(|k| gap(k) < 1e-10 * size), "{lane}");
        }
        assert!(of_lane(&blocks, 3).iter().flatten().all(|x| x.is_nan()));
    }
}
