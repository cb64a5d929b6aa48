//! The stiffness of a law at rest.

use viscera_number::tensor::{Mat3, double_dot};
use viscera_number::unroll::tabulate;

/// The tangent `A_iJkL` as `[J][L][i][k]` for `J <= L` [Pa].
type Tangent = [[Mat3<f64>; 3]; 3];

/// A symmetric matrix over `N` strains.
type Symmetric<const N: usize> = [[f64; N]; N];

/// Deviatoric strains of norm 1, each at right angles to the others.
#[rustfmt::skip]
const DEVIATORIC: [Mat3<f64>; 5] = {
    const R: f64 = std::f64::consts::FRAC_1_SQRT_2;
    const S: f64 = 0.408_248_290_463_863; // 1 / sqrt(6)
    [
        [[0.0, R, 0.0], [R, 0.0, 0.0], [0.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, R], [0.0, R, 0.0]],
        [[0.0, 0.0, R], [0.0, 0.0, 0.0], [R, 0.0, 0.0]],
        [[R, 0.0, 0.0], [0.0, -R, 0.0], [0.0, 0.0, 0.0]],
        [[S, 0.0, 0.0], [0.0, S, 0.0], [0.0, 0.0, -2.0 * S]],
    ]
};

/// A law whose stiffnesses differ by no more than this part of the largest is isotropic but for rounding.
const ISOTROPIC: f64 = 1e-12;

/// Sweeps of rotations, which converge quadratically; no matrix of five rows needs half of them.
const SWEEPS: usize = 20;

/// Entries beside the diagonal that are rounding, as a part of the largest on it.
const DIAGONAL: f64 = 1e-14;

/// `e : A : e'` of each pair of symmetric strains [Pa].
pub(crate) fn stiffness<const N: usize>(
    tangent: &Tangent,
    strains: &[Mat3<f64>; N],
) -> Symmetric<N> {
    let component = |[i, j, k, l]: [usize; 4]| {
        if j <= l { tangent[j][l][i][k] } else { tangent[l][j][k][i] }
    };
    // A : e' of each strain, then e : A : e'.
    let stresses = strains.each_ref().map(|strain| {
        tabulate!(|i, j| {
            let all = (0..9).map(|n| [n / 3, n % 3]);
            all.map(|[k, l]| component([i, j, k, l]) * strain[k][l]).sum::<f64>()
        })
    });
    strains.each_ref().map(|strain| stresses.each_ref().map(|stress| double_dot(strain, stress)))
}

/// The least shear modulus: half the smallest stiffness against a deviatoric strain of norm 1 [Pa]. It is `mu` of an
/// isotropic law, that of the matrix between fibres, and the same however fibres lie in space.
pub(crate) fn shear_modulus(tangent: &Tangent) -> f64 {
    // dP_01/dF_01 and its like are equal in an isotropic law.
    let mean = (0..3).map(|a| tangent[a][a][(a + 1) % 3][(a + 1) % 3]).sum::<f64>() / 3.0;
    let stiffness = stiffness(tangent, &DEVIATORIC);
    let largest =
        tangent.iter().flatten().flatten().flatten().fold(mean, |max, a| max.max(a.abs()));
    let differs = |a: usize, b: usize| {
        let isotropic = if a == b { 2.0 * mean } else { 0.0 };
        !((stiffness[a][b] - isotropic).abs() <= ISOTROPIC * largest)
    };
    if !(0..5).any(|a| (0..5).any(|b| differs(a, b))) {
        return mean;
    }
    0.5 * smallest_eigenvalue(stiffness)
}

/// By Jacobi's rotations; no number if an entry is none.
fn smallest_eigenvalue<const N: usize>(mut matrix: Symmetric<N>) -> f64 {
    for _ in 0..SWEEPS {
        let largest = (0..N).fold(0.0f64, |max, a| max.max(matrix[a][a].abs()));
        let is_diagonal =
            (0..N).all(|p| (p + 1..N).all(|q| matrix[p][q].abs() <= DIAGONAL * largest));
        if is_diagonal {
            break;
        }
        for (p, q) in (0..N).flat_map(|p| (p + 1..N).map(move |q| (p, q))) {
            rotate(&mut matrix, p, q);
        }
    }
    (0..N).map(|a| matrix[a][a]).fold(f64::INFINITY, |least, value| {
        if value.is_nan() || value < least { value } else { least }
    })
}

/// Turns the axes `p` and `q` such that their entry vanishes.
fn rotate<const N: usize>(matrix: &mut Symmetric<N>, p: usize, q: usize) {
    if matrix[p][q] == 0.0 {
        return;
    }
    let slope = (matrix[q][q] - matrix[p][p]) / (2.0 * matrix[p][q]);
    let tangent = slope.signum() / (slope.abs() + slope.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    let sine = tangent * cosine;
    let turned = |a: f64, b: f64| (cosine * a - sine * b, sine * a + cosine * b);
    for row in matrix.iter_mut() {
        (row[p], row[q]) = turned(row[p], row[q]);
    }
    for k in 0..N {
        (matrix[p][k], matrix[q][k]) = turned(matrix[p][k], matrix[q][k]);
    }
}
