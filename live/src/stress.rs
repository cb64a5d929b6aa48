//! Von Mises stress at nodes: `sqrt(3/2 s : s)` with `s` the deviator of Cauchy's stress `sigma = P F^T / J`.

use viscera_core::body::Body;
use viscera_core::tensor::{Mat3, cross, dot};

/// Means of Cauchy's stress over the cells around each corner of a cell, weighted by volume at rest; then its von Mises
/// stress [Pa]. A node in the middle of an edge has the mean of the edge's two ends.
pub fn von_mises(body: &Body, u: &[f64]) -> Vec<f64> {
    let (n, cells) = (body.n_corners(), body.cells());
    let points = body.quadrature_points(u);
    let of_cell = points.len() / cells.len();
    let is_linear = body.material().name() == "linear";
    let mut sums = vec![[[0.0; 3]; 3]; n];
    let mut weights = vec![0.0; n];
    for (nodes, within) in cells.iter().zip(points.chunks_exact(of_cell)) {
        let weight = volume(nodes.map(|node| body.points()[node as usize]));
        for point in within {
            let sigma =
                if is_linear { point.stress } else { cauchy(&point.gradient, &point.stress) };
            for &node in nodes {
                add(&mut sums[node as usize], &sigma, weight / of_cell as f64);
            }
        }
        nodes.iter().for_each(|&node| weights[node as usize] += weight);
    }
    for (sum, weight) in sums.iter_mut().zip(weights) {
        sum.iter_mut().flatten().for_each(|entry| *entry /= weight);
    }
    let corners = sums.iter().map(of_tensor);
    let middle = |&[a, b]: &[u32; 2]| {
        let mut mean = [[0.0; 3]; 3];
        add(&mut mean, &sums[a as usize], 0.5);
        add(&mut mean, &sums[b as usize], 0.5);
        of_tensor(&mean)
    };
    corners.chain(body.edges().iter().map(middle)).collect()
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

fn add(sum: &mut Mat3<f64>, part: &Mat3<f64>, weight: f64) {
    for (sum, part) in sum.iter_mut().flatten().zip(part.iter().flatten()) {
        *sum += weight * part;
    }
}

fn volume([a, b, c, d]: [[f64; 3]; 4]) -> f64 {
    let from = |x: [f64; 3]| std::array::from_fn(|i| x[i] - a[i]);
    dot(&from(b), &cross(&from(c), &from(d))) / 6.0
}
