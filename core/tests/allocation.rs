//! The on-line evaluator allocates nothing.

mod counting;
#[path = "../src/mesh/samples.rs"]
mod samples;

use counting::allocations;
use viscera_core::body::Body;
use viscera_core::law::Material;
use viscera_core::mesh::{Surface, surface};
use viscera_core::reduced::{ReducedModel, Reduction};

const SIZE: [f64; 3] = [0.04, 0.03, 0.03];

/// A block held at the bottom and touched at the top.
fn model() -> ReducedModel {
    let (points, cells) = samples::block([4, 3, 3], SIZE);
    let at = |z: f64| -> Vec<u32> {
        (0..points.len() as u32).filter(|&n| (points[n as usize][2] - z).abs() < 1e-12).collect()
    };
    let (fixed, touchable) = (at(0.0), at(SIZE[2]));
    let law = Material::new("neo_hookean", vec![vec![3.0e3, 11.0e3]]).unwrap();
    let surface = Surface::new(&points, &surface(&points, &cells));
    let body = Body::new(points, cells, law).unwrap();
    let user = serde_json::Value::Null;
    let (radius, depth, order, tolerance) = (0.012, 0.004, 3, 1e-3);
    let reduction = Reduction {
        touchable,
        radius,
        depth,
        order,
        tolerance,
        pade: true,
        preload: Vec::new(),
        user,
    };
    reduction.run(&body, &surface, &fixed, &mut |_| true).unwrap()
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| 1 + 1).0, 0);
    let (count, mut list) = allocations(|| Vec::<u64>::with_capacity(8));
    assert_eq!(count, 1);
    assert_eq!(allocations(|| list.reserve_exact(1000)).0, 1);
}

#[test]
fn a_touch_allocates_nothing() {
    let model = model();
    let mut workspace = vec![0.0; model.workspace_len()];
    let mut surface = vec![0.0; 3 * model.arrays().surface_nodes.len()];
    let mut interior = vec![0.0; 3 * model.interior_nodes().len()];
    let mut largest: f32 = 0.0;
    for random in samples::noise(600, 1).chunks_exact(6) {
        let point = std::array::from_fn(|i| SIZE[i] * (0.5 + random[i]));
        let d = std::array::from_fn(|i| 0.006 * random[3 + i]);
        let (count, _) = allocations(|| {
            let contact = model.locate(point).expect("the point is finite");
            let response = model.respond(&contact, d);
            model.surface_displacement(&contact, d, &mut workspace, &mut surface);
            model.interior_displacement(&contact, d, &mut workspace, &mut interior);
            response
        });
        assert_eq!(count, 0);
        largest = surface.iter().fold(largest, |max, u| max.max(u.abs()));
    }
    assert!(largest > 1e-3, "the touches moved something: {largest} m");
}
