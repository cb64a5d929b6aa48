//! Places on faces: their share of the surface, and what they feel between the nodes.

use super::*;
use crate::contact::samples::{Height, Samples};
use crate::element::Element;

/// Whatever the parts of the faces, a body within a layer is pressed by its consistent nodal forces, and the areas on both
/// sides of a sharp edge add up to the surface.
#[test]
fn samples_of_every_spacing_share_the_surface_out() {
    for (element, body) in [("linear", cube(2)), ("quadratic", quadratic_cube(2))] {
        let reference = nodal_areas(&body, f64::INFINITY);
        let whole: f64 = reference.iter().sum();
        assert!((whole - 6.0 * SIDE * SIDE).abs() < 1e-12 * whole);
        for spacing in [0.02, 0.01, 0.0] {
            let areas = nodal_areas(&body, spacing);
            let error =
                areas.iter().zip(&reference).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-12 * whole, "{element}, {spacing}: {error}");
        }
    }
}

fn quadratic_cube(n: usize) -> Body {
    let (points, cells) = block([n; 3], [SIDE; 3]);
    let material = Material::new("neo_hookean", vec![vec![4e3, 6e3]]).unwrap();
    Body::with_element(Element::P2, points, cells, material).unwrap()
}

/// The area that each node has, by the weights of its samples [m^2].
fn nodal_areas(body: &Body, spacing: f64) -> Vec<f64> {
    let samples = Samples::new(body, spacing, &vec![false; body.points().len()]);
    let mut areas = vec![0.0; body.points().len()];
    for sample in 0..samples.len() {
        for &(node, weight) in samples.nodes().of(sample) {
            areas[node as usize] += weight * samples.area(sample);
        }
    }
    areas
}

/// On the top of a cube whose edges are far apart, at a place between all of them.
#[test]
fn a_small_sphere_is_felt_between_the_nodes() {
    let body = cube(1);
    let problem = problem(&body, base(&body));
    let above = Pose::at([0.037, 0.061, SIDE + 0.01]);
    let mut tool = Tool::new(sphere(0.01), Friction::Coulomb(0.0), above);
    tool.displacement = [0.0, 0.0, -0.002];
    let mut contact = Contact::new(&body);
    contact.add(&body, tool, &vec![0.0; body.n_dofs()]).unwrap();
    let found = Newton::default().solve_in_contact(&problem, &mut contact, &mut |_| true).unwrap();
    assert!(found.status.is_converged(), "{}", found.message);
    let report = contact.report(0).unwrap();
    assert!(report.touching > 0 && report.force[2] < -0.1, "{report:?}");
    assert!(report.gap > -1e-3 * diagonal(body.points()), "{report:?}");
}

/// The layer is that of the organ that is touched, however far another one lies.
#[test]
fn a_far_organ_makes_no_layer_thicker() {
    let (points, cells) = block([1; 3], [SIDE; 3]);
    let n_cells = cells.len();
    let far = points.iter().map(|x| [x[0] + 100.0 * SIDE, x[1], x[2]]);
    let both: Vec<_> = points.iter().copied().chain(far).collect();
    let others = cells.iter().map(|cell| cell.map(|node| points.len() as u32 + node));
    let all = cells.iter().copied().chain(others).collect();
    let material = || Material::new("neo_hookean", vec![vec![4e3, 6e3]]).unwrap();
    let alone = Body::new(points.clone(), cells, material()).unwrap();
    let beside = Body::new(both, all, material()).unwrap();
    let [height, near] = [&alone, &beside].map(Height::new);
    let together = |nodes: &[u32]| Height::of_all(&beside, nodes).of(0, 1e-9);
    assert_eq!(together(&[0, 1]), height.of(0, 1e-9));
    assert!(together(&[0, points.len() as u32]) > 50.0 * height.of(0, 1e-9), "a pair of both");
    for cell in 0..n_cells {
        // So thin a face that the height of the cell does not count.
        assert_eq!(near.of(cell, 1e-9), height.of(cell, 1e-9));
    }
    assert!((height.of(0, 1e-9) / SIDE - 0.015 * 3.0f64.sqrt()).abs() < 1e-12);
}
