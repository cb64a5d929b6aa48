//! Eigenvalues of symmetric matrices and singular values of all, three by three, by Jacobi's rotations.

use crate::tensor::{Mat3, Vec3, cross, dot, mul_vector, transpose_mul};
use crate::unroll::tabulate;

/// Sweeps of Jacobi's rotations; they converge quadratically, and five do.
const MAX_SWEEPS: usize = 10;

/// A symmetric matrix with its eigenvalues replaced by their absolute values.
pub(super) fn absolute(a: Mat3<f64>) -> Mat3<f64> {
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

/// `F = sum_p s_p u_p v_p`: singular values and both frames in rows, which are rotations. So the least value has the sign
/// of `det F`.
pub(super) fn singular(f: &Mat3<f64>) -> ([f64; 3], Mat3<f64>, Mat3<f64>) {
    let (_, v) = eigen(transpose_mul(f, f)); // a product of rotations
    let images = v.map(|v| mul_vector(f, &v));
    let u = directions(&images);
    (std::array::from_fn(|p| dot(&u[p], &images[p])), u, v)
}

/// A rotation whose rows are along three orthogonal vectors, the shortest as it comes. Where one vanishes, as the
/// thickness of a flat cell, its direction is what the others leave.
fn directions(x: &Mat3<f64>) -> Mat3<f64> {
    let length = x.map(|x| dot(&x, &x).sqrt());
    let mut order = [0, 1, 2];
    order.sort_by(|&p, &q| length[q].total_cmp(&length[p]));
    let [i, j, k] = order;
    let mut u = *x;
    u[i] = if length[i] > 0.0 { x[i].map(|x| x / length[i]) } else { [1.0, 0.0, 0.0] };
    u[j] = if length[j] > f64::EPSILON.sqrt() * length[i] { x[j] } else { across(&u[i]) };
    let common = dot(&u[i], &u[j]);
    let rest: Vec3<f64> = std::array::from_fn(|n| u[j][n] - common * u[i][n]);
    u[j] = rest.map(|x| x / dot(&rest, &rest).sqrt());
    u[k] = cross(&u[(k + 1) % 3], &u[(k + 2) % 3]);
    u
}

/// The axis that is least along a direction.
fn across(u: &Vec3<f64>) -> Vec3<f64> {
    let least = (0..3).min_by(|&p, &q| u[p].abs().total_cmp(&u[q].abs()));
    std::array::from_fn(|n| f64::from(Some(n) == least))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Also of flat cells, whose third direction no division by a singular value finds.
    #[test]
    fn singular_values_and_frames_give_the_matrix_again() {
        for f in [
            [[2.1, 0.3, -0.4], [0.2, 0.3, 0.1], [0.5, -0.1, 0.12]],
            [[0.4, 0.0, 0.0], [0.0, -0.4, 0.0], [0.0, 0.0, 0.5]],
            [[1.0, 0.5, 0.0], [0.25, 2.0, 0.0], [1.25, 2.5, 0.0]],
            [[1.0, 0.0, 0.5], [2.0, 0.0, 1.0], [0.0, 0.0, 0.0]],
            [[0.0; 3]; 3],
        ] {
            let (s, u, v) = singular(&f);
            for i in 0..3 {
                for k in 0..3 {
                    let again: f64 = (0..3).map(|p| s[p] * u[p][i] * v[p][k]).sum();
                    assert!((again - f[i][k]).abs() < 1e-14, "{f:?} {again}");
                    for frame in [&u, &v] {
                        let product = dot(&frame[i], &frame[k]);
                        assert!((product - f64::from(i == k)).abs() < 1e-14, "{f:?} {product}");
                    }
                }
            }
            for frame in [&u, &v] {
                assert!(dot(&frame[0], &cross(&frame[1], &frame[2])) > 0.0, "{f:?} {frame:?}");
            }
        }
    }
}
