//! Tangents of which every cell's part is positive semidefinite.

use super::*;

/// Smallest and largest eigenvalue.
fn extremes(tangent: &SymmetricBlocks, n: usize) -> [f64; 2] {
    let mut dense = faer::Mat::<f64>::zeros(n, n);
    for ((row, column), block) in tangent.pattern().pairs().zip(tangent.values().chunks_exact(9)) {
        for (entry, &value) in block.iter().enumerate() {
            let (r, c) = (3 * row as usize + entry / 3, 3 * column as usize + entry % 3);
            (dense[(r, c)], dense[(c, r)]) = (value, value);
        }
    }
    let eigenvalues = dense.self_adjoint_eigenvalues(faer::Side::Lower).unwrap();
    [eigenvalues[0], eigenvalues[n - 1]]
}

#[test]
fn a_convex_tangent_is_positive_semidefinite_and_leaves_the_force_alone() {
    for law in ["saint_venant_kirchhoff", "neo_hookean", "mooney_rivlin J-1"] {
        for body in bodies(law) {
            // Whatever is under pressure gives way when it turns.
            let press = [[-0.2, 0.05, 0.0], [0.0, -0.4, 0.05], [0.0, 0.0, -0.25]];
            let pressed = affine(&body, &press, [0.0; 3]);
            let u = along(&pressed, 5e-4 * agility(&body), &noise(pressed.len(), 2));
            let name = format!("{law}, {}", body.element().name());
            let linearized = |curvature| {
                let (mut f, mut tangent) = (vec![0.0; u.len()], body.zero_tangent());
                body.linearize(&u, curvature, &mut f, &mut tangent);
                (f, extremes(&tangent, u.len()))
            };
            let (exact, convex) = (linearized(Curvature::Exact), linearized(Curvature::Projected));
            assert!(exact.1[0] < -1e-3 * exact.1[1], "{name}: definite anyway, {:?}", exact.1);
            assert!(convex.1[0] > -1e-9 * convex.1[1], "{name}: {:?}", convex.1);
            assert_eq!(exact.0, convex.0, "{name}");
        }
    }
}

#[test]
fn where_every_cell_is_stable_the_convex_tangent_is_the_exact_one() {
    for body in bodies("neo_hookean") {
        let u: Vec<f64> = state(&body).iter().map(|u| 0.05 * u).collect();
        let values = |curvature| {
            let mut tangent = body.zero_tangent();
            body.linearize(&u, curvature, &mut vec![0.0; u.len()], &mut tangent);
            tangent.values
        };
        let (exact, convex) = (values(Curvature::Exact), values(Curvature::Projected));
        // Rotations of a stressed cell are curved, by the size of its stress: a part of the strain.
        assert!(
            largest_difference(&exact, &convex) < 0.05 * largest(&exact),
            "{}",
            body.element().name()
        );
    }
}
