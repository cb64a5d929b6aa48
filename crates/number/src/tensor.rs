//! 3x3 tensors over any scalar: what laws need of tensor algebra, and nothing more.

use crate::Scalar;
use crate::unroll::{array, tabulate};

/// Rows of a second-order tensor.
pub type Mat3<S> = [[S; 3]; 3];
/// A vector.
pub type Vec3<S> = [S; 3];

/// `factor * identity`, shaped like `factor`.
#[inline(always)]
pub fn spherical<S: Scalar>(factor: &S) -> Mat3<S> {
    tabulate!(|i, j| if i == j { factor.clone() } else { factor.constant(0.0) })
}

/// `A + B`.
#[inline(always)]
pub fn add<S: Scalar>(a: &Mat3<S>, b: &Mat3<S>) -> Mat3<S> {
    tabulate!(|i, j| a[i][j].clone() + b[i][j].clone())
}

/// `A - B`.
#[inline(always)]
pub fn sub<S: Scalar>(a: &Mat3<S>, b: &Mat3<S>) -> Mat3<S> {
    tabulate!(|i, j| a[i][j].clone() - b[i][j].clone())
}

/// `s A`.
#[inline(always)]
pub fn scale<S: Scalar>(s: &S, a: &Mat3<S>) -> Mat3<S> {
    tabulate!(|i, j| s.clone() * a[i][j].clone())
}

/// `A^T B`.
#[inline(always)]
pub fn transpose_mul<S: Scalar>(a: &Mat3<S>, b: &Mat3<S>) -> Mat3<S> {
    tabulate!(|i, j| {
        a[0][i].clone() * b[0][j].clone()
            + a[1][i].clone() * b[1][j].clone()
            + a[2][i].clone() * b[2][j].clone()
    })
}

/// `A v`.
#[inline(always)]
pub fn mul_vector<S: Scalar>(a: &Mat3<S>, v: &Vec3<S>) -> Vec3<S> {
    array!(3, |i| dot(&a[i], v))
}

/// `A^T v`.
#[inline(always)]
pub fn transpose_mul_vector<S: Scalar>(a: &Mat3<S>, v: &Vec3<S>) -> Vec3<S> {
    array!(3, |j| {
        a[0][j].clone() * v[0].clone()
            + a[1][j].clone() * v[1].clone()
            + a[2][j].clone() * v[2].clone()
    })
}

/// `a . b`.
#[inline(always)]
pub fn dot<S: Scalar>(a: &Vec3<S>, b: &Vec3<S>) -> S {
    a[0].clone() * b[0].clone() + a[1].clone() * b[1].clone() + a[2].clone() * b[2].clone()
}

/// `a x b`.
#[inline(always)]
pub fn cross<S: Scalar>(a: &Vec3<S>, b: &Vec3<S>) -> Vec3<S> {
    array!(3, |i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j].clone() * b[k].clone() - a[k].clone() * b[j].clone()
    })
}

/// `A : B`.
#[inline(always)]
pub fn double_dot<S: Scalar>(a: &Mat3<S>, b: &Mat3<S>) -> S {
    dot(&a[0], &b[0]) + dot(&a[1], &b[1]) + dot(&a[2], &b[2])
}

/// Trace.
#[inline(always)]
pub fn trace<S: Scalar>(a: &Mat3<S>) -> S {
    a[0][0].clone() + a[1][1].clone() + a[2][2].clone()
}

/// Cofactor tensor, `cof A = det(A) A^-T`; defined for singular `A` too.
#[inline(always)]
pub fn cofactor<S: Scalar>(a: &Mat3<S>) -> Mat3<S> {
    tabulate!(|i, j| {
        let (p, q) = ((i + 1) % 3, (i + 2) % 3);
        let (r, s) = ((j + 1) % 3, (j + 2) % 3);
        a[p][r].clone() * a[q][s].clone() - a[p][s].clone() * a[q][r].clone()
    })
}

/// Tensor cross product `(A x B)_iJ = e_ipq e_JRS A_pR B_qS`; `cof A = (A x A) / 2`.
#[inline(always)]
pub fn tensor_cross<S: Scalar>(a: &Mat3<S>, b: &Mat3<S>) -> Mat3<S> {
    tabulate!(|i, j| {
        let (p, q) = ((i + 1) % 3, (i + 2) % 3);
        let (r, s) = ((j + 1) % 3, (j + 2) % 3);
        a[p][r].clone() * b[q][s].clone()
            - a[p][s].clone() * b[q][r].clone()
            - a[q][r].clone() * b[p][s].clone()
            + a[q][s].clone() * b[p][r].clone()
    })
}

/// Determinant from the tensor and its cofactor.
#[inline(always)]
pub fn determinant<S: Scalar>(a: &Mat3<S>, cofactor: &Mat3<S>) -> S {
    dot(&a[0], &cofactor[0])
}

/// Inverse of a tensor, or none when it is singular to rounding.
#[inline]
pub fn inverse(a: &Mat3<f64>) -> Option<Mat3<f64>> {
    let z = cofactor(a);
    let det = determinant(a, &z);
    let size = a.iter().flatten().fold(0.0f64, |max, x| max.max(x.abs()));
    (det.abs() > 1e-12 * size.powi(3)).then(|| tabulate!(|i, j| z[j][i] / det))
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Mat3<f64> = [[1.1, 0.2, -0.3], [0.05, 0.9, 0.4], [0.3, -0.1, 1.2]];

    #[test]
    fn the_cofactor_is_the_inverse_transposed_times_the_determinant() {
        let z = cofactor(&A);
        let j = determinant(&A, &z);
        let product = transpose_mul(&z, &A);
        for i in 0..3 {
            for k in 0..3 {
                let expected = if i == k { j } else { 0.0 };
                assert!((product[i][k] - expected).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn half_the_cross_with_itself_is_the_cofactor() {
        let (half, z) = (scale(&0.5, &tensor_cross(&A, &A)), cofactor(&A));
        assert!(sub(&half, &z).iter().flatten().all(|d| d.abs() < 1e-15));
    }
}
