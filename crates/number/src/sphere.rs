//! Directions that cover the unit sphere evenly.

use std::f64::consts::PI;

/// Point n of a spiral that covers the unit sphere evenly with as many (Swinbank and Purser, QJRMS 132 (2006) 1769):
///   (r cos(n g), r sin(n g), z),   z = 1 - (2n + 1)/N,   r = (1 - z^2)^(1/2),   g = (3 - 5^(1/2)) pi.
pub fn on_sphere(n: usize, of: usize) -> [f64; 3] {
    let golden_angle = PI * (3.0 - 5f64.sqrt());
    let height = 1.0 - (2 * n + 1) as f64 / of as f64;
    let (sin, cos) = (n as f64 * golden_angle).sin_cos();
    let radius = (1.0 - height * height).sqrt();
    [radius * cos, radius * sin, height]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As an even cover has them: unit vectors with no mean and the second moments of the sphere.
    #[test]
    fn the_spiral_covers_the_sphere_evenly() {
        let points: Vec<_> = (0..192).map(|n| on_sphere(n, 192)).collect();
        let mean = |of: &dyn Fn(&[f64; 3]) -> f64| points.iter().map(of).sum::<f64>() / 192.0;
        for i in 0..3 {
            assert!(mean(&|x| x[i]).abs() < 1e-2);
            for j in 0..3 {
                let sphere = if i == j { 1.0 / 3.0 } else { 0.0 };
                assert!((mean(&|x| x[i] * x[j]) - sphere).abs() < 1e-2, "{i}{j}");
            }
        }
        assert!(points.iter().all(|x| (x.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-12));
    }
}
