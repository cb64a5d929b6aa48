//! The tangent made convex cell by cell: what Newton's method steps with where the energy is not.
//!
//! A crushed or buckling cell has directions of negative curvature. With the eigenvalues of its own tangent replaced by
//! their absolute values, `|K| = V |Lambda| V^T`, every cell adds a positive semidefinite part, the step is one of
//! descent, and cells that are sound keep their tangent to the last bit. A multiple of the identity added to the whole
//! tangent would be as safe, and freeze the body for the sake of one cell.
//! Chen, Hsieh, Jacobson et al., Stabler Neo-Hookean Simulation: Absolute Eigenvalue Filtering for Projected Newton,
//! SIGGRAPH 2024.

use super::{LANES, Lane};
use crate::law::TangentBlocks;
use faer::{Mat, Side};

/// Rows of a cell's tangent: three vectors times three components.
const N: usize = 9;

/// A pivot below this part of the largest diagonal entry is none: a cell at rest has no stiffness against rotations.
const ROUNDING: f64 = 1e-10;

type Dense = [[f64; N]; N];

/// Replaces the tangent of each cell that is not positive semidefinite by its absolute value.
pub(super) fn make_convex(blocks: &mut TangentBlocks<Lane>) {
    for lane in 0..LANES {
        let tangent = of_lane(blocks, lane);
        if is_finite(&tangent) && !is_convex(&tangent) {
            write(&absolute(&tangent), blocks, lane);
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

fn write(tangent: &Dense, blocks: &mut TangentBlocks<Lane>, lane: usize) {
    for (r, row) in tangent.iter().enumerate() {
        for (c, value) in row.iter().enumerate().skip(3 * (r / 3)) {
            blocks[r / 3][c / 3][r % 3][c % 3][lane] = *value;
        }
    }
}

fn is_finite(tangent: &Dense) -> bool {
    tangent.iter().flatten().all(|value| value.is_finite())
}

/// Whether Cholesky's method goes through, but for rounding.
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

/// `V |Lambda| V^T`; the tangent itself where no eigenvalues are found.
fn absolute(tangent: &Dense) -> Dense {
    let matrix = Mat::from_fn(N, N, |r, c| tangent[r][c]);
    let Ok(eigen) = matrix.self_adjoint_eigen(Side::Lower) else {
        return *tangent;
    };
    let (vectors, values) = (eigen.U(), eigen.S().column_vector());
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            (0..N).map(|k| vectors[(r, k)] * values[k].abs() * vectors[(c, k)]).sum()
        })
    })
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
}
