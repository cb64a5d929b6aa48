//! The straight-sided quadratic tetrahedron: the deformation gradient varies linearly, four points
//! integrate its squares exactly and leave no mode without stiffness (24 strains for 30 - 6 motions).

use super::Shape;
use crate::mesh::EDGES;

/// Quadratic shape functions `l_a (2 l_a - 1)` of the corners and `4 l_a l_b` of the edges.
pub struct Tet10;

/// Barycentric coordinates of the quadrature points: `(5 - sqrt 5) / 20` but one, `(5 + 3 sqrt 5) / 20`.
const NEAR: f64 = 0.585_410_196_624_968_5;
const FAR: f64 = 0.138_196_601_125_010_5;

const SLOPES: [[[f64; 3]; 10]; 4] = [slopes(0), slopes(1), slopes(2), slopes(3)];

/// `dN/d(x, y, z)` at a quadrature point, from `dl_0 = -dx - dy - dz` and `dl_k = dx_k`.
const fn slopes(point: usize) -> [[f64; 3]; 10] {
    let mut l = [FAR; 4];
    l[point] = NEAR;
    let mut slopes = [[0.0; 3]; 10];
    let mut a = 0;
    while a < 4 {
        add(&mut slopes[a], a, 4.0 * l[a] - 1.0);
        a += 1;
    }
    let mut k = 0;
    while k < 6 {
        let [a, b] = EDGES[k];
        add(&mut slopes[4 + k], a, 4.0 * l[b]);
        add(&mut slopes[4 + k], b, 4.0 * l[a]);
        k += 1;
    }
    slopes
}

/// Adds `factor dl_a/d(x, y, z)`.
const fn add(slopes: &mut [f64; 3], a: usize, factor: f64) {
    if a > 0 {
        slopes[a - 1] += factor;
    } else {
        slopes[0] -= factor;
        slopes[1] -= factor;
        slopes[2] -= factor;
    }
}

impl Shape<10> for Tet10 {
    const POINTS: usize = 4;
    const LOADS: [f64; 10] = [-0.05, -0.05, -0.05, -0.05, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2];

    #[inline(always)]
    fn slopes(point: usize) -> &'static [[f64; 3]; 10] {
        &SLOPES[point]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of the unit tetrahedron, then midpoints.
    fn nodes() -> [[f64; 3]; 10] {
        let corner = |a: usize| std::array::from_fn(|i| (a == i + 1) as u8 as f64);
        std::array::from_fn(|n| match n {
            0..4 => corner(n),
            _ => {
                let [a, b] = EDGES[n - 4].map(corner);
                std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
            }
        })
    }

    fn quadrature_point(point: usize) -> [f64; 3] {
        std::array::from_fn(|i| if i + 1 == point { NEAR } else { FAR })
    }

    /// Nodal values of `1, x_i, x_i x_j` have the gradients `0, e_i, x_i e_j + x_j e_i`.
    #[test]
    fn quadratic_fields_have_their_gradients() {
        for point in 0..4 {
            let (x, slopes) = (quadrature_point(point), Tet10::slopes(point));
            let gradient = |f: &dyn Fn(&[f64; 3]) -> f64, k: usize| -> f64 {
                nodes().iter().zip(slopes).map(|(node, s)| f(node) * s[k]).sum()
            };
            for k in 0..3 {
                assert!(gradient(&|_| 1.0, k).abs() < 1e-14);
                for i in 0..3 {
                    let delta = (i == k) as u8 as f64;
                    assert!((gradient(&|x| x[i], k) - delta).abs() < 1e-14);
                    for j in 0..3 {
                        let expected = delta * x[j] + ((j == k) as u8 as f64) * x[i];
                        assert!((gradient(&|x| x[i] * x[j], k) - expected).abs() < 1e-14);
                    }
                }
            }
        }
    }

    /// The mean over a cell of `1`, `l_a` and `l_a l_b` is 1, 1/4, and 1/10 or 1/20.
    #[test]
    fn points_and_loads_integrate_quadratics() {
        let l = |point: usize, a: usize| if point == a { NEAR } else { FAR };
        for a in 0..4 {
            assert!(((0..4).map(|q| l(q, a)).sum::<f64>() / 4.0 - 0.25).abs() < 1e-15);
            for b in 0..4 {
                let mean = (0..4).map(|q| l(q, a) * l(q, b)).sum::<f64>() / 4.0;
                assert!((mean - if a == b { 0.1 } else { 0.05 }).abs() < 1e-15);
            }
        }
        assert!((Tet10::LOADS.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        let [corner, edge] = [2.0 * 0.1 - 0.25, 4.0 * 0.05];
        assert!((Tet10::LOADS[0] - corner).abs() < 1e-15 && (Tet10::LOADS[9] - edge).abs() < 1e-15);
    }
}
