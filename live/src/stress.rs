//! Von Mises stress at nodes: `sqrt(3/2 s : s)` with `s` the deviator of Cauchy's stress `sigma = P F^T / J`.

use viscera_core::body::Body;
use viscera_core::mesh::{EDGES, cell_volume, quadratic_cells};
use viscera_core::tensor::{Mat3, cross, dot};

/// Von Mises stress [Pa] of the means, over the cells around each node, of Cauchy's stress there, weighted by volume at
/// rest.
///
/// A quadratic cell has at its corners the linear function through its four quadrature points, and in the middle of an
/// edge the mean of the two ends. The pressures of these points matter for no deviator.
pub fn von_mises(body: &Body, u: &[f64]) -> Vec<f64> {
    let cells = body.cells();
    let mut sums = vec![[[0.0; 3]; 3]; body.points().len()];
    let mut weights = vec![0.0; sums.len()];
    let mut give = |node: u32, sigma: &Mat3<f64>, weight: f64| {
        add(&mut sums[node as usize], sigma, weight);
        weights[node as usize] += weight;
    };
    let is_quadratic = !body.edges().is_empty();
    let quadratic = is_quadratic.then(|| quadratic_cells(body.n_corners(), cells, body.edges()));
    let stresses = cauchy_at_points(body, u);
    for (cell, points) in stresses.chunks_exact(stresses.len() / cells.len()).enumerate() {
        let weight = cell_volume(body.points(), cells[cell]);
        let corners = at_corners(points);
        cells[cell].iter().zip(&corners).for_each(|(&node, sigma)| give(node, sigma, weight));
        let middles = quadratic.iter().flat_map(|nodes| &nodes[cell][4..]);
        for (&node, ends) in middles.zip(EDGES) {
            give(node, &combined(ends.map(|end| (0.5, &corners[end]))), weight);
        }
    }
    sums.iter().zip(weights).map(|(sum, weight)| of_tensor(sum) / weight).collect()
}

/// Cauchy's stress [Pa] at the quadrature points, cell by cell; of a linear law its stress as it is.
fn cauchy_at_points(body: &Body, u: &[f64]) -> Vec<Mat3<f64>> {
    let is_linear = body.material().name() == "linear";
    let points = body.quadrature_points(u).into_iter();
    points
        .map(|point| if is_linear { point.stress } else { cauchy(&point.gradient, &point.stress) })
        .collect()
}

/// At the corners of a cell what its one point has, or the linear function through its four points: these have the
/// barycentric coordinates `(5 - sqrt 5) / 20`, but `(5 + 3 sqrt 5) / 20` of the corner of the same number, so that
/// `sigma_a = sqrt 5 sigma_q=a - (sqrt 5 - 1) / 4 sum_q sigma_q`.
fn at_corners(points: &[Mat3<f64>]) -> [Mat3<f64>; 4] {
    let [a, b, c, d] = points else { return [points[0]; 4] };
    let root = 5f64.sqrt();
    let all = combined([a, b, c, d].map(|point| (0.25 * (1.0 - root), point)));
    [a, b, c, d].map(|point| combined([(root, point), (1.0, &all)]))
}

/// `P F^T / J`; zero where a cell has no volume left.
fn cauchy(f: &Mat3<f64>, p: &Mat3<f64>) -> Mat3<f64> {
    let ratio = dot(&f[0], &cross(&f[1], &f[2]));
    let scale = if ratio > 0.0 { 1.0 / ratio } else { 0.0 };
    std::array::from_fn(|i| std::array::from_fn(|j| scale * dot(&p[i], &f[j])))
}

fn of_tensor(sigma: &Mat3<f64>) -> f64 {
    let mean = (sigma[0][0] + sigma[1][1] + sigma[2][2]) / 3.0;
    let deviator = |i: usize, j: usize| sigma[i][j] - if i == j { mean } else { 0.0 };
    let square: f64 = (0..9).map(|k| deviator(k / 3, k % 3).powi(2)).sum();
    (1.5 * square).sqrt()
}

fn combined<const N: usize>(parts: [(f64, &Mat3<f64>); N]) -> Mat3<f64> {
    let mut sum = [[0.0; 3]; 3];
    parts.iter().for_each(|(weight, part)| add(&mut sum, part, *weight));
    sum
}

fn add(sum: &mut Mat3<f64>, part: &Mat3<f64>, weight: f64) {
    for (sum, part) in sum.iter_mut().flatten().zip(part.iter().flatten()) {
        *sum += weight * part;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Barycentric coordinates of the quadrature points of a quadratic cell (crates/solid/src/element/tet10.rs).
    const NEAR: f64 = 0.585_410_196_624_968_5;
    const FAR: f64 = 0.138_196_601_125_010_5;

    #[test]
    fn a_stress_that_is_linear_in_a_cell_is_found_at_its_corners() {
        let corners: [Mat3<f64>; 4] = std::array::from_fn(|a| {
            std::array::from_fn(|i| std::array::from_fn(|j| ((a * 9 + 3 * i + j) as f64).sin()))
        });
        let points: [Mat3<f64>; 4] = std::array::from_fn(|q| {
            combined::<4>(std::array::from_fn(|a| (if a == q { NEAR } else { FAR }, &corners[a])))
        });
        for (found, exact) in at_corners(&points).iter().zip(&corners) {
            for (x, y) in found.as_flattened().iter().zip(exact.as_flattened()) {
                assert!((x - y).abs() < 1e-14);
            }
        }
    }
}
